//! The ways of keeping the SPADs' state, in one step a CLK period and in finer ones, for both laws of dead time.

use guided_dtof::engine::CohortOptions;
use guided_dtof::photon::{DeadTimeLaw, PixelLight};

use super::comparison::{Case, case};

/// Two bins' correlation may be neglected up to `neglect`: pooled always with 1, followed jointly with 0.
pub fn options(neglect: f64) -> CohortOptions {
    CohortOptions {
        neglect,
        ..CohortOptions::default()
    }
}

#[test]
fn the_pool_of_spads() {
    let light = PixelLight::echo(0.3, case().light.arrival()).with_background(15e6);
    let name = "pool, 15 Mcounts/s";
    Case {
        name,
        light,
        options: options(1.0),
        ..case()
    }
    .agrees();
}

#[test]
fn the_joint_state() {
    for (name, sub_bins) in [
        ("joint state, 40 Mcounts/s", 1),
        ("joint state in 4 steps", 4),
    ] {
        let options = CohortOptions {
            sub_bins: Some(sub_bins),
            ..options(0.0)
        };
        Case {
            name,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn paralysable_spads_in_both_ways() {
    for (name, neglect) in [
        ("paralysable, joint state", 0.0),
        ("paralysable, pool", 1.0),
    ] {
        let (law, options) = (DeadTimeLaw::Paralysable, options(neglect));
        Case {
            name,
            law,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn the_pool_in_finer_steps() {
    for (name, law) in [
        ("pool in 4 steps", DeadTimeLaw::NonParalysable),
        ("paralysable, pool in 4 steps", DeadTimeLaw::Paralysable),
    ] {
        let options = CohortOptions {
            sub_bins: Some(4),
            ..options(1.0)
        };
        Case {
            name,
            law,
            options,
            ..case()
        }
        .agrees();
    }
}

#[test]
fn much_light_in_finer_steps() {
    let light = PixelLight::echo(10.0, case().light.arrival()).with_background(400e6);
    let options = CohortOptions {
        sub_bins: Some(4),
        ..options(0.0)
    };
    let name = "joint state, 400 Mcounts/s";
    Case {
        name,
        light,
        options,
        stop_periods: 200,
        laser_cycles: 30,
        ..case()
    }
    .agrees();
}
