//! SDF text to [`Sdf`]: the file, its head and its CELLs.

use std::borrow::Cow;

use super::tokens::{Token, Tokens};
use super::{Sdf, SdfCell, SdfHeader, SdfInstance, SkippedEntry};
use crate::InputError;
use crate::units::Time;

const HEADER_TEXTS: [&str; 9] = [
    "SDFVERSION",
    "DESIGN",
    "DATE",
    "VENDOR",
    "PROGRAM",
    "VERSION",
    "PROCESS",
    "VOLTAGE",
    "TEMPERATURE",
];

/// Entries among delays and checks that are not modelled.
const LEFT_OUT: [&str; 11] = [
    "COND",
    "CONDELSE",
    "PATHPULSE",
    "PATHPULSEPERCENT",
    "NETDELAY",
    "PERIOD",
    "SKEW",
    "BIDIRECTSKEW",
    "NOCHANGE",
    "LABEL",
    "TIMINGENV",
];

pub(super) type Result<T> = std::result::Result<T, InputError>;

impl<'a> Sdf<'a> {
    /// Reads a delay file; `source` names it in complaints.
    ///
    /// # Errors
    /// What is malformed or of an unknown kind: line, reason and cure.
    pub fn parse(source: &str, text: &'a str) -> Result<Self> {
        let mut parser = Parser {
            source,
            tokens: Tokens::new(text),
            ahead: None,
            line: 1,
            header: SdfHeader {
                texts: Vec::new(),
                divider: '.',
                timescale: Time::from_ns(1),
            },
            skipped: Vec::new(),
        };
        let cells = parser.file()?;
        Ok(Sdf {
            source: source.to_owned(),
            header: parser.header,
            cells,
            skipped: parser.skipped,
        })
    }
}

pub(super) struct Parser<'a, 's> {
    source: &'s str,
    pub(super) tokens: Tokens<'a>,
    ahead: Option<(Token<'a>, usize)>,
    /// Line of the last token taken.
    pub(super) line: usize,
    pub(super) header: SdfHeader<'a>,
    pub(super) skipped: Vec<SkippedEntry>,
}

impl<'a> Parser<'a, '_> {
    pub(super) fn error<T>(&self, message: impl Into<String>) -> Result<T> {
        Err(InputError::at_line(self.source, self.line, message))
    }

