//! Measured curves: pairs of numbers in a scene file, or in a CSV file beside it.
//!
//! ```text
//!   pulse = [[0.0, 0.0], [1.0, 0.8], [2.0, 1.0], [4.0, 0.1]]      pairs
//!   pulse = "laser.csv"                                           two columns, a header line or none
//!   pulse = "gaussian"                                            a word for what needs no measurement
//! ```
//!
//! A file is read once, when the scene is: a scene holds, and writes into `frame.json`, what was in it.

use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;

use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize};
use toml::Value;

use crate::files::{InputError, Lines};

/// Most points of a curve.
const MOST_POINTS: usize = 65_536;

/// Something not negative over something else, linear between its points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<[f64; 2]>", into = "Vec<[f64; 2]>")]
pub struct Curve {
    /// Its points.
    pub(crate) points: Arc<[[f64; 2]]>,
}

/// Why points make no curve.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// One point, none, or far too many.
    #[error("the number of points is {0}; give 2 to {MOST_POINTS} pairs of numbers")]
    Points(usize),
    /// The first number of a pair is not above that of the pair before.
    #[error(
        "{0} does not follow the number before it; give pairs in rising order of their first number"
    )]
    Order(f64),
    /// A value is negative, infinite or NaN.
    #[error("the value {0} is impossible; give finite ones of at least 0")]
    Value(f64),
    /// All values are zero.
    #[error("all values are 0; give at least one above it")]
    Nothing,
}

impl Curve {
    /// A curve through `points`, pairs of where and how much.
    ///
    /// # Errors
    /// When they are no curve.
    pub(crate) fn new(points: &[[f64; 2]]) -> Result<Self, CurveError> {
        if !(2..=MOST_POINTS).contains(&points.len()) {
            return Err(CurveError::Points(points.len()));
        }
        let odd = points.iter().find(|[_, y]| !(y.is_finite() && *y >= 0.0));
        if let Some(&[_, y]) = odd {
            return Err(CurveError::Value(y));
        }
        let follows = |pair: &&[[f64; 2]]| pair[1][0] > pair[0][0] && pair[1][0].is_finite();
        if let Some(pair) = points.windows(2).find(|pair| !follows(pair)) {
            return Err(CurveError::Order(pair[1][0]));
        }
        if !points[0][0].is_finite() {
            return Err(CurveError::Order(points[0][0]));
        }
        if points.iter().all(|[_, y]| *y == 0.0) {
            return Err(CurveError::Nothing);
        }
        Ok(Curve {
            points: points.into(),
        })
    }

    /// The first and the last place.
    pub(crate) fn ends(&self) -> (f64, f64) {
        (self.points[0][0], self.points[self.points.len() - 1][0])
    }

    /// Its greatest value.
    pub(crate) fn greatest(&self) -> f64 {
        self.points.iter().map(|[_, y]| *y).fold(0.0, f64::max)
    }

    /// Its value at `x`; beyond its ends `None`.
    pub(crate) fn interpolate(&self, x: f64) -> Option<f64> {
        let (first, last) = self.ends();
        if !(first..=last).contains(&x) {
            return None;
        }
        let right = self.points.partition_point(|[place, _]| *place <= x);
        let Some(&[x1, y1]) = self.points.get(right) else {
            return Some(self.points[self.points.len() - 1][1]);
        };
        let [x0, y0] = self.points[right - 1];
        Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
    }

    /// Reads a file of two columns, with a header line or none.
    ///
    /// # Errors
    /// When it cannot be read, with the line of what is wrong.
    pub(crate) fn load(path: &Path) -> Result<Self, InputError> {
        Self::parse(Lines::open(path)?)
    }

    fn parse<R: BufRead>(mut lines: Lines<R>) -> Result<Self, InputError> {
        let source = lines.source.to_owned();
        let mut points = Vec::new();
        let mut may_be_header = true;
        while let Some((number, line)) = lines.next_used()? {
            let columns: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
            let values: Vec<f64> = columns.iter().filter_map(|c| c.parse().ok()).collect();
            let is_header = std::mem::take(&mut may_be_header) && values.is_empty();
            let complain = |message| Err(InputError::at_line(&source, number, message));
            match (columns.len(), <[f64; 2]>::try_from(&values[..])) {
                (2, Ok(_)) if points.len() == MOST_POINTS => {
                    return complain(format!(
                        "has more than {MOST_POINTS} pairs, the most of a curve; give fewer"
                    ));
                }
                (2, Ok(pair)) => points.push(pair),
                _ if is_header => (),
                _ => {
                    return complain(format!(
                        "{line:?} is not a pair of numbers; give two, with a comma between them"
                    ));
                }
            }
        }
        Curve::new(&points).map_err(|why| InputError::new(source, why.to_string()))
    }
}

