//! Any number of SPADs in a macropixel: the first rows and columns of a larger grid.
//!
//! ```text
//!    0  1  2  ·       nine SPADs on a grid of 4×4, numbered row by row; places without a SPAD (·) see no light
//!    3  4  5  ·
//!    6  7  8  ·
//!    ·  ·  ·  ·
//! ```
//!
//! Sides of a [`SpadGrid`] are powers of two, because some bits of a random word choose a SPAD. Photons of another number of
//! SPADs are drawn for the whole grid, and those that fall on a place without a SPAD are thinned away ([`SpadSpread`]): what is
//! left is a Poisson process on each SPAD. Crosstalk into such a place is lost, as is crosstalk that leaves a macropixel, because
//! an avalanche that crosstalk triggers triggers no further one.

use super::light::{LightError, PixelLight, SpadSpread};
use super::spad_grid::{MOST_SPADS, SpadGrid};

/// Where the SPADs of a macropixel are on a grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SpadLayout {
    spads: usize,
    cols: usize,
    grid: SpadGrid,
}

impl From<SpadGrid> for SpadLayout {
    /// A SPAD on every place.
    fn from(grid: SpadGrid) -> Self {
        SpadLayout {
            spads: grid.spads(),
            cols: grid.cols(),
            grid,
        }
    }
}

impl SpadLayout {
    /// `spads` SPADs, as nearly square as can be: the smallest number of columns from ⌈√n⌉ to 8 that fills two rows or more. If
    /// there is none, the last row of ⌈√n⌉ columns is partly filled. `None` for other numbers than 1 to [`MOST_SPADS`].
    pub fn new(spads: usize) -> Option<Self> {
        if !(1..=MOST_SPADS).contains(&spads) {
            return None;
        }
        let least = (1..=8).find(|side| side * side >= spads)?;
        let is_filled = |cols: &usize| spads.is_multiple_of(*cols) && spads / cols > 1;
        let cols = (least..=8).find(is_filled).unwrap_or(least);
        let side = |length: usize| length.next_power_of_two();
        Some(SpadLayout {
            spads,
            cols,
            grid: SpadGrid::new(side(spads.div_ceil(cols)), side(cols)),
        })
    }

    /// How many SPADs there are.
    pub fn spads(self) -> usize {
        self.spads
    }

    /// Rows, of which the last one may be partly filled.
    pub fn rows(self) -> usize {
        self.spads.div_ceil(self.cols)
    }

    /// Columns.
    pub fn cols(self) -> usize {
        self.cols
    }

    /// The grid for which photons are drawn.
    pub fn grid(self) -> SpadGrid {
        self.grid
    }

    /// Whether every place of the grid has a SPAD.
    pub fn is_full(self) -> bool {
        self.spads == self.grid.spads()
    }

    /// The number of the SPAD on a place of the grid, if there is one.
    pub fn spad_at(self, place: u8) -> Option<u8> {
        let (row, col) = (
            usize::from(place) / self.grid.cols(),
            usize::from(place) % self.grid.cols(),
        );
        let spad = row * self.cols + col;
        (col < self.cols && spad < self.spads).then_some(spad as u8)
    }

