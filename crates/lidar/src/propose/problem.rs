//! Designs by theory: what each takes to reach a goal, and what that costs.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::echo::{BinnedEcho, WindowedEcho};
use super::goal::{Choice, Goal};
use super::point::{Candidate, ChipDesign, DesignPoint, Limit};
use crate::analysis::TimingVerdict;
use crate::chip::{CellLibrary, EventType, Mode, Sensor, SensorConfig, Silicon, Tdc, macropixel};
use crate::files::InputError;
use crate::netlist::{Netlist, ScopeId};
use crate::scene::{Emission, EyeRule, Object, Scene, Shape, Train};
use crate::theory::design::share_inside;
use crate::theory::partial::largest_mean;
use crate::units::{SPEED_OF_LIGHT_M_PER_S, Time};

/// Laser cycles beyond which nobody looks.
pub(super) const MOST_CYCLES: u32 = 10_000_000;

/// Most bits of a bin and of a P-counter that sensors may have.
const MOST_BIN_BITS: usize = 16;
const MOST_COUNTER_BITS: usize = 12;

/// CLK periods of a laser cycle beyond the last window's end: the QuantIC4x4's 520 are 512 and these.
const SPARE_PERIODS: u32 = 8;

/// Most signal photons a pulse for each SPAD: chosen. In more, SPADs that are blind hide the place of an echo, which theory knows on average
/// alone: with 0.7, a fifth of the targets in windows of four bins were not found where 1 % was promised.
const MOST_PHOTONS_A_SPAD: f64 = 0.25;

/// Share of the frames missed that full bins may be.
const OVERFLOW_SHARE: f64 = 0.1;

/// A pulse, and none for as long as anybody looks.
const ONE_PULSE: Train = Train {
    rate_hz: 1.0,
    pulses: 1.0,
    frame_s: 1e9,
};

/// A goal, and what stays the same in all designs: the sensor but for bins, bits, clock and THRESHOLD, optics and laser but for energy and rate.
#[derive(Debug)]
pub struct Problem {
    goal: Goal,
    sensor: Sensor,
    scene: Scene,
    /// Signal photons a pulse of 1 uJ, background and dark counts a second.
    signal_per_uj: f64,
    background_hz: f64,
    /// Of pulses of 1 uJ.
    emission: Emission,
    /// Counts that bins of 0, 1, … bits may have on average.
    most_counts: Vec<f64>,
    areas: Mutex<HashMap<[usize; 3], f64>>,
}

impl Problem {
    /// What `goal` asks of a sensor like this one behind the scene's optics; of the scene nothing else counts.
    ///
    /// # Errors
    /// Sensors whose bins are not CLK periods or that count otherwise than with more SPADs than THRESHOLD, and a laser that is not judged.
    pub fn new(goal: Goal, sensor: Sensor, scene: &Scene) -> Result<Self, InputError> {
        let refused = |what: &str| {
            Err(InputError::new(
                "the sensor",
                format!(
                    "{what}; propose varies guided sensors with tdc = \"clocked\", summation and event_type = \"greater\""
                ),
            ))
        };
        match &sensor {
            s if s.tdc == Tdc::DelayLine => return refused("has delay lines"),
            s if s.tdc == Tdc::Counter => return refused("has a counter TDC"),
            s if s.mode != Mode::Guided => return refused("is not guided"),
            s if s.front_end.joins() => return refused("joins SPADs on one line"),
            s if s.event_type != EventType::Greater => return refused("has another event_type"),
            s if s.own_files().next().is_some() => return refused("has a block of its own"),
            _ => {}
        }
        let mut scene = Scene {
            lidar: scene.lidar.clone(),
            stereo: scene.stereo,
            ..Scene::default()
        };
        scene.light.illuminance_klux = goal.illuminance_klux;
        scene.lidar.pulse_energy_uj = 1.0;
        scene.lidar.frame_rate_hz = goal.fps;
        // Every macropixel looks at it at a right angle.
        let around = Shape::Sphere {
            centre_m: Default::default(),
            radius_m: goal.range_m,
        };
        scene.objects = vec![Object::new("target", goal.reflectivity, around)];
        let (rows, cols) = (sensor.rows as u32, sensor.cols as u32);
        let emission = scene.emission(rows, cols, ONE_PULSE);
        if emission.beside_class_1().is_none() {
            let message = format!(
                "{} nm is not judged for the safety of eyes; give {}",
                scene.lidar.wavelength_nm,
                Emission::JUDGED
            );
            return Err(InputError::new("scene.lidar.wavelength_nm", message));
        }
        let budget = scene.photon_budget(rows, cols);
        let overflow = OVERFLOW_SHARE * (1.0 - goal.detection);
        // One less: a bin that is just full is taken for one that has overflowed.
        let most = |bits| (largest_mean(bits, overflow) - 1.0).max(0.1);
        Ok(Problem {
            signal_per_uj: budget.signal_per_pulse(goal.range_m, goal.reflectivity),
            background_hz: budget.background_hz(goal.reflectivity, goal.illuminance_klux)
                + scene.lidar.dark_counts_hz(),
            emission,
            most_counts: (0..=MOST_BIN_BITS as u32).map(most).collect(),
            areas: Mutex::default(),
            goal,
            sensor,
            scene,
        })
    }

