//! What a scene looks like, whatever the strength of its light.
//!
//! ```text
//!   place, shape and material of objects, air, sun's place, field of view ──► look: views of macropixels, disparities of the camera pair
//!   energy of the laser, illuminance, detection efficiency, lens, filter  ──► strength: how much light there is
//! ```

use super::settings::{Lidar, Light, Scene};

impl Scene {
    /// Whether `other` differs from it in nothing but the strength of light and of its detection. Then macropixels see the same
    /// ([`GroundTruth`](super::GroundTruth)), to the bit, and the camera pair with drawn errors
    /// ([`BehaviouralStereo`](crate::guide::BehaviouralStereo)) measures the same. What shows strength in views themselves, light of other lidars and
    /// light that bounces, looks the same in equal scenes only.
    pub fn looks_like(&self, other: &Self) -> bool {
        let shows_strength =
            |scene: &Self| scene.lidar.bounce_rays > 0 || !scene.interferers.is_empty();
        if shows_strength(self) || shows_strength(other) {
            return self == other;
        }
        self.light.without_strength() == other.light.without_strength()
            && self.lidar.without_strength() == other.lidar.without_strength()
            && (&self.stereo, &self.medium, &self.rig) == (&other.stereo, &other.medium, &other.rig)
            && self.objects == other.objects
    }
}

impl Light {
    fn without_strength(&self) -> Self {
        Light {
            illuminance_klux: 0.0,
            ..*self
        }
    }
}

impl Lidar {
    fn without_strength(&self) -> Self {
        Lidar {
            pulse_energy_uj: 0.0,
            pde: 0.0,
            lens_diameter_mm: 0.0,
            lens_f_number: 0.0,
            transmittance: 0.0,
            solar_irradiance_w_m2: 0.0,
            dark_count_hz: 0.0,
            frame_rate_hz: 0.0,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guide::{BehaviouralStereo, Guide, GuideInput};
    use crate::scene::{GroundTruth, Interferer};
    use proptest::prelude::*;

    prop_compose! {
        /// The street, perhaps in fog or under a sun with a place, and its light.
        fn street()(
            has_fog: bool,
            sun_elevation_deg in prop::option::of(20f64..60.0),
            has_third_camera: bool,
        ) -> Scene {
            let mut scene = Scene::outdoor();
            scene.medium.extinction_1_m = if has_fog { 0.02 } else { 0.0 };
            scene.light.sun_elevation_deg = sun_elevation_deg;
            scene.stereo.third_camera_baseline_m = if has_third_camera { 0.3 } else { 0.0 };
            scene
        }
    }

    /// A share of each strength in turn.
    fn strengths(scene: &mut Scene) -> [&mut f64; 9] {
        let (light, lidar) = (&mut scene.light, &mut scene.lidar);
        [
            &mut light.illuminance_klux,
            &mut lidar.pulse_energy_uj,
            &mut lidar.pde,
            &mut lidar.lens_diameter_mm,
            &mut lidar.lens_f_number,
            &mut lidar.transmittance,
            &mut lidar.solar_irradiance_w_m2,
            &mut lidar.dark_count_hz,
            &mut lidar.frame_rate_hz,
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn what_looks_alike_is_seen_alike(
            scene in street(),
            shares in prop::array::uniform9(0.1f64..0.9),
            seed in 0u64..100,
        ) {
            let mut other = scene.clone();
            let keys = strengths(&mut other);
            keys.into_iter().zip(shares).for_each(|(key, share)| *key *= share);
            prop_assert!(scene != other && scene.looks_like(&other));
            let [here, there] = [&scene, &other].map(|scene| GroundTruth::render(scene, 12, 16));
            prop_assert!(here == there);
            let maps = [&scene, &other].map(|scene| {
                BehaviouralStereo.estimate(&GuideInput::still(scene, 12, 16, seed)).unwrap()
            });
            prop_assert!(maps[0] == maps[1] && maps[0].guided() > 0);
        }
    }

    #[test]
    fn what_is_seen_otherwise_does_not_look_alike() {
        let scene = Scene::outdoor();
        let changed = |change: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            scene.looks_like(&other)
        };
        assert!(changed(&|_| {}));
        assert!(!changed(&|other| other.lidar.fov_deg += 1.0));
        assert!(!changed(&|other| other.lidar.pulse_fwhm_ns += 1.0));
        assert!(!changed(&|other| other.light.sun_elevation_deg = Some(30.0)));
        assert!(!changed(&|other| other.medium.extinction_1_m = 0.01));
        assert!(!changed(&|other| other.stereo.baseline_m += 0.1));
        assert!(!changed(&|other| other.objects[0].reflectivity *= 0.5));
        assert!(!changed(&|other| drop(other.objects.pop())));
        assert!(!changed(&|other| {
            other.interferers.push(Interferer::default());
            other.lidar.pulse_energy_uj *= 2.0;
        }));
        // Light that bounces is as strong as the laser.
        for change in [false, true] {
            let mut bright = scene.clone();
            bright.lidar.bounce_rays = 4;
            let mut other = bright.clone();
            other.lidar.pulse_energy_uj *= if change { 2.0 } else { 1.0 };
            assert_eq!(bright.looks_like(&other), !change);
        }
    }
}
