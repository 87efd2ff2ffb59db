//! SPADs and pulses that differ: bounds allow for what is not known of them.

use super::*;

/// How many of 60 macropixels have a bound, and the root mean squares of errors and bounds, bins.
fn bounded_errors_and_bounds(spread: f64, photons: f64, background_hz: f64) -> (usize, [f64; 2]) {
    let config = SensorConfig {
        dead_time_spread: spread,
        ..SensorConfig::default()
    };
    let bench = Bench::new(config, 4_000, 40.0);
    let place = 7.3;
    let counts = bench.expose(5, 60, |_| bench.echo(place, photons, background_hz));
    let finder = EchoFinder::new(&bench.law, bench.width, &DepthOptions::default()).unwrap();
    let found = counts.iter().filter_map(|counts| {
        let sighting = finder.find(counts)?;
        Some((sighting.position_bins - place, sighting.bound_bins?))
    });
    let found: Vec<(f64, f64)> = found.collect();
    let rms = |squares: f64| (squares / found.len() as f64).sqrt();
    let errors = found.iter().map(|(error, _)| error * error).sum();
    let bounds = found.iter().map(|(_, bound)| bound * bound).sum();
    (found.len(), [rms(errors), rms(bounds)])
}

#[test]
fn bounds_allow_for_a_spread_of_dead_times() {
    for (spread, photons, background_hz) in [
        (0.1, 10.0, 50e6),
        (0.1, 20.0, 10e6),
        (0.1, 60.0, 50e6),
        (0.2, 10.0, 50e6),
        (0.2, 20.0, 10e6),
    ] {
        let light = format!("{spread}: {photons} photons, {background_hz} Hz");
        let ranged = bounded_errors_and_bounds(spread, photons, background_hz);
        let (bounded, [error, bound]) = ranged;
        assert!(bounded > 50, "{light}: {bounded} of 60 have a bound");
        assert!(error < 1.2 * bound, "{light}: {error} and {bound} bins");
        // The bound is of that, and not of the counts alone.
        let (_, [_, of_alike]) = bounded_errors_and_bounds(0.0, photons, background_hz);
        assert!(
            bound > 1.1 * of_alike,
            "{light}: {bound} and {of_alike} bins"
        );
    }
}

#[test]
fn bounds_allow_for_a_spread_of_energies() {
    let errors_and_bounds = |energy_spread: f64| {
        let mut bench = Bench::new(SensorConfig::default(), 4_000, 40.0);
        bench.width.energy_spread = energy_spread;
        let place = 7.3;
        let counts = bench.expose(6, 60, |_| bench.echo(place, 10.0, 10e6));
        let finder = EchoFinder::new(&bench.law, bench.width, &DepthOptions::default()).unwrap();
        let found = counts.iter().filter_map(|counts| {
            let sighting = finder.find(counts)?;
            Some((sighting.position_bins - place, sighting.bound_bins?))
        });
        let found: Vec<(f64, f64)> = found.collect();
        assert!(found.len() > 50, "{} of 60 have a bound", found.len());
        let middle = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        };
        let far = found
            .iter()
            .filter(|(error, bound)| error.abs() > 3.0 * bound);
        let (error, bound) = found
            .iter()
            .map(|(error, bound)| (error.abs(), *bound))
            .unzip();
        (far.count(), middle(error), middle(bound))
    };
    let (far, error, bound) = errors_and_bounds(0.3);
    // Half of the errors are within 0.67 standard deviations.
    assert!(far <= 1 && error < bound, "{far}, {error} and {bound} bins");
    let (_, error_of_alike, of_alike) = errors_and_bounds(0.0);
    assert!(
        error > 1.5 * error_of_alike && bound > 1.5 * of_alike,
        "{bound} and {of_alike} bins, {error} and {error_of_alike}"
    );
}
