//! Boolean expressions of Liberty files (`function`, `next_state`, `clear` …) as truth tables.
//!
//! `!` and a following `'` invert, `*`, `&` and blanks between operands are AND, `^` is exclusive OR, `+` and `|` are OR; they
//! bind in this order. A name that is none elsewhere, such as `1A`, stands between escaped quotation marks.

/// The values of a function of up to six inputs: bit i is that for inputs whose bits make i, the first input the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TruthTable {
    pub inputs: u32,
    pub bits: u64,
}

impl TruthTable {
    /// Most inputs.
    pub(super) const MOST: usize = 6;

    fn mask(inputs: u32) -> u64 {
        if inputs == 6 {
            u64::MAX
        } else {
            (1 << (1 << inputs)) - 1
        }
    }

    /// A function given by its value for packed inputs.
    pub(super) fn from_fn(inputs: u32, value: impl Fn(u32) -> bool) -> Self {
        let bits = (0..1 << inputs).fold(0, |bits, i| bits | u64::from(value(i)) << i);
        TruthTable { inputs, bits }
    }

    /// The function where an input is 0, and where it is 1.
    pub(crate) fn cofactors(self, input: usize) -> [Self; 2] {
        [0, 1].map(|value| {
            TruthTable::from_fn(self.inputs, |i| {
                self.value(i & !(1 << input) | value << input)
            })
        })
    }

    /// The value of a function that has only one.
    #[cfg(feature = "yosys")]
    pub(crate) fn constant(self) -> Option<bool> {
        [false, true]
            .into_iter()
            .find(|&value| self == TruthTable::from_fn(self.inputs, |_| value))
    }

    /// Its value for packed inputs.
    pub(super) fn value(self, inputs: u32) -> bool {
        self.bits >> inputs & 1 == 1
    }

    /// The inverse function.
    pub(crate) fn inverted(self) -> Self {
        TruthTable {
            bits: !self.bits & Self::mask(self.inputs),
            ..self
        }
    }

    /// Whether an input's rise can make the output rise, and fall.
    pub(super) fn unate(self, input: u32) -> (bool, bool) {
        let mut can = (false, false);
        for low in (0..1 << self.inputs).filter(|i| i >> input & 1 == 0) {
            let (before, after) = (self.value(low), self.value(low | 1 << input));
            can.0 |= !before && after;
            can.1 |= before && !after;
        }
        can
    }

    /// The function as one of `names`, if it is nothing but that input: its index, and whether it is inverted.
    pub(crate) fn literal(self) -> Option<(usize, bool)> {
        (0..self.inputs as usize).find_map(|input| {
            let same = TruthTable::from_fn(self.inputs, |i| i >> input & 1 == 1);
            let mask = Self::mask(self.inputs);
            match self.bits {
                bits if bits == same.bits => Some((input, false)),
                bits if bits == !same.bits & mask => Some((input, true)),
                _ => None,
            }
        })
    }
}

/// The truth table of an expression over `names`; `None` where it names something else, has too many inputs or is malformed.
pub(super) fn truth_table(text: &str, names: &[&str]) -> Option<TruthTable> {
    if names.len() > TruthTable::MOST {
        return None;
    }
    let inputs = names.len() as u32;
    let mut parser = Parser {
        rest: text,
        names,
        inputs,
        depth: 0,
    };
    let bits = parser.or()?;
    parser.rest.trim().is_empty().then_some(TruthTable {
        inputs,
        bits: bits & TruthTable::mask(inputs),
    })
}

struct Parser<'t> {
    rest: &'t str,
    names: &'t [&'t str],
    inputs: u32,
    depth: u32,
}

