//! SPADs that differ: detection efficiency and dark counts of each SPAD of the array, hot ones among them.

use super::settings::{Lidar, Scene};
use crate::photon::{RandomPurpose, SpadSpread, normal, random_stream};

impl Lidar {
    /// Whether SPADs differ.
    pub(super) fn has_spread(&self) -> bool {
        self.pde_spread > 0.0 || self.dark_count_spread > 0.0 || self.hot_spad_share > 0.0
    }
}

impl Scene {
    /// How the SPADs of macropixel number `pixel`, `spads` of them, differ; `None` where they do not. Their dark counts are those of
    /// [`Lidar::dark_count_hz`], and not added to them.
    ///
    /// A SPAD's efficiency is Gaussian about the mean, cut off at none; its dark count rate is log-normal about its share of the
    /// macropixel's mean, or that of a hot SPAD. Which is which is a function of seed, macropixel and SPAD alone.
    pub(crate) fn spad_spread(&self, pixel: u32, spads: usize) -> Option<SpadSpread> {
        let lidar = &self.lidar;
        if !lidar.has_spread() {
            return None;
        }
        let heat = lidar.dark_count_factor();
        let mean_hz = lidar.dark_counts_hz() / spads as f64;
        let (mut factors, mut dark_hz) = (Vec::new(), Vec::new());
        for spad in 0..spads as u32 {
            let mut random = random_stream(
                lidar.spad_seed.into(),
                RandomPurpose::SpadSpread,
                pixel,
                spad,
            );
            let is_hot = f64::from(random.next_u32()) < lidar.hot_spad_share * 2f64.powi(32);
            factors.push((1.0 + lidar.pde_spread * normal(&mut random)).max(0.0));
            let spread = lidar.dark_count_spread;
            let log = spread * normal(&mut random) - 0.5 * spread * spread;
            dark_hz.push(if is_hot {
                lidar.hot_spad_hz * heat
            } else {
                mean_hz * libm::exp(log)
            });
        }
        SpadSpread::new(&factors, &dark_hz).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::PixelLight;

    #[test]
    fn spads_have_the_spread_that_is_asked_for() {
        let mut scene = Scene::outdoor();
        assert_eq!(scene.spad_spread(3, 16), None);
        scene.lidar.dark_count_hz = 16e3;
        scene.lidar.hot_spad_share = 0.02;
        scene.lidar.hot_spad_hz = 5e6;
        let greatest_hz = |pixel: u32| {
            let spread = scene.spad_spread(pixel, 16).unwrap();
            PixelLight::dark().with_spads(spread).background_hz() / 16.0
        };
        let hot = (0..2000).filter(|&pixel| greatest_hz(pixel) > 1e6).count();
        // 1 - 0.98^16 = 0.276 of the macropixels have a hot SPAD.
        assert!((hot as f64 / 2000.0 - 0.276).abs() < 0.05, "{hot}");
        let normal = (0..2000)
            .filter(|&pixel| (greatest_hz(pixel) - 1e3).abs() < 1e-6)
            .count();
        assert_eq!(normal, 2000 - hot);
        assert_eq!(scene.spad_spread(7, 16), scene.spad_spread(7, 16));
        let other = Scene {
            lidar: Lidar {
                spad_seed: 2,
                ..scene.lidar.clone()
            },
            ..scene.clone()
        };
        assert_ne!(
            (0..50)
                .map(|p| scene.spad_spread(p, 16))
                .collect::<Vec<_>>(),
            (0..50)
                .map(|p| other.spad_spread(p, 16))
                .collect::<Vec<_>>()
        );
    }
}
