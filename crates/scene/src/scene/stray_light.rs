//! Stray light: what the lens throws from where it belongs over other macropixels.
//!
//! ```text
//!   a sign       ▁▁▁▁▁▁█▁▁▁▁▁▁▁           a share s of its light is scattered (lens surfaces, dust, filter), and makes a halo about it:
//!   its image    ▁▁▂▃▅▇█▇▅▃▂▁▁▁           s / (2πw²) · (1 + r²/w²)^(-3/2) a macropixel at a distance of r macropixels
//! ```
//!
//! The halo is that of a lens that scatters little, falling off with the cube of the distance (Harvey's law for surfaces has powers of 2 to
//! 3); a measured one may be given as a curve. It has all that comes through the lens: echoes, sunlight, pulses of other lidars. Light
//! from outside the field of view throws none in. Six macropixels beside a retroreflector of 1000 photons a pulse, a halo of
//! one per cent is another echo of 0.01: what *blooming* is called where it hides what stands there.
//!
//! A macropixel gets light from all others, of most of them very little. The light of each surface is summed up in cells of time, by its
//! photons, mean and variance, so that none is lost however many macropixels it comes from.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::curve::CurveSetting;
use super::falling::Falling;
use super::settings::{Lidar, Scene};
use crate::photon::{Glint, PulseTrain, merged};
use crate::units::Time;

/// Length of a cell, in standard deviations of the laser pulse.
const CELL: f64 = 0.5;

/// If the halo has no more than that a pulse of another lidar, its pulses are left out: of 16 000 laser cycles a sixth of a photon.
const LEAST_PHOTONS: f64 = 1e-5;

/// How far the sum of a halo is taken macropixel by macropixel.
const SUMMED: i32 = 200;

/// How one macropixel's light is spread over the array.
struct Halo {
    cols: usize,
    /// Share that a macropixel so many rows and columns away gets, row by row.
    shares: Vec<f64>,
    /// Share that stays.
    own: f64,
}

impl Halo {
    fn new(lidar: &Lidar, rows: usize, cols: usize) -> Self {
        let aspect = lidar.macropixel_aspect;
        let radius = lidar.stray_radius;
        let strength = |row: f64, col: f64| {
            let away = libm::hypot(row * aspect, col);
            match &lidar.stray {
                CurveSetting::Word(_) => libm::pow(1.0 + (away / radius).powi(2), -1.5),
                CurveSetting::Curve(curve) => curve.interpolate(away).unwrap_or(0.0),
            }
        };
        let cells = (-SUMMED..=SUMMED)
            .flat_map(|row| (-SUMMED..=SUMMED).map(move |col| (f64::from(row), f64::from(col))));
        let is_near = |(row, col): &(f64, f64)| {
            libm::hypot(row * aspect, *col) <= f64::from(SUMMED) * aspect.min(1.0)
        };
        let near: f64 = cells
            .filter(is_near)
            .map(|(row, col)| strength(row, col))
            .sum();
        // Beyond, the integral of the power.
        let end = f64::from(SUMMED) * aspect.min(1.0);
        let far = match &lidar.stray {
            CurveSetting::Word(_) => {
                std::f64::consts::TAU * radius.powi(3) / libm::hypot(radius, end) / aspect
            }
            CurveSetting::Curve(_) => 0.0,
        };
        let unit = lidar.stray_share / (near + far);
        let place = |at: usize| ((at / cols) as f64, (at % cols) as f64);
        let share = |at: usize| unit * strength(place(at).0, place(at).1);
        let shares: Vec<f64> = (0..rows * cols).map(share).collect();
        Halo {
            cols,
            own: 1.0 - lidar.stray_share + shares[0],
            shares,
        }
    }

    /// Share of the light of macropixel `from` that macropixel `to` gets.
    fn share(&self, from: usize, to: usize) -> f64 {
        let cols = self.cols;
        let apart = (from / cols).abs_diff(to / cols) * cols + (from % cols).abs_diff(to % cols);
        match apart {
            0 => self.own,
            _ => self.shares[apart],
        }
    }
}

