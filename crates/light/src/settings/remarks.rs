//! Remarks on settings that are possible, and probably in another unit than their key has.

use toml::{Table, Value};

use super::print::Section;

/// Remarks that are said; a file in another unit has one for each length.
const MOST_SAID: usize = 4;

/// A sentence for each value that is far from what is usual, by `sections`. `values` holds what a reader has made of the settings.
pub fn remarks(sections: &[Section], values: &Table) -> Vec<String> {
    let mut remarks = Vec::new();
    for section in sections {
        let mut look = |place: &str, table: &Table| {
            for key in section.keys {
                let remark = table.get(key.name).and_then(|value| key.remark(value));
                remarks.extend(remark.map(|remark| format!("{place}{remark}")));
            }
        };
        let name = section.name;
        if name.is_empty() {
            look("", values);
            continue;
        }
        match values.get(name) {
            Some(Value::Table(table)) => look(&format!("in [{name}], "), table),
            Some(Value::Array(items)) => {
                for (number, item) in (1..).zip(items.iter().filter_map(Value::as_table)) {
                    let own = item.get("name").and_then(Value::as_str);
                    let own = own.map_or(String::new(), |own| format!(" ({own})"));
                    look(&format!("in [[{name}]] number {number}{own}, "), item);
                }
            }
            _ => {}
        }
    }
    remarks
}

/// The first of `remarks` about `source`, and how many more there are.
pub fn said_remarks(source: &str, remarks: &[String]) -> Vec<String> {
    let mut said: Vec<String> = (remarks.iter().take(MOST_SAID))
        .map(|remark| format!("{source}: {remark}"))
        .collect();
    if remarks.len() > MOST_SAID {
        let more = remarks.len() - MOST_SAID;
        said.push(format!(
            "{source}: {more} more values are far from the usual ones, too"
        ));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Key, Range};

    const KEYS: &[Key] = &[
        Key {
            usual: Some((0.01, 500.0)),
            ..Key::new("fwhm_ns", "ns", Range::Within(0.0, 1e6), "", "")
        },
        Key {
            usual: Some((0.0, 1000.0)),
            ..Key::new("foot_m", "m", Range::Within(-1e6, 1e6), "", "")
        },
        Key::new("share", "", Range::Within(0.0, 1.0), "", ""),
    ];

    fn said(text: &str) -> Vec<String> {
        let sections = [
            Section::new("lidar", "", KEYS),
            Section::new("object", "", KEYS),
        ];
        remarks(&sections, &toml::from_str(text).unwrap())
    }

    #[test]
    fn a_value_in_another_unit_is_told_with_that_unit() {
        for (text, remark) in [
            (
                "[lidar]\nfwhm_ns = 5e-9",
                "in [lidar], fwhm_ns = 5e-9 ns is far from the usual 0.01 to 500 ns; if you mean 5e-9 s, give 5 ns",
            ),
            (
                "[[object]]\n[[object]]\nname = \"mate\"\nfoot_m = [-950, 1500, 7000]",
                "in [[object]] number 2 (mate), foot_m = 7000 m is far from the usual sizes up to 1000 m; if you mean 7000 mm, give 7 m",
            ),
            (
                "[lidar]\nfwhm_ns = 1e12",
                "in [lidar], fwhm_ns = 1e12 ns is far from the usual 0.01 to 500 ns; check its unit",
            ),
        ] {
            assert_eq!(said(text), [remark]);
        }
        assert_eq!(
            said("[lidar]\nfwhm_ns = 0.0\nfoot_m = -900\nshare = 0.5"),
            [""; 0]
        );
    }

    /// The text that a remark gives is read, and is usual.
    #[test]
    fn the_advice_can_be_followed() {
        for power in -9..=6 {
            let number: f64 = format!("4.5e{power}").parse().unwrap();
            let Some(remark) = KEYS[0].remark(&number.into()) else {
                continue;
            };
            if let Some(advice) = remark.split("give ").nth(1) {
                let again = KEYS[0].plain(&advice.into()).unwrap();
                assert_eq!(KEYS[0].remark(&again), None, "{remark}");
            } else {
                assert!(remark.ends_with("check its unit"), "{remark}");
            }
        }
    }

    #[test]
    fn an_impossible_number_names_the_unit_in_which_it_is_possible() {
        let clk = Key::new("clk_hz", "Hz", Range::Within(1e6, 2e9), "", "");
        let fault = |key: &Key, number: f64| key.fault(&number.into()).unwrap();
        assert!(
            fault(&clk, 384.0).ends_with("give 1e6 to 2e9 Hz; if you mean 384 MHz, give 3.84e8 Hz")
        );
        assert!(fault(&KEYS[2], 20.0).ends_with("give 0 to 1; if you mean 20 %, give 0.2"));
        assert!(fault(&clk, -1.0).ends_with("give 1e6 to 2e9 Hz"));
        let rows = Key::new("rows", "", Range::Within(1.0, 256.0), "", "");
        assert!(fault(&rows, 900.0).ends_with("give 1 to 256"));
    }

    #[test]
    fn many_remarks_are_counted() {
        let many: Vec<String> = (0..9).map(|n| n.to_string()).collect();
        let said = said_remarks("s.toml", &many);
        assert_eq!((said.len(), said[0].as_str()), (5, "s.toml: 0"));
        assert!(said[4].contains("5 more"));
    }
}
