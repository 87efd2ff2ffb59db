//! The ways of keeping the SPADs' state, for both laws of dead time.

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
    Case {
        name: "joint state, 40 Mcounts/s",
        options: options(0.0),
        ..case()
    }
    .agrees();
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
fn much_light() {
    let light = PixelLight::echo(10.0, case().light.arrival()).with_background(400e6);
    let name = "joint state, 400 Mcounts/s";
    Case {
        name,
        light,
        options: options(0.0),
        stop_periods: 200,
        laser_cycles: 30,
        ..case()
    }
    .agrees();
}
