//! Races, and the cures that they name.

use super::*;
use proptest::prelude::*;

fn fs(fs: i64) -> Time {
    Time::from_fs(fs)
}

proptest! {
    /// Against all shorter periods, one by one, in a world where a period is some hundred femtoseconds.
    #[test]
    fn a_shorter_period_is_offered_where_one_helps(
        period in 120i64..1000,
        edges in 0i64..5,
        shift in 0i64..300,
        hold in 1i64..80,
        setup in 1i64..80,
        into in 0f64..1.0,
        shortest in 50i64..900,
    ) {
        // From the last change before it that holds to the one after it that is set up.
        let change = period * (2 * edges + 1) / 2 + shift;
        let strobe = change - hold + 1 + ((hold + setup - 2) as f64 * into) as i64;
        let strobes = ((fs(strobe), fs(strobe)), fs(shortest));
        let race = Race::strobe_at_shift(fs(period), edges, (fs(strobe), fs(shift)), (fs(setup), fs(hold)), strobes);
        prop_assert_eq!((race.comes, race.from, race.to), (fs(strobe), fs(change - hold), Some(fs(change + setup))));
        prop_assert_eq!(-race.slack(), fs(strobe - change + hold).min(fs(change + setup - strobe)));
        let meets = |period: i64, edge: i64| {
            let change = (period * (2 * edge + 1)) as f64 / 2.0 + shift as f64;
            change - hold as f64 - 0.5 < strobe as f64 && (strobe as f64) < change + setup as f64 + 0.5
        };
        let is_free = |period: &i64| !(0..200).any(|edge| meets(*period, edge));
        let Cure::Period { at_least, at_most } = race.cure else {
            return Err(TestCaseError::fail("a period helps"));
        };
        // Bands of earlier edges may follow without room for a period between them.
        let is_clear = |longer: &i64| !(0..=edges).any(|edge| meets(*longer, edge));
        prop_assert!(is_clear(&at_least.as_fs()), "{at_least:?}");
        let passed_over = (period..at_least.as_fs()).filter(is_clear).count();
        prop_assert!(passed_over < 12, "{passed_over} {at_least:?}");
        // A run of free periods, next below those that meet this edge. A cure keeps ROUNDING, 4 fs, from either end of it.
        let shorter = (1..period).rev().find(|&shorter| !meets(shorter, edges)).unwrap_or(0);
        let free = (shortest + 1..=shorter).rev().take_while(is_free).count();
        prop_assert!(at_most.is_some() || free < 12, "{free} periods up to {shorter}");
        prop_assert!(at_most.is_none() || free > 3);
        if let Some(at_most) = at_most {
            prop_assert!((shorter - 5..=shorter).contains(&at_most.as_fs()), "{shorter} {at_most:?}");
        }
    }
}

#[test]
fn a_phase_is_offered_within_half_a_period_of_clk() {
    let with = |phase_fs: i64, comes: i64| {
        let what = Conflict::ClkAtResetEnd;
        let race = Race::with_stop(what, fs(comes), (fs(500), fs(900)), fs(phase_fs), fs(2000));
        assert_eq!(
            (race.comes, race.from, race.to),
            (fs(comes), fs(500), Some(fs(900)))
        );
        match race.cure {
            Cure::Phase { at_most, at_least } => [at_most, at_least].map(|t| t.map(Time::as_fs)),
            cure => panic!("{cure}"),
        }
    };
    // Later by 900 − 700 fs, or earlier by 700 − 500 fs, and 4 fs of rounding.
    assert_eq!(with(0, 700), [Some(-204), Some(204)]);
    assert_eq!(with(-796, 700), [Some(-1000), Some(-592)]);
    assert_eq!(with(-797, 700), [None, Some(-593)]);
    assert_eq!(with(796, 700), [Some(592), Some(1000)]);
    assert_eq!(with(797, 700), [Some(593), None]);
    assert_eq!(with(0, 850), [Some(-54), Some(354)]);
}

#[test]
fn a_slow_path_needs_a_period_as_long_as_it_takes() {
    let race = Race::too_slow(Conflict::SlowPath, fs(1300), fs(1250));
    assert_eq!((race.comes, race.from, race.to), (fs(1300), fs(1250), None));
    let cure = Cure::Period {
        at_least: fs(1304),
        at_most: None,
    };
    assert_eq!(race.cure, cure);
}
