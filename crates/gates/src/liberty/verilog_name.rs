//! Names of a library's cells and pins in Verilog: plain where they may be, and else escaped.
//!
//! A name that a foundry gave may be a keyword (`and`, `buf`) or have any sign in it. Escaped names may have all that is printed
//! but blanks (IEEE 1364-2005, 3.7.1).

/// Whether Verilog can have this name, escaped or not.
pub(super) fn is_possible(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_graphic())
}

/// The name as Verilog has it, with the blank that ends an escaped one.
pub(super) fn in_verilog(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let begins = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    // Keywords have small letters and digits alone; so may other names, which are none the worse for being escaped.
    let may_be_keyword = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    if begins && name.chars().all(plain) && !name.chars().all(may_be_keyword) {
        name.to_owned()
    } else {
        format!("\\{name} ")
    }
}

/// A name as SDF has it: signs other than letters, digits and `_` are preceded by a backslash.
pub(super) fn in_sdf(name: &str) -> String {
    let special = |c: char| !(c.is_ascii_alphanumeric() || c == '_');
    name.chars().fold(String::new(), |mut text, c| {
        text.extend(special(c).then_some('\\'));
        text.push(c);
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_where_they_must_be() {
        for (name, verilog, sdf) in [
            ("INV_1", "INV_1", "INV_1"),
            ("_x", "_x", "_x"),
            ("buf", "\\buf ", "buf"),
            ("1inv", "\\1inv ", "1inv"),
            ("A[0]", "\\A[0] ", "A\\[0\\]"),
            ("nand\"2", "\\nand\"2 ", "nand\\\"2"),
        ] {
            assert_eq!(
                (in_verilog(name), in_sdf(name)),
                (verilog.to_owned(), sdf.to_owned())
            );
            assert!(is_possible(name));
        }
        for name in ["", "a b", "a\nb", "a\u{7f}", "ü"] {
            assert!(!is_possible(name), "{name:?}");
        }
    }
}
