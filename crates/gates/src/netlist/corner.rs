//! What delays and limits are given for: three corners of silicon, two directions of a change.

use crate::logic::Logic;

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
    /// Fast corner, fs.
    pub min_fs: u32,
    /// Typical corner, fs.
    pub typ_fs: u32,
    /// Slow corner, fs.
    pub max_fs: u32,
}

impl Delay {
    /// The same delay in every corner.
    pub const fn fixed(fs: u32) -> Self {
        Delay {
            min_fs: fs,
            typ_fs: fs,
            max_fs: fs,
        }
    }

    /// Fast and slow corners scaled from the typical delay.
    pub const fn scaled(typ_fs: u32) -> Self {
        Delay {
            min_fs: (typ_fs as u64 * 72 / 100) as u32,
            typ_fs,
            max_fs: (typ_fs as u64 * 145 / 100) as u32,
        }
    }

    /// Every corner times `factor`, rounded to whole femtoseconds.
    pub(crate) fn times(self, factor: f64) -> Self {
        let scale = |fs: u32| (fs as f64 * factor).round() as u32;
        Delay {
            min_fs: scale(self.min_fs),
            typ_fs: scale(self.typ_fs),
            max_fs: scale(self.max_fs),
        }
    }

    /// The delay of one corner, fs.
    pub const fn in_corner_fs(self, corner: Corner) -> u32 {
        match corner {
            Corner::Fast => self.min_fs,
            Corner::Typ => self.typ_fs,
            Corner::Slow => self.max_fs,
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
            min_fs: 3,
            typ_fs: 100,
            max_fs: 1001,
        };
        let scaled = delay.times(1.5);
        assert_eq!(
            Corner::ALL.map(|corner| scaled.in_corner_fs(corner)),
            [5, 150, 1502]
        );
        let [min, typ, max] = Corner::ALL.map(|corner| Delay::scaled(1000).in_corner_fs(corner));
        assert_eq!([min, typ, max], [720, 1000, 1450]);
    }
}
