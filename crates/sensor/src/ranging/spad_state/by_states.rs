//! A SPAD in many small steps, state by state, against the sums that go through a laser cycle in few. Chances of afterpulses and crosstalk
//! go to 10 %, so that what they change shows.

use super::*;
use proptest::prelude::*;

/// Steps of [`Spad`] to a bin, and small ones to each.
const STEPS: usize = 16;
const SMALL: usize = 40;

/// What a bin saw: avalanches, those by crosstalk, and the chance that their number is odd.
#[derive(Debug, Clone, Copy, Default)]
struct BinAvalanches {
    fired: f64,
    by_crosstalk: f64,
    odd: f64,
}

/// SPADs that are ready, or that became blind in one small step: a mass, and the same with the sign that every avalanche turns.
#[derive(Debug, Clone, Copy, Default)]
struct Mass {
    plain: f64,
    /// With carriers trapped when they recover.
    trapped: f64,
    sign: f64,
    trapped_sign: f64,
}

/// Under `light` photons in every step, after the first as many in all steps before; small steps of which the first order is kept.
fn by_states(dead: &Dead, light: &[f64]) -> Vec<BinAvalanches> {
    let dt = 1.0 / (STEPS * SMALL) as f64;
    let small = (dead.time_bins / dt).round() as usize;
    let before = (60.0 * (1.0 + dead.time_bins)) as usize * STEPS;
    let steps = std::iter::repeat_n(light[0], before).chain(light.iter().copied());
    let mut seen = Vec::new();
    let mut states = States {
        dead,
        dt,
        ready: Mass {
            plain: 1.0,
            sign: 1.0,
            ..Mass::default()
        },
        blind: vec![Mass::default(); small],
        avalanches_ago: vec![0.0; small],
        oldest: 0,
        released: 0.0,
    };
    for (step, photons) in steps.enumerate() {
        if step % STEPS == 0 {
            states.forget_signs();
            seen.push(BinAvalanches::default());
        }
        let bin = seen.last_mut().unwrap();
        for _ in 0..SMALL {
            if !dead.paralysable {
                states.fire(photons * STEPS as f64, bin)
            } else {
                states.fire_or_blind(photons * STEPS as f64, bin)
            }
        }
        bin.odd = (1.0 - states.signs()) / 2.0;
    }
    seen.split_off(before / STEPS)
}

struct States<'d> {
    dead: &'d Dead,
    dt: f64,
    ready: Mass,
    /// In rings of a dead time: SPADs that became blind, and avalanches of photons.
    blind: Vec<Mass>,
    avalanches_ago: Vec<f64>,
    oldest: usize,
    /// Carriers that wait to be released as light.
    released: f64,
}

