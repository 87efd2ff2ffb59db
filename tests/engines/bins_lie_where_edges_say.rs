//! Bins of any lengths, as the taps of a delay line make them: the window engine counts what the edges say, laser cycle by
//! laser cycle and bin by bin, and what assumes equal bins refuses others.

use guided_dtof::chip::{
    EventType, Exposure, Mode, SensorConfig, WindowLaw, correlation, histogram,
};
use guided_dtof::engine::{
    Cohort, CohortOptions, EngineError, Expose, LitPixel, NotModelled, Replay, Window, full_stream,
    stream_config,
};
use guided_dtof::photon::{PhotonStream, PixelLight, SpadEvent};
use guided_dtof::ranging::{DepthOptions, EchoFinder, UnequalBins};
use guided_dtof::units::Time;
use proptest::prelude::*;

/// What the window engine must count: every laser cycle, every bin, every pulse.
fn by_edges(law: &WindowLaw, start: u16, pulses: &[SpadEvent]) -> Option<Vec<u16>> {
    let config = law.sensor();
    let Some(window) = law.window(start).settled().ok()? else {
        return Some(vec![0; config.bins]);
    };
    let first = match config.mode {
        Mode::Guided => 0,
        Mode::Conventional => -1,
    };
    let mut hits = vec![0; config.bins];
    for cycle in first..i64::from(law.exposure().laser_cycles) {
        let edges = law.edges(&window, cycle);
        for (bin, hits) in hits.iter_mut().enumerate() {
            let collected = edges.bin(bin);
            let within = pulses.iter().filter(|p| collected.contains(&p.time));
            let fired = within.fold(0u64, |fired, pulse| fired ^ (1 << pulse.spad));
            let is_event = correlation::model(fired, config.event_type, config.threshold);
            // What the edges before number -1 took never was in the pipeline.
            let is_compared = law.edge_of(collected.end - Time::from_fs(1)) >= -1;
            *hits += u64::from(is_event && is_compared);
        }
    }
    let counts = hits.into_iter();
    Some(
        counts
            .map(|n| histogram::model(n, config.bin_bits as u32, config.overflow))
            .collect(),
    )
}

/// Taps in CLK periods: of any widths, within the window of CLK periods or beyond it.
fn taps(bins: usize) -> impl Strategy<Value = Vec<f64>> {
    let width = prop_oneof![1 => Just(1e-6), 4 => 0.01f64..1.0, 2 => 1f64..3.0];
    (0f64..2.0, prop::collection::vec(width, bins)).prop_map(|(first, widths)| {
        let ends = widths.iter().scan(first, |at, width| {
            *at += width;
            Some(*at)
        });
        std::iter::once(first).chain(ends).collect()
    })
}

fn sensors() -> impl Strategy<Value = (SensorConfig, Vec<Vec<f64>>)> {
    let event_types =
        prop::sample::select(vec![EventType::Greater, EventType::Equal, EventType::Less]);
    let modes = prop::sample::select(vec![Mode::Guided, Mode::Conventional]);
    let chip = (1usize..20, 100f64..400.0, event_types, 0u8..3, modes);
    chip.prop_flat_map(|(bins, clk_mhz, event_type, threshold, mode)| {
        let config = SensorConfig {
            bins,
            clk_hz: clk_mhz * 1e6,
            event_type,
            threshold,
            mode,
            bin_bits: 4,
            dead_time_ns: 3.0,
            ..SensorConfig::default()
        };
        (Just(config), prop::collection::vec(taps(bins), 0..4))
    })
}

/// With the taps of one delay line, or of several that start values take in turn, or of none.
fn law(config: &SensorConfig, exposure: &Exposure, lines: &[Vec<f64>]) -> WindowLaw {
    let law = WindowLaw::new(config, exposure);
    let tap = |periods: &f64| Time::from_s(periods / config.clk_hz);
    let lines: Vec<Vec<Time>> = lines
        .iter()
        .map(|taps| taps.iter().map(tap).collect())
        .collect();
    if lines.is_empty() {
        law
    } else {
        law.with_taps(&lines)
    }
}

