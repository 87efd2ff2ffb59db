//! SDF text to [`Sdf`]: the file, its head and its CELLs.

use std::borrow::Cow;

use super::error::{SdfError, SdfExpected, SdfFault, SdfToken};
use super::skipped::{SkippedEntry, SkippedKind};
use super::tokens::{Token, Tokens};
use super::{Sdf, SdfCell, SdfHeader, SdfInstance};
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

pub(super) type Result<T> = std::result::Result<T, SdfError>;

impl<'a> Sdf<'a> {
    /// Reads a delay file; `source` names it in complaints.
    ///
    /// # Errors
    /// What is malformed or of an unknown kind, with its line.
    ///
    /// # Example
    ///
    /// ```
    /// use femtogate::sdf::{Sdf, SdfFault};
    ///
    /// let error = Sdf::parse("layout.sdf", "(DELAYFILE\n  (DIVIDER x))").unwrap_err();
    /// assert_eq!((error.line, &error.fault), (2, &SdfFault::UnknownDivider));
    /// assert_eq!(
    ///     error.to_string(),
    ///     "layout.sdf:2: the divider is neither . nor /; choose one of the two"
    /// );
    /// ```
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
    pub(super) fn error<T>(&self, fault: SdfFault) -> Result<T> {
        Err(self.error_at(self.line, fault))
    }

    fn error_at(&self, line: usize, fault: SdfFault) -> SdfError {
        SdfError {
            source_name: self.source.to_owned(),
            line,
            fault,
        }
    }

    pub(super) fn peek(&mut self) -> Result<Token<'a>> {
        if self.ahead.is_none() {
            let next = self.tokens.next();
            let next = next.map_err(|(line, fault)| self.error_at(line, fault))?;
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

    pub(super) fn unexpected<T>(&self, token: Token<'_>, expected: SdfExpected) -> Result<T> {
        let found = match token {
            Token::Open => SdfToken::Open,
            Token::Close => SdfToken::Close,
            Token::Colon => SdfToken::Colon,
            Token::Text(text) => SdfToken::Text(text.to_owned()),
            Token::Word(word) => SdfToken::Word(beginning(word)),
            Token::End => SdfToken::End,
        };
        self.error(SdfFault::UnexpectedToken { found, expected })
    }

    pub(super) fn is_next(&mut self, token: Token<'_>) -> Result<bool> {
        Ok(self.peek()? == token)
    }

    fn expect(&mut self, token: Token<'_>, expected: SdfExpected) -> Result<()> {
        match self.next_token()? {
            t if t == token => Ok(()),
            t => self.unexpected(t, expected),
        }
    }

    pub(super) fn open(&mut self) -> Result<()> {
        self.expect(Token::Open, SdfExpected::Open)
    }

    pub(super) fn close(&mut self) -> Result<()> {
        self.expect(Token::Close, SdfExpected::Close)
    }

    pub(super) fn word(&mut self, expected: SdfExpected) -> Result<&'a str> {
        match self.next_token()? {
            Token::Word(word) => Ok(word),
            token => self.unexpected(token, expected),
        }
    }

    /// Takes a word, and says whether it is this keyword.
    fn is_keyword(&mut self, keyword: &'static str) -> Result<bool> {
        let word = self.word(SdfExpected::Keyword(keyword))?;
        Ok(word.eq_ignore_ascii_case(keyword))
    }

    /// `(KEYWORD`, in capitals, or nothing where the list is closed.
    pub(super) fn entry(&mut self) -> Result<Option<String>> {
        if self.is_next(Token::Close)? {
            self.next_token()?;
            return Ok(None);
        }
        self.open()?;
        Ok(Some(
            self.word(SdfExpected::AnyKeyword)?.to_ascii_uppercase(),
        ))
    }

    /// Everything up to the parenthesis that closes the present list.
    pub(super) fn skip_list(&mut self) -> Result<()> {
        let mut depth = 1;
        while depth > 0 {
            match self.next_token()? {
                Token::Open => depth += 1,
                Token::Close => depth -= 1,
                Token::End => return self.unexpected(Token::End, SdfExpected::Close),
                _ => {}
            }
        }
        Ok(())
    }

    /// Leaves out an entry that is known and not modelled; refuses any other.
    pub(super) fn leave_out(&mut self, keyword: &str) -> Result<()> {
        match SkippedKind::from_keyword(keyword) {
            Some(kind) => {
                SkippedEntry::count(&mut self.skipped, kind, self.line);
                self.skip_list()
            }
            None => self.error(SdfFault::UnknownEntry {
                keyword: beginning(keyword),
            }),
        }
    }

    fn file(&mut self) -> Result<Vec<SdfCell<'a>>> {
        self.open()?;
        if !self.is_keyword("DELAYFILE")? {
            return self.error(SdfFault::NoDelayFile);
        }
        let mut cells = Vec::new();
        while let Some(keyword) = self.entry()? {
            if keyword == "CELL" {
                cells.push(self.cell()?);
            } else if cells.is_empty() {
                self.header_entry(&keyword)?;
            } else {
                return self.error(SdfFault::EntryAfterCell { keyword });
            }
        }
        self.expect(Token::End, SdfExpected::End)?;
        Ok(cells)
    }

    fn header_entry(&mut self, keyword: &str) -> Result<()> {
        match keyword {
            "DIVIDER" => {
                self.header.divider = match self.word(SdfExpected::Divider)? {
                    "." => '.',
                    "/" => '/',
                    _ => return self.error(SdfFault::UnknownDivider),
                };
                self.close()
            }
            "TIMESCALE" => {
                let mut text = self.word(SdfExpected::Timescale)?.to_owned();
                if let Token::Word(unit) = self.peek()? {
                    text += unit;
                    self.next_token()?;
                }
                let Some(scale) = timescale_fs(&text) else {
                    return self.error(SdfFault::UnknownTimescale { text });
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
                        token => return self.unexpected(token, SdfExpected::Close),
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
        if !self.is_keyword("CELLTYPE")? {
            return self.error(SdfFault::NoCellType);
        }
        let cell_type = match self.next_token()? {
            Token::Text(name) => name,
            token => return self.unexpected(token, SdfExpected::CellType),
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
                "INSTANCE" if has_instance => return self.error(SdfFault::SecondInstance),
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

    pub(super) fn name(&mut self, expected: SdfExpected) -> Result<Cow<'a, str>> {
        let word = self.word(expected)?;
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

/// As much of a word as a sentence has room for.
fn beginning(word: &str) -> String {
    word.chars().take(60).collect()
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