    /// What is asked.
    pub fn goal(&self) -> &Goal {
        &self.goal
    }

    /// The sensor that designs are made from.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The target before a design's laser: a sphere about the lidar.
    pub fn scene_of(&self, design: &ChipDesign) -> Scene {
        let mut scene = self.scene.clone();
        scene.lidar.pulse_energy_uj = design.pulse_energy_uj;
        scene
    }

    /// A design's chip.
    pub fn config_of(&self, design: &ChipDesign) -> SensorConfig {
        SensorConfig {
            bins: design.bins,
            bin_bits: design.bin_bits,
            counter_bits: design.counter_bits,
            clk_hz: design.clk_hz,
            threshold: design.threshold,
            ..SensorConfig::clone(&self.sensor)
        }
    }

    /// Signal photons a pulse of this energy (uJ), and background and dark counts a second, of a macropixel.
    pub(super) fn light(&self, pulse_energy_uj: f64) -> (f64, f64) {
        (self.signal_per_uj * pulse_energy_uj, self.background_hz)
    }

    /// The most energy that eyes and SPADs allow a single pulse, uJ.
    pub(super) fn most_energy_uj(&self) -> f64 {
        let judged = self.emission.beside_class_1();
        let of_eyes_uj = 1.0 / judged.expect("a judged wavelength").times_class_1;
        // Within rounding of it a pulse blinds nobody.
        let most_photons = MOST_PHOTONS_A_SPAD * self.sensor.spads() as f64 * (1.0 - 1e-9);
        of_eyes_uj.min(most_photons / self.signal_per_uj)
    }

    /// Whether a chip meets its timing.
    ///
    /// # Errors
    /// What it fails by, or what makes it no chip.
    pub fn timing(&self, config: &SensorConfig) -> Result<(), String> {
        config.check().map_err(|fault| fault.to_string())?;
        let (period, dead_time) = (config.clock().period(), config.dead_time());
        if dead_time <= period {
            return Err(format!(
                "has periods of {period}, in which photons of a SPAD cancel, as its dead time is {dead_time}"
            ));
        }
        let verdict = TimingVerdict::analyse(config, &Silicon::new(config), (0, 0));
        if verdict.is_met() {
            Ok(())
        } else {
            Err(verdict.to_string())
        }
    }

    /// Area of a macropixel: um² in the sensor's cell library, transistors without one.
    pub(super) fn area(&self, config: &SensorConfig) -> f64 {
        let key = [config.bins, config.bin_bits, config.counter_bits];
        let known = || self.areas.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(&area) = known().get(&key) {
            return area;
        }
        let circuit = macropixel::circuit(config);
        let library = CellLibrary::from_config(config).ok();
        let area = match library.and_then(CellLibrary::from_file) {
            None => circuit.transistors() as f64,
            Some(library) => {
                let netlist = Netlist::elaborate(&circuit);
                let placed = library.characterised(&netlist);
                placed.silicon(&netlist, &library.liberty, ScopeId::TOP).0
            }
        };
        known().insert(key, area);
        area
    }

