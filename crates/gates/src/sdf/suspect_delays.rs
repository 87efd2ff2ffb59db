//! Delays of a file that are allowed and probably mistakes: delays of zero, and a cell twice.

use std::collections::HashMap;
use std::fmt;

use super::{DelayPath, Sdf, SdfCell, SdfDelay, SdfInstance};
use crate::netlist::Corner;
use crate::units::Time;

/// Delays of a file that are probably a mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SuspectDelay {
    /// Arcs without delay.
    Zeros {
        /// How many.
        zeros: usize,
        /// Arcs in all.
        arcs: usize,
        /// Line of the first.
        line: usize,
    },
    /// Cells whose arcs are given by several entries.
    Twice {
        /// How many entries come too late.
        entries: usize,
        /// Line of the first of them.
        line: usize,
        /// Line of the one that it replaces.
        before: usize,
    },
}

impl SuspectDelay {
    /// Line of the first.
    pub fn line(&self) -> usize {
        match self {
            SuspectDelay::Zeros { line, .. } | SuspectDelay::Twice { line, .. } => *line,
        }
    }
}

impl fmt::Display for SuspectDelay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SuspectDelay::Zeros { zeros, arcs, .. } if zeros == arcs => {
                write!(f, "every delay is zero, so that gates switch at once")
            }
            SuspectDelay::Zeros { zeros, arcs, .. } => {
                write!(f, "{zeros} of {arcs} delays are zero")
            }
            SuspectDelay::Twice {
                entries, before, ..
            } => {
                write!(
                    f,
                    "delays of a cell are given again, after line {before}, and the last ones count"
                )?;
                match entries {
                    1 => Ok(()),
                    entries => write!(f, " ({entries} such entries)"),
                }
            }
        }
    }
}

/// The delays of a file that are probably mistakes, in one corner.
pub fn suspect_delays(sdf: &Sdf<'_>, corner: Corner) -> Vec<SuspectDelay> {
    let is_arc = |delay: &&SdfDelay<'_>| {
        let is_of_cell = matches!(delay.path, DelayPath::IoPath(..) | DelayPath::Device(_));
        is_of_cell && !delay.increment
    };
    let given =
        |delay: &SdfDelay<'_>| [delay.rise, delay.fall].map(|delay| delay.in_corner(corner));
    let arcs = sdf.cells.iter().flat_map(|cell| &cell.delays);
    let arcs = arcs
        .filter(is_arc)
        .filter(|delay| given(delay) != [None; 2]);
    let mut found = Vec::new();
    let (mut all, mut zeros, mut line) = (0, 0, 0);
    for delay in arcs {
        all += 1;
        if given(delay)
            .into_iter()
            .flatten()
            .all(|time| time == Time::ZERO)
        {
            zeros += 1;
            if zeros == 1 {
                line = delay.line;
            }
        }
    }
    if zeros > 0 {
        found.push(SuspectDelay::Zeros {
            zeros,
            arcs: all,
            line,
        });
    }
    let mut first: HashMap<&str, &SdfCell<'_>> = HashMap::new();
    let mut twice: Option<SuspectDelay> = None;
    for cell in &sdf.cells {
        let SdfInstance::Path(path) = &cell.instance else {
            continue;
        };
        let mut own = cell.delays.iter().filter(is_arc);
        let Some(&before) = first.get(path.as_ref()) else {
            if own.next().is_some() {
                first.insert(path, cell);
            }
            continue;
        };
        // Entries for one arc each are no repetition.
        let is_given = |delay: &SdfDelay<'_>| {
            let mut earlier = before.delays.iter().filter(is_arc);
            earlier.any(|other| other.path == delay.path)
        };
        if own.any(is_given) {
            match &mut twice {
                Some(SuspectDelay::Twice { entries, .. }) => *entries += 1,
                _ => {
                    twice = Some(SuspectDelay::Twice {
                        entries: 1,
                        line: cell.line,
                        before: before.line,
                    });
                }
            }
        }
    }
    found.extend(twice);
    found
}

#[cfg(test)]
mod tests {
    use super::super::tests::file;
    use super::*;

    #[test]
    fn suspect_delays_are_told_with_their_line() {
        let told = |body: &str| {
            let text = file(body);
            let sdf = Sdf::parse("a.sdf", &text).expect("delays");
            let told = |suspect: &SuspectDelay| (suspect.line(), suspect.to_string());
            suspect_delays(&sdf, Corner::Typ)
                .iter()
                .map(told)
                .collect::<Vec<_>>()
        };
        let sdf_cell = |instance: &str, delay: &str| {
            format!(
                "(CELL (CELLTYPE \"INV\") (INSTANCE {instance}) (DELAY (ABSOLUTE (IOPATH A Z {delay}))))\n"
            )
        };
        let (ten, zero) = ("(10)", "(0)");
        assert_eq!(told(&sdf_cell("a", ten)), []);
        let all = told(&(sdf_cell("a", zero) + &sdf_cell("b", zero)));
        assert_eq!(
            all,
            [(
                3,
                "every delay is zero, so that gates switch at once".to_owned()
            )]
        );
        let some = told(&(sdf_cell("a", ten) + &sdf_cell("b", zero) + &sdf_cell("c", zero)));
        assert_eq!(some, [(4, "2 of 3 delays are zero".to_owned())]);
        let again = "delays of a cell are given again, after line 3, and the last ones count";
        let twice = sdf_cell("a", ten) + &sdf_cell("b", ten) + &sdf_cell("a", ten);
        assert_eq!(told(&twice), [(5, again.to_owned())]);
        let often = told(&(twice + &sdf_cell("b", ten)));
        assert_eq!(often, [(5, format!("{again} (2 such entries)"))]);
    }
}
