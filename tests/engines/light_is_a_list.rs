//! Light of several echoes, with a profile, in segments, on SPADs that differ: the photons are as many as the description
//! says, wherever they fall, and every engine counts them or refuses.

use guided_dtof::chip::SpadGrid;
use guided_dtof::engine::LitPixel;
use guided_dtof::photon::{
    Echo, OtherLaser, PhotonStream, PixelLight, Profile, PulseShape, PulseTrain, SpadModel,
    SpadSpread, StreamConfig,
};
use guided_dtof::units::{Frequency, Time};
use proptest::prelude::*;

use crate::cohort_agrees_with_window::comparison;
use crate::window_sees_what_the_full_stream_shows::{
    Arrival, Case, Sigma, agreed, arrivals, cases, sigmas,
};

/// What is added to light of one echo.
#[derive(Debug, Clone)]
struct More {
    echoes: Vec<(f64, Arrival, Option<Sigma>, bool)>,
    /// Edges as shares of 1.2 laser cycles, and rates relative to the background with 1 Mcount/s more.
    profile: Option<Vec<(f64, f64)>>,
    /// Photons, period and delay in laser cycles, standard deviation, and what both lasers wait at most in periods.
    trains: Vec<(f64, f64, f64, Sigma, [f64; 2])>,
    /// Where the light changes, as shares of the exposure.
    changes: Vec<f64>,
    /// Factors and dark counts of SPADs, which are repeated.
    spads: Option<Vec<(f64, f64)>>,
}

fn more() -> impl Strategy<Value = More> {
    let echo = (
        0.0f64..2.0,
        arrivals(),
        prop::option::of(sigmas()),
        prop::bool::weighted(0.2),
    );
    let profile = prop::collection::vec((0.01f64..1.0, 0.0f64..3.0), 1..5);
    let spads = prop::collection::vec((0.0f64..2.0, 0.0f64..1e6), 1..7);
    let dither = prop_oneof![Just(0.0), 0.0f64..0.9];
    let train = (
        prop_oneof![0.0f64..3.0, 0.0f64..1e4],
        0.05f64..5.0,
        0.0f64..3.0,
        sigmas(),
        [dither.clone(), dither],
    );
    (
        prop::collection::vec(echo, 0..3),
        prop::option::of(profile),
        prop::collection::vec(train, 0..3),
        prop::collection::vec(0.0f64..1.0, 0..3),
        prop::option::of(spads),
    )
        .prop_map(|(echoes, profile, trains, changes, spads)| More {
            echoes,
            profile,
            trains,
            changes,
            spads,
        })
}

/// `case` with more light.
fn with_more(case: Case, more: &More) -> Case {
    let Case {
        config,
        exposure,
        stream,
        pixel,
    } = &case;
    let clk_fs = 1e15 / config.clk_hz;
    let cycle_fs = clk_fs * f64::from(exposure.stop_periods);
    let mut light = pixel.light.clone().unwrap();
    let first = light.clone();
    for &(photons, arrival, sigma, is_measured) in &more.echoes {
        let sigma = sigma.map(|sigma| Time::from_fs(sigma.fs(clk_fs)));
        let sigma_fs = sigma.unwrap_or(stream.pulse_sigma).as_fs();
        let arrival_fs = arrival.fs(pixel.start, clk_fs, cycle_fs, sigma_fs);
        let mut echo = Echo::new(photons, Time::from_fs(arrival_fs));
        echo.sigma = sigma;
        if is_measured {
            echo = echo.with_shape(PulseShape::new(Time::from_ps(900), &[1.0, 3.0, 0.0]).unwrap());
        }
        light = light.with_echo(echo);
    }
    if let Some(pieces) = &more.profile {
        let rate_hz = first.background_hz() + 1e6;
        let mut edges: Vec<Time> = pieces
            .iter()
            .map(|(edge, _)| Time::from_fs((edge * 1.2 * cycle_fs) as i64))
            .collect();
        edges.push(Time::ZERO);
        edges.sort();
        edges.dedup();
        let rates: Vec<f64> = pieces.iter().map(|(_, rate)| rate * rate_hz).collect();
        let profile = Profile::new(&edges, &rates[..edges.len() - 1]).unwrap();
        light = light.with_profile(profile);
    }
    for (number, &(photons, period, delay, sigma, dither)) in (0..).zip(&more.trains) {
        let period_s = period * cycle_fs * 1e-15;
        // Brighter trains in shorter exposures: with ten times as many photons one draw in some took this test a minute.
        let most = 3e4 * period / f64::from(exposure.laser_cycles);
        let [dither_s, own_dither_s] = dither.map(|share| share * period_s);
        light = light.with_train(PulseTrain {
            laser: OtherLaser {
                number,
                period_s,
                phase: None,
                dither_s,
                own_dither_s,
            },
            photons: photons.min(most),
            delay: Time::from_fs((delay * cycle_fs) as i64),
            sigma: Time::from_fs(sigma.fs(clk_fs)),
        });
    }
    let mut segments = vec![(0, light.clone())];
    let mut changes = more.changes.clone();
    changes.sort_by(f64::total_cmp);
    for (number, share) in changes.iter().enumerate() {
        let cycle = (share * f64::from(exposure.laser_cycles)) as u32;
        if segments.last().unwrap().0 < cycle {
            // Another echo, then the first light without what was added to it.
            let arrival = light.arrival() + Time::from_fs((2.5 * clk_fs) as i64);
            let next = match number {
                0 => light.clone().with_arrival(arrival),
                _ => first.clone(),
            };
            segments.push((cycle, next));
        }
    }
    let mut light = PixelLight::timeline(segments).unwrap();
    if let Some(spads) = &more.spads {
        let each = spads.iter().cycle().take(config.spad_grid().spads());
        let (factors, dark): (Vec<f64>, Vec<f64>) = each.copied().unzip();
        light = light.with_spads(SpadSpread::new(&factors, &dark).unwrap());
    }
    let pixel = LitPixel {
        light: Some(light),
        ..pixel.clone()
    };
    Case { pixel, ..case }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::cases::cases(60)))]

    #[test]
    fn the_window_engine_counts_what_the_full_stream_shows(
        case in cases(700, 80.0),
        more in more(),
    ) {
        agreed(&with_more(case, &more));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(crate::cases::cases(40)))]

    #[test]
    fn in_cycles_as_short_as_the_window_too(case in cases(60, 4.0), more in more()) {
        agreed(&with_more(case, &more));
    }
}

