//! What is chosen to be reproduced.

use super::measured::FRAMES;
use super::registry::{CLAIMS, FIGURES, MEASUREMENTS, TABLES};
use crate::settings::words;

/// Which numbers to reproduce: claims of the list, figures and tables of the thesis.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// Numbers of claims.
    pub claims: Vec<u32>,
    /// Numbers of figures.
    pub figures: Vec<u32>,
    /// Numbers of tables.
    pub tables: Vec<u32>,
    /// Numbers of measurements of the chip against its theory.
    pub measurements: Vec<u32>,
    /// Frames behind each measured number; [`FRAMES`](super::measured::FRAMES) where none is given.
    pub frames: Option<usize>,
}

impl Selection {
    /// Everything there is.
    pub fn all() -> Self {
        Selection {
            claims: CLAIMS.iter().map(|c| c.number).collect(),
            figures: FIGURES.iter().map(|f| f.number).collect(),
            tables: TABLES.iter().map(|t| t.number).collect(),
            measurements: MEASUREMENTS.iter().map(|m| m.number).collect(),
            frames: None,
        }
    }

    /// Whether nothing is chosen.
    pub fn is_empty(&self) -> bool {
        self.parts() == 0
    }

    /// How many parts are chosen.
    pub fn parts(&self) -> usize {
        self.claims.len() + self.figures.len() + self.tables.len() + self.measurements.len()
    }

    /// About how long this many threads take, s. Parts are made side by side, so none takes less than its longest.
    pub fn run_time_s(&self, threads: usize) -> f64 {
        let frames = self.frames.unwrap_or(FRAMES) as f64 / FRAMES as f64;
        let parts = LONG_S.iter().filter_map(|&(part, number, seconds)| {
            let (chosen, times) = match part {
                Part::Claim => (&self.claims, 1.0),
                Part::Figure => (&self.figures, 1.0),
                Part::Table => (&self.tables, 1.0),
                Part::Measurement => (&self.measurements, frames),
            };
            chosen.contains(&number).then_some(seconds * times)
        });
        let (sum, longest) = parts.fold((0.0, 0.0), |(sum, longest): (f64, f64), seconds| {
            (sum + seconds, longest.max(seconds))
        });
        longest.max(sum / threads as f64)
    }

    /// Whether everything that is chosen exists.
    ///
    /// # Errors
    /// The first that does not.
    pub fn check(&self) -> Result<(), NothingThere> {
        let known = Selection::all();
        let parts = [
            (Part::Claim, &self.claims, known.claims),
            (Part::Figure, &self.figures, known.figures),
            (Part::Table, &self.tables, known.tables),
            (Part::Measurement, &self.measurements, known.measurements),
        ];
        for (part, chosen, known) in parts {
            if let Some(&number) = chosen.iter().find(|n| !known.contains(n)) {
                return Err(NothingThere {
                    part,
                    number,
                    known,
                });
            }
        }
        Ok(())
    }
}

/// Parts that take more than 3 s of processor time, each by itself in the release build.
const LONG_S: [(Part, u32, f64); 18] = [
    (Part::Claim, 5, 7.0),
    (Part::Claim, 14, 6.0),
    (Part::Claim, 15, 9.0),
    (Part::Claim, 19, 33.0),
    (Part::Claim, 22, 11.0),
    (Part::Claim, 23, 3.0),
    (Part::Claim, 24, 15.0),
    (Part::Figure, 42, 8.0),
    (Part::Figure, 43, 6.0),
    (Part::Figure, 44, 9.0),
    (Part::Figure, 45, 10.0),
    (Part::Figure, 104, 3.0),
    (Part::Figure, 108, 9.0),
    (Part::Figure, 109, 9.0),
    (Part::Measurement, 1, 4.0),
    (Part::Measurement, 2, 7.0),
    (Part::Measurement, 3, 5.0),
    (Part::Measurement, 4, 12.0),
];

words! {
    /// What can be reproduced.
    #[non_exhaustive]
    pub enum Part {
        /// A claim of the thesis.
        Claim = "claim",
        /// A figure of it.
        Figure = "figure",
        /// A table of it.
        Table = "table",
        /// One of our own measurements.
        Measurement = "measurement",
    }
}

/// A number that nothing has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no {} {number} to reproduce; choose from {}", part.name(), listed(known))]
pub struct NothingThere {
    /// What was asked for.
    pub part: Part,
    /// Its number.
    pub number: u32,
    /// Numbers that there are.
    pub known: Vec<u32>,
}

fn listed(numbers: &[u32]) -> String {
    let numbers: Vec<String> = numbers.iter().map(u32::to_string).collect();
    numbers.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_unique_and_in_order() {
        let all = Selection::all();
        for numbers in [all.claims, all.figures, all.tables, all.measurements] {
            assert!(
                numbers.windows(2).all(|pair| pair[0] < pair[1]),
                "{numbers:?}"
            );
        }
        assert_eq!(Selection::all().claims, (1..=29).collect::<Vec<_>>());
    }

    #[test]
    fn what_does_not_exist_is_named() {
        let selection = Selection {
            figures: vec![35, 999],
            ..Selection::default()
        };
        let fault = selection.check().unwrap_err();
        assert_eq!((fault.part, fault.number), (Part::Figure, 999));
        let message = fault.to_string();
        assert!(
            message.contains("no figure 999") && message.contains("35"),
            "{message}"
        );
        assert!(Selection::all().check().is_ok());
    }

    #[test]
    fn run_times_are_those_of_what_is_chosen() {
        let one = |claims: &[u32]| Selection {
            claims: claims.to_vec(),
            ..Selection::default()
        };
        assert!(one(&[1]).run_time_s(2) < 1.0);
        let longest = one(&[19]).run_time_s(8);
        assert!((one(&[19, 24]).run_time_s(8) - longest).abs() < 1e-9);
        assert!(one(&[19, 24]).run_time_s(1) > longest);
        let measured = Selection {
            measurements: vec![4],
            ..Selection::default()
        };
        let of_more = Selection {
            frames: Some(3000),
            ..measured.clone()
        };
        assert!(of_more.run_time_s(2) > 9.0 * measured.run_time_s(2));
        let all = Selection::all();
        assert!(LONG_S.iter().all(|(part, number, _)| {
            let numbers = match part {
                Part::Claim => &all.claims,
                Part::Figure => &all.figures,
                Part::Table => &all.tables,
                Part::Measurement => &all.measurements,
            };
            numbers.contains(number)
        }));
    }
}