/// Whose light it is: our own, or that of another lidar by its number.
type Laser = Option<u32>;

/// A cell: whose light, from which surface, and its number in time.
type Cell = (Laser, usize, i64);

/// Photons a pulse that come within one cell, and the sums of their times after its start and of the squares.
type Moments = [f64; 3];

/// The light of all macropixels by cells of time.
struct Cells {
    length_fs: f64,
    /// Those that have light of any macropixel.
    used: Vec<Cell>,
    /// What each macropixel has of them, by their place.
    by_pixel: Vec<Vec<(usize, Moments)>>,
}

impl Cells {
    fn new(falling: &[Falling], length_fs: f64) -> Self {
        let by_number = |light: &Falling| {
            let mut sums = BTreeMap::<Cell, Moments>::new();
            let mut add = |(laser, surface), photons: f64, time_fs: f64, variance_fs2: f64| {
                let cell = (time_fs / length_fs).floor();
                let late_fs = time_fs - cell * length_fs;
                let sum = sums.entry((laser, surface, cell as i64)).or_default();
                let moments = [1.0, late_fs, late_fs * late_fs + variance_fs2];
                sum.iter_mut()
                    .zip(moments)
                    .for_each(|(sum, moment)| *sum += photons * moment);
            };
            for glint in light.glints.iter().filter(|glint| glint.photons > 0.0) {
                add(
                    (None, glint.surface),
                    glint.photons,
                    glint.arrival_fs,
                    glint.variance_fs2,
                );
            }
            for train in &light.trains {
                let [delay_fs, sigma_fs] = [train.delay, train.sigma].map(|t| t.as_fs() as f64);
                let variance_fs2 = sigma_fs * sigma_fs;
                add(
                    (Some(train.laser.number), 0),
                    train.photons,
                    delay_fs,
                    variance_fs2,
                );
            }
            sums
        };
        let sums: Vec<_> = falling.par_iter().map(by_number).collect();
        let mut used: Vec<Cell> = sums.iter().flat_map(|sums| sums.keys()).copied().collect();
        used.sort_unstable();
        used.dedup();
        let place = |key: &Cell| used.binary_search(key).expect("it is one of them");
        let by_place = |sums: &BTreeMap<Cell, Moments>| {
            sums.iter().map(|(key, sum)| (place(key), *sum)).collect()
        };
        let by_pixel = sums.par_iter().map(by_place).collect();
        Cells {
            length_fs,
            used,
            by_pixel,
        }
    }

    /// The glints of some sums over all cells, of surfaces from `first_surface` on.
    fn glints(&self, sums: &[Moments], first_surface: usize) -> Vec<(Laser, Glint)> {
        let glint = |(place, &[photons, late, square]): (usize, &Moments)| {
            let (laser, surface, cell) = self.used[place];
            let (late_fs, square_fs2) = (late / photons, square / photons);
            let glint = Glint {
                photons,
                arrival_fs: cell as f64 * self.length_fs + late_fs,
                variance_fs2: (square_fs2 - late_fs * late_fs).max(0.0),
                surface: first_surface + surface,
            };
            (photons > 0.0).then_some((laser, glint))
        };
        sums.iter().enumerate().filter_map(glint).collect()
    }
}

