//! A window policy as users write it: `KEY=VALUE,KEY=VALUE`.

use toml::Table;

use super::WindowPolicy;
use crate::files::InputError;
use crate::settings::{Assignment, Document, Key, Range, Settings};

impl WindowPolicy {
    /// This policy with what `text` changes in it; `source` is what complaints call the place where it stands.
    ///
    /// # Errors
    /// Unknown keys and impossible values.
    pub fn with_changes(self, text: &str, source: &str) -> Result<Self, InputError> {
        let option = format!("{source} {text}");
        let mut document = Document::from_table(&option, Table::new());
        for text in text.split(',').filter(|part| !part.trim().is_empty()) {
            let is_its = |key: &&Key| matches!(key.range, Range::OneOf(words) if words.contains(&text.trim()));
            if let Some(key) = Self::KEYS.iter().find(is_its) {
                let message = format!("names no key; did you mean {}={}?", key.name, text.trim());
                return Err(InputError::new(option, message));
            }
            document.assign(&Assignment::parse(text, &option)?)?;
        }
        let mut faults = Vec::new();
        let read = document.section::<WindowPolicy>("", &document.table, &mut faults);
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
        assert_eq!(policy.with_changes("", "windows").unwrap(), policy);
        let changed = policy
            .with_changes("unguided=sweep,overlap=50 %", "windows")
            .unwrap();
        let expected = WindowPolicy {
            unguided: Unguided::Sweep,
            overlap: 0.5,
            ..policy
        };
        assert_eq!(changed, expected);
        let patient = WindowPolicy::default()
            .with_changes("patience=3", "windows")
            .unwrap();
        assert_eq!(patient.patience, Some(3));
    }

    #[test]
    fn defaults_are_within_their_ranges() {
        let table = Table::try_from(WindowPolicy::for_sequences()).unwrap();
        for key in WindowPolicy::KEYS {
            assert_eq!(key.fault(&table[key.name]), None);
        }
    }

    #[test]
    fn what_is_wrong_is_said_in_one_sentence() {
        for (text, says) in [
            ("unguided=wander", "`wander` is impossible; give off"),
            ("unguided=neighbor", "did you mean `neighbour`?"),
            ("neighbour", "did you mean unguided=neighbour?"),
            ("overlap=1", "overlap = 1 is impossible; give 0 to 0.9"),
            ("patience=-1", "patience"),
            ("steps_in_doubt", "has no value; give key=value"),
            ("wide=true", "unknown key `wide`"),
        ] {
            let error = WindowPolicy::default()
                .with_changes(text, "windows")
                .unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
        }
    }
}
