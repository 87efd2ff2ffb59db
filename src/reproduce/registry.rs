//! The lists: claims by number, tables and figures by their number in the thesis, measurements of the chip.

use super::claim::Claim;
use super::{
    chip, delay_line, demonstrator, design, guided_bins, measured, penalty, photon_budget,
    precision, sensors, silicon, stereo, system,
};
use crate::engine::EngineError;
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

/// A measurement of the chip against its theory.
#[derive(Clone, Copy)]
pub struct Measurement {
    /// Its number.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// Makes it, with so many frames behind each number.
    pub measure: fn(usize) -> Result<measured::Study, EngineError>,
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
pub const CLAIMS: [Claim; 28] = [
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
        7,
        "signal photons",
        "3.3.2, Eq. 15, Table 6",
        photon_budget::signal_rows,
    ),
    claim(
        8,
        "sunlight",
        "3.3.2, Eq. 16, Table 6",
        photon_budget::background_rows,
    ),
    claim(
        9,
        "probability of detection",
        "3.2.2, Eq. 17 to 19, Fig. 32",
        photon_budget::detection_rows,
    ),
    claim(10, "precision", "3.2.3, Eq. 20, Fig. 33", precision::rows),
    claim(
        11,
        "laser cycles at 200 m",
        "3.3.3, Fig. 35",
        penalty::cycles_rows,
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
        14,
        "penalty of partial histograms at 200 m",
        "3.4, Table 7, Fig. 42 to 45",
        penalty::long_range_rows,
    ),
    claim(
        15,
        "penalty of partial histograms at 75 m",
        "6.4.2, Table 15, Fig. 108, 109",
        penalty::demonstrator_rows,
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
        guided_bins::bin_rows,
    ),
    claim(
        20,
        "delay lines and their calibration",
        "6.3.1, Eq. 28 and 29, Fig. 90 to 93",
        delay_line::rows,
    ),
    claim(
        21,
        "light of the demonstrator",
        "6.3.1, Fig. 94",
        photon_budget::demonstrator_rows,
    ),
    claim(
        22,
        "errors of the demonstrator",
        "6.4.2, Fig. 103 to 105",
        system::error_rows,
    ),
    claim(
        23,
        "tracking to 75 m",
        "6.4.1, Fig. 99, 100, Table 14",
        system::tracking_rows,
    ),
    claim(24, "fog", "6.4.1, Fig. 101", system::fog_rows),
    claim(25, "glass", "6.4.1, Fig. 102", demonstrator::glass_rows),
    claim(
        26,
        "targets that leave their window",
        "6.4.2, 6.5.3, Fig. 107",
        stereo::motion_rows,
    ),
    claim(27, "time of a frame", "6.4.2, Fig. 106", system::frame_rows),
    claim(
        28,
        "published sensors",
        "2.5, 6.5.1, Tables 5 and 16",
        sensors::rows,
    ),
];

/// Every table, by number.
pub const TABLES: [Table; 4] = [
    table(
        7,
        "schemes of Tables 7 and 15 and what they cost, overflow counted",
        penalty::charts::table_7,
    ),
    table(
        9,
        "clock, range, bin and tolerated guide error",
        design::table_9,
    ),
    table(
        16,
        "published sensors (Tables 5 and 16) in the demonstrator's light, to a precision of one bin",
        sensors::table,
    ),
    table(
        39,
        "static RAM cells by process node (Fig. 39), and what they hold",
        design::table_39,
    ),
];

/// Every figure, by number.
pub const FIGURES: [Figure; 34] = [
    figure(20, "wavelength of a VCSEL", photon_budget::figure_20),
    figure(
        28,
        "bins per pixel of published sensors",
        sensors::figure_28,
    ),
    figure(32, "probability of detection", photon_budget::figure_32),
    figure(33, "precision", precision::figure_33),
    figure(34, "photon budget", photon_budget::figure_34),
    figure(
        35,
        "laser cycles against distance",
        penalty::charts::figure_35,
    ),
    figure(36, "counts of a bin", silicon::figure_36),
    figure(37, "bins of a full histogram", silicon::figure_37),
    figure(38, "bits of a full histogram", silicon::figure_38),
    figure(39, "area of a static RAM cell", silicon::figure_39),
    figure(40, "area of a histogram", silicon::figure_40),
    figure(
        41,
        "histograms that fit a quarter of the pixel",
        silicon::figure_41,
    ),
    figure(
        42,
        "laser cycles of zooming's detection",
        penalty::charts::figure_42,
    ),
    figure(
        43,
        "laser cycles of sliding's windows",
        penalty::charts::figure_43,
    ),
    figure(
        44,
        "laser cycles of the schemes",
        penalty::charts::figure_44,
    ),
    figure(45, "penalty of the schemes", penalty::charts::figure_45),
    figure(56, "ripple delay", chip::figure_56),
    figure(61, "distance limits of a stereo pair", stereo::figure_61),
    figure(66, "stereo depths and their spread", stereo::figure_66),
    figure(67, "standard deviation of stereo depths", stereo::figure_67),
    figure(68, "stereo error against distance", stereo::figure_68),
    figure(70, "yaw after calibration", stereo::figure_70),
    figure(
        71,
        "least bin interval for a stereo guide",
        guided_bins::figure_71,
    ),
    figure(
        90,
        "bins of delay lines while a laser is delayed",
        delay_line::figure_90,
    ),
    figure(91, "bin intervals of delay lines", delay_line::figure_91),
    figure(
        92,
        "a plane through delay lines, by column",
        delay_line::figure_92,
    ),
    figure(
        93,
        "a plane before and after calibration",
        delay_line::figure_93,
    ),
    figure(
        94,
        "photon budget of the demonstrator",
        photon_budget::figure_94,
    ),
    figure(
        103,
        "distances by the demonstrator",
        demonstrator::figure_103,
    ),
    figure(104, "σ of the demonstrator", system::figure_104),
    figure(106, "time of a frame", system::figure_106),
    figure(107, "a pedestrian leaves his window", stereo::figure_107),
    figure(
        108,
        "laser cycles of the demonstrator's schemes",
        penalty::charts::figure_108,
    ),
    figure(
        109,
        "penalty of the demonstrator's schemes",
        penalty::charts::figure_109,
    ),
];

/// Every measurement, by number.
pub const MEASUREMENTS: [Measurement; 4] = [
    Measurement {
        number: 1,
        title: "probability of detection (3.2.2, Eq. 17)",
        measure: measured::detection::study,
    },
    Measurement {
        number: 2,
        title: "precision (3.2.3, Eq. 20)",
        measure: measured::precision::study,
    },
    Measurement {
        number: 3,
        title: "penalty of partial histograms (3.4)",
        measure: measured::penalty::study,
    },
    Measurement {
        number: 4,
        title: "zooming and sliding at 200 m and 75 m (3.4, 6.4.2)",
        measure: measured::partial::study,
    },
];
