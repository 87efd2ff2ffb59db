//! Tables of delays, slews, limits and energies over two axes, interpolated linearly and continued linearly beyond their ends, as
//! timing analysers do.

use std::collections::HashMap;

use super::error::LibertyError;
use super::group::Group;
use super::table_fault::LibertyTableFault as Fault;
use super::units::Units;

/// What an axis is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axis {
    /// Slew of the input, or of the clock in a limit's table.
    Related,
    /// Load of the output, or slew of the data in a limit's table.
    Other,
}

/// A function of two variables; a table without an axis does not depend on it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    /// Slews of the input or clock, fs.
    related: Vec<f64>,
    /// Loads, fF, or slews of the data, fs.
    other: Vec<f64>,
    /// By `related`, then `other`, fs; fJ of energies.
    values: Vec<f64>,
}

impl Table {
    /// The same value everywhere, fs.
    pub(super) fn fixed(value_fs: f64) -> Self {
        Table {
            related: Vec::new(),
            other: Vec::new(),
            values: vec![value_fs],
        }
    }

    /// Checks that times can be kept: delays are whole femtoseconds of 32 bits.
    ///
    /// # Errors
    /// The first one beyond 4.295 us.
    pub(super) fn check_range(&self, line: usize, attribute: &str) -> Result<(), LibertyError> {
        let mut values = self.values.iter();
        let beyond = values.find(|&&fs| fs > f64::from(u32::MAX));
        beyond.map_or(Ok(()), |fs| {
            let fault = Fault::TimeOutOfRange {
                attribute: attribute.to_owned(),
                time_fs: *fs,
            };
            Err(LibertyError::new(line, fault))
        })
    }

    /// The value, fs: `related` is the slew of the input or the clock, fs; `other` the load, fF, or the data's slew, fs.
    pub(super) fn interpolate(&self, related: f64, other: f64) -> f64 {
        let (row, along_row) = place(&self.related, related);
        let (col, along_col) = place(&self.other, other);
        let cols = self.other.len().max(1);
        let value = |r: usize, c: usize| self.values[r * cols + c];
        let in_row = |r: usize| match self.other.len() {
            0 | 1 => value(r, 0),
            _ => value(r, col) + (value(r, col + 1) - value(r, col)) * along_col,
        };
        match self.related.len() {
            0 | 1 => in_row(0),
            _ => {
                let (low, high) = (in_row(row), in_row(row + 1));
                low + (high - low) * along_row
            }
        }
    }
}

/// The stretch of an axis that `x` lies in or nearest to, and how far along it, beyond 0 and 1 outside the axis.
fn place(axis: &[f64], x: f64) -> (usize, f64) {
    if axis.len() < 2 {
        return (0, 0.0);
    }
    let above = axis.partition_point(|&mark| mark <= x);
    let low = above.clamp(1, axis.len() - 1) - 1;
    (low, (x - axis[low]) / (axis[low + 1] - axis[low]))
}

