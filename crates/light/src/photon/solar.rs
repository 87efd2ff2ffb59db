//! Sunlight in the filter's band: the reference spectrum ASTM G173-03 through any filter.
//!
//! Thesis 3.3.2 integrates the spectrum over 905 ± 10 nm for the background of a surface in full sun, its
//! 100 klux (Eq. 10, M_target,bg = 13.8). That is the *global tilt* column, by trapezoids, in W/m²:
//! 13.808. The number is an irradiance; the thesis prints W/sr/m² and uses it as an exitance.
//!
//! The spectrum is linear between its entries (1 nm apart from 400 to 1700 nm), so a top-hat filter gives
//! the trapezoid rule, cut off exactly at its edges.

use std::sync::OnceLock;

use super::optics::Filter;
use crate::numerics::integrate;

/// Illuminance that stands for the reference spectrum, klux (thesis 3.2.1).
pub const FULL_SUN_KLUX: f64 = 100.0;

/// The reference spectrum: (wavelength nm, global tilt irradiance W/m²/nm), ascending, 280 to 4000 nm.
pub fn spectrum() -> &'static [(f64, f64)] {
    static SPECTRUM: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    SPECTRUM.get_or_init(|| {
        include_str!("astm_g173.csv")
            .lines()
            .filter_map(|line| line.split_once(','))
            .filter_map(|(nm, w)| Some((nm.parse().ok()?, w.parse().ok()?)))
            .collect()
    })
}

/// Spectral irradiance at `wavelength_nm`, W/m²/nm; zero outside the table.
pub fn spectral_irradiance(wavelength_nm: f64) -> f64 {
    let table = spectrum();
    let right = table.partition_point(|&(nm, _)| nm < wavelength_nm);
    match (
        right.checked_sub(1).map(|left| table[left]),
        table.get(right),
    ) {
        (Some((nm_0, w_0)), Some(&(nm_1, w_1))) => {
            w_0 + (w_1 - w_0) * (wavelength_nm - nm_0) / (nm_1 - nm_0)
        }
        (None, Some(&(nm, w))) if nm == wavelength_nm => w,
        _ => 0.0,
    }
}

/// Solar irradiance that `filter` lets through in full sun (100 klux), W/m² (M_target,bg of Eq. 10).
pub fn band_irradiance(filter: &Filter) -> f64 {
    let (from, to) = filter.passband_nm();
    let (first, last) = (spectrum()[0].0, spectrum()[spectrum().len() - 1].0);
    let (from, to) = (from.max(first), to.min(last));
    if from >= to {
        return 0.0;
    }
    let mut breaks = vec![from, to];
    breaks.extend(spectrum().iter().map(|&(nm, _)| nm));
    // A filter may be narrower than the spectrum's steps.
    breaks.extend((-16..=16).map(|k| filter.centre_nm + f64::from(k) * filter.fwhm_nm / 4.0));
    breaks.retain(|nm| (from..=to).contains(nm));
    breaks.sort_by(f64::total_cmp);
    integrate(
        |nm| spectral_irradiance(nm) * filter.transmission(nm),
        &breaks,
        1e-13,
    )
}

#[cfg(test)]
mod tests {
    use super::super::optics::FilterShape;
    use super::*;
    use std::f64::consts::{LN_2, PI};

    /// Trapezoids over the table's own entries.
    fn trapezoid(from_nm: f64, to_nm: f64, filter: &Filter) -> f64 {
        spectrum()
            .windows(2)
            .filter(|w| w[0].0 >= from_nm && w[1].0 <= to_nm)
            .map(|w| {
                let value = |(nm, irradiance): (f64, f64)| irradiance * filter.transmission(nm);
                0.5 * (value(w[0]) + value(w[1])) * (w[1].0 - w[0].0)
            })
            .sum()
    }

    #[test]
    fn the_filter_of_table_6_passes_13_8_watts() {
        let filter = Filter::new(905.0, 20.0, FilterShape::TopHat);
        let got = band_irradiance(&filter);
        assert!((got - 13.808).abs() < 5e-4, "{got}");
        assert!(
            (got - trapezoid(895.0, 915.0, &filter)).abs() < 1e-12,
            "{got}"
        );
    }

    #[test]
    fn the_whole_spectrum_is_a_kilowatt() {
        let all = Filter::new(2140.0, 3720.0, FilterShape::TopHat);
        let got = band_irradiance(&all);
        assert!((got - trapezoid(280.0, 4000.0, &all)).abs() < 1e-9, "{got}");
        assert!((got - 1000.4).abs() < 0.1, "{got}");
    }

    #[test]
    fn a_narrow_filter_of_any_shape_samples_the_spectrum() {
        for shape in FilterShape::ALL {
            let filter = Filter::new(905.3, 1e-3, shape);
            // Width of the top hat that passes as much of white light, over its width at half maximum.
            let width = match shape {
                FilterShape::TopHat | FilterShape::Cosine => 1.0,
                FilterShape::Gaussian => 0.5 * (PI / LN_2).sqrt(),
                FilterShape::Lorentz => 0.5 * PI,
            };
            let want = spectral_irradiance(905.3) * width * filter.fwhm_nm;
            let error = band_irradiance(&filter) / want - 1.0;
            // The wings of the Lorentzian see the rest of the spectrum.
            let allowed = if shape == FilterShape::Lorentz {
                2e-3
            } else {
                1e-6
            };
            assert!(error.abs() < allowed, "{shape:?}: {error:e}");
        }
    }

    #[test]
    fn smooth_filters_agree_with_fine_trapezoids() {
        for shape in [
            FilterShape::Gaussian,
            FilterShape::Cosine,
            FilterShape::Lorentz,
        ] {
            let filter = Filter::new(940.0, 10.0, shape);
            let steps = 372_000;
            let fine: f64 = (0..steps)
                .map(|k| 280.0 + (f64::from(k) + 0.5) * 0.01)
                .map(|nm| spectral_irradiance(nm) * filter.transmission(nm) * 0.01)
                .sum();
            let got = band_irradiance(&filter);
            assert!((got / fine - 1.0).abs() < 1e-5, "{shape:?}: {got} {fine}");
        }
    }

    #[test]
    fn there_is_no_light_outside_the_table() {
        assert_eq!(spectral_irradiance(200.0), 0.0);
        assert_eq!(spectral_irradiance(5000.0), 0.0);
        assert_eq!(
            band_irradiance(&Filter::new(100.0, 10.0, FilterShape::TopHat)),
            0.0
        );
        assert_eq!(spectral_irradiance(280.0), spectrum()[0].1);
        assert_eq!(spectral_irradiance(4000.0), 0.0071043);
    }
}
