//! What a flip-flop's pins do, by its `ff` group.
//!
//! ```text
//!   next_state : "(SE * SI) + (!SE * D)"    D is the data; SE and SI are tied to 0
//!   next_state : "(E * D) + (!E * IQ)"      D is the data; E is tied to 1
//! ```
//!
//! A cell whose next state is more than its data stands for a plain flip-flop once its other pins are tied to a level: the enable
//! of a scan chain, a load enable, a synchronous reset.

use super::error::LibertyError;
use super::function::{TruthTable, truth_table};
use super::group::Group;
use super::words::check_word;
use crate::netlist::MAX_OUTPUTS;

/// Inputs that a flip-flop can have here, most of which are tied.
pub(super) const MAX_PINS: usize = 32;

/// Pins of a flip-flop: indices of inputs, each with whether it is inverted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FlipFlop {
    pub data: (usize, bool),
    pub clock: (usize, bool),
    pub clear: Option<(usize, bool)>,
    pub preset: Option<(usize, bool)>,
    /// Outputs that show the state, and its inverse.
    pub q: Option<usize>,
    pub qn: Option<usize>,
    /// Levels of the state and of its inverse while clear and preset are both active, where the file gives them.
    pub both_active: [Option<bool>; 2],
    /// Inputs that are tied, as bits, and the levels that they are tied to.
    pub tied: u32,
    pub tied_levels: u32,
}

impl FlipFlop {
    /// The same flip-flop, told by the inverse of its state: clear and preset are exchanged, and so are the outputs.
    pub(super) fn mirrored(self) -> Self {
        FlipFlop {
            data: (self.data.0, !self.data.1),
            clear: self.preset,
            preset: self.clear,
            q: self.qn,
            qn: self.q,
            both_active: [self.both_active[1], self.both_active[0]],
            ..self
        }
    }

    /// The same flip-flop without the output of the inverse state, where that is not the other's inverse while clear and preset are active.
    pub(super) fn with_outputs_that_agree(self) -> Self {
        let [state, inverse] = self.both_active;
        let agree = self.q.is_none() || state == inverse.map(|level| !level);
        FlipFlop {
            qn: self.qn.filter(|_| agree),
            ..self
        }
    }

    /// Whether its outputs show that the preset wins while clear and preset are both active; none where the file does not say.
    pub(super) fn preset_wins(&self) -> Option<bool> {
        let [state, inverse] = self.both_active;
        match self.q {
            Some(_) => state,
            None => inverse.map(|level| !level),
        }
    }

    /// Reads the `ff` group of a cell; none of a kind that has no use here.
    ///
    /// # Errors
    /// Words that mean nothing.
    pub(super) fn read(
        cell: &Group<'_>,
        ff: &Group<'_>,
        inputs: &[&str],
        outputs: &[&str],
    ) -> Result<Option<Self>, LibertyError> {
        for attribute in ["clear_preset_var1", "clear_preset_var2"] {
            check_word(ff, attribute, &["L", "H", "N", "T", "X"])?;
        }
        let level = |attribute| match ff.value(attribute)? {
            "H" => Some(true),
            "L" => Some(false),
            // Kept, toggled or unknown.
            _ => None,
        };
        let [state, inverse] = ["clear_preset_var1", "clear_preset_var2"].map(level);
        let given = |attribute| ff.value(attribute).is_some();
        // One that is not given is the other's inverse.
        let both_active = match [given("clear_preset_var1"), given("clear_preset_var2")] {
            [true, false] => [state, state.map(|level| !level)],
            [false, true] => [inverse.map(|level| !level), inverse],
            _ => [state, inverse],
        };
        Ok(pins(cell, ff, inputs, outputs).map(|pins| FlipFlop {
            both_active,
            ..pins
        }))
    }
}

fn pins(cell: &Group<'_>, ff: &Group<'_>, inputs: &[&str], outputs: &[&str]) -> Option<FlipFlop> {
    let control = |name: &str| match ff.value(name) {
        None => Some(None),
        Some(text) => control_pin(text, inputs).map(Some),
    };
    let (clock, clear, preset) = (
        control("clocked_on")??,
        control("clear")?,
        control("preset")?,
    );
    let controls = [Some(clock), clear, preset].into_iter().flatten();
    let controls: Vec<usize> = controls.map(|(pin, _)| pin).collect();
    let free: Vec<usize> = (0..inputs.len())
        .filter(|pin| !controls.contains(pin))
        .collect();
    let (data, tied, tied_levels) = data_pin(cell, ff, inputs, &free)?;
    let [q, qn] = shown_states(cell, ff, outputs);
    let fits =
        outputs.len() <= MAX_OUTPUTS && inputs.len() <= MAX_PINS && (q.is_some() || qn.is_some());
    fits.then_some(FlipFlop {
        data,
        clock,
        clear,
        preset,
        q,
        qn,
        both_active: [None; 2],
        tied,
        tied_levels,
    })
}