    pub(super) fn peek(&mut self) -> Result<Token<'a>> {
        if self.ahead.is_none() {
            let next = self.tokens.next();
            let next =
                next.map_err(|(line, message)| InputError::at_line(self.source, line, message))?;
            self.ahead = Some(next);
        }
        Ok(self.ahead.map_or(Token::End, |(token, _)| token))
    }

    pub(super) fn next_token(&mut self) -> Result<Token<'a>> {
        let token = self.peek()?;
        if let Some((_, line)) = self.ahead.take() {
            self.line = line;
        }
        Ok(token)
    }

    pub(super) fn unexpected<T>(&self, token: Token<'_>, wanted: &str) -> Result<T> {
        let found = match token {
            Token::Open => "(".to_owned(),
            Token::Close => ")".to_owned(),
            Token::Colon => ":".to_owned(),
            Token::Text(text) => format!("{text:?}"),
            Token::Word(word) => word.chars().take(60).collect(),
            Token::End => "the end of the file".to_owned(),
        };
        self.error(format!(
            "found {found} where {wanted} belongs; give an SDF file, or write this one anew"
        ))
    }

    pub(super) fn is_next(&mut self, token: Token<'_>) -> Result<bool> {
        Ok(self.peek()? == token)
    }

    fn expect(&mut self, token: Token<'_>, name: &str) -> Result<()> {
        match self.next_token()? {
            t if t == token => Ok(()),
            t => self.unexpected(t, name),
        }
    }

    pub(super) fn open(&mut self) -> Result<()> {
        self.expect(Token::Open, "(")
    }

    pub(super) fn close(&mut self) -> Result<()> {
        self.expect(Token::Close, ")")
    }

    pub(super) fn word(&mut self, wanted: &str) -> Result<&'a str> {
        match self.next_token()? {
            Token::Word(word) => Ok(word),
            token => self.unexpected(token, wanted),
        }
    }

    /// `(KEYWORD`, in capitals, or nothing where the list is closed.
    pub(super) fn entry(&mut self) -> Result<Option<String>> {
        if self.is_next(Token::Close)? {
            self.next_token()?;
            return Ok(None);
        }
        self.open()?;
        Ok(Some(self.word("a keyword")?.to_ascii_uppercase()))
    }

    /// Everything up to the parenthesis that closes the present list.
    pub(super) fn skip_list(&mut self) -> Result<()> {
        let mut depth = 1;
        while depth > 0 {
            match self.next_token()? {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                Token::End => return self.unexpected(Token::End, ")"),
                _ => {}
            }
        }
        Ok(())
    }

    /// Leaves out an entry that is known and not modelled; refuses any other.
    pub(super) fn leave_out(&mut self, keyword: &str) -> Result<()> {
        match LEFT_OUT.iter().find(|k| **k == keyword) {
            Some(what) => {
                SkippedEntry::count(&mut self.skipped, what, self.line);
                self.skip_list()
            }
            None => {
                let keyword: String = keyword.chars().take(60).collect();
                self.error(format!(
                    "{keyword} is not an entry of SDF that belongs here; remove it"
                ))
            }
        }
    }

    fn file(&mut self) -> Result<Vec<SdfCell<'a>>> {
        self.open()?;
        if !self.word("DELAYFILE")?.eq_ignore_ascii_case("DELAYFILE") {
            return self.error(
                "this is not an SDF file, which begins with (DELAYFILE; give one that does",
            );
        }
        let mut cells = Vec::new();
        while let Some(keyword) = self.entry()? {
            if keyword == "CELL" {
                cells.push(self.cell()?);
            } else if cells.is_empty() {
                self.header_entry(&keyword)?;
            } else {
                return self.error(format!(
                    "{keyword} follows a CELL; move it to the head of the file"
                ));
            }
        }
        self.expect(Token::End, "the end of the file")?;
        Ok(cells)
    }

    fn header_entry(&mut self, keyword: &str) -> Result<()> {
        match keyword {
            "DIVIDER" => {
                self.header.divider = match self.word("a divider")? {
                    "." => '.',
                    "/" => '/',
                    _ => {
                        return self.error("the divider is neither . nor /; choose one of the two");
                    }
                };
                self.close()
            }
            "TIMESCALE" => {
                let mut text = self.word("a time scale")?.to_owned();
                if let Token::Word(unit) = self.peek()? {
                    text += unit;
                    self.next_token()?;
                }
                let Some(scale) = timescale_fs(&text) else {
                    return self.error(format!(
                        "{text} is not a time scale; give 1, 10 or 100 and s, ms, us, ns, ps or fs"
                    ));
                };
                self.header.timescale = Time::from_fs(scale);
                self.close()
            }
            _ => {
                let Some(name) = HEADER_TEXTS.into_iter().find(|k| *k == keyword) else {
                    return self.leave_out(keyword);
                };
                let mut text = Cow::Borrowed("");
                loop {
                    match self.next_token()? {
                        Token::Close => break,
                        Token::Text(part) | Token::Word(part) if text.is_empty() => {
                            text = Cow::Borrowed(part);
                        }
                        Token::Text(part) | Token::Word(part) => text.to_mut().push_str(part),
                        Token::Colon => text.to_mut().push(':'),
                        token => return self.unexpected(token, ")"),
                    }
                }
                self.header.texts.push((name, text));
                Ok(())
            }
        }
    }

    fn cell(&mut self) -> Result<SdfCell<'a>> {
        let line = self.line;
        self.open()?;
        if !self.word("CELLTYPE")?.eq_ignore_ascii_case("CELLTYPE") {
            return self.error("a CELL begins with (CELLTYPE \"…\"); add its type");
        }
        let cell_type = match self.next_token()? {
            Token::Text(name) => name,
            token => return self.unexpected(token, "a quoted cell type"),
        };
        self.close()?;
        let mut cell = SdfCell {
            line,
            cell_type,
            instance: SdfInstance::Path(Cow::Borrowed("")),
            delays: Vec::new(),
            checks: Vec::new(),
        };
        let mut has_instance = false;
        while let Some(keyword) = self.entry()? {
            match keyword.as_str() {
                "INSTANCE" if has_instance => {
                    return self.error("a second INSTANCE in one CELL; make it a CELL of its own");
                }
                "INSTANCE" => {
                    has_instance = true;
                    if let Token::Word(word) = self.peek()? {
                        self.next_token()?;
                        cell.instance = match word {
                            "*" => SdfInstance::Every,
                            _ => SdfInstance::Path(self.path(word)),
                        };
                    }
                    self.close()?;
                }
                "DELAY" => self.delay_list(&mut cell.delays)?,
                "TIMINGCHECK" => {
                    while let Some(keyword) = self.entry()? {
                        cell.checks.extend(self.check(&keyword)?);
                    }
                }
                other => self.leave_out(other)?,
            }
        }
        Ok(cell)
    }

    pub(super) fn name(&mut self, wanted: &str) -> Result<Cow<'a, str>> {
        let word = self.word(wanted)?;
        Ok(self.path(word))
    }

    /// A path with dots between names and without escapes, except of dots within a name.
    fn path(&self, word: &'a str) -> Cow<'a, str> {
        let divider = self.header.divider;
        if !word.contains(['\\', '/']) && (divider == '.' || !word.contains('.')) {
            return Cow::Borrowed(word);
        }
        let mut path = String::with_capacity(word.len());
        let mut characters = word.chars();
        while let Some(c) = characters.next() {
            match c {
                '\\' => match characters.next() {
                    Some('.') => path += "\\.",
                    Some(escaped) => path.push(escaped),
                    None => path.push('\\'),
                },
                c if c == divider => path.push('.'),
                '.' => path += "\\.",
                c => path.push(c),
            }
        }
        Cow::Owned(path)
    }
}

fn timescale_fs(text: &str) -> Option<i64> {
    let split = text.find(|c: char| c.is_ascii_alphabetic())?;
    let (number, unit) = text.split_at(split);
    let factor = match number {
        "1" | "1.0" => 1,
        "10" | "10.0" => 10,
        "100" | "100.0" => 100,
        _ => return None,
    };
    let unit_fs = match unit.to_ascii_lowercase().as_str() {
        "fs" => 1,
        "ps" => 1_000,
        "ns" => 1_000_000,
        "us" => 1_000_000_000,
        "ms" => 1_000_000_000_000,
        "s" => 1_000_000_000_000_000,
        _ => return None,
    };
    Some(factor * unit_fs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_timescale_of_the_standard_is_known() {
        let units = ["fs", "ps", "ns", "us", "ms", "s"];
        for (unit, thousands) in units.into_iter().zip(0u32..) {
            for (number, factor) in [
                ("1", 1),
                ("1.0", 1),
                ("10", 10),
                ("10.0", 10),
                ("100", 100),
                ("100.0", 100),
            ] {
                let wanted = Some(factor * 1000i64.pow(thousands));
                assert_eq!(
                    timescale_fs(&format!("{number}{unit}")),
                    wanted,
                    "{number}{unit}"
                );
            }
        }
        assert_eq!(["2ps", "1as", "ps", "100"].map(timescale_fs), [None; 4]);
    }
}
