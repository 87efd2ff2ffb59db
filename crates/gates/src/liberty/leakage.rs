//! Leakage of a cell: `cell_leakage_power`, or the mean of its `leakage_power` groups over their conditions, or the library's default.
//!
//! ```text
//!   leakage_power () { value : 48.99; when : "A * !Y"; related_pg_pin : VDD; }     states are averaged,
//!   leakage_power () { value : 53.33; when : "!A * Y"; related_pg_pin : VDD; }     supplies are added up
//! ```

use std::collections::BTreeMap;

use super::error::{LibertyError, LibertyFault};
use super::group::Group;

/// Leakage of a cell in the file's unit; none where neither the cell nor the library states one.
///
/// # Errors
/// What is not a number, and a group without one.
pub(super) fn leakage_of(
    cell: &Group<'_>,
    library: &Group<'_>,
) -> Result<Option<f64>, LibertyError> {
    if let Some(stated) = cell.number("cell_leakage_power")? {
        return Ok(Some(stated));
    }
    let is_ground = |name: &str| {
        let mut pins = cell.of_kind("pg_pin");
        let type_of = pins
            .find(|pin| pin.arguments.contains(&name))
            .and_then(|pin| pin.value("pg_type"));
        type_of.is_some_and(|word| word.contains("ground"))
    };
    // Of each supply: sum and number of what is stated for a condition, and for none.
    let mut supplies: BTreeMap<&str, [(f64, f64); 2]> = BTreeMap::new();
    for group in cell.of_kind("leakage_power") {
        let missing = || LibertyError::new(group.line, LibertyFault::NoLeakageValue);
        let value = group.number("value")?.ok_or_else(missing)?;
        let supply = group.value("related_pg_pin").unwrap_or_default();
        // What flows out is what flowed in.
        if is_ground(supply) {
            continue;
        }
        let of_supply = supplies.entry(supply).or_default();
        let (sum, count) = &mut of_supply[usize::from(group.value("when").is_none())];
        (*sum, *count) = (*sum + value, *count + 1.0);
    }
    if supplies.is_empty() {
        // A default of 0, which many files have, states nothing.
        let default = library.number("default_cell_leakage_power")?;
        return Ok(default.filter(|&default| default > 0.0));
    }
    let mean = |&[states, always]: &[(f64, f64); 2]| {
        let (sum, count) = if states.1 > 0.0 { states } else { always };
        sum / count
    };
    Ok(Some(supplies.values().map(mean).sum()))
}

#[cfg(test)]
mod tests {
    use super::super::group::read;
    use super::*;

    #[test]
    fn states_are_averaged_and_supplies_added_up() {
        let cell_leakage = |cell: &str| {
            let text = format!(
                "library (l) {{ default_cell_leakage_power : 7;\n cell (c) {{ {cell} }} }}"
            );
            let library = read(&text).unwrap();
            leakage_of(&library.groups[0], &library)
        };
        let groups = |supply: &str, values: [f64; 2]| {
            let group = |when: &str, value: f64| {
                format!("leakage_power () {{ value : {value}; {when} {supply} }} ")
            };
            let [low, high] = values;
            group("when : \"A\";", low) + &group("when : \"!A\";", high) + &group("", 50.0)
        };
        for (cell, expected) in [
            (
                "cell_leakage_power : 3;".to_owned() + &groups("", [1.0, 2.0]),
                3.0,
            ),
            (groups("", [1.0, 2.0]), 1.5),
            ("leakage_power () { value : 4; }".to_owned(), 4.0),
            (
                groups("related_pg_pin : VDD;", [1.0, 2.0])
                    + &groups("related_pg_pin : VNW;", [10.0, 20.0]),
                16.5,
            ),
            (
                "pg_pin (VSS) { pg_type : primary_ground; } ".to_owned()
                    + &groups("related_pg_pin : VDD;", [1.0, 2.0])
                    + &groups("related_pg_pin : VSS;", [100.0, 100.0]),
                1.5,
            ),
            (String::new(), 7.0),
        ] {
            assert_eq!(cell_leakage(&cell), Ok(Some(expected)), "{cell}");
        }
        assert_eq!(
            cell_leakage("leakage_power () { when : \"A\"; }")
                .unwrap_err()
                .line,
            2
        );
        for default in ["", "default_cell_leakage_power : 0;"] {
            let text = format!("library (l) {{ {default} cell (c) {{ }} }}");
            let none = read(&text).unwrap();
            assert_eq!(leakage_of(&none.groups[0], &none), Ok(None));
        }
    }
}
