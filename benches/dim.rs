//! What dim light costs the window engine, and some bright light beside it: ns of processor time for a laser cycle of a macropixel,
//! 16 000 laser cycles of 4800 CLK periods, one thread, the better of two runs. `cargo bench --bench dim` prints a line a light.

use cpu_time::ThreadTime;
use guided_dtof::chip::{EventType, Exposure, SensorConfig, WindowLaw};
use guided_dtof::engine::{Expose, LitPixel, Window, stream_config};
use guided_dtof::photon::{Echo, PhotonStream, PixelLight, SpadSpread};
use guided_dtof::units::Time;

const CYCLES: u32 = 16_000;
const PIXELS: u16 = 6;

struct Case {
    name: &'static str,
    background_hz: f64,
    /// Photons of a laser cycle, and in how many echoes.
    signal: f64,
    echoes: i32,
    /// Probability of an afterpulse, and of crosstalk.
    secondaries: f64,
    /// SPADs along a side of a macropixel.
    side: usize,
    threshold: u8,
    /// Whether SPADs differ.
    differ: bool,
}

const fn case(name: &'static str, background_mhz: f64, signal: f64, echoes: i32) -> Case {
    Case {
        name,
        background_hz: background_mhz * 1e6,
        signal,
        echoes,
        secondaries: 0.0,
        side: 4,
        threshold: 0,
        differ: false,
    }
}

fn cases() -> [Case; 21] {
    let secondaries = 0.01;
    [
        case("8 Mcounts/s, 0.1", 8.0, 0.1, 1),
        case("26 Mcounts/s, 0.1", 26.0, 0.1, 1),
        case("26 Mcounts/s, 1", 26.0, 1.0, 1),
        case("26 Mcounts/s, 3", 26.0, 3.0, 1),
        case("26 Mcounts/s, 7.9", 26.0, 7.9, 1),
        case("26 Mcounts/s, 2 in two echoes", 26.0, 2.0, 2),
        case("26 Mcounts/s, 10 in two echoes", 26.0, 10.0, 2),
        case("8 Mcounts/s, 1 in six echoes", 8.0, 1.0, 6),
        case("80 Mcounts/s, 1", 80.0, 1.0, 1),
        Case {
            secondaries,
            ..case("26 Mcounts/s, 3, 1 % secondaries", 26.0, 3.0, 1)
        },
        Case {
            secondaries,
            ..case(
                "26 Mcounts/s, 2 in two echoes, 1 % secondaries",
                26.0,
                2.0,
                2,
            )
        },
        Case {
            secondaries,
            ..case("8 Mcounts/s, 0.1, 1 % secondaries", 8.0, 0.1, 1)
        },
        Case {
            secondaries,
            ..case("26 Mcounts/s, 0.1, 1 % secondaries", 26.0, 0.1, 1)
        },
        Case {
            secondaries,
            ..case("26 Mcounts/s, 1, 1 % secondaries", 26.0, 1.0, 1)
        },
        case("26 Mcounts/s, 0.5", 26.0, 0.5, 1),
        case("400 Mcounts/s, 0.1", 400.0, 0.1, 1),
        Case {
            secondaries,
            ..case("400 Mcounts/s, 0.1, 1 % secondaries", 400.0, 0.1, 1)
        },
        Case {
            side: 2,
            ..case("26 Mcounts/s, 1, 2×2 SPADs", 26.0, 1.0, 1)
        },
        Case {
            side: 8,
            ..case("26 Mcounts/s, 1, 8×8 SPADs", 26.0, 1.0, 1)
        },
        Case {
            differ: true,
            ..case("26 Mcounts/s, 1, SPADs that differ", 26.0, 1.0, 1)
        },
        Case {
            threshold: 3,
            ..case("26 Mcounts/s, 3, THRESHOLD 3", 26.0, 3.0, 1)
        },
    ]
}

fn main() {
    for case in cases() {
        let config = SensorConfig {
            spad_rows: case.side,
            spad_cols: case.side,
            threshold: case.threshold,
            event_type: EventType::Greater,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 4800, CYCLES);
        let mut stream = stream_config(&config, &exposure, 1, Time::from_ps(1_900));
        stream.spads.afterpulse_probability = case.secondaries;
        stream.spads.crosstalk_probability = case.secondaries;
        let stream = PhotonStream::new(&stream);
        let law = WindowLaw::new(&config, &exposure);
        let pixels: Vec<LitPixel> = (0..PIXELS)
            .map(|number| {
                let start = 40 + number * 77;
                let open = law.window(start).open().expect("a window that opens");
                let signal = case.signal / f64::from(case.echoes);
                let place = 7.3 + f64::from(number) / 8.0;
                let first = PixelLight::echo(signal, law.time_of(&open, place));
                let mut light = first.with_background(case.background_hz);
                for echo in 1..case.echoes {
                    let arrival = law.time_of(&open, 7.3 - 2.1 * f64::from(echo));
                    light = light.with_echo(Echo::new(signal, arrival));
                }
                if case.differ {
                    let factors: [f64; 16] = std::array::from_fn(|spad| 0.8 + 0.025 * spad as f64);
                    light =
                        light.with_spads(SpadSpread::new(&factors, &[2e3; 16]).expect("a spread"));
                }
                LitPixel {
                    number: number.into(),
                    start,
                    light: Some(light),
                }
            })
            .collect();
        let engine = Window::new(&config, &exposure);
        let times = (0..2).map(|_| {
            let begin = ThreadTime::now();
            engine.expose(&stream, &pixels).expect("no refusal");
            begin.elapsed().as_secs_f64() * 1e9 / f64::from(CYCLES) / f64::from(PIXELS)
        });
        let least = times.fold(f64::INFINITY, f64::min);
        println!("{:42} {least:6.1} ns", case.name);
    }
}
