//! Attributes whose value is one of a few words: one that the Liberty manual does not have is refused.

use super::error::LibertyError;
use super::group::Group;
use super::syntax_fault::LibertySyntaxFault;

/// Checks that an attribute, if it is there, is one of these words.
///
/// # Errors
/// Another one.
pub(super) fn check_word(
    group: &Group<'_>,
    attribute: &'static str,
    known: &'static [&'static str],
) -> Result<(), LibertyError> {
    match group.value(attribute) {
        Some(word) if !known.contains(&word) => {
            let word = word.to_owned();
            let fault = LibertySyntaxFault::UnknownWord {
                attribute,
                word,
                known,
            };
            Err(LibertyError::new(group.line, fault))
        }
        _ => Ok(()),
    }
}

/// Whether an attribute is there and true. Files have it in capitals, too.
///
/// # Errors
/// A word that is neither true nor false.
pub(super) fn is_true(group: &Group<'_>, attribute: &'static str) -> Result<bool, LibertyError> {
    let word = group.value(attribute).unwrap_or("false");
    if !word.eq_ignore_ascii_case("true") && !word.eq_ignore_ascii_case("false") {
        check_word(group, attribute, &["true", "false"])?;
    }
    Ok(word.eq_ignore_ascii_case("true"))
}

/// What a `timing` group is of.
///
/// # Errors
/// A word that is not in the Liberty manual.
pub(super) fn timing_type<'t>(timing: &Group<'t>) -> Result<&'t str, LibertyError> {
    let word = timing.value("timing_type").unwrap_or("combinational");
    let begins = [
        "combinational",
        "three_state_disable",
        "three_state_enable",
        "setup",
        "hold",
        "recovery",
        "removal",
        "skew",
        "non_seq_setup",
        "non_seq_hold",
    ];
    let with_edge = begins.into_iter().any(|begin| {
        matches!(
            word.strip_prefix(begin),
            Some("_rising" | "_falling" | "_rise" | "_fall" | "")
        )
    });
    let others = [
        "rising_edge",
        "falling_edge",
        "clear",
        "preset",
        "min_pulse_width",
        "minimum_period",
        "max_clock_tree_path",
        "min_clock_tree_path",
        "nochange_high_high",
        "nochange_high_low",
        "nochange_low_high",
        "nochange_low_low",
    ];
    if with_edge || others.contains(&word) {
        return Ok(word);
    }
    let word = word.to_owned();
    let fault = LibertySyntaxFault::UnknownTimingType { word };
    Err(LibertyError::new(timing.line, fault))
}

/// Which edge of the input makes which of the output, where a `timing` group says so.
///
/// # Errors
/// A word that is not in the Liberty manual.
pub(super) fn timing_sense<'t>(timing: &Group<'t>) -> Result<Option<&'t str>, LibertyError> {
    let known = &["positive_unate", "negative_unate", "non_unate"];
    check_word(timing, "timing_sense", known)?;
    Ok(timing.value("timing_sense"))
}