/// The pin that a clock or control is, and whether it is inverted: it depends on its pin alone, however many others there are.
pub(super) fn control_pin(text: &str, inputs: &[&str]) -> Option<(usize, bool)> {
    inputs.iter().enumerate().find_map(|(pin, &input)| {
        let (_, inverts) = truth_table(text, &[input])?.literal()?;
        Some((pin, inverts))
    })
}

/// The outputs that show the state of an `ff` group, and its inverse.
pub(super) fn shown_states(
    cell: &Group<'_>,
    ff: &Group<'_>,
    outputs: &[&str],
) -> [Option<usize>; 2] {
    let state = ff.arguments.as_slice();
    [false, true].map(|inverted| {
        outputs.iter().position(|output| {
            let function = cell.pin(output).and_then(|pin| pin.value("function"));
            let shown = function.and_then(|text| truth_table(text, state)?.literal());
            // The second name of an `ff` is its state inverted.
            shown.is_some_and(|(which, inverts)| inverts ^ (which == 1) == inverted)
        })
    })
}

/// The data among the `free` inputs, which of the others are tied and to what: a pin that the file calls data is preferred, then fewest pins
/// that are tied to 1.
fn data_pin(
    cell: &Group<'_>,
    ff: &Group<'_>,
    inputs: &[&str],
    free: &[usize],
) -> Option<((usize, bool), u32, u32)> {
    let text = ff.value("next_state")?;
    let free_names = free.iter().map(|&pin| inputs[pin]);
    // Where the next state may be the state, its names are inputs of the function, too.
    let names: Vec<&str> = free_names.chain(ff.arguments.iter().copied()).collect();
    let names = if names.len() > TruthTable::MOST {
        &names[..free.len()]
    } else {
        &names[..]
    };
    let table = truth_table(text, names)?;
    let others = |data: usize| (0..free.len()).filter(move |&other| other != data);
    let mut found = Vec::new();
    for data in 0..free.len() {
        for levels in (0..1_u32 << free.len()).filter(|levels| levels >> data & 1 == 0) {
            let tied = others(data).fold(table, |table, other| {
                table.cofactors(other)[(levels >> other & 1) as usize]
            });
            if let Some((pin, inverts)) = tied.literal()
                && pin == data
            {
                let rank = match cell
                    .pin(inputs[free[data]])
                    .and_then(|pin| pin.value("nextstate_type").or(pin.value("signal_type")))
                {
                    Some("data") => 0,
                    None => 1,
                    Some(_) => 2,
                };
                found.push((rank, levels.count_ones(), data, levels, inverts));
            }
        }
    }
    let (_, _, data, levels, inverts) = found.into_iter().min()?;
    let tied = others(data).fold(0, |tied, other| tied | 1 << free[other]);
    let ones = others(data).filter(|&other| levels >> other & 1 == 1);
    let ones = ones.fold(0, |ones, other| ones | 1 << free[other]);
    Some(((free[data], inverts), tied, ones))
}

#[cfg(test)]
mod tests {
    use super::super::group::read;
    use super::*;

    /// The flip-flop of inputs A to F, of which E is the clock and F the clear.
    fn of_next_state(next_state: &str, data: &str) -> Option<FlipFlop> {
        let text = format!(
            "library (l) {{ cell (c) {{ ff (IQ, IQN) {{ next_state : \"{next_state}\"; clocked_on : \"E\"; clear : \"!F\"; }} pin ({data}) {{ nextstate_type : data; }} pin (Q) {{ function : \"IQ\"; }} }} }}"
        );
        let library = read(&text).unwrap();
        let cell = &library.groups[0];
        FlipFlop::read(
            cell,
            &cell.groups[0],
            &["A", "B", "C", "D", "E", "F"],
            &["Q"],
        )
        .unwrap()
    }

    #[test]
    fn what_is_not_data_is_tied_to_a_level() {
        let pins = |next_state: &str, data: &str| {
            let found = of_next_state(next_state, data)?;
            Some((found.data, found.tied, found.tied_levels))
        };
        assert_eq!(pins("A", "A"), Some(((0, false), 0b1110, 0)));
        // Scan chains: enabled by 1, and by 0, where only the pin's type tells the data.
        assert_eq!(
            pins("(B * A) + (!B * C)", "C"),
            Some(((2, false), 0b1011, 0))
        );
        assert_eq!(
            pins("(!B * A) + (B * !C)", "C"),
            Some(((2, true), 0b1011, 0b10))
        );
        // A load enable and a synchronous reset.
        assert_eq!(
            pins("(A B + !A IQ) C", "B"),
            Some(((1, false), 0b1101, 0b101))
        );
        for next_state in ["A ^ B ^ IQ", "IQ", "1", "A +"] {
            assert_eq!(pins(next_state, "A"), None, "{next_state}");
        }
    }

    #[test]
    fn a_mirrored_flip_flop_has_the_inverse_state() {
        let found = of_next_state("!A", "A").unwrap();
        let mirrored = found.mirrored();
        assert_eq!(
            (mirrored.data, mirrored.clear, mirrored.qn),
            ((0, false), None, Some(0))
        );
        assert_eq!(mirrored.preset, Some((5, true)));
        assert_eq!(mirrored.mirrored(), found);
    }
}
