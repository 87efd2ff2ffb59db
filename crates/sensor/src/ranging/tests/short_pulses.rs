//! Pulses from none to longer than a bin, and light from little to too much: what is said of a place holds.

use super::*;

/// Echoes of each light.
const ECHOES: u32 = 60;

/// Where echo number `n` is, bins: places that no two have alike.
fn place(n: u32) -> f64 {
    6.0 + 3.0 * (f64::from(n) * 0.618_033_988_749_894_9).fract()
}

/// Errors and bounds of the echoes of some light, bins, where there is a bound. The surface reaches from `half_depth` bins before
/// the place to as much behind it.
fn ranged(fwhm_ns: f64, photons: f64, background_hz: f64, half_depth: f64) -> Vec<(f64, f64)> {
    let mut bench = Bench::new(SensorConfig::default(), 1000, 40.0);
    let sigma = Time::from_s(1e-9 * fwhm_ns / 2.354_820_045);
    bench.width = sigma.into();
    let counts = bench.expose(7, ECHOES, |n| {
        let part = |part: i32| {
            let off = 0.5 * f64::from(part) * half_depth;
            bench.echo(place(n) + off, 0.2 * photons, 0.2 * background_hz)
        };
        let first = part(-2).with_background(background_hz);
        (-1..=2).map(part).fold(first, |light, part| {
            let mut echoes = part.segments().flat_map(|segment| segment.echoes());
            light.with_echo(echoes.next().expect("an echo").clone())
        })
    });
    let finder = EchoFinder::new(&bench.law, sigma, &DepthOptions::default()).unwrap();
    let found = (0..).zip(&counts).filter_map(|(n, counts)| {
        let sighting = finder.find(counts)?;
        let is_told = sighting.is_significant && !sighting.is_saturated;
        let bound = sighting.bound_bins.filter(|_| is_told)?;
        Some((sighting.position_bins - place(n), bound))
    });
    found.collect()
}

#[test]
fn bounds_hold_for_pulses_of_any_length_and_light() {
    let (mut all, mut beyond) = (0, 0);
    // Every third light, or all where `GDTOF_CASES` asks for them.
    let apart = if std::env::var_os("GDTOF_CASES").is_some() {
        1
    } else {
        3
    };
    for (pulse, fwhm_ns) in [0.0, 0.2, 0.5, 1.0, 2.0, 4.5].into_iter().enumerate() {
        for (sun, background_hz) in [0.0, 8e6, 50e6].into_iter().enumerate() {
            for (echo, (photons, half_depth)) in [
                (0.3, 0.0),
                (1.0, 0.0),
                (1.0, 0.15),
                (5.0, 0.0),
                (5.0, 0.15),
                (20.0, 0.0),
                (50.0, 0.0),
                (300.0, 0.0),
            ]
            .into_iter()
            .enumerate()
            {
                if !(pulse + sun + echo).is_multiple_of(apart) {
                    continue;
                }
                let light =
                    format!("{fwhm_ns} ns, {photons} photons +- {half_depth}, {background_hz} Hz");
                let ranged = ranged(fwhm_ns, photons, background_hz, half_depth);
                let rms = |member: &dyn Fn(&(f64, f64)) -> f64| {
                    let squares = ranged.iter().map(|pair| member(pair).powi(2));
                    (squares.sum::<f64>() / ranged.len() as f64).sqrt()
                };
                let (error, bound) = (rms(&|pair| pair.0), rms(&|pair| pair.1));
                assert!(error < 1.5 * bound, "{light}: {error} {bound}");
                assert!(
                    20 * ranged.len() > 17 * ECHOES as usize,
                    "{light}: {} have a bound",
                    ranged.len()
                );
                all += ranged.len();
                let is_beyond = |(error, bound): &&(f64, f64)| error.abs() > 5.0 * bound;
                beyond += ranged.iter().filter(is_beyond).count();
            }
        }
    }
    assert!(
        1000 * beyond <= all,
        "{beyond} of {all} are beyond five bounds"
    );
}