/// Light on all macropixels of a scene with what the lens scatters; dark counts do not come through it.
pub(super) fn with_stray_light(scene: &Scene, falling: &[Falling], cols: usize) -> Vec<Falling> {
    let dark_hz = scene.dark_hz();
    let halo = Halo::new(&scene.lidar, falling.len() / cols, cols);
    let cell_fs = CELL * scene.pulse_resolution().as_fs() as f64;
    let cells = Cells::new(falling, cell_fs.max(1.0));
    // Beyond surfaces that are seen, and those that throw light on them.
    let first_surface = 2 * scene.objects.len();
    let trains: Vec<&PulseTrain> = falling.iter().flat_map(|light| &light.trains).collect();
    let received = |to: usize| {
        let mut own = Falling {
            background_hz: dark_hz,
            ..falling[to].clone()
        };
        own.glints.iter_mut().for_each(|g| g.photons *= halo.own);
        own.trains.iter_mut().for_each(|t| t.photons *= halo.own);
        let mut sums = vec![Moments::default(); cells.used.len()];
        for (from, source) in falling.iter().enumerate() {
            let share = halo.share(from, to);
            own.background_hz += share * (source.background_hz - dark_hz);
            if from == to {
                continue;
            }
            for (place, moments) in &cells.by_pixel[from] {
                let sum = sums[*place].iter_mut().zip(moments);
                sum.for_each(|(sum, moment)| *sum += share * moment);
            }
        }
        let mut of_others = BTreeMap::<u32, Vec<Glint>>::new();
        for (laser, glint) in cells.glints(&sums, first_surface) {
            match laser {
                None => own.glints.push(glint),
                Some(number) => of_others.entry(number).or_default().push(glint),
            }
        }
        for (number, mut glints) in of_others {
            let of_laser = trains.iter().find(|train| train.laser.number == number);
            let laser = of_laser.expect("its cells are those of trains").laser;
            if glints.iter().map(|glint| glint.photons).sum::<f64>() < LEAST_PHOTONS {
                continue;
            }
            // Their variances are those of whole pulses.
            let echoes = merged(&mut glints, Time::ZERO, Time::ZERO);
            own.trains.extend(echoes.into_iter().map(|echo| PulseTrain {
                laser,
                photons: echo.photons,
                delay: echo.arrival,
                sigma: echo.sigma.unwrap_or(Time::ZERO),
            }));
        }
        own
    };
    (0..falling.len()).into_par_iter().map(received).collect()
}

#[cfg(test)]
mod tests {
    use crate::scene::{DVec3, GroundTruth, Object, Scene, Shape};

    /// A white board that fills the middle macropixel of 33 × 33, 30 m ahead in the dark, so many times as bright as if it were no mirror.
    fn sign(lidar: &str, retro: f64) -> Scene {
        let mut scene = Scene::parse("test", &format!("[lidar]\n{lidar}\n")).unwrap();
        (scene.lidar.pulse_energy_uj, scene.lidar.lens_diameter_mm) = (20.0, 4.0);
        let side_m = 30.0 * 2.0 * 8f64.to_radians().tan() / 33.0;
        let shape = Shape::Plane {
            centre_m: DVec3::new(0.0, 0.0, 30.0),
            normal: DVec3::NEG_Z,
            width_m: side_m,
            height_m: side_m,
        };
        let mut board = Object::new("sign", 1.0, shape);
        board.retro = retro;
        scene.objects = vec![board];
        scene.light.sky_reflectivity = 0.0;
        scene
    }

    fn signals(scene: &Scene) -> Vec<f64> {
        let truth = GroundTruth::render(scene, 33, 33);
        let lights = scene.pixel_light(&truth);
        lights
            .iter()
            .map(|light| light.signal_per_cycle())
            .collect()
    }

    #[test]
    fn a_halo_has_the_share_that_it_takes_and_falls_off_as_said() {
        let (plain, halo) = (
            sign("", 100.0),
            sign("stray_share = 0.05\nstray_radius = 2", 100.0),
        );
        let middle = 16 * 33 + 16;
        let all = signals(&plain)[middle];
        let spread = signals(&halo);
        let strength = |row: i32, col: i32| spread[((16 + row) * 33 + 16 + col) as usize] / all;
        let law = |r: f64| 0.05 / (std::f64::consts::TAU * 4.0) * (1.0 + r * r / 4.0).powf(-1.5);
        for (row, col) in [(1, 0), (0, -3), (4, 4), (-9, 2), (16, 16)] {
            let expected = law(f64::from(row * row + col * col).sqrt());
            assert!(
                (strength(row, col) / expected - 1.0).abs() < 0.02,
                "{row} {col}: {}",
                strength(row, col)
            );
        }
        assert!(
            (strength(0, 0) - (0.95 + law(0.0))).abs() < 1e-3,
            "{}",
            strength(0, 0)
        );
        // What misses the array: about 2 w / side of the halo.
        let total: f64 = spread.iter().sum::<f64>() / all;
        assert!((0.992..0.996).contains(&total), "{total}");
    }

