//! Pulses from none to longer than a bin, and light from little to too much: what is said of a place holds.

use super::*;

/// Echoes of each light.
const ECHOES: u32 = 100;

/// Where echo number `n` is, bins: places that no two have alike.
fn place(n: u32) -> f64 {
    6.0 + 3.0 * (f64::from(n) * 0.618_033_988_749_894_9).fract()
}

/// Errors and bounds of the echoes of some light, bins, where there is a bound.
fn ranged(fwhm_ns: f64, photons: f64, background_hz: f64) -> Vec<(f64, f64)> {
    let mut bench = Bench::new(SensorConfig::default(), 1000, 40.0);
    let sigma = Time::from_s(1e-9 * fwhm_ns / 2.354_820_045);
    bench.width = sigma.into();
    let counts = bench.expose(7, ECHOES, |n| bench.echo(place(n), photons, background_hz));
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
    for fwhm_ns in [0.0, 0.2, 0.5, 1.0, 2.0, 4.5] {
        for background_hz in [0.0, 8e6, 50e6] {
            for photons in [0.3, 1.0, 5.0, 20.0, 50.0, 300.0] {
                let ranged = ranged(fwhm_ns, photons, background_hz);
                let light = format!("{fwhm_ns} ns, {photons} photons, {background_hz} Hz");
                let rms = |of: &dyn Fn(&(f64, f64)) -> f64| {
                    let squares = ranged.iter().map(|pair| of(pair).powi(2));
                    (squares.sum::<f64>() / ranged.len() as f64).sqrt()
                };
                let (error, bound) = (rms(&|pair| pair.0), rms(&|pair| pair.1));
                assert!(error < 1.4 * bound, "{light}: {error} {bound}");
                assert!(ranged.len() > 90, "{light}: {} have a bound", ranged.len());
                all += ranged.len();
                beyond += ranged
                    .iter()
                    .filter(|(error, bound)| error.abs() > 5.0 * bound)
                    .count();
            }
        }
    }
    assert!(
        1000 * beyond <= all,
        "{beyond} of {all} are beyond five bounds"
    );
}
