//! Cells of a Liberty file, as `abc -liberty` and `dfflibmap` place them, by what the file says that they do.

use super::{Placing, YosysCell, YosysError};
use crate::liberty::{CellFunction, Role, TruthTable};
use crate::netlist::CellKind::{And2, Buf, Inv, Mux2, Nand2, Nor2, Or2, Xnor2, Xor2};
use crate::netlist::Net;

/// Places what has the function of a library's cell.
pub(super) fn place(
    to: &mut Placing<'_>,
    given: &YosysCell<'_>,
    function: &CellFunction,
) -> Result<(), YosysError> {
    let pins = function.inputs.iter().map(|pin| to.pin(given, pin));
    let pins = pins.collect::<Result<Vec<Net>, YosysError>>()?;
    let flip_flop = match &function.role {
        Role::Gate(table) => {
            let output = to.pin(given, &function.outputs[0])?;
            return to.function(given, *table, &pins, Some(output)).map(drop);
        }
        Role::FlipFlop(flip_flop) => flip_flop,
    };
    let active =
        |to: &mut Placing<'_>, (pin, inverted): (usize, bool)| to.high(pins[pin], !inverted);
    let data = active(to, flip_flop.data);
    let clock = active(to, flip_flop.clock);
    let [reset, set] = [flip_flop.clear, flip_flop.preset].map(|pin| Some(active(to, pin?)));
    let outputs = [flip_flop.q, flip_flop.qn].map(|output| {
        let name = &function.outputs[output?];
        let is_open = given.entry.connections.get(name).is_none_or(Vec::is_empty);
        (!is_open).then(|| to.pin(given, name))
    });
    let [q, qn] = outputs.map(Option::transpose);
    to.flip_flop(given, [data, clock], [reset, set], [q?, qn?])
}

impl Placing<'_> {
    /// Gates that make a function of these inputs: input after input is split off, one that takes a single gate first.
    fn function(
        &mut self,
        given: &YosysCell<'_>,
        table: TruthTable,
        inputs: &[Net],
        output: Option<Net>,
    ) -> Result<Net, YosysError> {
        let (kind, nets) = if let Some(value) = table.constant() {
            (Buf, vec![self.constant_for(given, "", value)?])
        } else if let Some((input, inverted)) = table.literal() {
            if !inverted && output.is_none() {
                return Ok(inputs[input]);
            }
            (if inverted { Inv } else { Buf }, vec![inputs[input]])
        } else {
            let split = |input: usize| {
                let [zero, one] = table.cofactors(input);
                Some(match (zero.constant(), one.constant()) {
                    (Some(false), _) => (And2, input, one),
                    (Some(true), _) => (Nand2, input, one.inverted()),
                    (_, Some(true)) => (Or2, input, zero),
                    (_, Some(false)) => (Nor2, input, zero.inverted()),
                    _ if zero != one.inverted() => return None,
                    _ => match zero.literal() {
                        Some((_, true)) => (Xnor2, input, one),
                        _ => (Xor2, input, zero),
                    },
                })
            };
            if let Some((kind, input, rest)) = (0..inputs.len()).find_map(split) {
                let rest = self.function(given, rest, inputs, None)?;
                (kind, vec![inputs[input], rest])
            } else {
                // The select of a multiplexer of few others.
                let others = |input: &usize| {
                    let either = table.cofactors(*input);
                    either.iter().filter(|of| of.literal().is_none()).count()
                };
                let select = (0..inputs.len()).rev().filter(|&input| {
                    let [zero, one] = table.cofactors(input);
                    zero != one
                });
                let select = select.min_by_key(others).expect("it is not constant");
                let [zero, one] = table.cofactors(select);
                let zero = self.function(given, zero, inputs, None)?;
                let one = self.function(given, one, inputs, None)?;
                (Mux2, vec![zero, one, inputs[select]])
            }
        };
        let output = output.unwrap_or_else(|| self.m.unnamed());
        self.gate_into(kind, &nets, output);
        Ok(output)
    }
}
