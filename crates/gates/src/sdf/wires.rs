//! Wire delays: where INTERCONNECT and PORT end, and how they are added to the arcs of that pin.

use super::annotate::{Annotator, Wire, causes};
use super::error::{SdfError, SdfFault};
use super::skipped::SkippedKind;
use super::{SdfDelay, join};
use crate::netlist::{CellId, Direction, Edge, NetId, Timing};

impl Annotator<'_, '_, '_> {
    pub(super) fn interconnect(
        &mut self,
        scope: &str,
        delay: &SdfDelay<'_>,
        from: &str,
        to: &str,
    ) -> Result<(), SdfError> {
        let source = self.net_of(scope, from, delay.line, Direction::Input)?;
        let target = join(scope, to);
        if let Some((instance, name)) = target.rsplit_once('.')
            && let Some(cell) = self.netlist.cell(instance)
        {
            let flat = self.netlist.cells()[cell.index()];
            let pin = self.input(flat.kind, name, delay.line)?;
            if source.is_none() || flat.inputs[pin] != source {
                let [from, to] = [from, to].map(str::to_owned);
                return self.error(delay.line, SdfFault::NotConnected { from, to });
            }
            self.wire(cell, pin, delay);
            return Ok(());
        }
        self.net_of(scope, to, delay.line, Direction::Output)?;
        self.note(SkippedKind::WireToOutput, delay.line);
        Ok(())
    }

    /// The net of a cell's output pin, or of a port of the top with this direction.
    fn net_of(
        &self,
        scope: &str,
        path: &str,
        line: usize,
        port: Direction,
    ) -> Result<Option<NetId>, SdfError> {
        let full = join(scope, path);
        if let Some((instance, name)) = full.rsplit_once('.')
            && let Some(cell) = self.netlist.cell(instance)
        {
            let flat = self.netlist.cells()[cell.index()];
            let output = self.output(flat.kind, name, line)?;
            return Ok(flat.outputs[output]);
        }
        let signal = full.split('[').next().unwrap_or("");
        let top = &self.netlist.scopes()[0].module;
        let is_port = top
            .port_signals()
            .any(|(direction, s)| direction == port && s.name == signal);
        match self.netlist.net(&full) {
            Some(net) if is_port => Ok(Some(net)),
            _ => {
                let path = path.to_owned();
                self.error(line, SdfFault::UnknownWireEnd { path })
            }
        }
    }

    pub(super) fn wire(&mut self, cell: CellId, pin: usize, delay: &SdfDelay<'_>) {
        let kind = self.netlist.cells()[cell.index()].kind;
        let values = [delay.rise, delay.fall].map(|triple| triple.in_corner(self.corner));
        if !kind.triggers(pin) {
            let longest = values.into_iter().flatten().max().unwrap_or_default();
            let longest = self.result.longest_wire_to_d.max(longest);
            self.result.longest_wire_to_d = longest;
            self.note(SkippedKind::WireToD, delay.line);
            return;
        }
        if values == [None; 2] {
            return;
        }
        let wire = self.wires.entry((cell, pin)).or_insert(Wire {
            line: delay.line,
            rise_fs: 0,
            fall_fs: 0,
        });
        wire.line = delay.line;
        for (member, value) in [&mut wire.rise_fs, &mut wire.fall_fs]
            .into_iter()
            .zip(values)
        {
            if let Some(time) = value {
                *member = time.as_fs() + if delay.increment { *member } else { 0 };
            }
        }
    }

    pub(super) fn add_wires(&mut self, timing: &mut Timing) -> Result<(), SdfError> {
        let mut wires: Vec<_> = std::mem::take(&mut self.wires).into_iter().collect();
        // In the order of the file, so that the first mistake is the one reported.
        wires.sort_unstable_by_key(|((cell, pin), wire)| (wire.line, *cell, *pin));
        for ((cell, pin), wire) in wires {
            let kind = self.netlist.cells()[cell.index()].kind;
            let mut delays = *timing.cell_delays(cell);
            let mut unequal = false;
            let arcs = delays[pin][..kind.outputs().len()].iter_mut();
            for (delay, rises) in
                arcs.flat_map(|arc| [(&mut arc.rise_fs, true), (&mut arc.fall_fs, false)])
            {
                let by_edge = [(Edge::Rise, wire.rise_fs), (Edge::Fall, wire.fall_fs)];
                let causes = by_edge
                    .iter()
                    .filter(|(edge, _)| causes(kind, pin, *edge, rises))
                    .map(|(_, fs)| *fs);
                let Some(longest) = causes.clone().max() else {
                    continue;
                };
                unequal |= causes.clone().any(|fs| fs != longest);
                let sum = *delay as i64 + longest;
                let Ok(fs) = u32::try_from(sum) else {
                    return self.out_of_range(wire.line, sum);
                };
                *delay = fs;
            }
            if unequal {
                self.note(SkippedKind::UnequalWire, wire.line);
            }
            self.result.wires += 1;
            timing.set(cell, delays);
        }
        Ok(())
    }
}
