//! What is chosen to be reproduced.

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
    pub(crate) fn is_empty(&self) -> bool {
        self.parts() == 0
    }

    /// How many parts are chosen.
    pub(crate) fn parts(&self) -> usize {
        self.claims.len() + self.figures.len() + self.tables.len() + self.measurements.len()
    }

    /// Whether everything that is chosen exists.
    ///
    /// # Errors
    /// The first that does not.
    pub(crate) fn check(&self) -> Result<(), NothingThere> {
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
}