impl States<'_> {
    fn forget_signs(&mut self) {
        for mass in self.blind.iter_mut().chain([&mut self.ready]) {
            (mass.sign, mass.trapped_sign) = (mass.plain, mass.trapped);
        }
    }

    fn signs(&self) -> f64 {
        self.blind
            .iter()
            .chain([&self.ready])
            .map(|mass| mass.sign + mass.trapped_sign)
            .sum()
    }

    /// A small step under `photons` photons in a bin, of a SPAD that light does not keep blind.
    fn fire(&mut self, photons: f64, seen: &mut BinAvalanches) {
        let (dead, ready) = (self.dead, &mut self.ready);
        let back = self.blind[self.oldest];
        let crosstalk = dead.crosstalk * photons * (ready.plain + ready.trapped);
        let (light, release) = (photons + crosstalk, 1.0 / dead.afterpulse_bins);
        let of_photons = photons / light;
        let fires = |rate: f64| -(-rate * self.dt).exp_m1();
        let (hit, hit_or_released) = (fires(light), fires(light + release));
        let hit_first = hit_or_released * light / (light + release);
        let fresh = dead.afterpulses * of_photons;
        let still = fresh + (1.0 - fresh) * (-dead.time_bins / dead.afterpulse_bins).exp();
        let split = |plain: f64, trapped: f64| {
            let (hit, hit_trapped, all_trapped) =
                (plain * hit, trapped * hit_first, trapped * hit_or_released);
            let with_traps = hit * fresh + hit_trapped * still;
            (hit, all_trapped, hit + all_trapped - with_traps, with_traps)
        };
        let (hit, all_trapped, plain, trapped) = split(ready.plain, ready.trapped);
        let (sign_hit, sign_trapped, sign, trapped_sign) = split(ready.sign, ready.trapped_sign);
        seen.fired += hit + all_trapped;
        seen.by_crosstalk += (hit + ready.trapped * hit_first) * (1.0 - of_photons);
        ready.plain += back.plain - hit;
        ready.trapped += back.trapped - all_trapped;
        ready.sign += back.sign - sign_hit;
        ready.trapped_sign += back.trapped_sign - sign_trapped;
        self.blind[self.oldest] = Mass {
            plain,
            trapped,
            sign: -sign,
            trapped_sign: -trapped_sign,
        };
        self.oldest = (self.oldest + 1) % self.blind.len();
    }

    /// The same of one that all light keeps blind, where afterpulses come as light.
    fn fire_or_blind(&mut self, photons: f64, seen: &mut BinAvalanches) {
        let dead = self.dead;
        let afterpulses = self.released / dead.afterpulse_bins;
        self.released +=
            self.avalanches_ago[self.oldest] * dead.afterpulses - afterpulses * self.dt;
        let crosstalk = dead.crosstalk * photons * self.ready.plain;
        let light = photons + afterpulses + crosstalk;
        let stay = (-light * self.dt).exp();
        // Those of the oldest that no light met since.
        let back = self.blind[self.oldest];
        self.blind[self.oldest] = Mass::default();
        let mut blinded = Mass::default();
        for mass in &mut self.blind {
            blinded.plain += mass.plain * (1.0 - stay);
            blinded.sign += mass.sign * (1.0 - stay);
            (mass.plain, mass.sign) = (mass.plain * stay, mass.sign * stay);
        }
        let (fired, sign_fired) = (
            self.ready.plain * (1.0 - stay),
            self.ready.sign * (1.0 - stay),
        );
        self.ready.plain += back.plain - fired;
        self.ready.sign += back.sign - sign_fired;
        self.blind[self.oldest] = Mass {
            plain: blinded.plain + fired,
            sign: blinded.sign - sign_fired,
            ..Mass::default()
        };
        self.avalanches_ago[self.oldest] = fired * photons / light;
        self.oldest = (self.oldest + 1) % self.blind.len();
        seen.fired += fired;
        seen.by_crosstalk += fired * crosstalk / light;
    }
}

fn by_sums(dead: &Dead, light: &[f64]) -> Vec<BinAvalanches> {
    let constant = Dual::<0>::constant;
    let mut spad = Spad::steady(dead, constant(light[0] * STEPS as f64), 1.0 / STEPS as f64);
    let bins = light.chunks(STEPS).map(|steps| {
        spad.begin_bin();
        steps
            .iter()
            .for_each(|&photons| spad.step(constant(photons)));
        BinAvalanches {
            fired: spad.fired.value,
            by_crosstalk: spad.by_crosstalk.value,
            odd: spad.parity.as_ref().map_or(spad.fired.value, |parity| {
                (1.0 - parity.ready.value - parity.blind.value) / 2.0
            }),
        }
    });
    bins.collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn few_steps_are_as_good_as_many(
        time_bins in prop_oneof![0.3f64..1.0, 1.0f64..4.0],
        paralysable: bool,
        afterpulses in prop_oneof![Just(0.0), 0.02f64..0.1],
        afterpulse_bins in 0.5f64..4.0,
        crosstalk in prop_oneof![Just(0.0), 0.02f64..0.1],
        background in 0.02f64..0.3,
        signal in 0.1f64..3.0,
    ) {
        let dead = Dead { time_bins, paralysable, afterpulses, afterpulse_bins, crosstalk };
        let pulse = |step: usize| {
            let z = (step as f64 / STEPS as f64 - 3.0) / 0.7;
            (-0.5 * z * z).exp() / (0.7 * std::f64::consts::TAU.sqrt())
        };
        let light: Vec<f64> = (0..12 * STEPS).map(|step| (background + signal * pulse(step)) / STEPS as f64).collect();
        // In 300 cases avalanches were off by up to 0.3 %. Where light keeps SPADs blind, the sums know but an average of the flip-flop's sign.
        let of_odd = if paralysable { 0.03 } else { 0.006 };
        for (bin, (sums, states)) in by_sums(&dead, &light).iter().zip(by_states(&dead, &light)).enumerate() {
            let is_near = |sum: f64, state: f64, by: f64| (sum - state).abs() <= by * state;
            prop_assert!(is_near(sums.fired, states.fired, 0.004), "{bin} {sums:?} {states:?}");
            prop_assert!(is_near(sums.by_crosstalk, states.by_crosstalk, 0.015), "{bin} {sums:?} {states:?}");
            prop_assert!(is_near(sums.odd, states.odd, of_odd), "{bin} {sums:?} {states:?}");
        }
    }
}
