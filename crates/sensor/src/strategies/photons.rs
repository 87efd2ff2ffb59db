//! Photons of a macropixel, where a chip may go wrong: near edges of CLK and of its window, in bursts, around the end of the dead time.
//!
//! ```text
//!   CLK      ▔▔▁▁▔▔▁▁▔▔▁▁▔▔▁▁▔▔▁▁▔▔▁▁
//!   window          ├──┬──┬──┬──┤
//!   photons      ↓  ↓↓ ↓      ↓↓↓↓      ↓        ↓
//!                │  │  │      └ burst    └ dead ──┴ ± a few femtoseconds
//!                │  │  └ near an edge of a bin
//!                │  └ near the edges of the window
//!                └ near an edge of CLK
//! ```
//!
//! Places are relative to clocks and windows, so that a photon stays near its edge while sensor and start value shrink. What of
//! [`pulses_of`] lies outside of the exposure or in the dead time of its SPAD is left out.

use std::cell::OnceCell;

use proptest::collection::vec;
use proptest::prelude::*;

use crate::chip::{Exposure, SensorConfig, WindowLaw};
use crate::photon::{SpadEvent, apply_dead_time};
use crate::units::Time;

/// One photon, or several that belong together.
#[derive(Debug, Clone, PartialEq)]
pub enum Photons {
    /// At any time.
    Anywhere {
        /// Which part of the exposure has passed, in 2⁻³².
        share: u32,
        /// SPAD, modulo the macropixel's.
        spad: u8,
    },
    /// Near a rising or falling edge of CLK, as a SPAD sees it.
    NearClk {
        /// Which part of the exposure has passed at about that edge, in 2⁻³².
        share: u32,
        /// After the edge, fs.
        off_fs: i64,
        /// SPAD, modulo the macropixel's.
        spad: u8,
    },
    /// Near an edge of a bin, the window's own among them. Nowhere if no window opens.
    NearWindow {
        /// Laser cycle, modulo those of the exposure.
        cycle: u32,
        /// Edge, modulo those of the window: the first and the last are the window's.
        edge: u8,
        /// After the edge, fs.
        off_fs: i64,
        /// SPAD, modulo the macropixel's.
        spad: u8,
    },
    /// Several photons, each on the next SPAD.
    Burst {
        /// Which part of the exposure has passed at the first one, in 2⁻³².
        share: u32,
        /// How many.
        count: u8,
        /// From one to the next, ps.
        spacing_ps: u32,
    },
    /// Two photons on one SPAD, the later one about when the dead time ends.
    AfterDeadTime {
        /// Which part of the exposure has passed at the first one, in 2⁻³².
        share: u32,
        /// The later one after the end of the mean dead time, fs.
        off_fs: i64,
        /// SPAD, modulo the macropixel's.
        spad: u8,
    },
}

/// A photon at any time. Shrinks towards the beginning of the exposure.
pub fn anywhere() -> impl Strategy<Value = Photons> + Clone {
    (any::<u32>(), 0u8..64).prop_map(|(share, spad)| Photons::Anywhere { share, spad })
}

/// A photon up to 3 fs or up to 300 ps beside an edge of CLK. Shrinks towards the edge.
pub fn near_clk_edges() -> impl Strategy<Value = Photons> + Clone {
    (any::<u32>(), offsets_fs(), 0u8..64).prop_map(|(share, off_fs, spad)| Photons::NearClk {
        share,
        off_fs,
        spad,
    })
}

/// A photon up to 3 fs or up to 300 ps beside an edge of a bin. Shrinks towards the beginning of the window in the first laser cycle.
pub fn near_window_edges() -> impl Strategy<Value = Photons> + Clone {
    // Of the many edges of bins, the window's own come often.
    let edge = prop_oneof![Just(0), any::<u8>(), Just(LAST_EDGE)];
    (0u32..8, edge, offsets_fs(), 0u8..64).prop_map(|(cycle, edge, off_fs, spad)| {
        Photons::NearWindow {
            cycle,
            edge,
            off_fs,
            spad,
        }
    })
}

/// 2 to 12 photons, up to 2 ns from one to the next. Shrinks towards two at one time.
pub fn bursts() -> impl Strategy<Value = Photons> + Clone {
    (any::<u32>(), 2u8..=12, 0u32..2_000).prop_map(|(share, count, spacing_ps)| Photons::Burst {
        share,
        count,
        spacing_ps,
    })
}

/// Two photons of one SPAD, the later one up to 3 fs or up to 300 ps beside the end of the dead time.
pub fn after_dead_time() -> impl Strategy<Value = Photons> + Clone {
    (any::<u32>(), offsets_fs(), 0u8..64).prop_map(|(share, off_fs, spad)| Photons::AfterDeadTime {
        share,
        off_fs,
        spad,
    })
}

/// Up to `most` photons or groups of them, of all kinds. Shrinks towards none.
pub fn photons(most: usize) -> impl Strategy<Value = Vec<Photons>> + Clone {
    let kinds = prop_oneof![
        4 => anywhere(),
        2 => near_clk_edges(),
        4 => near_window_edges(),
        1 => bursts(),
        1 => after_dead_time(),
    ];
    vec(kinds, 0..=most)
}

/// Up to `most` photons at any times. Shrinks towards none.
pub fn photons_anywhere(most: usize) -> impl Strategy<Value = Vec<Photons>> + Clone {
    vec(anywhere(), 0..=most)
}

/// The number that stands for the last edge of a window.
const LAST_EDGE: u8 = u8::MAX;

/// How far from an edge, fs.
fn offsets_fs() -> impl Strategy<Value = i64> + Clone {
    prop_oneof![-3i64..=3, -300_000i64..=300_000]
}