impl Parser<'_> {
    fn next(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn skip(&mut self) {
        self.rest = &self.rest[1..];
    }

    fn or(&mut self) -> Option<u64> {
        let mut bits = self.xor()?;
        while matches!(self.next(), Some('+' | '|')) {
            self.skip();
            bits |= self.xor()?;
        }
        Some(bits)
    }

    fn xor(&mut self) -> Option<u64> {
        let mut bits = self.and()?;
        while self.next() == Some('^') {
            self.skip();
            bits ^= self.and()?;
        }
        Some(bits)
    }

    fn and(&mut self) -> Option<u64> {
        let mut bits = self.inverted()?;
        loop {
            match self.next() {
                Some('*' | '&') => self.skip(),
                Some(c) if "!(\\".contains(c) || is_name(c) => {}
                _ => return Some(bits),
            }
            bits &= self.inverted()?;
        }
    }

    fn inverted(&mut self) -> Option<u64> {
        let mut inverts = false;
        while self.next() == Some('!') {
            self.skip();
            inverts = !inverts;
        }
        let mut bits = self.operand()?;
        while self.next() == Some('\'') {
            self.skip();
            inverts = !inverts;
        }
        if inverts {
            bits = !bits;
        }
        Some(bits)
    }

    fn operand(&mut self) -> Option<u64> {
        if self.next()? == '(' {
            self.depth += 1;
            if self.depth > 64 {
                return None;
            }
            self.skip();
            let bits = self.or()?;
            self.depth -= 1;
            return (self.next()? == ')').then(|| {
                self.skip();
                bits
            });
        }
        if let Some(quoted) = self.rest.strip_prefix("\\\"") {
            let (name, rest) = quoted.split_once("\\\"")?;
            self.rest = rest;
            return self.input(name);
        }
        let end = self.rest.find(|c| !is_name(c)).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        match name {
            "0" => Some(0),
            "1" => Some(u64::MAX),
            name => self.input(name),
        }
    }

    fn input(&self, name: &str) -> Option<u64> {
        let input = self.names.iter().position(|known| *known == name)?;
        Some(TruthTable::from_fn(self.inputs, |i| i >> input & 1 == 1).bits)
    }
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || "_[].".contains(c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operators_bind_as_liberty_says() {
        let table = |text| truth_table(text, &["A", "B", "S"]).unwrap();
        let expected = |value: fn(bool, bool, bool) -> bool| {
            TruthTable::from_fn(3, |i| value(i & 1 == 1, i & 2 != 0, i & 4 != 0))
        };
        assert_eq!(table("(A*B)+(!S)"), expected(|a, b, s| a & b | !s));
        assert_eq!(table("A & !S | B S"), expected(|a, b, s| a & !s | b & s));
        assert_eq!(
            table("A' + B ^ S A"),
            expected(|a, b, s| !a | (b ^ (s & a)))
        );
        assert_eq!(table("(!(S))"), expected(|_, _, s| !s));
        assert_eq!(table("1"), expected(|_, _, _| true));
        assert_eq!(table("0"), expected(|_, _, _| false));
        assert_eq!(table("A 0 + B"), expected(|_, b, _| b));
        let quoted = truth_table(r#"\"1\" !\"B 2\" S"#, &["1", "B 2", "S"]);
        assert_eq!(quoted, Some(expected(|a, b, s| a & !b & s)));
        // As many inputs as a table has.
        let names = ["A", "B", "C", "D", "E", "F", "G"];
        let tables = [6, 7].map(|n| truth_table("A", &names[..n]).is_some());
        assert_eq!(tables, [true, false]);
        for bad in ["A +", "Q", "(A", "A)", "", "A B +", "*A", "\\\"A", "A \\B"] {
            assert_eq!(truth_table(bad, &["A", "B", "S"]), None, "{bad}");
        }
    }

    #[test]
    fn brackets_stand_64_deep_and_as_often_as_one_likes() {
        let of_a = |text: &str| truth_table(text, &["A"]);
        let deep = |depth: usize| format!("{}A{}", "(".repeat(depth), ")".repeat(depth));
        assert_eq!((of_a(&deep(64)), of_a(&deep(65))), (of_a("A"), None));
        assert_eq!(of_a(&vec!["(A)"; 200].join("*")), of_a("A"));
    }

    #[test]
    fn unateness_and_literals_follow() {
        let xor = truth_table("A ^ B", &["A", "B"]).unwrap();
        assert_eq!(xor.unate(0), (true, true));
        let nand = truth_table("!(A B)", &["A", "B"]).unwrap();
        assert_eq!(nand.unate(1), (false, true));
        let literal = |text| truth_table(text, &["D", "SE"]).unwrap().literal();
        assert_eq!(literal("!SE"), Some((1, true)));
        assert_eq!(literal("D"), Some((0, false)));
        assert_eq!(literal("D SE"), None);
    }
}
