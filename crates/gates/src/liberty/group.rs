//! The syntax of Liberty files: groups of attributes and further groups.
//!
//! ```text
//!   cell (INVX1) {                        group: kind, arguments
//!     area : 16;                          simple attribute
//!     index_1 ("0.06, 0.24, 0.48");       complex attribute
//!     pin(A) { … }                        group in a group
//!   }
//! ```
//!
//! Nothing is copied: names and values are parts of the text, so an escaped quotation mark keeps its backslash. A value is looked
//! at only by who asks for it, so that a library of 12 MB is read in a tenth of a second, nearly all of whose numbers belong to
//! cells that no chip here has.
//!
//! | syntax | how it is read |
//! |---|---|
//! | comment behind an unquoted value | ends the value |
//! | no semicolon | the end of the line, a closing brace or the next attribute ends the value |
//! | `NAME = 1.5;` | a variable, which is passed over: a value that uses it is not a number |
//! | `include_file (FILE)` | refused |
//! | strings continued by a backslash | joined before ([`super::text`]) |
//!
//! Source: the Liberty user guide, volume 1 (Synopsys, open source), and what OpenSTA reads. `define` and the attributes of
//! vendors are read as any others and mean nothing.

use super::error::LibertyError;
use super::syntax_fault::LibertySyntaxFault as Fault;

/// A group, with where it begins.
#[derive(Debug)]
pub(super) struct Group<'t> {
    /// What it is: `cell`, `pin`, `timing` and so on.
    pub kind: &'t str,
    /// Its arguments, without quotation marks.
    pub arguments: Vec<&'t str>,
    /// Line it begins in, from 1.
    pub line: usize,
    /// Attributes in order: name and values.
    attributes: Vec<(&'t str, Vec<&'t str>)>,
    /// Groups in order.
    pub groups: Vec<Group<'t>>,
}

impl<'t> Group<'t> {
    /// First argument: the name of a cell, a pin, a table's template.
    pub(super) fn name(&self) -> &'t str {
        self.arguments.first().copied().unwrap_or_default()
    }

    /// Values of an attribute, the last one of this name as in other readers.
    pub(super) fn values(&self, name: &str) -> Option<&[&'t str]> {
        let mut found = self.attributes.iter().rev();
        found.find(|(n, _)| *n == name).map(|(_, v)| v.as_slice())
    }

    /// The one value of an attribute.
    pub(super) fn value(&self, name: &str) -> Option<&'t str> {
        self.values(name)?.first().copied()
    }

    /// The one value of an attribute as a number.
    ///
    /// # Errors
    /// One that is none.
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, LibertyError> {
        self.value(name)
            .map(|text| self.parse(name, text))
            .transpose()
    }

    /// All numbers of an attribute, separated by commas or blanks.
    ///
    /// # Errors
    /// One that is none.
    pub(super) fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, LibertyError> {
        let Some(values) = self.values(name) else {
            return Ok(None);
        };
        let apart = |c: char| c == ',' || c == '\\' || c.is_whitespace();
        let words = values.iter().flat_map(|text| text.split(apart));
        let words = words.filter(|word| !word.is_empty());
        words
            .map(|word| self.parse(name, word))
            .collect::<Result<_, _>>()
            .map(Some)
    }

    fn parse(&self, name: &str, text: &str) -> Result<f64, LibertyError> {
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| {
            let fault = Fault::NotNumber {
                attribute: name.to_owned(),
                group: self.kind.to_owned(),
                text: text.to_owned(),
            };
            LibertyError::new(self.line, fault)
        })
    }

    /// Pins with the group of each; one group may be that of several, as in `pin (A, B)`.
    pub(super) fn pins(&self) -> impl Iterator<Item = (&'t str, &Group<'t>)> {
        let pins = self.of_kind("pin");
        pins.flat_map(|pin| pin.arguments.iter().map(move |&name| (name, pin)))
    }

    /// The group of a pin.
    pub(super) fn pin(&self, name: &str) -> Option<&Group<'t>> {
        self.pins()
            .find_map(|(own, pin)| (own == name).then_some(pin))
    }

    /// Groups of a kind.
    pub(super) fn of_kind(&self, kind: &str) -> impl Iterator<Item = &Group<'t>> {
        self.groups.iter().filter(move |group| group.kind == kind)
    }
}

