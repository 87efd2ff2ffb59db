//! The lists: claims by number, tables and figures by their number in the thesis.

use super::claim::Claim;
use super::{chip, design, stereo};
use crate::report::{Chart, Grid};

/// A figure of the thesis that can be computed.
#[derive(Clone, Copy)]
pub struct Figure {
    /// Its number in the thesis.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// Draws it.
    pub draw: fn() -> Vec<Chart>,
}

/// A table of the thesis that can be computed.
#[derive(Clone, Copy)]
pub struct Table {
    /// Its number in the thesis.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// Makes it.
    pub make: fn() -> Grid,
}

const fn claim(
    number: u32,
    title: &'static str,
    source: &'static str,
    compute: fn() -> Vec<super::Row>,
) -> Claim {
    Claim {
        number,
        title,
        source,
        compute,
    }
}

const fn figure(number: u32, title: &'static str, draw: fn() -> Vec<Chart>) -> Figure {
    Figure {
        number,
        title,
        draw,
    }
}

const fn table(number: u32, title: &'static str, make: fn() -> Grid) -> Table {
    Table {
        number,
        title,
        make,
    }
}

/// Every claim, by number.
pub const CLAIMS: [Claim; 13] = [
    claim(
        1,
        "design tables",
        "4.8, Table 9, Eq. 23 to 25",
        design::table_9_rows,
    ),
    claim(
        2,
        "ripple and shortest CLK period",
        "4.6, Fig. 56",
        chip::ripple_rows,
    ),
    claim(
        3,
        "LOCAL_STOP of start value 5",
        "4.5, Fig. 54",
        chip::fig_54_rows,
    ),
    claim(
        4,
        "two start values, two windows",
        "4.3, Fig. 48",
        chip::fig_48_rows,
    ),
    claim(5, "serial load", "4.7, Fig. 57", chip::load_rows),
    claim(
        6,
        "area of the P-counter",
        "4.4.4, 4.5, Fig. 52, 55",
        chip::area_rows,
    ),
    claim(
        12,
        "size of a full histogram",
        "3.3.4, Fig. 36 to 38",
        design::size_rows,
    ),
    claim(
        13,
        "silicon for a histogram",
        "3.3.5, Fig. 39 to 41",
        design::silicon_rows,
    ),
    claim(
        16,
        "on-chip data, full over guided",
        "abstract, 6.5.1",
        design::data_rows,
    ),
    claim(
        17,
        "stereo error and nearest distance",
        "5.2.1, 5.2.4, Eq. 26 and 27, Fig. 61, 68",
        stereo::error_rows,
    ),
    claim(
        18,
        "yaw after calibration",
        "5.2.4, 6.4.2, Fig. 70",
        stereo::yaw_rows,
    ),
    claim(
        19,
        "least bin interval for a stereo guide",
        "5.2.5, Eq. 25, Fig. 71",
        stereo::bin_rows,
    ),
    claim(
        26,
        "targets that leave their window",
        "6.4.2, 6.5.3, Fig. 107",
        stereo::motion_rows,
    ),
];

/// Every table, by number.
pub const TABLES: [Table; 2] = [
    table(
        9,
        "clock, range, bin and tolerated guide error",
        design::table_9,
    ),
    table(
        39,
        "static RAM cells by process node (Fig. 39), and what they hold",
        design::table_39,
    ),
];

/// Every figure, by number.
pub const FIGURES: [Figure; 5] = [
    figure(56, "ripple delay", chip::figure_56),
    figure(61, "distance limits of a stereo pair", stereo::figure_61),
    figure(68, "stereo error against distance", stereo::figure_68),
    figure(70, "yaw after calibration", stereo::figure_70),
    figure(
        71,
        "least bin interval for a stereo guide",
        stereo::figure_71,
    ),
];