proptest! {
    /// Laser cycles shorter and longer than a window.
    #[test]
    fn the_window_engine_counts_between_the_edges(
        (config, lines) in sensors(),
        (stop_periods, laser_cycles) in (2u32..60, 1u32..12),
        start in 0u16..80,
        pulses in prop::collection::vec((0f64..1.0, 0u8..16), 0..150),
        at_edges in prop::collection::vec((any::<u16>(), any::<u16>(), -1i64..1), 0..20),
    ) {
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let law = law(&config, &exposure, &lines);
        let end_s = exposure.end().as_s();
        let mut pulses: Vec<SpadEvent> = pulses
            .into_iter()
            .map(|(at, spad)| SpadEvent { time: Time::from_s(at * end_s), spad })
            .collect();
        // The femtoseconds before and at edges.
        if let Some(window) = law.window(start).open() {
            pulses.extend(at_edges.into_iter().map(|(cycle, edge, off)| {
                let edges = law.edges(&window, i64::from(cycle) % i64::from(laser_cycles));
                let edge = edges.edges()[usize::from(edge) % edges.edges().len()];
                SpadEvent { time: edge + Time::from_fs(off), spad: 7 }
            }));
        }
        pulses.retain(|pulse| pulse.time >= Time::ZERO);
        pulses.sort_unstable();
        let engine = Window::with_law(law.clone());
        prop_assert_eq!(engine.histogram(start, &pulses).ok(), by_edges(&law, start, &pulses));
    }

    /// In light, too, and for all of it.
    #[test]
    fn light_is_counted_between_the_edges(
        (config, lines) in sensors(),
        (stop_periods, laser_cycles) in (20u32..80, 1u32..40),
        (start, seed) in (0u16..60, any::<u64>()),
        (signal_per_cycle, background_hz) in (0f64..4.0, 0f64..1e8),
    ) {
        let exposure = Exposure::new(&config, stop_periods, laser_cycles);
        let law = law(&config, &exposure, &lines);
        let stream = stream_config(&config, &exposure, seed, Time::from_ps(900));
        let stream = PhotonStream::new(&stream);
        let arrival = Time::from_ns(30);
        let light = PixelLight::echo(signal_per_cycle, arrival).with_background(background_hz);
        let pixel = LitPixel { number: 3, start, light: Some(light.clone()) };
        let engine = Window::with_law(law.clone());
        let exposed = engine.expose(&stream, std::slice::from_ref(&pixel)).ok().map(|e| e.histograms.into_counts());
        let pulses = stream.pixel_events(3, &light).events;
        prop_assert_eq!(&exposed, &by_edges(&law, start, &pulses));
        let all = full_stream(&engine, &stream, &[pixel]).ok().map(|e| e.histograms.into_counts());
        prop_assert_eq!(exposed, all);
    }
}

#[test]
fn what_needs_equal_bins_refuses_others() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 1000);
    let uneven: Vec<f64> = (0..17).map(|n| 0.3 * f64::from(n * n)).collect();
    let uneven = law(&config, &exposure, &[uneven]);
    let finder = EchoFinder::new(&uneven, Time::from_ps(900), &DepthOptions::default());
    assert_eq!(finder, Err(UnequalBins));
    let arrival = Time::from_ns(100);
    let light = PixelLight::echo(0.5, arrival).with_background(1e6);
    let stream = stream_config(&config, &exposure, 1, Time::from_ps(900));
    let cohort = Cohort::with_law(uneven, CohortOptions::default());
    let refused = cohort.draw(&stream, 0, 60, &light);
    let too_long = matches!(
        refused,
        Err(EngineError::NotInCohorts(NotModelled::ShortDeadTime { bin, .. })) if bin > Time::from_ns(9)
    );
    assert!(too_long, "a SPAD may fire twice in a bin: {refused:?}");
}

/// A delay line of half CLK periods: depths are as exact as its bins are fine.
#[test]
fn depths_are_found_in_bins_of_half_a_clk_period() {
    let config = SensorConfig::default();
    let exposure = Exposure::new(&config, 520, 1000);
    let halves: Vec<f64> = (0..17).map(|n| 0.5 * f64::from(n)).collect();
    let law = law(&config, &exposure, &[halves]);
    let sigma = Time::from_ps(500);
    let finder = EchoFinder::new(&law, sigma, &DepthOptions::default()).unwrap();
    assert!((finder.bin_s * config.clk_hz - 0.5).abs() < 1e-6);
    let stream = PhotonStream::new(&stream_config(&config, &exposure, 1, sigma));
    let engine = Window::with_law(law.clone());
    let window = law.window(200).open().unwrap();
    for (number, position) in (0..).zip([5.0, 6.3, 7.5, 9.9]) {
        let arrival = law.time_of(&window, position);
        let light = PixelLight::echo(0.3, arrival).with_background(1e6);
        let pixel = LitPixel {
            number,
            start: 200,
            light: Some(light),
        };
        let exposed = engine.expose(&stream, &[pixel]).unwrap();
        let counts: Vec<u32> = (exposed.histograms[0].iter()).map(|&n| n.into()).collect();
        let found = finder.find(&counts).unwrap();
        // 260 photons, each within 0.4 bins: a standard deviation of 0.03 bins.
        let off = found.position_bins - position;
        assert!(
            found.is_significant && off.abs() < 0.15,
            "{position}: {off}"
        );
        assert_eq!(
            law.edges(&window, 0).bin_of(arrival),
            Some((position + 0.5) as usize)
        );
    }
}
