//! The entries of a CELL: delays and timing checks with their numbers.

use std::borrow::Cow;

use super::error::{SdfExpected, SdfFault};
use super::parser::{Parser, Result};
use super::skipped::{SkippedEntry, SkippedKind};
use super::tokens::Token;
use super::{CheckKeyword, DelayPath, PinEdge, SdfCheck, SdfDelay, Triple};
use crate::netlist::Edge;
use crate::units::Time;

/// Longest delay or limit, fs: 4.29 µs, what delays are stored in.
const LONGEST_FS: f64 = u32::MAX as f64;

impl<'a> Parser<'a, '_> {
    pub(super) fn delay_list(&mut self, delays: &mut Vec<SdfDelay<'a>>) -> Result<()> {
        while let Some(keyword) = self.entry()? {
            let increment = match keyword.as_str() {
                "ABSOLUTE" => false,
                "INCREMENT" => true,
                other => {
                    self.leave_out(other)?;
                    continue;
                }
            };
            while let Some(keyword) = self.entry()? {
                let line = self.line;
                let path = match keyword.as_str() {
                    "IOPATH" => {
                        let from = self.pin_edge()?;
                        DelayPath::IoPath(from, self.name(SdfExpected::OutputPin)?)
                    }
                    "DEVICE" => DelayPath::Device(match self.peek()? {
                        Token::Word(_) => Some(self.name(SdfExpected::OutputPin)?),
                        _ => None,
                    }),
                    "PORT" => DelayPath::Port(self.name(SdfExpected::InputPin)?),
                    "INTERCONNECT" => {
                        let from = self.name(SdfExpected::DrivingPin)?;
                        DelayPath::Interconnect(from, self.name(SdfExpected::DrivenPin)?)
                    }
                    other => {
                        self.leave_out(other)?;
                        continue;
                    }
                };
                let (rise, fall) = self.rise_and_fall(increment)?;
                delays.push(SdfDelay {
                    line,
                    increment,
                    path,
                    rise,
                    fall,
                });
            }
        }
        Ok(())
    }

    /// The values of a delay and the parenthesis that ends it: 1, 2, 3, 6 or 12 of them, of which the first two
    /// are 0 to 1 and 1 to 0.
    fn rise_and_fall(&mut self, may_be_negative: bool) -> Result<(Triple, Triple)> {
        let mut values = Vec::new();
        while self.is_next(Token::Open)? {
            self.next_token()?;
            if matches!(self.peek()?, Token::Word(w) if w.eq_ignore_ascii_case("RETAIN")) {
                SkippedEntry::count(&mut self.skipped, SkippedKind::Retain, self.line);
                self.skip_list()?;
                continue;
            }
            let value = if self.is_next(Token::Open)? {
                self.next_token()?;
                let value = self.triple()?;
                if !self.is_next(Token::Close)? {
                    SkippedEntry::count(&mut self.skipped, SkippedKind::PulseLimits, self.line);
                }
                self.skip_list()?;
                value
            } else {
                self.triple()?
            };
            if !may_be_negative && value.0.iter().flatten().any(|&time| time < Time::ZERO) {
                return self.error(SdfFault::NegativeDelay);
            }
            values.push(value);
            if values.len() > 12 {
                return self.error(SdfFault::TooManyValues);
            }
        }
        self.close()?;
        if values.len() > 2 {
            SkippedEntry::count(&mut self.skipped, SkippedKind::OtherTransitions, self.line);
        }
        match values[..] {
            [] => self.error(SdfFault::NoValue),
            [both] => Ok((both, both)),
            [rise, fall, ..] => Ok((rise, fall)),
        }
    }

    /// `min:typ:max)`, `typ)` or `)`, with or without members; the parenthesis is taken.
    fn triple(&mut self) -> Result<Triple> {
        let mut members = [None; 3];
        let mut at = 0;
        loop {
            match self.next_token()? {
                Token::Close => break,
                Token::Colon if at < 2 => at += 1,
                Token::Word(word) if members[at].is_none() => {
                    members[at] = Some(Time::from_fs(self.number(word)?));
                }
                token => return self.unexpected(token, SdfExpected::Value),
            }
        }
        match at {
            0 => Ok(Triple([members[0]; 3])),
            1 => self.error(SdfFault::TwoNumbers),
            _ => Ok(Triple(members)),
        }
    }

    fn number(&self, word: &str) -> Result<i64> {
        let is_decimal = word
            .bytes()
            .all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'));
        let Some(value) = word.parse::<f64>().ok().filter(|_| is_decimal) else {
            return self.unexpected(Token::Word(word), SdfExpected::Number);
        };
        // Below 2³² fs, 53 bits hold every decimal fraction to far less than half a femtosecond.
        let fs = value * self.header.timescale.as_fs() as f64;
        if fs.is_finite() && fs.abs() <= LONGEST_FS {
            Ok(fs.round() as i64)
        } else {
            let number = word.to_owned();
            self.error(SdfFault::NumberTooLarge { number })
        }
    }

    /// `PIN`, `(posedge PIN)` or `(negedge PIN)`.
    fn pin_edge(&mut self) -> Result<PinEdge<'a>> {
        if !self.is_next(Token::Open)? {
            let pin = self.name(SdfExpected::Pin)?;
            return Ok(PinEdge { edge: None, pin });
        }
        self.next_token()?;
        let edge = match self.word(SdfExpected::Edge)?.to_ascii_lowercase().as_str() {
            "posedge" | "01" => Edge::Rise,
            "negedge" | "10" => Edge::Fall,
            _ => return self.error(SdfFault::UnknownEdge),
        };
        let pin = self.name(SdfExpected::Pin)?;
        self.close()?;
        let edge = Some(edge);
        Ok(PinEdge { edge, pin })
    }

    pub(super) fn check(&mut self, keyword: &str) -> Result<Option<SdfCheck<'a>>> {
        let Some(kind) = CheckKeyword::ALL
            .into_iter()
            .find(|k| k.keyword() == keyword)
        else {
            self.leave_out(keyword)?;
            return Ok(None);
        };
        let line = self.line;
        let mut conditional = false;
        let pin = self.check_pin(&mut conditional)?;
        let reference = match kind {
            CheckKeyword::Width => None,
            _ => Some(self.check_pin(&mut conditional)?),
        };
        let mut limits = [Triple::default(); 2];
        for limit in &mut limits[..kind.limits()] {
            self.open()?;
            *limit = self.triple()?;
        }
        while let Some(keyword) = self.entry()? {
            if !matches!(keyword.as_str(), "SCOND" | "CCOND") {
                return self.error(SdfFault::EntryInCheck { keyword });
            }
            conditional = true;
            self.skip_list()?;
        }
        // A check that holds only sometimes must not become one that always does.
        if conditional {
            SkippedEntry::count(&mut self.skipped, SkippedKind::Cond, line);
            return Ok(None);
        }
        Ok(Some(SdfCheck {
            line,
            kind,
            pin,
            reference,
            limits,
        }))
    }

    /// A pin of a check; one with a condition is passed over.
    fn check_pin(&mut self, conditional: &mut bool) -> Result<PinEdge<'a>> {
        if self.is_next(Token::Open)? {
            // Whether a condition follows shows only behind the parenthesis: look there on a copy.
            let mut beyond = self.tokens.clone();
            if matches!(beyond.next(), Ok((Token::Word(w), _)) if w.eq_ignore_ascii_case("COND")) {
                *conditional = true;
                self.next_token()?;
                self.skip_list()?;
                let pin = Cow::Borrowed("");
                return Ok(PinEdge { edge: None, pin });
            }
        }
        self.pin_edge()
    }
}
