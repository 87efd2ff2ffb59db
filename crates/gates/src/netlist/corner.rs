//! What delays and limits are given for: three corners of silicon, two directions of a change.

use crate::logic::Logic;
use crate::units::Time;

/// Which of the three characterised delays applies: of slow, typical or fast silicon. SDF calls the delays max, typ and
/// min, and configurations may, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Corner {
    /// Fastest silicon, highest voltage: shortest delays.
    #[cfg_attr(feature = "serde", serde(alias = "min"))]
    Fast,
    /// Typical silicon, 50 °C.
    #[default]
    Typ,
    /// Slowest silicon, lowest voltage: longest delays.
    #[cfg_attr(feature = "serde", serde(alias = "max"))]
    Slow,
}

impl Corner {
    /// All corners, fastest first.
    pub const ALL: [Corner; 3] = [Corner::Fast, Corner::Typ, Corner::Slow];

    /// Name in files, tables and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Corner::Fast => "fast",
            Corner::Typ => "typ",
            Corner::Slow => "slow",
        }
    }
}

impl std::str::FromStr for Corner {
    type Err = String;

    /// A name, or SDF's.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "fast" | "min" => Ok(Corner::Fast),
            "typ" => Ok(Corner::Typ),
            "slow" | "max" => Ok(Corner::Slow),
            _ => Err("is not a speed of silicon; give slow, typ or fast".to_owned()),
        }
    }
}

/// Minimum, typical and maximum of one delay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Delay {
    /// Fast corner.
    pub min: Time,
    /// Typical corner.
    pub typ: Time,
    /// Slow corner.
    pub max: Time,
}

impl Delay {
    /// Longest delay or limit that is kept: 4.29 µs, which is 32 bits of femtoseconds.
    pub const LONGEST: Time = Time::from_fs(u32::MAX as i64);

    /// The same delay in every corner.
    pub const fn fixed(delay: Time) -> Self {
        Delay {
            min: delay,
            typ: delay,
            max: delay,
        }
    }

    /// Fast and slow corners scaled from the typical delay.
    pub const fn scaled(typ: Time) -> Self {
        Delay {
            min: Time::from_fs(typ.as_fs() * 72 / 100),
            typ,
            max: Time::from_fs(typ.as_fs() * 145 / 100),
        }
    }

    /// Every corner times `factor`, rounded to whole femtoseconds.
    pub(crate) fn times(self, factor: f64) -> Self {
        let scale = |time: Time| Time::from_fs((time.as_fs() as f64 * factor).round() as i64);
        Delay {
            min: scale(self.min),
            typ: scale(self.typ),
            max: scale(self.max),
        }
    }

    /// The delay of one corner.
    pub const fn in_corner(self, corner: Corner) -> Time {
        match corner {
            Corner::Fast => self.min,
            Corner::Typ => self.typ,
            Corner::Slow => self.max,
        }
    }

    /// The delay of one corner as it is kept, fs.
    pub(crate) const fn in_corner_fs(self, corner: Corner) -> u32 {
        Self::kept_fs(self.in_corner(corner))
    }

    /// A time as delays and limits are kept, fs: negative ones are 0, and longer ones are the longest.
    pub(crate) const fn kept_fs(time: Time) -> u32 {
        let fs = time.as_fs();
        if fs < 0 {
            0
        } else if fs > u32::MAX as i64 {
            u32::MAX
        } else {
            fs as u32
        }
    }
}

/// Direction of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Edge {
    /// To 1.
    Rise,
    /// To 0.
    Fall,
}

impl Edge {
    /// Either direction.
    pub const BOTH: [Edge; 2] = [Edge::Rise, Edge::Fall];

    /// The direction of a change to `value`, if it is to a known level.
    pub fn from_final_value(value: Logic) -> Option<Self> {
        match value {
            Logic::One => Some(Edge::Rise),
            Logic::Zero => Some(Edge::Fall),
            Logic::X | Logic::Z => None,
        }
    }

    /// The level after the edge.
    pub const fn level(self) -> Logic {
        match self {
            Edge::Rise => Logic::One,
            Edge::Fall => Logic::Zero,
        }
    }

    pub(crate) const fn opposite(self) -> Self {
        match self {
            Edge::Rise => Edge::Fall,
            Edge::Fall => Edge::Rise,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_corner_is_scaled_and_rounded() {
        let delay = Delay {
            min: Time::from_fs(3),
            typ: Time::from_fs(100),
            max: Time::from_fs(1001),
        };
        let scaled = delay.times(1.5);
        assert_eq!(
            Corner::ALL.map(|corner| scaled.in_corner_fs(corner)),
            [5, 150, 1502]
        );
        let scaled = |fs| Delay::scaled(Time::from_fs(fs));
        let [min, typ, max] = Corner::ALL.map(|corner| scaled(1000).in_corner_fs(corner));
        assert_eq!([min, typ, max], [720, 1000, 1450]);
    }

    #[test]
    fn what_cannot_be_kept_is_the_nearest_that_can() {
        let kept = |fs| Delay::kept_fs(Time::from_fs(fs));
        let longest = i64::from(u32::MAX);
        let found = [i64::MIN, -1, 0, 7, longest, longest + 1, i64::MAX].map(kept);
        assert_eq!(found, [0, 0, 0, 7, u32::MAX, u32::MAX, u32::MAX]);
    }
}
