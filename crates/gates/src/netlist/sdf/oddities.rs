//! What a delay file may say, but hardly means: delays of zero, and a cell twice.

use std::collections::HashMap;
use std::fmt;

use super::{DelayPath, Sdf, SdfCell, SdfDelay, SdfInstance};
use crate::netlist::corner::Corner;

/// One of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Oddity {
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

impl Oddity {
    /// Line of the first.
    pub fn line(&self) -> usize {
        match self {
            Oddity::Zeros { line, .. } | Oddity::Twice { line, .. } => *line,
        }
    }
}

impl fmt::Display for Oddity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Oddity::Zeros { zeros, arcs, .. } if zeros == arcs => {
                write!(f, "every delay is zero, so that gates switch at once")
            }
            Oddity::Zeros { zeros, arcs, .. } => {
                write!(f, "{zeros} of {arcs} delays are zero")
            }
            Oddity::Twice {
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

/// What is odd about the delays of a file in one corner.
pub fn oddities(sdf: &Sdf<'_>, corner: Corner) -> Vec<Oddity> {
    let is_arc = |delay: &&SdfDelay<'_>| {
        let is_of_cell = matches!(delay.path, DelayPath::IoPath(..) | DelayPath::Device(_));
        is_of_cell && !delay.increment
    };
    let given = |delay: &SdfDelay<'_>| [delay.rise, delay.fall].map(|delay| delay.at(corner));
    let arcs = sdf.cells.iter().flat_map(|cell| &cell.delays);
    let arcs = arcs
        .filter(is_arc)
        .filter(|delay| given(delay) != [None; 2]);
    let mut found = Vec::new();
    let (mut all, mut zeros, mut line) = (0, 0, 0);
    for delay in arcs {
        all += 1;
        if given(delay).into_iter().flatten().all(|fs| fs == 0) {
            zeros += 1;
            if zeros == 1 {
                line = delay.line;
            }
        }
    }
    if zeros > 0 {
        found.push(Oddity::Zeros {
            zeros,
            arcs: all,
            line,
        });
    }
    let mut first: HashMap<&str, &SdfCell<'_>> = HashMap::new();
    let mut twice: Option<Oddity> = None;
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
                Some(Oddity::Twice { entries, .. }) => *entries += 1,
                _ => {
                    twice = Some(Oddity::Twice {
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