    /// The echo of a pulse of this energy.
    pub(super) fn echo(&self, clk_hz: f64, threshold: u8, pulse_energy_uj: f64) -> BinnedEcho {
        let config = SensorConfig {
            clk_hz,
            threshold,
            ..SensorConfig::clone(&self.sensor)
        };
        let (signal, background_hz) = self.light(pulse_energy_uj);
        BinnedEcho::new(&config, self.scene.echo_width(), signal, background_hz)
    }

    /// CLK periods to the end of the last window that is needed, and the bits of a P-counter that counts them.
    fn reach(&self, window: &Choice) -> Result<(u32, usize), Limit> {
        let bin_m = 0.5 * SPEED_OF_LIGHT_M_PER_S / window.clk_hz;
        let needed_m =
            self.goal.range_m + 3.0 * window.guide_sigma_m + 0.5 * window.bins as f64 * bin_m;
        let step = self.sensor.step_periods as f64;
        let steps = (needed_m / bin_m / step).ceil() + 1.0;
        let bits = window.counter_bits.unwrap_or(MOST_COUNTER_BITS);
        let reaches = |bits: &usize| steps <= libm::exp2(*bits as f64);
        let found = match window.counter_bits {
            Some(own) => Some(own).filter(reaches),
            None => (2..=MOST_COUNTER_BITS).find(reaches),
        };
        let short_m = needed_m - libm::exp2(bits as f64) * step * bin_m;
        let limit = Limit::Reach { bits, short_m };
        found.map(|bits| ((steps * step) as u32, bits)).ok_or(limit)
    }