/// SPAD pulses of a macropixel by its number in the array, with this start value: in order of time, within the exposure, and thinned by
/// the dead time.
///
/// The sensor must have passed [`SensorConfig::check`].
pub fn pulses_of(
    photons: &[Photons],
    config: &SensorConfig,
    exposure: &Exposure,
    (number, start): (u32, u16),
) -> Vec<SpadEvent> {
    let place = Place {
        config,
        exposure,
        start,
        law: OnceCell::new(),
    };
    let mut pulses = Vec::with_capacity(photons.len());
    for group in photons {
        place.add_pulses(group, &mut pulses);
    }
    pulses.retain(|pulse| (Time::ZERO..exposure.end()).contains(&pulse.time));
    pulses.sort_unstable();
    apply_dead_time(&mut pulses, &config.spad_model(), number);
    pulses
}

/// What photons may be near to.
struct Place<'s> {
    config: &'s SensorConfig,
    exposure: &'s Exposure,
    start: u16,
    /// Measured where a photon asks for it.
    law: OnceCell<WindowLaw>,
}

impl Place<'_> {
    fn law(&self) -> &WindowLaw {
        let law = || WindowLaw::new(self.config, self.exposure);
        self.law.get_or_init(law)
    }

    /// When this part of the exposure has passed.
    fn time(&self, share: u32) -> Time {
        let fs = i128::from(self.exposure.end().as_fs()) * i128::from(share);
        Time::from_fs((fs >> 32) as i64)
    }

    fn add_pulses(&self, group: &Photons, pulses: &mut Vec<SpadEvent>) {
        let spads = self.config.spads() as u8;
        let mut add = |time: Time, spad: u8| pulses.push(SpadEvent::new(time, spad % spads));
        match *group {
            Photons::Anywhere { share, spad } => add(self.time(share), spad),
            Photons::NearClk {
                share,
                off_fs,
                spad,
            } => {
                let (clock, phase) = (self.exposure.clock, self.exposure.stop_phase);
                let half = clock.half_periods_until(self.time(share) + phase);
                // A SPAD's pulse is sampled this much later.
                let latency = self.law().timing().spad_to_sampled;
                let edge = clock.half_periods(half) - phase - latency;
                add(edge + Time::from_fs(off_fs), spad);
            }
            Photons::NearWindow {
                cycle,
                edge,
                off_fs,
                spad,
            } => {
                let Some(window) = self.law().window(self.start).open() else {
                    return;
                };
                let cycle = cycle % self.exposure.laser_cycles;
                let edges = self.law().edges(&window, cycle.into());
                let edges = edges.edges();
                let edge = match edge {
                    LAST_EDGE => edges.len() - 1,
                    edge => usize::from(edge) % edges.len(),
                };
                add(edges[edge] + Time::from_fs(off_fs), spad);
            }
            Photons::Burst {
                share,
                count,
                spacing_ps,
            } => {
                let spacing = Time::from_ps(spacing_ps.into());
                for number in 0..count {
                    add(self.time(share) + spacing * i64::from(number), number);
                }
            }
            Photons::AfterDeadTime {
                share,
                off_fs,
                spad,
            } => {
                let first = self.time(share);
                let later = first + self.config.dead_time() + Time::from_fs(off_fs);
                add(first, spad);
                add(later, spad);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_lie_where_their_kind_says() {
        // Half a CLK period is a whole number of femtoseconds.
        let config = SensorConfig {
            clk_hz: 400e6,
            ..SensorConfig::default()
        };
        let exposure = Exposure::new(&config, 60, 3);
        let pulses = |group: Photons| pulses_of(&[group], &config, &exposure, (0, 30));
        let law = WindowLaw::new(&config, &exposure);
        let window = law.window(30).open().unwrap();
        let near_window = |edge, off_fs| Photons::NearWindow {
            cycle: 4,
            edge,
            off_fs,
            spad: 17,
        };
        let edges = law.edges(&window, 1);
        let first = pulses(near_window(0, 0));
        assert_eq!(first, [SpadEvent::new(edges.edges()[0], 1)]);
        let last = pulses(near_window(LAST_EDGE, -1));
        assert_eq!(edges.bin_of(last[0].time), Some(15));
        assert_eq!(edges.bin_of(last[0].time + Time::from_fs(1)), None);

        // In the femtosecond of an edge a pulse is sampled by it, and by the next one after it.
        let near_clk = |off_fs| Photons::NearClk {
            share: 1 << 31,
            off_fs,
            spad: 0,
        };
        let [at, after] = [0, 1].map(|off_fs| pulses(near_clk(off_fs))[0].time);
        let half_period = exposure.clock.half_periods(1);
        let is_edge = |time| law.edge_of(time) < law.edge_of(time + Time::from_fs(1));
        assert!(is_edge(at) || is_edge(at - half_period) || is_edge(at + half_period));
        assert_eq!(after - at, Time::from_fs(1));

        let burst = Photons::Burst {
            share: 0,
            count: 5,
            spacing_ps: 100,
        };
        assert_eq!(pulses(burst).len(), 5);
        for (off_fs, count) in [(0, 1), (1, 2)] {
            let pair = Photons::AfterDeadTime {
                share: 9,
                off_fs,
                spad: 3,
            };
            assert_eq!(pulses(pair).len(), count, "{off_fs} fs after the dead time");
        }
        let late = Photons::Anywhere {
            share: u32::MAX,
            spad: 0,
        };
        let end = exposure.end() - pulses(late)[0].time;
        assert!(end > Time::ZERO && end < Time::from_ps(1), "{end}");
    }
}
