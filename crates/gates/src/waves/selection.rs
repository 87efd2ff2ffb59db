//! Which part of the hierarchy goes into a waveform file.
//!
//! A whole chip has millions of nets and a viewer that wants to hold them all; one block of
//! it is what one looks at. Scopes on the way to a selected one are kept, empty, so that a signal
//! has the same path in every file.

use std::io;

use crate::netlist::Netlist;

/// What part of the hierarchy to dump. Starts as [`WaveSelection::all`] and is narrowed from there.
///
/// # Example
///
/// ```
/// use femtogate::netlist::{CellKind, ModuleBuilder, Netlist};
/// use femtogate::units::Time;
/// use femtogate::waves::{WaveSelection, VcdWriter};
///
/// let mut m = ModuleBuilder::new("top");
/// let (a, z) = (m.input("A"), m.output("Z"));
/// m.cell("inverter", CellKind::Inv, &[a], &[z]);
/// let netlist = Netlist::elaborate(&m.finish()?);
/// let whole = VcdWriter::new(Vec::new(), &netlist, &WaveSelection::all())?;
/// let text = String::from_utf8(whole.finish(Time::from_ns(1))?)?;
/// assert!(text.contains("$scope module top $end"));
///
/// let nowhere = WaveSelection::all().with_scope("nowhere");
/// assert!(VcdWriter::new(Vec::new(), &netlist, &nowhere).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WaveSelection {
    below: Vec<String>,
    depth: usize,
    with_anonymous: bool,
}

impl Default for WaveSelection {
    fn default() -> Self {
        Self::all()
    }
}

/// What a file shows of one scope.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coverage {
    /// Neither it nor anything below it.
    Nothing,
    /// Only its name: something below it is shown.
    Path,
    /// Its signals.
    Signals,
}

impl WaveSelection {
    /// Every signal to which a designer gave a name.
    pub fn all() -> Self {
        WaveSelection {
            below: Vec::new(),
            depth: usize::MAX,
            with_anonymous: false,
        }
    }

    /// Only the scope at this dotted path below the top, and what is below it. Several calls add
    /// up.
    pub fn with_scope(mut self, path: impl Into<String>) -> Self {
        self.below.push(path.into());
        self
    }

    /// Only this many levels of instances below the chosen scopes; 0 is the scopes alone.
    pub fn depth(mut self, levels: usize) -> Self {
        self.depth = levels;
        self
    }

    /// Also the nets between gates that the builder numbered because nobody named them.
    pub fn with_anonymous(mut self) -> Self {
        self.with_anonymous = true;
        self
    }

    pub(super) fn includes_anonymous(&self) -> bool {
        self.with_anonymous
    }

    /// Coverage of every scope of `netlist`.
    ///
    /// # Errors
    /// When a path leads nowhere.
    pub(super) fn coverage(&self, netlist: &Netlist) -> io::Result<Vec<Coverage>> {
        let scopes = netlist.scopes();
        // Levels of instances still to be shown below each scope that is shown.
        let mut levels: Vec<Option<usize>> = vec![None; scopes.len()];
        if self.below.is_empty() {
            levels[0] = Some(self.depth);
        }
        for path in &self.below {
            let scope = netlist
                .scope(path)
                .ok_or_else(|| no_such("instance", path, netlist))?;
            levels[scope.index()] = Some(self.depth);
        }
        for i in 1..scopes.len() {
            let inherited = levels[scopes[i].parent.index()].and_then(|left| left.checked_sub(1));
            levels[i] = levels[i].max(inherited);
        }
        let mut coverage: Vec<Coverage> = levels
            .iter()
            .map(|left| match left {
                Some(_) => Coverage::Signals,
                None => Coverage::Nothing,
            })
            .collect();
        // Parents come before their children, so going backwards completes every path.
        for i in (1..scopes.len()).rev() {
            let parent = scopes[i].parent.index();
            if coverage[i] != Coverage::Nothing && coverage[parent] == Coverage::Nothing {
                coverage[parent] = Coverage::Path;
            }
        }
        Ok(coverage)
    }
}

/// A path that leads nowhere.
pub(super) fn no_such(what: &str, path: &str, netlist: &Netlist) -> io::Error {
    let top = &netlist.scopes()[0].name;
    io::Error::new(
        io::ErrorKind::InvalidInput,
        format!("no {what} `{path}` below `{top}`; give a dotted path that starts below the top"),
    )
}

#[cfg(test)]
mod tests {
    use super::Coverage::{Nothing, Path, Signals};
    use super::*;
    use crate::netlist::{CellKind, ModuleBuilder};

    /// top { a: middle { x: leaf, y: leaf }, b: middle { x: leaf, y: leaf } }
    fn tree() -> Netlist {
        let mut m = ModuleBuilder::new("leaf");
        let a = m.input("A");
        m.gate(CellKind::Inv, &[a]);
        let mut module = m.finish().unwrap();
        for (name, children) in [("middle", ["x", "y"]), ("top", ["a", "b"])] {
            let mut m = ModuleBuilder::new(name);
            let a = m.input("A");
            for child in children {
                m.instance(child, &module, &[("A", &[a])]);
            }
            module = m.finish().unwrap();
        }
        Netlist::elaborate(&module)
    }

    fn coverage(selection: WaveSelection) -> Vec<Coverage> {
        selection.coverage(&tree()).unwrap()
    }

    #[test]
    fn scopes_are_chosen_by_path_and_depth() {
        assert_eq!(coverage(WaveSelection::all()), [Signals; 7]);
        assert_eq!(
            coverage(WaveSelection::all().depth(1)),
            [
                Signals, Signals, Nothing, Nothing, Signals, Nothing, Nothing
            ]
        );
        assert_eq!(
            coverage(WaveSelection::all().with_scope("b")),
            [Path, Nothing, Nothing, Nothing, Signals, Signals, Signals]
        );
        assert_eq!(
            coverage(
                WaveSelection::all()
                    .with_scope("b")
                    .with_scope("a.y")
                    .depth(0)
            ),
            [Path, Path, Nothing, Signals, Signals, Nothing, Nothing]
        );
    }

    #[test]
    fn a_path_that_leads_nowhere_is_named() {
        let error = WaveSelection::all()
            .with_scope("a.z")
            .coverage(&tree())
            .unwrap_err();
        assert!(error.to_string().contains("`a.z`"), "{error}");
    }
}
