//! A window policy as users write it: `KEY=VALUE,KEY=VALUE`.

use toml::Table;

use super::WindowPolicy;
use crate::files::InputError;
use crate::settings::{Document, Key, Range};

const fn key(name: &'static str, range: Range, what: &'static str, source: &'static str) -> Key {
    Key::new(name, "", range, what, source)
}

/// What can be set.
pub const POLICY_KEYS: &[Key] = &[
    key(
        "unguided",
        Range::OneOf(&["off", "keep", "sweep", "neighbour"]),
        "What macropixels without an estimate do",
        "thesis 4.9 for sweep, else chosen",
    ),
    key(
        "steps_in_doubt",
        Range::Switch,
        "Step the window where one does not hold the guide's uncertainty",
        "chosen",
    ),
    key(
        "patience",
        Range::Within(0.0, 1e6),
        "Exposures without a peak after which windows step although the guide is sure; never, if left out",
        "chosen",
    ),
    key(
        "within",
        Range::Within(0.5, 0.999_999),
        "Share of the estimates that a window must hold for the guide to be sure",
        "thesis Eq. 25",
    ),
    key(
        "overlap",
        Range::Within(0.0, 0.9),
        "Share of a window that the next one has in common with it",
        "chosen: a pulse of 4.5 ns and as much again of a window of 41.7 ns",
    ),
    key(
        "detection",
        Range::Within(0.01, 0.999),
        "Chance that a target within a window makes a significant peak",
        "chosen",
    ),
    key(
        "gross",
        Range::Within(0.0, 1.0),
        "Share of the guide's estimates that are altogether wrong",
        "chosen",
    ),
    key(
        "neighbour_px",
        Range::Within(0.0, 64.0),
        "Macropixels from which an estimate is taken over, at most",
        "chosen",
    ),
];

impl WindowPolicy {
    /// This policy with what `text` changes in it; `source` is what complaints call the place where it stands.
    ///
    /// # Errors
    /// Keys and values that cannot be.
    pub fn with(self, text: &str, source: &str) -> Result<Self, InputError> {
        let option = format!("{source} {text}");
        let mut document = Document::of(&option, Table::new());
        for assignment in text.split(',').filter(|part| !part.trim().is_empty()) {
            document.assign(assignment, &option)?;
        }
        let mut faults = Vec::new();
        let given = document.table();
        let read =
            document.section::<WindowPolicy>("", given, POLICY_KEYS, &Table::new(), &mut faults);
        document.complain(faults)?;
        let mut table = Table::try_from(self).expect("numbers and words");
        table.extend(read);
        Ok(table.try_into().expect("every value has been tried"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Unguided;
    use super::*;

    #[test]
    fn what_is_not_said_stays() {
        let policy = WindowPolicy::for_sequences();
        assert_eq!(policy.with("", "windows").unwrap(), policy);
        let changed = policy
            .with("unguided=sweep,overlap=50 %", "windows")
            .unwrap();
        let expected = WindowPolicy {
            unguided: Unguided::Sweep,
            overlap: 0.5,
            ..policy
        };
        assert_eq!(changed, expected);
        let patient = WindowPolicy::default()
            .with("patience=3", "windows")
            .unwrap();
        assert_eq!(patient.patience, Some(3));
    }

    #[test]
    fn keys_are_those_of_the_policy() {
        let table = Table::try_from(WindowPolicy::for_sequences()).unwrap();
        assert_eq!(table.len(), POLICY_KEYS.len());
        for key in POLICY_KEYS {
            assert_eq!(key.fault(&table[key.name]), None);
        }
    }

    #[test]
    fn what_is_wrong_is_said_in_one_sentence() {
        for (text, says) in [
            ("unguided=wander", "unknown variant `wander`"),
            ("overlap=1", "overlap = 1 is impossible; give 0 to 0.9"),
            ("patience=-1", "patience"),
            ("steps_in_doubt", "has no value; give key=value"),
            ("wide=true", "unknown field `wide`"),
        ] {
            let error = WindowPolicy::default().with(text, "windows").unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
        }
    }
}
