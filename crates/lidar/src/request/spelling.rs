//! How messages name a setting.

use std::fmt::Display;

/// How the caller writes settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spelling {
    /// Options of the command line: `--laser-cycles 1000`.
    Options,
    /// Keys of files and arguments of functions: `laser_cycles = 1000`.
    #[default]
    Keys,
}

impl Spelling {
    /// A setting by name; `key` has underscores.
    pub(crate) fn name(self, key: &str) -> String {
        match self {
            Spelling::Options => format!("--{}", key.replace('_', "-")),
            Spelling::Keys => key.to_owned(),
        }
    }

    /// A setting with a value, a word.
    pub(crate) fn assignment(self, key: &str, value: impl Display) -> String {
        match self {
            Spelling::Options => format!("{} {value}", self.name(key)),
            Spelling::Keys => format!("{key} = \"{value}\""),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_called_as_they_are_written() {
        let [options, keys] = [Spelling::Options, Spelling::Keys];
        assert_eq!(options.name("laser_cycles"), "--laser-cycles");
        assert_eq!(options.assignment("engine", "gate"), "--engine gate");
        assert_eq!(keys.name("laser_cycles"), "laser_cycles");
        assert_eq!(keys.assignment("engine", "gate"), "engine = \"gate\"");
    }
}