impl TryFrom<Vec<[f64; 2]>> for Curve {
    type Error = CurveError;

    fn try_from(points: Vec<[f64; 2]>) -> Result<Self, CurveError> {
        Curve::new(&points)
    }
}

impl From<Curve> for Vec<[f64; 2]> {
    fn from(curve: Curve) -> Self {
        curve.points.to_vec()
    }
}

/// One of some words, or a measured curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum CurveSetting<Word> {
    /// What needs no measurement.
    Word(Word),
    /// A curve.
    Curve(Curve),
}

impl<Word> CurveSetting<Word> {
    /// The curve, if it is one.
    pub(crate) fn curve(&self) -> Option<&Curve> {
        match self {
            CurveSetting::Word(_) => None,
            CurveSetting::Curve(curve) => Some(curve),
        }
    }
}

impl<Word: Default> Default for CurveSetting<Word> {
    fn default() -> Self {
        CurveSetting::Word(Word::default())
    }
}

impl<'de, Word: DeserializeOwned> Deserialize<'de> for CurveSetting<Word> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let said = |e: toml::de::Error| D::Error::custom(e.message().trim());
        match Value::deserialize(deserializer)? {
            Value::String(word) => {
                let word = Word::deserialize(Value::String(word)).map_err(said)?;
                Ok(CurveSetting::Word(word))
            }
            Value::Array(pairs) => {
                let curve = Curve::deserialize(Value::Array(pairs)).map_err(said)?;
                Ok(CurveSetting::Curve(curve))
            }
            other => {
                let message = format!("{other} is neither a word nor a list of pairs of numbers");
                Err(D::Error::custom(message))
            }
        }
    }
}

/// Puts the curve in the place of its file's name, where `value` is one. Files are sought beside the scene file.
///
/// # Errors
/// What is wrong with the file.
pub(super) fn read_file(value: &Value, folder: &Path) -> Result<Option<Value>, InputError> {
    let name = value.as_str().filter(|name| {
        let extension = Path::new(name).extension();
        extension.is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
    });
    let Some(name) = name else {
        return Ok(None);
    };
    let curve = Curve::load(&folder.join(name))?;
    Ok(Some(Value::try_from(&curve).expect("numbers")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_linear_between_their_points_and_nothing_beyond() {
        let curve = Curve::new(&[[1.0, 0.0], [2.0, 1.0], [4.0, 0.5]]).unwrap();
        let at = [0.9, 1.0, 1.25, 2.0, 3.0, 4.0, 4.1].map(|x| curve.interpolate(x));
        let expected = [
            None,
            Some(0.0),
            Some(0.25),
            Some(1.0),
            Some(0.75),
            Some(0.5),
            None,
        ];
        assert_eq!(at, expected);
        assert_eq!((curve.ends(), curve.greatest()), ((1.0, 4.0), 1.0));
    }

    #[test]
    fn points_that_are_no_curve_are_refused() {
        let refused = |points: &[[f64; 2]]| Curve::new(points).unwrap_err().to_string();
        assert!(refused(&[[1.0, 1.0]]).contains("the number of points is 1"));
        assert!(refused(&[[1.0, 1.0], [1.0, 2.0]]).contains("rising order"));
        assert!(refused(&[[1.0, 1.0], [f64::NAN, 2.0]]).contains("rising order"));
        assert!(refused(&[[1.0, 1.0], [2.0, -2.0]]).contains("-2 is impossible"));
        assert!(refused(&[[1.0, 0.0], [2.0, 0.0]]).contains("all values are 0"));
    }

    #[test]
    fn files_have_two_columns_and_perhaps_a_header() {
        let read = |text: &str| Curve::parse(Lines::new("a.csv", text.as_bytes()));
        let curve = read("time_ns,power\n0,0\n# measured\n1, 2.5\n\n3;0\n").unwrap();
        assert_eq!(*curve.points, [[0.0, 0.0], [1.0, 2.5], [3.0, 0.0]]);
        let refused = |text: &str| read(text).unwrap_err().to_string();
        assert!(refused("0,0\n1,2,3\n").starts_with("a.csv:2: \"1,2,3\" is not a pair"));
        assert!(refused("x,y\nz,w\n").starts_with("a.csv:2: "));
        assert!(refused("").starts_with("a.csv: the number of points is 0"));
        let long: String = (0..=MOST_POINTS).map(|x| format!("{x},1\n")).collect();
        assert!(refused(&long).starts_with("a.csv:65537: has more than 65536 pairs"));
        assert!(read(&long[..long.len() - 8]).is_ok());
    }
}
