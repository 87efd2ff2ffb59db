//! What can be wrong with the syntax of a Liberty file.

/// What is wrong with the syntax of a Liberty file, or with a value that is no number or no word that belongs there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LibertySyntaxFault {
    /// The file does not begin as a Liberty file does.
    #[error("the file does not begin with library (NAME) {{; give a Liberty file")]
    NoLibrary,
    /// Something follows the library.
    #[error("something follows the library's closing brace; remove it, or a brace before it")]
    AfterLibrary,
    /// A comment without an end.
    #[error("a comment has no end")]
    UnclosedComment,
    /// A string without an end.
    #[error("a quotation mark has no partner")]
    UnclosedString,
    /// Arguments without an end.
    #[error("a bracket has no partner")]
    UnclosedBracket,
    /// A group without an end.
    #[error("the {group} {name} of line {line} has no closing brace; add it")]
    UnclosedGroup {
        /// Kind of the group.
        group: String,
        /// Its name.
        name: String,
        /// Line it begins in.
        line: usize,
    },
    /// A group without arguments.
    #[error("{group} has no arguments in brackets")]
    NoArguments {
        /// Kind of the group.
        group: String,
    },
    /// A group without contents.
    #[error("{group} has no contents in braces")]
    NoContents {
        /// Kind of the group.
        group: String,
    },
    /// Groups in each other beyond what any library has.
    #[error("groups are more than {most} deep")]
    TooDeep {
        /// How many are read.
        most: usize,
    },
    /// A mark in a place where none belongs.
    #[error("{mark:?} is not expected here")]
    UnexpectedMark {
        /// The mark.
        mark: char,
    },
    /// A name that nothing follows that would make it an attribute or a group.
    #[error("{name} is neither an attribute nor a group")]
    LoneName {
        /// The name.
        name: String,
    },
    /// An attribute without a value.
    #[error("the attribute before {next} has no value")]
    NoValue {
        /// Name of the next attribute.
        next: String,
    },
    /// A file that is to be included.
    #[error("what is in {file:?} is not included; put its text in the place of include_file")]
    NotIncluded {
        /// Name of the file.
        file: String,
    },
    /// A text where a number belongs.
    #[error("{attribute} of this {group} is {text:?}, which is not a number")]
    NotNumber {
        /// Name of the attribute.
        attribute: String,
        /// Kind of the group that has it.
        group: String,
        /// Its value, or the part of it that is none.
        text: String,
    },
    /// A word that an attribute cannot have.
    #[error("{attribute} {word:?} is not known: it is {}", .known.join(", "))]
    UnknownWord {
        /// Name of the attribute.
        attribute: &'static str,
        /// Its value.
        word: String,
        /// What it can be.
        known: &'static [&'static str],
    },
    /// A kind of timing that the Liberty manual does not have.
    #[error("timing_type {word:?} is not known")]
    UnknownTimingType {
        /// The kind.
        word: String,
    },
}
