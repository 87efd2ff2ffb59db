//! What is read of a file, where values end, and what is no Liberty.

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
fn what_ends_a_value_is_no_part_of_it() {
    let text = "library (l) {
  a : clear /* x */;  b : 3 // y
  c : rising_edge/* of
  two lines */;
  d : 1 e : 2;
  f /* g */ : /* h */ \"i\" /* ; */ ;
  j : 4 \\
  ;
  k : 12 May 12:30:00;
  at : http://x;
  t (1 /* a */, 2/* b */, /* c */3);
  v = 1.5; w=2;
  cell (X/* y */) { area : 1 } ;
};;
";
    let library = read(text).unwrap();
    for (name, value) in [
        ("a", "clear"),
        ("b", "3"),
        ("c", "rising_edge"),
        ("d", "1"),
        ("e", "2"),
        ("f", "i"),
        ("j", "4"),
        ("k", "12 May 12:30:00"),
        ("at", "http://x"),
    ] {
        assert_eq!(library.value(name), Some(value), "{name}");
    }
    assert_eq!(library.values("t"), Some(&["1", "2", "3"][..]));
    let cell = library.of_kind("cell").next().unwrap();
    assert_eq!((cell.name(), cell.line), ("X", 13));
    assert_eq!(cell.number("area").unwrap(), Some(1.0));
}

#[test]
fn names_have_colons_and_brackets_and_one_group_is_of_several_pins() {
    let text = "library (l) { cell (a:b) {
  pin (A[3:0]) { x : 1; }
  pin (B, \"C\" D) { x : 2; }
  when : \"\\\"1A\\\" & B\";
} }";
    let library = read(text).unwrap();
    let cell = library.of_kind("cell").next().unwrap();
    assert_eq!(cell.name(), "a:b");
    assert_eq!(cell.value("when"), Some("\\\"1A\\\" & B"));
    let pins: Vec<_> = cell
        .pins()
        .map(|(name, pin)| (name, pin.value("x")))
        .collect();
    let [one, two] = [Some("1"), Some("2")];
    assert_eq!(pins, [("A[3:0]", one), ("B", two), ("C", two), ("D", two)]);
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
        ("library (l) {\n a :\n b : 3;\n}", 3),
        // A value has no comment within it.
        ("library (l) {\n a : b /* c */ d;\n}", 2),
        ("library (l) {\n a : b \\\n d;\n}", 3),
        // The string of a path that ends in a backslash does not take in the next line.
        ("library (l) {\n a : \"C:\\\";\n b : \"c\";\n}", 2),
        ("library (l) {\n\n include_file (\"a.lib\");\n}", 3),
        ("library (l) { /\n}", 2),
        ("", 1),
        // A vertical tab and another alphabet's blank are no blanks here, and end no word.
        ("library (l) { a (\u{b}", 1),
        ("library (l) { a (\u{2003}", 1),
    ] {
        assert_eq!(read(text).unwrap_err().line, line, "{text}");
    }
    let library = read("library (l) {\n area : wide; }").unwrap();
    assert!(
        library
            .number("area")
            .unwrap_err()
            .to_string()
            .contains("wide")
    );
    let deep = |groups: usize| {
        format!(
            "library (l) {{ {}{} }}",
            "g () { ".repeat(groups),
            "}".repeat(groups)
        )
    };
    assert!(read(&deep(DEEPEST)).is_ok());
    for groups in [DEEPEST + 1, 10_000] {
        assert!(
            read(&deep(groups))
                .unwrap_err()
                .to_string()
                .contains("deep")
        );
    }
}