/// Reads a file of one `library` group.
///
/// # Errors
/// What is no Liberty, with its line.
pub(super) fn read(text: &str) -> Result<Group<'_>, LibertyError> {
    let mut reader = Reader {
        text,
        at: 0,
        line: 1,
    };
    let first = reader.token()?;
    let library = match first {
        Some(Token::Word("library")) => reader.group("library", 0)?,
        _ => return Err(reader.fault(Fault::NoLibrary)),
    };
    loop {
        match reader.token()? {
            None => return Ok(library),
            Some(Token::Mark(b';')) => {}
            Some(_) => return Err(reader.fault(Fault::AfterLibrary)),
        }
    }
}

/// Groups within groups: a real library has six.
const DEEPEST: usize = 32;

#[derive(Debug, PartialEq, Clone, Copy)]
enum Token<'t> {
    Word(&'t str),
    Mark(u8),
}

struct Reader<'t> {
    text: &'t str,
    at: usize,
    line: usize,
}

impl<'t> Reader<'t> {
    fn fault(&self, fault: Fault) -> LibertyError {
        LibertyError::new(self.line, fault)
    }

    /// Passes over blanks, comments and continued lines.
    fn blanks(&mut self) -> Result<(), LibertyError> {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'\\' => {}
                blank if blank.is_ascii_whitespace() => {}
                b'/' if bytes.get(self.at + 1) == Some(&b'*') => {
                    let rest = &self.text[self.at + 2..];
                    let Some(end) = rest.find("*/") else {
                        return Err(self.fault(Fault::UnclosedComment));
                    };
                    self.line += rest[..end].matches('\n').count();
                    self.at += end + 3;
                }
                b'/' if bytes.get(self.at + 1) == Some(&b'/') => {
                    let rest = &self.text[self.at..];
                    self.at += rest.find('\n').unwrap_or(rest.len());
                    continue;
                }
                _ => break,
            }
            self.at += 1;
        }
        Ok(())
    }

    /// A name, a string or a mark of what a group contains.
    fn token(&mut self) -> Result<Option<Token<'t>>, LibertyError> {
        self.blanks()?;
        let Some(&first) = self.text.as_bytes().get(self.at) else {
            return Ok(None);
        };
        if first == b'"' {
            return Ok(Some(Token::Word(self.string()?)));
        }
        if b"(){}:;,=".contains(&first) {
            self.at += 1;
            return Ok(Some(Token::Mark(first)));
        }
        // What ends a word is passed over by `blanks` or a token itself, so that there is no empty word.
        Ok(Some(Token::Word(self.word("(){}:;,=\"\\"))))
    }

    /// What stands before a blank, a comment or one of `marks`.
    fn word(&mut self, marks: &str) -> &'t str {
        let rest = &self.text[self.at..];
        let ends = |c: char| c.is_ascii_whitespace() || marks.contains(c);
        let word = &rest[..rest.find(ends).unwrap_or(rest.len())];
        let word = &word[..word.find("/*").unwrap_or(word.len())];
        self.at += word.len();
        word
    }

    /// What stands between quotation marks, of which the first is next. One with a backslash before it is part of the string,
    /// which then ends in its line: else a path that ends in a backslash would take in what follows.
    fn string(&mut self) -> Result<&'t str, LibertyError> {
        let bytes = &self.text.as_bytes()[self.at + 1..];
        let (mut length, mut lines, mut is_escaped) = (0, 0, false);
        loop {
            match bytes.get(length) {
                Some(b'"') => break,
                Some(b'\\') => {
                    is_escaped |= bytes.get(length + 1) == Some(&b'"');
                    lines += usize::from(bytes.get(length + 1) == Some(&b'\n'));
                    length += 2;
                }
                Some(b'\n') if !is_escaped => {
                    lines += 1;
                    length += 1;
                }
                None | Some(b'\n') => return Err(self.fault(Fault::UnclosedString)),
                Some(_) => length += 1,
            }
        }
        let string = &self.text[self.at + 1..][..length];
        self.line += lines;
        self.at += length + 2;
        Ok(string)
    }

    /// Arguments up to the closing bracket; the opening one is read. Colons and square brackets are parts of names.
    fn arguments(&mut self) -> Result<Vec<&'t str>, LibertyError> {
        let mut arguments = Vec::new();
        loop {
            self.blanks()?;
            match self.text.as_bytes().get(self.at) {
                Some(b',') => self.at += 1,
                Some(b')') => {
                    self.at += 1;
                    return Ok(arguments);
                }
                Some(b'"') => arguments.push(self.string()?),
                None | Some(b'(' | b'{' | b'}' | b';') => {
                    return Err(self.fault(Fault::UnclosedBracket));
                }
                Some(_) => arguments.push(self.word("(){};,\"\\")),
            }
        }
    }

    /// The rest of a group whose kind is read.
    fn group(&mut self, kind: &'t str, depth: usize) -> Result<Group<'t>, LibertyError> {
        let line = self.line;
        let opens = self.token()? == Some(Token::Mark(b'('));
        if !opens {
            let group = kind.to_owned();
            return Err(self.fault(Fault::NoArguments { group }));
        }
        let arguments = self.arguments()?;
        if self.token()? != Some(Token::Mark(b'{')) {
            let group = kind.to_owned();
            return Err(self.fault(Fault::NoContents { group }));
        }
        self.contents(
            Group {
                kind,
                arguments,
                line,
                attributes: Vec::new(),
                groups: Vec::new(),
            },
            depth,
        )
    }

    /// What is in a group's braces, of which the first is read.
    fn contents(&mut self, mut group: Group<'t>, depth: usize) -> Result<Group<'t>, LibertyError> {
        if depth > DEEPEST {
            return Err(self.fault(Fault::TooDeep { most: DEEPEST }));
        }
        loop {
            let name = match self.token()? {
                Some(Token::Mark(b';')) => continue,
                Some(Token::Mark(b'}')) => return Ok(group),
                Some(Token::Word(name)) => name,
                Some(Token::Mark(mark)) => {
                    let mark = char::from(mark);
                    return Err(self.fault(Fault::UnexpectedMark { mark }));
                }
                None => {
                    return Err(self.fault(Fault::UnclosedGroup {
                        group: group.kind.to_owned(),
                        name: group.name().to_owned(),
                        line: group.line,
                    }));
                }
            };
            let line = self.line;
            match self.token()? {
                Some(Token::Mark(b':')) => {
                    let value = self.simple_value()?;
                    group.attributes.push((name, vec![value]));
                }
                Some(Token::Mark(b'(')) => {
                    let arguments = self.arguments()?;
                    let (at, before) = (self.at, self.line);
                    if self.token()? == Some(Token::Mark(b'{')) {
                        let inner = Group {
                            kind: name,
                            arguments,
                            line,
                            attributes: Vec::new(),
                            groups: Vec::new(),
                        };
                        let inner = self.contents(inner, depth + 1)?;
                        group.groups.push(inner);
                    } else if name == "include_file" {
                        let file = arguments.first().copied().unwrap_or_default();
                        let file = file.to_owned();
                        return Err(LibertyError::new(line, Fault::NotIncluded { file }));
                    } else {
                        (self.at, self.line) = (at, before);
                        group.attributes.push((name, arguments));
                    }
                }
                Some(Token::Mark(b'=')) => {
                    self.simple_value()?;
                }
                _ => {
                    let name = name.to_owned();
                    return Err(self.fault(Fault::LoneName { name }));
                }
            }
        }
    }

    /// A simple attribute's value: quoted, or what stands before its end.
    fn simple_value(&mut self) -> Result<&'t str, LibertyError> {
        let line = self.line;
        self.blanks()?;
        let bytes = self.text.as_bytes();
        if bytes.get(self.at) == Some(&b'"') {
            return self.string();
        }
        let start = self.at;
        while let Some(&byte) = bytes.get(self.at) {
            let next = bytes.get(self.at + 1);
            let is_comment = byte == b'/'
                && match next {
                    Some(b'*') => true,
                    // Not that of http://.
                    Some(b'/') => bytes[self.at - 1].is_ascii_whitespace(),
                    _ => false,
                };
            if is_comment || b";\n}\\".contains(&byte) {
                break;
            }
            if byte == b':' {
                let value = self.text[start..self.at].trim();
                if self.line > line && is_attribute(value) {
                    let next = value.to_owned();
                    return Err(self.fault(Fault::NoValue { next }));
                }
                if let Some(attribute) = last_name(&self.text[start..self.at]) {
                    self.at = start + attribute;
                    break;
                }
            }
            self.at += 1;
        }
        Ok(self.text[start..self.at].trim())
    }
}

/// Where the name of an attribute begins behind a value that no semicolon ends.
fn last_name(text: &str) -> Option<usize> {
    let text = text.trim_end();
    let start = text.rfind(|c: char| c.is_ascii_whitespace())? + 1;
    (is_attribute(&text[start..]) && !text[..start].trim().is_empty()).then_some(start)
}

/// Whether this may be the name of an attribute.
fn is_attribute(name: &str) -> bool {
    let mut name = name.chars();
    name.next().is_some_and(|c| c.is_ascii_alphabetic())
        && name.all(|c| c.is_ascii_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests;
