//! What can be wrong with the units and the tables of a Liberty file.

/// What is wrong with the units or the tables of a Liberty file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LibertyTableFault {
    /// A unit that is none.
    #[error("its {} is {text:?}; give a number, a prefix and {}, as in {}", .unit.attribute(), .unit.letter(), .unit.example())]
    UnknownUnit {
        /// What it is the unit of.
        unit: LibertyUnit,
        /// What is given.
        text: String,
    },
    /// A library without a unit of capacitance.
    #[error("it has no capacitive_load_unit of ff or pf")]
    NoLoadUnit,
    /// A time beyond what delays are kept in.
    #[error("its {attribute} reaches {:.3} us; times up to 4.295 us are known", .time_fs * 1e-9)]
    TimeOutOfRange {
        /// Table or attribute that has it.
        attribute: String,
        /// The time, fs.
        time_fs: f64,
    },
    /// A table without values.
    #[error("{table} has no values")]
    NoValues {
        /// Kind of the table.
        table: String,
    },
    /// A table with three axes.
    #[error(
        "the table {template} is over three axes, of which the third is {axis}; tables over slews and loads are read"
    )]
    ThreeAxes {
        /// Name of the table's template.
        template: String,
        /// What the third axis is of.
        axis: String,
    },
    /// A table with an axis that is neither of a slew nor of a load.
    #[error("the table {template} is over {axis}; tables over slews and loads are read")]
    UnknownAxis {
        /// Name of the table's template.
        template: String,
        /// What the axis is of.
        axis: String,
    },
    /// A table whose template is not there.
    #[error("{table} has the axes of {template:?}, a template that the library does not have")]
    UnknownTemplate {
        /// Kind of the table.
        table: String,
        /// Name of the template.
        template: String,
    },
    /// An axis whose values do not rise.
    #[error("{index} of {table} does not rise")]
    NotRising {
        /// Attribute with the axis.
        index: &'static str,
        /// Kind of the table.
        table: String,
    },
    /// A table with more or fewer values than its axes have places.
    #[error("{table} has {values} values, and its axes want {wanted}")]
    ValueCount {
        /// Kind of the table.
        table: String,
        /// Values that it has.
        values: usize,
        /// Values that its axes want.
        wanted: usize,
    },
}

/// What a unit of a Liberty file is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LibertyUnit {
    /// Times.
    Time,
    /// Voltages.
    Voltage,
    /// Leakage of cells.
    LeakagePower,
}

impl LibertyUnit {
    /// Attribute that has it.
    pub(super) fn attribute(self) -> &'static str {
        match self {
            LibertyUnit::Time => "time_unit",
            LibertyUnit::Voltage => "voltage_unit",
            LibertyUnit::LeakagePower => "leakage_power_unit",
        }
    }

    /// The unit without a prefix.
    pub(super) fn letter(self) -> char {
        match self {
            LibertyUnit::Time => 's',
            LibertyUnit::Voltage => 'V',
            LibertyUnit::LeakagePower => 'W',
        }
    }

    fn example(self) -> &'static str {
        match self {
            LibertyUnit::Time => "1ns",
            LibertyUnit::Voltage => "1V",
            LibertyUnit::LeakagePower => "1nW",
        }
    }
}
