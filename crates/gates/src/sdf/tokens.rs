//! SDF text as tokens with line numbers.

use super::error::SdfFault;

/// One token; words keep their escapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Token<'a> {
    Open,
    Close,
    Colon,
    /// Contents of a quoted string.
    Text(&'a str),
    /// Keyword, identifier, path, number or operator.
    Word(&'a str),
    End,
}

/// Reads tokens; white space and comments (`//` to the end of the line, nesting `/* */`) lie between them.
#[derive(Clone)]
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
    line: usize,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Tokens {
            text,
            at: 0,
            line: 1,
        }
    }

    fn rest(&self) -> &'a [u8] {
        &self.text.as_bytes()[self.at..]
    }

    fn step(&mut self, bytes: usize) {
        let passed = &self.rest()[..bytes];
        self.line += passed.iter().filter(|&&b| b == b'\n').count();
        self.at += bytes;
    }

    /// The next token and its line, or the line and what is wrong.
    pub(super) fn next(&mut self) -> Result<(Token<'a>, usize), (usize, SdfFault)> {
        self.skip_blanks()?;
        let line = self.line;
        let single = |this: &mut Self, token| {
            this.step(1);
            Ok((token, line))
        };
        match self.rest().first() {
            None => Ok((Token::End, line)),
            Some(b'(') => single(self, Token::Open),
            Some(b')') => single(self, Token::Close),
            Some(b':') => single(self, Token::Colon),
            Some(b'"') => {
                let start = self.at + 1;
                let Some(length) = self.text[start..].find('"') else {
                    return Err((line, SdfFault::UnclosedText));
                };
                self.step(length + 2);
                Ok((Token::Text(&self.text[start..start + length]), line))
            }
            Some(_) => {
                let length = self.word_length();
                let word = &self.text[self.at..self.at + length];
                self.step(length);
                Ok((Token::Word(word), line))
            }
        }
    }

    /// At least 1, and at the border of a character: every byte that ends a word is ASCII.
    fn word_length(&self) -> usize {
        let rest = self.rest();
        let mut length = 0;
        while let Some(&byte) = rest.get(length) {
            match byte {
                // The escaped character may be of several bytes; the others are word bytes anyway.
                b'\\'
                    if rest
                        .get(length + 1)
                        .is_some_and(|b| !b.is_ascii_whitespace()) =>
                {
                    length += 2;
                }
                b'(' | b')' | b':' | b'"' => break,
                b if b.is_ascii_whitespace() => break,
                b'/' if length > 0 && matches!(rest.get(length + 1), Some(b'/' | b'*')) => break,
                _ => length += 1,
            }
        }
        length
    }

    fn skip_blanks(&mut self) -> Result<(), (usize, SdfFault)> {
        loop {
            match self.rest() {
                [b, ..] if b.is_ascii_whitespace() => self.step(1),
                [b'/', b'/', ..] => {
                    let rest = self.rest();
                    let end = rest.iter().position(|&b| b == b'\n');
                    self.step(end.unwrap_or(rest.len()));
                }
                [b'/', b'*', ..] => self.skip_comment()?,
                _ => return Ok(()),
            }
        }
    }

    fn skip_comment(&mut self) -> Result<(), (usize, SdfFault)> {
        let line = self.line;
        let mut depth = 0;
        loop {
            match self.rest() {
                [b'/', b'*', ..] => {
                    depth += 1;
                    self.step(2);
                }
                [b'*', b'/', ..] => {
                    depth -= 1;
                    self.step(2);
                    if depth == 0 {
                        return Ok(());
                    }
                }
                [] => return Err((line, SdfFault::UnclosedComment)),
                _ => self.step(1),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_nest_and_lines_are_counted() {
        let text = "(A // x\n/* 1 /* 2\n */ */ b\\/c \"t\nu\":1/*x*/)";
        let mut tokens = Tokens::new(text);
        let mut all = Vec::new();
        loop {
            let (token, line) = tokens.next().unwrap();
            if token == Token::End {
                break;
            }
            all.push((token, line));
        }
        assert_eq!(
            all,
            [
                (Token::Open, 1),
                (Token::Word("A"), 1),
                (Token::Word("b\\/c"), 3),
                (Token::Text("t\nu"), 3),
                (Token::Colon, 4),
                (Token::Word("1"), 4),
                (Token::Close, 4),
            ]
        );
    }
}
