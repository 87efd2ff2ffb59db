//! What is wrong with a command line, in one sentence: clap finds it, and answers in several lines with what was typed as it was typed.

use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::voice;
use crate::files::{InputError, instead_of};

/// Ends the program: shows the help or the version that was asked for, or complains with exit status 2.
pub(super) fn exit_with(error: &clap::Error) -> ! {
    let Some(complaint) = complaint(error) else {
        error.exit()
    };
    voice::complain(complaint);
    std::process::exit(2)
}

/// Nothing for what is no complaint.
fn complaint(error: &clap::Error) -> Option<InputError> {
    let texts = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => vec![text.as_str()],
        Some(ContextValue::Strings(texts)) => texts.iter().map(String::as_str).collect(),
        _ => Vec::new(),
    };
    let text = |kind| texts(kind).first().copied().unwrap_or_default();
    let argument = text(ContextKind::InvalidArg);
    let name = bare(argument);
    // The likeliest is the last one.
    let meant = |kind, cure: &str| match texts(kind).last() {
        Some(meant) => format!("did you mean `{meant}`?"),
        None => cure.to_owned(),
    };
    Some(match error.kind() {
        ErrorKind::InvalidValue | ErrorKind::ValueValidation => {
            let value = text(ContextKind::InvalidValue);
            let known = texts(ContextKind::ValidValue);
            let instead = || instead_of(value, known.iter().copied());
            if value.trim().is_empty() {
                let cure = if known.is_empty() {
                    "give one".to_owned()
                } else {
                    instead()
                };
                return Some(InputError::new(name, format!("has no value; {cure}")));
            }
            let message = match std::error::Error::source(error) {
                _ if !known.is_empty() => format!("is unknown; {}", instead()),
                Some(cause) => value_wanted(value, cause),
                None => "is impossible; `--help` says what to give".to_owned(),
            };
            InputError::new(format!("{name} {value}"), message)
        }
        ErrorKind::UnknownArgument => {
            let cure = meant(ContextKind::SuggestedArg, "`--help` lists what there is");
            InputError::new(argument, format!("is unknown here; {cure}"))
        }
        ErrorKind::InvalidSubcommand => {
            let cure = meant(
                ContextKind::SuggestedSubcommand,
                "`gdtof --help` lists all commands",
            );
            let given = text(ContextKind::InvalidSubcommand);
            InputError::new(given, format!("is not a command; {cure}"))
        }
        ErrorKind::MissingRequiredArgument => {
            let missing = texts(ContextKind::InvalidArg);
            let names = missing.iter().map(|argument| bare(argument));
            let names: Vec<&str> = names.collect();
            let message = match names.len() {
                1 => "is needed; give it, as `--help` says",
                _ => "are needed; give them, as `--help` says",
            };
            InputError::new(names.join(", "), message)
        }
        ErrorKind::ArgumentConflict => {
            let others = texts(ContextKind::PriorArg);
            let others: Vec<&str> = others.into_iter().map(bare).collect();
            let message = if others.is_empty() || others.contains(&name) {
                "is given twice; leave one of them out".to_owned()
            } else {
                format!(
                    "cannot be used with {}; leave one of them out",
                    others.join(", ")
                )
            };
            InputError::new(name, message)
        }
        ErrorKind::TooManyValues | ErrorKind::WrongNumberOfValues | ErrorKind::TooFewValues => {
            let message = "has another number of values than it takes; `--help` says how many";
            InputError::new(argument, message)
        }
        ErrorKind::InvalidUtf8 => InputError::new(
            "command line",
            "has an argument that is not UTF-8 text; give texts in UTF-8",
        ),
        _ => return None,
    })
}

/// `--rows <R>` without what it takes, `<DEMO>` and `[NAME]...` without brackets.
fn bare(argument: &str) -> &str {
    let name = argument.split(' ').next().unwrap_or(argument);
    name.trim_matches(['<', '>', '[', ']', '.'])
}

/// What to say of a value that is not what an option takes.
fn value_wanted(value: &str, cause: &(dyn std::error::Error + 'static)) -> String {
    use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
    if let Some(cause) = cause.downcast_ref::<ParseIntError>() {
        let whole = value
            .parse::<f64>()
            .ok()
            .filter(|n| n.fract() == 0.0 && (0.0..1e15).contains(n));
        match (cause.kind(), whole) {
            (IntErrorKind::PosOverflow, _) => "is too large; give a smaller number".to_owned(),
            (_, Some(whole)) => {
                format!("is not written as a whole number; give {}", whole.abs())
            }
            _ if value.starts_with('-') => {
                "is below zero; give a whole number, 0 or more".to_owned()
            }
            _ => "is not a whole number; give one, in digits alone".to_owned(),
        }
    } else if cause.is::<ParseFloatError>() {
        "is not a number; give one, such as 0.5 or 2e-3".to_owned()
    } else if let Some((_, range)) = cause.to_string().split_once(" is not in ") {
        let (least, most) = range.split_once("..").unwrap_or((range, ""));
        match most.trim_start_matches('=') {
            "" => format!("is impossible; give {least} or more"),
            most => format!("is impossible; give {least} to {most}"),
        }
    } else {
        // Readers of our own.
        cause.to_string()
    }
}