    /// Of a wall that fills the view each macropixel throws too little on any other to be worth an echo, and all of them together a
    /// hundredth of its light.
    #[test]
    fn a_weak_halo_keeps_all_its_light() {
        let wall = |lidar: &str, energy: f64| {
            let mut scene = sign(lidar, 1.0);
            scene.lidar.pulse_energy_uj *= energy;
            if let Shape::Plane {
                width_m, height_m, ..
            } = &mut scene.objects[0].shape
            {
                (*width_m, *height_m) = (100.0, 100.0);
            }
            scene
        };
        let share = |energy: f64| {
            let [plain, halo] = ["", "stray_share = 0.05\nstray_radius = 8"]
                .map(|lidar| signals(&wall(lidar, energy)).iter().sum::<f64>());
            halo / plain
        };
        let strong = share(1.0);
        assert!(strong > 0.95 && strong < 1.0, "{strong}");
        for energy in [1e-2, 1e-4] {
            let weak = share(energy);
            assert!(
                (weak / strong - 1.0).abs() < 1e-9,
                "{energy}: {weak} {strong}"
            );
        }
    }

    #[test]
    fn a_measured_halo_ends_where_its_curve_does_and_none_changes_nothing() {
        let middle = 16 * 33 + 16;
        let scene = sign("stray_share = 0.1\nstray = [[0, 1], [1, 1], [2, 0]]", 100.0);
        let (all, spread) = (signals(&sign("", 100.0))[middle], signals(&scene));
        let total: f64 = spread.iter().sum::<f64>() / all;
        assert!((total - 1.0).abs() < 1e-9, "{total}");
        let lit = spread.iter().filter(|photons| **photons > 0.0).count();
        assert_eq!(lit, 9);
        assert!((spread[middle + 1] - spread[middle + 33]).abs() < 1e-12 * all);
        assert_eq!(
            signals(&sign("stray_share = 0", 100.0)),
            signals(&sign("", 100.0))
        );
    }

    #[test]
    fn an_even_sky_stays_even_but_for_what_leaves_the_array() {
        let mut scene = sign(
            "stray_share = 0.05\nstray_radius = 0.5\ndark_count_hz = 1e5",
            1.0,
        );
        scene.objects.clear();
        scene.light.sky_reflectivity = 0.1;
        let rates = |scene: &Scene| -> Vec<f64> {
            let truth = GroundTruth::render(scene, 33, 33);
            scene
                .pixel_light(&truth)
                .iter()
                .map(|light| light.background_hz())
                .collect()
        };
        let spread = rates(&scene);
        scene.lidar.stray_share = 0.0;
        let even = rates(&scene)[0];
        let (middle, corner) = (spread[16 * 33 + 16], spread[0]);
        assert!(middle < even && middle > 0.998 * even, "{middle} {even}");
        assert!(corner < middle && corner > 0.95 * even, "{corner}");
    }

    #[test]
    fn more_halo_than_light_is_refused() {
        for (keys, complaint) in [
            (
                "stray_share = 1.1",
                "stray_share = 1.1 is impossible; give 0 to 1",
            ),
            (
                "stray = [[1, 1], [2, 0]]",
                "stray has distances from 1 to 2",
            ),
            ("stray = \"lots\"", "halo"),
        ] {
            let error = Scene::parse("test", &format!("[lidar]\n{keys}\n")).unwrap_err();
            assert!(error.to_string().contains(complaint), "{error}");
        }
    }
}