    /// What a choice takes at each of `rates` (pulses a second; the range allows no more than some), told to
    /// `offer`. Laser cycles are sought from `least`, up to `most`; returns how many it takes.
    ///
    /// # Errors
    /// What makes it impossible whatever the rate.
    pub(super) fn designs(
        &self,
        window: &Choice,
        seen: &WindowedEcho,
        (least, most): (u32, u32),
        rates_hz: &[f64],
        mut offer: impl FnMut(Candidate),
    ) -> Result<u32, Limit> {
        let Goal {
            detection,
            precision_m,
            fps,
            ..
        } = self.goal;
        let (periods, counter_bits) = self.reach(window)?;
        let photons = self.light(window.pulse_energy_uj).0 / self.sensor.spads() as f64;
        if photons > MOST_PHOTONS_A_SPAD {
            return Err(Limit::Blinding { photons });
        }
        let bin_m = 0.5 * SPEED_OF_LIGHT_M_PER_S / window.clk_hz;
        let window_m = seen.usable_bins() as f64 * bin_m;
        let step_m = self.sensor.step_periods as f64 * bin_m;
        let in_window = share_inside(window.guide_sigma_m, window_m, step_m);
        if in_window <= detection {
            return Err(Limit::Guide {
                guide_sigma_m: window.guide_sigma_m,
                window_m,
                share: in_window,
                detection,
            });
        }
        let variance_m2 = seen.variance(window.guide_sigma_m / bin_m) * bin_m * bin_m;
        let of_precision = (variance_m2 / (precision_m * precision_m)).ceil();
        let from = (of_precision as u32).max(least);
        let cycles = (of_precision <= f64::from(most))
            .then(|| seen.cycles_for(detection / in_window, from, most))
            .flatten();
        let laser_cycles = cycles.ok_or(Limit::Light { most })?;
        let counts = f64::from(laser_cycles) * seen.fullest;
        let holds =
            |bits: &usize| counts <= self.most_counts[*bits] || u64::from(laser_cycles) < 1 << bits;
        let bin_bits = window.bin_bits.or((1..=MOST_BIN_BITS).find(holds));
        let bin_bits = bin_bits.unwrap_or(MOST_BIN_BITS);
        let counts = if holds(&bin_bits) {
            counts.min(self.most_counts[bin_bits]) / self.most_counts[bin_bits]
        } else {
            counts / self.most_counts[bin_bits]
        };
        let mut design = ChipDesign {
            bins: window.bins,
            bin_bits,
            counter_bits,
            clk_hz: window.clk_hz,
            threshold: window.threshold,
            pulse_energy_uj: window.pulse_energy_uj,
            stop_periods: 0,
            laser_cycles,
            guide_sigma_m: window.guide_sigma_m,
        };
        let config = self.config_of(&design);
        let area = self.area(&config);
        let found = in_window * seen.detection(laser_cycles);
        let pulse_j = window.pulse_energy_uj * 1e-6;
        let pulses = f64::from(laser_cycles);
        // SPADs recover before the window opens again.
        let dead = (self.sensor.dead_time().as_s() * window.clk_hz).ceil() as u32;
        let shortest = periods.max(window.bins as u32 + dead) + SPARE_PERIODS;
        let mut before = 0;
        for &rate_hz in rates_hz {
            // Just below the rate, where rules for the safety of eyes change.
            let periods = (window.clk_hz / rate_hz) as u32 + 1;
            design.stop_periods = periods.max(shortest);
            if design.stop_periods == before {
                continue;
            }
            before = design.stop_periods;
            let exposed_s = f64::from(before) * pulses / window.clk_hz;
            let frame_s = config.frame_time(Time::from_s(exposed_s)).as_s();
            let pulse_hz = window.clk_hz / f64::from(before);
            let eye = |frames_hz: f64| -> (f64, EyeRule) {
                let train = Train {
                    rate_hz: pulse_hz,
                    pulses,
                    frame_s: (1.0 / frames_hz).max(pulses / pulse_hz),
                };
                let emission = self.emission.scaled(window.pulse_energy_uj, train);
                let judged = emission.beside_class_1().expect("a judged wavelength");
                (judged.times_class_1, judged.rule)
            };
            let at_goal = eye(fps);
            let fastest = 1.0 / frame_s;
            // Where eyes would have too much of it, as many as they may have.
            let (mut allowed, mut forbidden) = (fps, pulse_hz / pulses);
            if eye(fastest).0 <= 1.0 {
                allowed = fastest;
            } else {
                for _ in 0..24 {
                    let middle = 0.5 * (allowed + forbidden);
                    let end = if eye(middle).0 <= 1.0 {
                        &mut allowed
                    } else {
                        &mut forbidden
                    };
                    *end = middle;
                }
            }
            offer(Candidate {
                point: DesignPoint {
                    design,
                    power_w: pulse_j * pulses * fps,
                    area,
                    data_bit_s: config.histogram_bits() as f64 * fps,
                    fps: allowed.min(fastest),
                    detection: found,
                    in_window,
                    precision_m: (variance_m2 / pulses).sqrt(),
                    times_class_1: at_goal.0,
                },
                eye: at_goal,
                time: frame_s * fps,
                counts,
            });
        }
        Ok(laser_cycles)
    }

    /// One design by theory, with as many laser cycles as it takes, whether it keeps everything or not.
    ///
    /// # Errors
    /// What makes it impossible whatever the laser cycles.
    pub fn evaluate(&self, choice: &Choice) -> Result<Candidate, Limit> {
        self.judge_from(choice, 1)
    }

    /// The same with `least` laser cycles or more.
    pub(super) fn judge_from(&self, choice: &Choice, least: u32) -> Result<Candidate, Limit> {
        let echo = self.echo(choice.clk_hz, choice.threshold, choice.pulse_energy_uj);
        let (seen, cycles) = (echo.windowed(choice.bins), (least, MOST_CYCLES));
        let mut found = None;
        self.designs(choice, &seen, cycles, &[choice.rate_hz], |one| {
            found = Some(one)
        })?;
        Ok(found.expect("a design at one rate"))
    }
}