    /// `light`, all of it on the places that have a SPAD. `spread` says how the SPADs differ, one value for each SPAD.
    ///
    /// # Errors
    /// When `spread` has another number of SPADs.
    pub fn place_light(
        self,
        light: PixelLight,
        spread: Option<&SpadSpread>,
    ) -> Result<PixelLight, LightError> {
        if self.is_full() {
            return Ok(match spread {
                Some(spread) => light.with_spads(spread.clone()),
                None => light,
            });
        }
        let places = self.grid.spads();
        // An even share of the grid is smaller than one of the SPADs.
        let gain = places as f64 / self.spads as f64;
        let (mut factors, mut dark_hz) = (vec![0.0; places], vec![0.0; places]);
        let own = spread.map(|spread| (spread.factors(), spread.dark_hz()));
        for place in 0..places {
            let Some(spad) = self.spad_at(place as u8).map(usize::from) else {
                continue;
            };
            let missing = || LightError::Spads {
                factors: spread.map_or(0, SpadSpread::spads),
                dark: self.spads,
            };
            (factors[place], dark_hz[place]) = match &own {
                None => (gain, 0.0),
                Some((own, dark)) => (
                    gain * own.get(spad).ok_or_else(missing)?,
                    *dark.get(spad).ok_or_else(missing)?,
                ),
            };
        }
        Ok(light.with_spads(SpadSpread::new(&factors, &dark_hz)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::{PhotonStream, SpadModel, StreamConfig};
    use crate::units::{Frequency, Time};

    #[test]
    fn every_number_of_spads_has_a_layout_and_each_spad_one_place() {
        for spads in 1..=MOST_SPADS {
            let layout = SpadLayout::new(spads).unwrap();
            let places = 0..layout.grid().spads() as u8;
            let mut found: Vec<u8> = places.filter_map(|place| layout.spad_at(place)).collect();
            found.sort_unstable();
            assert!(found.into_iter().eq(0..spads as u8), "{spads}");
            assert!(layout.rows() * layout.cols() < spads + layout.cols());
            if spads.is_power_of_two() {
                assert!(layout.is_full(), "{spads}");
            }
        }
        let sides = |spads| {
            let layout = SpadLayout::new(spads).unwrap();
            (layout.rows(), layout.cols())
        };
        assert_eq!([9, 6, 12].map(sides), [(3, 3), (2, 3), (3, 4)]);
        assert_eq!([1, 2, 8, 16].map(sides), [(1, 1), (1, 2), (2, 4), (4, 4)]);
        // No rectangle with two rows has as many.
        assert_eq!([5, 13].map(sides), [(2, 3), (4, 4)]);
        assert_eq!(SpadLayout::new(0), None);
        assert_eq!(SpadLayout::new(65), None);
        assert_eq!(
            SpadLayout::from(SpadGrid::default()),
            SpadLayout::new(16).unwrap()
        );
    }

    /// Photons of each SPAD, and of all of them, against their Poisson means.
    #[test]
    fn all_light_falls_on_the_spads_that_are_there() {
        for spads in [1, 3, 9, 13, 16, 25] {
            let layout = SpadLayout::new(spads).unwrap();
            let cycles = 4000;
            let config = StreamConfig {
                seed: 5,
                clock: Frequency::from_hz(400_000_000),
                stop_periods: 400,
                laser_cycles: cycles,
                lead: Time::ZERO,
                pulse_sigma: Time::from_ns(2),
                pulse_shape: None,
                energy_spread: 0.0,
                spads: SpadModel {
                    grid: layout.grid(),
                    // Shorter than any distance of two photons, nearly.
                    ..SpadModel::with_dead_time(Time::from_ps(1))
                },
            };
            let light = PixelLight::echo(2.0, Time::from_ns(300)).with_background(1e6);
            let light = layout.place_light(light, None).unwrap();
            let events = PhotonStream::new(&config).pixel_events(7, &light).events;
            let mut of_spad = vec![0.0; spads];
            for event in events {
                let spad = layout.spad_at(event.spad).expect("no light elsewhere");
                of_spad[usize::from(spad)] += 1.0;
            }
            let all = f64::from(cycles) * (2.0 + 1e6 * 1e-6);
            let sum: f64 = of_spad.iter().sum();
            assert!((sum - all).abs() < 5.0 * all.sqrt(), "{spads}: {sum} {all}");
            let each = all / spads as f64;
            for count in of_spad {
                assert!((count - each).abs() < 5.0 * each.sqrt(), "{spads}: {count}");
            }
        }
    }

    #[test]
    fn spads_keep_their_own_efficiency_and_dark_counts() {
        let layout = SpadLayout::new(3).unwrap();
        let spread = SpadSpread::new(&[0.5, 1.0, 1.5], &[10.0, 0.0, 30.0]).unwrap();
        let light = PixelLight::background(100.0);
        let lit = layout.place_light(light.clone(), Some(&spread)).unwrap();
        let own = lit.spads().unwrap();
        let factors: Vec<f64> = own.factors().iter().map(|f| f * 3.0 / 4.0).collect();
        let expected = [0.5, 1.0, 1.5, 0.0];
        assert!(
            factors
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        let dark_hz = own.dark_hz();
        assert!(
            dark_hz
                .iter()
                .zip([10.0, 0.0, 30.0, 0.0])
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        let other = SpadSpread::new(&[1.0], &[0.0]).unwrap();
        assert!(layout.place_light(light, Some(&other)).is_err());
    }
}