#[test]
fn a_timeline_of_one_segment_is_its_light() {
    let config = stream(SpadModel::with_dead_time(Time::from_ns(8)), 300);
    let stream = PhotonStream::new(&config);
    let light = PixelLight::echo(0.4, Time::from_ns(40)).with_background(9e6);
    let timeline = PixelLight::timeline([(0, light.clone())]).unwrap();
    assert_eq!(light, timeline);
    assert_eq!(
        stream.pixel_events(3, &light),
        stream.pixel_events(3, &timeline)
    );
}

/// A piece of light, told once more in the plainest words: a rate on one SPAD between two times in certain laser cycles, or
/// a Gaussian echo of each of these.
#[derive(Debug, Clone, Copy)]
enum Piece {
    Even {
        hz: f64,
        from_ns: f64,
        until_ns: f64,
    },
    Echo {
        photons: f64,
        centre_ns: f64,
        sigma_ns: f64,
    },
}

const CYCLE_NS: f64 = 125.0;

fn stream(spads: SpadModel, laser_cycles: u32) -> StreamConfig {
    StreamConfig {
        seed: 11,
        clock: Frequency::from_hz(384_000_000),
        stop_periods: 48,
        laser_cycles,
        lead: Time::from_ps(700),
        pulse_sigma: Time::from_ns(1),
        pulse_shape: None,
        energy_spread: 0.0,
        spads,
    }
}

impl Piece {
    /// Mean photons of all SPADs between two times after the start of the exposure, sent by laser cycles `of`.
    fn photons(&self, laser_cycles: std::ops::Range<u32>, from_ns: f64, until_ns: f64) -> f64 {
        let each = laser_cycles.map(|cycle| {
            let start_ns = f64::from(cycle) * CYCLE_NS;
            match *self {
                Piece::Even {
                    hz,
                    from_ns: from,
                    until_ns: until,
                } => {
                    let from = from_ns.max(start_ns + from);
                    let until = until_ns.min(start_ns + until.min(CYCLE_NS));
                    hz * 1e-9 * (until - from).max(0.0)
                }
                Piece::Echo {
                    photons,
                    centre_ns,
                    sigma_ns,
                } => {
                    let below = |ns: f64| {
                        let z = (ns - start_ns - centre_ns) / sigma_ns;
                        0.5 * libm::erfc(-z / 2f64.sqrt())
                    };
                    photons * (below(until_ns) - below(from_ns))
                }
            }
        });
        each.sum()
    }
}

