//! Finding scopes and cells of a design by their paths.

use std::collections::HashMap;
use std::sync::Arc as Shared;

use crate::netlist::flat::Netlist;
use crate::netlist::module::Module;

/// Finds cells by path: scopes by their path, cells within a module by name.
pub(super) struct Index<'n> {
    netlist: &'n Netlist,
    scopes: HashMap<String, usize>,
    cells: HashMap<*const Module, HashMap<&'n str, usize>>,
    pub of_kind: HashMap<&'static str, Vec<usize>>,
}

impl<'n> Index<'n> {
    pub fn new(netlist: &'n Netlist) -> Self {
        let mut paths: Vec<String> = Vec::with_capacity(netlist.scopes().len());
        let mut cells = HashMap::new();
        for (index, scope) in netlist.scopes().iter().enumerate() {
            // A parent comes before its children.
            paths.push(match index {
                0 => String::new(),
                _ => join(&paths[scope.parent], &scope.name),
            });
            let of_module = || {
                let names = scope.module.cells().iter().enumerate();
                names.map(|(i, c)| (c.name.as_str(), i)).collect()
            };
            cells
                .entry(Shared::as_ptr(&scope.module))
                .or_insert_with(of_module);
        }
        let mut of_kind: HashMap<&'static str, Vec<usize>> = HashMap::new();
        for (index, cell) in netlist.cells().iter().enumerate() {
            of_kind.entry(cell.kind.name()).or_default().push(index);
        }
        let scopes = paths.into_iter().enumerate().map(|(i, p)| (p, i)).collect();
        Index {
            netlist,
            scopes,
            cells,
            of_kind,
        }
    }

    pub fn scope(&self, path: &str) -> Option<usize> {
        self.scopes.get(path).copied()
    }

    pub fn cell(&self, path: &str) -> Option<usize> {
        let (scope, name) = path.rsplit_once('.').unwrap_or(("", path));
        let scope = self.scope(scope)?;
        let module = Shared::as_ptr(&self.netlist.scopes()[scope].module);
        let local = *self.cells.get(&module)?.get(name)?;
        Some(self.netlist.cells_of(scope).start + local)
    }
}

pub(super) fn join(path: &str, name: &str) -> String {
    if path.is_empty() {
        name.to_owned()
    } else {
        format!("{path}.{name}")
    }
}
