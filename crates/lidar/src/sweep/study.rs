//! A study: what varies, over what, and what is made of each point.

use std::path::{Path, PathBuf};

use toml::Value;

use super::design::{self, SamplingDesign};
use super::keys;
use super::values::{Axis, Values, VariedKey};
use crate::settings::words;

mod files;
mod reading;
mod varied;

words! {
    /// What is made of each point.
    #[derive(Default)]
    #[non_exhaustive]
    pub enum StudyKind {
        /// A guided frame.
        #[default]
        Frame = "frame",
        /// What theory says of one macropixel.
        Theory = "theory",
    }
}

/// Points of a study at most: a study of more is a slip of the pen.
pub const MOST_POINTS: u64 = 100_000_000;

/// A study that can be run.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// What reports call it.
    pub name: String,
    /// What is made of each point.
    pub kind: StudyKind,
    /// Folder of its results, as written: relative to the current one.
    pub out: PathBuf,
    /// Seed of the first replica.
    pub seed: u64,
    /// Times that each point is taken.
    pub replicas: u64,
    /// Which points are taken.
    pub design: SamplingDesign,
    /// Its text, and what complaints call it.
    text: String,
    source: String,
    /// What files that it names are relative to.
    folder: PathBuf,
    fixed: Vec<(String, Value)>,
    axes: Vec<Axis>,
}

/// A point of a study: values of the keys that vary, and its seed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StudyPoint {
    /// In the order of [`Study::varied`].
    pub(super) values: Vec<Value>,
    pub(super) seed: u64,
}

impl Study {
    /// Its points; `None` for more than [`MOST_POINTS`].
    fn points(&self) -> Option<u64> {
        let places = match self.design {
            SamplingDesign::Grid => self.axes.iter().try_fold(1u64, |product, axis| {
                product.checked_mul(axis.len().expect("checked"))
            })?,
            SamplingDesign::Latin(points) | SamplingDesign::Sobol(points) => points,
        };
        places
            .checked_mul(self.replicas)
            .filter(|n| *n <= MOST_POINTS)
    }

    /// How many points it has.
    pub fn len(&self) -> u64 {
        self.points().expect("checked when it was read")
    }

    /// Never: a study has at least one point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its text, as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What complaints call it.
    pub(crate) fn source(&self) -> &str {
        &self.source
    }

    /// What files that it names are relative to.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keys that do not vary, with their values.
    pub(super) fn fixed(&self) -> &[(String, Value)] {
        &self.fixed
    }

    /// Keys that vary, in the order of the points' values.
    pub(super) fn varied(&self) -> impl Iterator<Item = &VariedKey> {
        self.axes.iter().flat_map(|axis| &axis.0)
    }

    /// The point of this number.
    pub(super) fn point(&self, index: u64) -> StudyPoint {
        let (place, replica) = (index / self.replicas, index % self.replicas);
        let mut values = Vec::new();
        match self.design {
            SamplingDesign::Grid => {
                let mut rest = place;
                for axis in self.axes.iter().rev() {
                    let len = axis.len().expect("checked");
                    let at = rest % len;
                    rest /= len;
                    values.extend(axis.0.iter().rev().map(|varied| varied.value(at)));
                }
                values.reverse();
            }
            design => {
                for (number, axis) in self.axes.iter().enumerate() {
                    let share = design::share(design, self.seed, number, place);
                    values.extend(axis.0.iter().map(|varied| varied.value_at(share)));
                }
            }
        }
        let seed = self.seed + replica;
        StudyPoint { values, seed }
    }

    /// A sentence for each key with a value that is far from what is usual ([`crate::settings::Key::remark`]).
    pub fn remarks(&self) -> Vec<String> {
        let fixed = self.fixed.iter();
        let fixed = fixed.map(|(name, value)| (name, value.clone()));
        let varied = self.varied().map(|key| (&key.name, key.values.all()));
        let remark = |(name, value): (&String, Value)| {
            let key = keys::find(self.kind, name).ok()?.key;
            let of_name = name.strip_suffix(key.name).unwrap_or_default();
            Some(format!("{of_name}{}", key.remark(&value)?))
        };
        fixed.chain(varied).filter_map(remark).collect()
    }

    /// Whether an axis is a range in equal ratios.
    pub(super) fn is_log(&self, column: &str) -> bool {
        let mut varied = self.varied();
        let found = varied.find(|varied| varied.column.name == column);
        matches!(found, Some(VariedKey { values: Values::Range(span), .. }) if span.is_log)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(text: &str) -> Study {
        Study::parse("study.toml", text, Path::new(""), "test").unwrap()
    }

    fn numbers(study: &Study, index: u64) -> Vec<f64> {
        let values = study.point(index).values.into_iter();
        let number = |value: Value| value.as_float().or(value.as_integer().map(|n| n as f64));
        values.map(|value| number(value).unwrap()).collect()
    }

    #[test]
    fn the_first_key_varies_slowest_and_seeds_fastest() {
        let study = study(
            "[study]\nseed = 7\nreplicas = 2\n[vary]\nsensor.rows = [4, 8]\n[[vary.zip]]\nsensor.bins = [8, 16, 32]\n\
             frame.laser_cycles = { from = 10, to = 1000, steps = 3, scale = \"log\" }\n",
        );
        assert_eq!(study.len(), 12);
        let all: Vec<_> = (0..12)
            .map(|index| (numbers(&study, index), study.point(index).seed))
            .collect();
        assert_eq!(all[0], (vec![4.0, 8.0, 10.0], 7));
        assert_eq!(all[1], (vec![4.0, 8.0, 10.0], 8));
        assert_eq!(all[3], (vec![4.0, 16.0, 100.0], 8));
        assert_eq!(all[11], (vec![8.0, 32.0, 1000.0], 8));
    }

    #[test]
    fn drawn_points_stay_within_their_ranges_and_keys_that_count_are_whole() {
        for design in ["latin", "sobol"] {
            let text = format!(
                "[study]\ndesign = \"{design}\"\npoints = 64\n[vary]\nsensor.clk_hz = {{ from = \"100 MHz\", to = 4e8 }}\n\
                 sensor.threshold = [1, 2, 3, 4]\nframe.laser_cycles = {{ from = 1, to = 1000, scale = \"log\" }}\n"
            );
            let study = study(&text);
            let points: Vec<_> = (0..64).map(|index| numbers(&study, index)).collect();
            for point in &points {
                assert!((1e8..=4e8).contains(&point[0]) && (1.0..=1000.0).contains(&point[2]));
                assert_eq!(point[2].fract(), 0.0);
            }
            // In equal ratios: as many of them below the geometric mean as above.
            let low = points.iter().filter(|point| point[2] < 31.6).count();
            assert!((28..=36).contains(&low), "{design}: {low}");
            for threshold in 1..=4 {
                let with_threshold = points
                    .iter()
                    .filter(|point| point[1] == f64::from(threshold));
                assert_eq!(with_threshold.count(), 16, "{design}");
            }
        }
    }
}