/// Photons of many macropixels by SPAD and by eighths of laser cycles, beside what the pieces of each segment say. A sum of
/// squares tells whether their spread is that of a Poisson process, too.
fn fall_as_described(
    name: &str,
    light: &PixelLight,
    segments: &[(std::ops::Range<u32>, Vec<Piece>)],
    factors: &[f64; 4],
    dark_hz: &[f64; 4],
) {
    const PARTS: usize = 8;
    let cycles = segments.last().unwrap().0.end;
    let grid = SpadGrid::new(2, 2);
    let spads = SpadModel {
        grid,
        ..SpadModel::with_dead_time(Time::ZERO)
    };
    let photons = PhotonStream::new(&stream(spads, cycles));
    let pixels = 400u32;
    let mut counts = vec![[0.0; 4]; cycles as usize * PARTS];
    for pixel in 0..pixels {
        for event in photons.pixel_events(pixel, light).events {
            let part = event.time.as_ns() / CYCLE_NS * PARTS as f64;
            counts[part as usize][usize::from(event.spad)] += 1.0;
        }
    }
    let (mut squares, mut cells) = (0.0, 0.0);
    for (part, counts) in counts.iter().enumerate() {
        let edge_ns = |part: usize| part as f64 * CYCLE_NS / PARTS as f64;
        let (from_ns, until_ns) = (edge_ns(part), edge_ns(part + 1));
        let pieces = segments.iter().flat_map(|(of, pieces)| {
            let photons = |piece: &Piece| piece.photons(of.clone(), from_ns, until_ns);
            pieces.iter().map(photons)
        });
        let even = pieces.sum::<f64>() / 4.0;
        for (spad, &count) in counts.iter().enumerate() {
            let dark = dark_hz[spad] * 1e-9 * (until_ns - from_ns);
            let mean = f64::from(pixels) * (even * factors[spad] + dark);
            let off: f64 = count - mean;
            assert!(
                off.abs() <= 5.5 * mean.sqrt() + 1.5,
                "{name}: SPAD {spad} from {from_ns} ns on: {count} photons, not {mean:.1}"
            );
            if mean > 5.0 {
                squares += off * off / mean;
                cells += 1.0;
            }
        }
    }
    let spread = (squares - cells) / (2.0 * cells).sqrt();
    assert!(spread.abs() < 5.0, "{name}: {squares} in {cells} cells");
}

#[test]
fn photons_fall_where_and_as_often_as_described() {
    const EVEN: [f64; 4] = [1.0; 4];
    const NONE: [f64; 4] = [0.0; 4];
    let ns = |ns: f64| Time::from_fs((ns * 1e6) as i64);
    let constant = |hz| Piece::Even {
        hz,
        from_ns: 0.0,
        until_ns: CYCLE_NS,
    };
    let gaussian = |photons, centre_ns, sigma_ns| Piece::Echo {
        photons,
        centre_ns,
        sigma_ns,
    };
    // As they are, and bright enough for photons to be drawn laser cycle by laser cycle.
    for bright in [1.0, 40.0] {
        let echoes = PixelLight::echo(0.3 * bright, ns(20.0))
            .with_echo(Echo::new(0.2 * bright, ns(61.0)).with_sigma(ns(9.0)))
            .with_echo(Echo::new(0.1 * bright, ns(-3.0)))
            .with_background(5e6 * bright);
        let pieces = vec![
            gaussian(0.3 * bright, 20.0, 1.0),
            gaussian(0.2 * bright, 61.0, 9.0),
            gaussian(0.1 * bright, -3.0, 1.0),
            constant(5e6 * bright),
        ];
        let name = |what: &str| format!("{what}, {bright} times as bright");
        let all = |pieces: &[Piece]| vec![(0..30, pieces.to_vec())];
        fall_as_described(&name("echoes"), &echoes, &all(&pieces), &EVEN, &NONE);

        let edges = [7.0, 9.0, 41.3, 300.0].map(ns);
        let rates = [30e6, 12e6, 1e6].map(|hz| hz * bright);
        let fog = PixelLight::echo(0.2 * bright, ns(80.0))
            .with_background(2e6 * bright)
            .with_profile(Profile::new(&edges, &rates).unwrap());
        let even = |hz, from_ns, until_ns| Piece::Even {
            hz: hz * bright,
            from_ns,
            until_ns,
        };
        let of_fog = vec![
            gaussian(0.2 * bright, 80.0, 1.0),
            constant(2e6 * bright),
            even(30e6, 7.0, 9.0),
            even(12e6, 9.0, 41.3),
            even(1e6, 41.3, 300.0),
        ];
        fall_as_described(&name("fog"), &fog, &all(&of_fog), &EVEN, &NONE);

        let laser = OtherLaser {
            number: 3,
            period_s: 171e-9,
            phase: Some(0.3),
            dither_s: 0.0,
            own_dither_s: 0.0,
        };
        let train = PulseTrain {
            laser,
            photons: 0.7 * bright,
            delay: ns(33.0),
            sigma: ns(2.0),
        };
        let other = PixelLight::echo(0.3 * bright, ns(20.0))
            .with_background(1e6 * bright)
            .with_train(train);
        let pulse = |pulse: u32| {
            let sent_ns = (f64::from(pulse) + 0.3) * 171.0;
            (0..1, vec![gaussian(0.7 * bright, sent_ns + 33.0, 2.0)])
        };
        let mut of_other: Vec<_> = (0..22).map(pulse).collect();
        let own = vec![gaussian(0.3 * bright, 20.0, 1.0), constant(1e6 * bright)];
        of_other.push((0..30, own));
        fall_as_described(&name("another laser"), &other, &of_other, &EVEN, &NONE);

        let moving = [
            (0, fog.clone()),
            (9, echoes.clone()),
            (20, PixelLight::background(3e6)),
        ];
        let moving = PixelLight::timeline(moving).unwrap();
        let of_moving = vec![
            (0..9, of_fog.clone()),
            (9..20, pieces.clone()),
            (20..30, vec![constant(3e6)]),
        ];
        fall_as_described(&name("motion"), &moving, &of_moving, &EVEN, &NONE);

        let (factors, dark_hz) = ([1.0, 0.0, 0.4, 1.7], [0.0, 3e6, 1e6, 0.0]);
        let spads = SpadSpread::new(&factors, &dark_hz).unwrap();
        let spread = moving.with_spads(spads);
        fall_as_described(&name("SPADs"), &spread, &of_moving, &factors, &dark_hz);
    }
}