/// Tables' templates by name.
pub(super) struct Templates<'g, 't>(HashMap<&'t str, &'g Group<'t>>);

impl<'g, 't> Templates<'g, 't> {
    pub(super) fn from_library(library: &'g Group<'t>) -> Self {
        let kinds = ["lu_table_template", "power_lut_template"];
        let templates = kinds.into_iter().flat_map(|kind| library.of_kind(kind));
        Templates(
            templates
                .map(|template| (template.name(), template))
                .collect(),
        )
    }

    /// Reads one table of times.
    ///
    /// # Errors
    /// Axes or values that do not fit each other, axes of something else than slews and loads, and times beyond 4.295 us.
    pub(super) fn table(&self, group: &Group<'t>, units: Units) -> Result<Table, LibertyError> {
        let table = self.table_in(group, units, units.time_fs)?;
        table.check_range(group.line, group.kind)?;
        Ok(table)
    }

    /// The same of values in a `unit`.
    pub(super) fn table_in(
        &self,
        group: &Group<'t>,
        units: Units,
        unit: f64,
    ) -> Result<Table, LibertyError> {
        let fault = |fault: Fault| LibertyError::new(group.line, fault);
        let table = || group.kind.to_owned();
        let numbers = group.numbers("values")?;
        let mut values = numbers.ok_or_else(|| fault(Fault::NoValues { table: table() }))?;
        let template = self.0.get(group.name());
        if let Some(third) = template.and_then(|template| template.value("variable_3")) {
            return Err(fault(Fault::ThreeAxes {
                template: group.name().to_owned(),
                axis: third.to_owned(),
            }));
        }
        if template.is_none() && values.len() > 1 {
            return Err(fault(Fault::UnknownTemplate {
                table: table(),
                template: group.name().to_owned(),
            }));
        }
        let mut axes: [(Option<Axis>, Vec<f64>); 2] = Default::default();
        for (index, axis) in axes.iter_mut().enumerate() {
            let variable = template.and_then(|t| t.value(["variable_1", "variable_2"][index]));
            let Some(variable) = variable else { continue };
            let (of, unit) = match variable {
                "input_net_transition" | "related_pin_transition" | "input_transition_time" => {
                    (Axis::Related, units.time_fs)
                }
                "constrained_pin_transition" => (Axis::Other, units.time_fs),
                "total_output_net_capacitance" => (Axis::Other, units.load_ff),
                _ => {
                    return Err(fault(Fault::UnknownAxis {
                        template: group.name().to_owned(),
                        axis: variable.to_owned(),
                    }));
                }
            };
            let index = ["index_1", "index_2"][index];
            let marks = match group.numbers(index)? {
                Some(marks) => marks,
                None => template
                    .map(|t| t.numbers(index))
                    .transpose()?
                    .flatten()
                    .unwrap_or_default(),
            };
            if marks.is_empty() || marks.windows(2).any(|pair| pair[0] >= pair[1]) {
                let table = table();
                return Err(fault(Fault::NotRising { index, table }));
            }
            *axis = (
                Some(of),
                marks.into_iter().map(|mark| mark * unit).collect(),
            );
        }
        let wanted: usize = axes.iter().map(|(_, marks)| marks.len().max(1)).product();
        if values.len() != wanted || axes[0].0.is_some() && axes[0].0 == axes[1].0 {
            return Err(fault(Fault::ValueCount {
                table: table(),
                values: values.len(),
                wanted,
            }));
        }
        values.iter_mut().for_each(|value| *value *= unit);
        let [first, second] = axes;
        if first.0 == Some(Axis::Other) {
            let (rows, cols) = (second.1.len().max(1), first.1.len());
            let turned = (0..rows * cols).map(|i| values[i % cols * rows + i / cols]);
            return Ok(Table {
                values: turned.collect(),
                related: second.1,
                other: first.1,
            });
        }
        Ok(Table {
            related: first.1,
            other: second.1,
            values,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::group::read;
    use super::*;

    const UNITS: Units = Units {
        time_fs: 1e6,
        load_ff: 1e3,
        energy_fj: 1e3,
        leakage_w: 1e-9,
    };

    fn table(text: &str) -> Result<Table, LibertyError> {
        let text = format!(
            "library (l) {{ lu_table_template (t) {{ variable_1 : total_output_net_capacitance; variable_2 : input_net_transition; index_1 (\"1, 3\"); index_2 (\"0, 10\"); }}\n lu_table_template (c) {{ variable_1 : input_voltage; }}\n lu_table_template (d) {{ variable_1 : input_net_transition; variable_3 : related_out_total_output_net_capacitance; }}\n {text} }}"
        );
        let library = read(&text).unwrap();
        Templates::from_library(&library).table(&library.groups[3], UNITS)
    }

    #[test]
    fn values_between_and_beyond_the_marks_are_on_straight_lines() {
        let delay = table("cell_rise (t) { values (\"1, 2\", \"3, 6\"); }").unwrap();
        let delay_ns =
            |slew_ns: f64, load_pf: f64| delay.interpolate(slew_ns * 1e6, load_pf * 1e3) / 1e6;
        assert_eq!(
            (delay_ns(0.0, 1.0), delay_ns(10.0, 1.0), delay_ns(0.0, 3.0)),
            (1.0, 2.0, 3.0)
        );
        assert_eq!(delay_ns(5.0, 2.0), 3.0);
        assert_eq!(delay_ns(0.0, 5.0), 5.0);
        assert_eq!(delay_ns(-10.0, 1.0), 0.0);
        let one = table("cell_rise (scalar) { values (\"7\"); }").unwrap();
        assert_eq!(one.interpolate(3.0, 4.0), 7e6);
    }

    #[test]
    fn tables_that_do_not_fit_are_refused() {
        for (text, says) in [
            ("cell_rise (t) { values (\"1, 2, 3\"); }", "want 4"),
            (
                "cell_rise (t) { index_1 (\"2, 1\"); values (\"1,2,3,4\"); }",
                "rise",
            ),
            (
                "cell_rise (c) { index_1 (\"1\"); values (\"1\"); }",
                "input_voltage",
            ),
            ("cell_rise (t) { }", "no values"),
            (
                "cell_rise (u) { values (\"1, 2\"); }",
                "\"u\", a template that the library does not have",
            ),
            (
                "cell_rise (d) { values (\"1\"); }",
                "third is related_out_total_output_net_capacitance",
            ),
            (
                "cell_rise (t) { values (\"1, 2\", \"3, 5000\"); }",
                "reaches 5.000 us",
            ),
        ] {
            let message = table(text).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
