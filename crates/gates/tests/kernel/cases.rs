//! How many random cases a test takes.

/// As many as usual, or `GDTOF_CASES`.
pub fn cases(usual: u32) -> u32 {
    std::env::var("GDTOF_CASES").map_or(usual, |cases| {
        cases.parse().expect("GDTOF_CASES is a number of cases")
    })
}