/// An echo without width comes at one instant, at which each SPAD fires once: by its own chance, whatever others do.
#[test]
fn spads_that_differ_take_photons_of_one_instant_independently() {
    let config = stream(SpadModel::with_dead_time(Time::ZERO), 400);
    let factors: Vec<f64> = (0..16).map(|spad| f64::from(spad) / 8.0).collect();
    let echo = Echo::new(16.0 * 0.4, Time::from_ns(50)).with_sigma(Time::ZERO);
    let light = PixelLight::dark()
        .with_echo(echo)
        .with_spads(SpadSpread::new(&factors, &[0.0; 16]).unwrap());
    let stream = PhotonStream::new(&config);
    let mut fired = [0.0; 16];
    for pixel in 0..40 {
        for event in stream.pixel_events(pixel, &light).events {
            fired[usize::from(event.spad)] += 1.0;
        }
    }
    for (fired, factor) in fired.iter().zip(factors) {
        let (n, chance) = (40.0 * 400.0, -libm::expm1(-0.4 * factor));
        let sigma = (n * chance * (1.0 - chance)).sqrt();
        assert!(
            (fired - n * chance).abs() <= 5.0 * sigma,
            "{factor}: {fired}"
        );
    }
}

#[test]
fn cohorts_follow_echoes_profiles_and_timelines() {
    let ns = |ns: f64| Time::from_fs((ns * 1e6) as i64);
    let glass = PixelLight::echo(0.5, ns(72.0))
        .with_echo(Echo::new(0.6, ns(88.0)).with_sigma(ns(4.0)))
        .with_background(30e6);
    let edges = [0.0, 60.0, 75.5, 90.0].map(ns);
    let fog = PixelLight::echo(0.4, ns(93.0))
        .with_background(8e6)
        .with_profile(Profile::new(&edges, &[120e6, 60e6, 20e6]).unwrap());
    let bright = PixelLight::echo(6.0, ns(80.0))
        .with_echo(Echo::new(3.0, ns(84.0)))
        .with_background(90e6);
    let moving = |early: &PixelLight, late: &PixelLight| {
        let segments = [(0, early.clone()), (25, late.clone()), (26, early.clone())];
        PixelLight::timeline(segments).unwrap()
    };
    let other = |photons: f64| PulseTrain {
        laser: OtherLaser {
            number: 0,
            period_s: 131.7e-9,
            phase: Some(0.2),
            dither_s: 0.0,
            own_dither_s: 0.0,
        },
        photons,
        delay: ns(400.0),
        sigma: ns(1.5),
    };
    let disturbed = |photons: f64| glass.clone().with_train(other(photons));
    let lights = [
        ("another laser", disturbed(4.0), 40),
        ("another laser over STOP", disturbed(1.0), 4),
        ("glass", glass.clone(), 40),
        ("fog", fog.clone(), 40),
        ("much light", bright.clone(), 40),
        ("motion", moving(&glass, &fog), 40),
        ("motion in fog", moving(&fog, &bright), 40),
        ("motion over STOP", moving(&bright, &fog), 4),
    ];
    for (name, light, start) in lights {
        comparison::Case {
            name,
            light,
            start,
            seeds: comparison::seeds() / 20,
            ..comparison::case()
        }
        .agrees();
    }
}
