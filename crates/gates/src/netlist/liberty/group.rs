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
//! Nothing is copied: names and values are parts of the text. A value is looked at only by who asks for it, so that a library
//! of 12 MB is read in a tenth of a second, nearly all of whose numbers belong to cells that no chip here has.
//!
//! Source: the Liberty user guide, volume 1 (Synopsys, open source). `define` and the attributes of vendors are read as any
//! others and mean nothing.

use super::error::LibertyError;

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
        number.ok_or_else(|| LibertyError {
            line: self.line,
            message: format!(
                "{name} of this {} is {text:?}, which is not a number",
                self.kind
            ),
        })
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
        _ => {
            return Err(
                reader.fault("the file does not begin with library (NAME) {; give a Liberty file")
            );
        }
    };
    match reader.token()? {
        None => Ok(library),
        Some(_) => Err(reader.fault("something follows the library's closing brace")),
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
    fn fault(&self, message: impl Into<String>) -> LibertyError {
        LibertyError {
            line: self.line,
            message: message.into(),
        }
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
                        return Err(self.fault("a comment has no end"));
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

    fn token(&mut self) -> Result<Option<Token<'t>>, LibertyError> {
        self.blanks()?;
        let rest = &self.text[self.at..];
        let Some(&first) = rest.as_bytes().first() else {
            return Ok(None);
        };
        if first == b'"' {
            let Some(end) = rest[1..].find('"') else {
                return Err(self.fault("a quotation mark has no partner"));
            };
            let word = &rest[1..=end];
            self.line += word.matches('\n').count();
            self.at += end + 2;
            return Ok(Some(Token::Word(word)));
        }
        if b"(){}:;,".contains(&first) {
            self.at += 1;
            return Ok(Some(Token::Mark(first)));
        }
        // What ends a word is passed over by `blanks` or a token itself, so that there is no empty word.
        let ends = |c: char| c.is_ascii_whitespace() || "(){}:;,\"\\".contains(c);
        let end = rest.find(ends).unwrap_or(rest.len());
        self.at += end;
        Ok(Some(Token::Word(&rest[..end])))
    }

    /// Arguments up to the closing bracket; the opening one is read.
    fn arguments(&mut self) -> Result<Vec<&'t str>, LibertyError> {
        let mut arguments = Vec::new();
        loop {
            match self.token()? {
                Some(Token::Word(word)) => arguments.push(word),
                Some(Token::Mark(b',')) => {}
                Some(Token::Mark(b')')) => return Ok(arguments),
                _ => return Err(self.fault("a bracket has no partner")),
            }
        }
    }

    /// The rest of a group whose kind is read.
    fn group(&mut self, kind: &'t str, depth: usize) -> Result<Group<'t>, LibertyError> {
        let line = self.line;
        let opens = self.token()? == Some(Token::Mark(b'('));
        if !opens {
            return Err(self.fault(format!("{kind} has no arguments in brackets")));
        }
        let arguments = self.arguments()?;
        if self.token()? != Some(Token::Mark(b'{')) {
            return Err(self.fault(format!("{kind} has no contents in braces")));
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
            return Err(self.fault(format!("groups are more than {DEEPEST} deep")));
        }
        loop {
            let name = match self.token()? {
                Some(Token::Mark(b';')) => continue,
                Some(Token::Mark(b'}')) => return Ok(group),
                Some(Token::Word(name)) => name,
                Some(Token::Mark(mark)) => {
                    return Err(self.fault(format!("{:?} is not expected here", char::from(mark))));
                }
                None => {
                    let (kind, name, line) = (group.kind, group.name(), group.line);
                    return Err(self.fault(format!(
                        "the {kind} {name} of line {line} has no closing brace"
                    )));
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
                    } else {
                        (self.at, self.line) = (at, before);
                        group.attributes.push((name, arguments));
                    }
                }
                _ => return Err(self.fault(format!("{name} is neither an attribute nor a group"))),
            }
        }
    }

    /// A simple attribute's value: quoted, or what stands before the semicolon or the end of the line.
    fn simple_value(&mut self) -> Result<&'t str, LibertyError> {
        self.blanks()?;
        if self.text.as_bytes().get(self.at) == Some(&b'"')
            && let Some(Token::Word(value)) = self.token()?
        {
            return Ok(value);
        }
        let rest = &self.text[self.at..];
        let end = rest.find([';', '\n', '}']).unwrap_or(rest.len());
        self.at += end;
        Ok(rest[..end].trim())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_attributes_and_continued_lines_are_read() {
        let text = "/* a\n b */ library (l) {\n  time_unit : \"1ns\";\n  area /* um2 */ : 3.5 ;\n  t (\"1, 2\", \\\n     \"3\");\n  cell (\"X\") { pin(A) { direction : input; } } // end\n}\n";
        let library = read(text).unwrap();
        assert_eq!((library.name(), library.line), ("l", 2));
        assert_eq!(library.value("time_unit"), Some("1ns"));
        assert_eq!(library.number("area").unwrap(), Some(3.5));
        assert_eq!(library.numbers("t").unwrap(), Some(vec![1.0, 2.0, 3.0]));
        let cell = library.of_kind("cell").next().unwrap();
        assert_eq!((cell.name(), cell.line), ("X", 7));
        assert_eq!(cell.groups[0].value("direction"), Some("input"));
    }

    #[test]
    fn what_is_no_liberty_is_told_with_its_line() {
        for (text, line) in [
            ("module x;", 1),
            ("library (l) {\n cell (a) {\n", 3),
            ("library (l) {\n a : \"b;\n}", 2),
            ("library (l) {\n a b;\n}", 2),
            ("library (l) { }\n}", 2),
            ("library (l) { a (1 ; }", 1),
            ("library (l) { /\n}", 2),
            ("", 1),
            // A vertical tab and another alphabet's blank are no blanks here, and end no word.
            ("library (l) { a (\u{b}", 1),
            ("library (l) { a (\u{2003}", 1),
        ] {
            assert_eq!(read(text).unwrap_err().line, line, "{text}");
        }
        let library = read("library (l) {\n area : wide; }").unwrap();
        assert!(library.number("area").unwrap_err().message.contains("wide"));
        let deep = |groups: usize| {
            format!(
                "library (l) {{ {}{} }}",
                "g () { ".repeat(groups),
                "}".repeat(groups)
            )
        };
        assert!(read(&deep(DEEPEST)).is_ok());
        for groups in [DEEPEST + 1, 10_000] {
            assert!(read(&deep(groups)).unwrap_err().message.contains("deep"));
        }
    }
}
