//! The lists: claims by number, tables and figures by their number in the thesis, measurements of the chip. Titles stand in
//! `thesis.toml`, what computes them here.

use std::sync::LazyLock;

use super::claim::ClaimRow;
use super::thesis::THESIS;
use super::{
    chip, delay_line, demonstrator, design, guided_bins, hslidar_modes, measured, penalty,
    photon_budget, precision, sensors, silicon, stereo, system,
};
use crate::engine::EngineError;
use crate::report::{Chart, Grid};

/// Something under a number and a title: what makes it, or what was made.
#[derive(Debug, Clone, Copy)]
pub struct NumberedItem<T> {
    /// Its number, in the thesis but for measurements.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// What it is.
    pub it: T,
}

/// Computes the rows of a claim.
pub(super) type Rows = fn() -> Vec<ClaimRow>;
/// Makes a table.
pub(super) type Tabulate = fn() -> Grid;
/// Draws a figure.
pub(super) type Draw = fn() -> Chart;
/// Measures; the argument is the number of frames behind each figure.
pub(super) type Measure = fn(usize) -> Result<measured::MeasuredStudy, EngineError>;

/// Pairs titles with what makes them, which must have the same numbers in the same order.
fn listed<F: Copy>(
    titles: impl ExactSizeIterator<Item = (u32, &'static str)>,
    makers: &[(u32, F)],
) -> Vec<NumberedItem<F>> {
    assert_eq!(titles.len(), makers.len(), "thesis.toml has as many");
    let pairs = titles.zip(makers);
    let pair = |((number, title), &(made, it))| {
        assert_eq!(number, made, "thesis.toml has the same order");
        NumberedItem { number, title, it }
    };
    pairs.map(pair).collect()
}

/// Every claim, by number.
pub static CLAIMS: LazyLock<Vec<NumberedItem<Rows>>> = LazyLock::new(|| {
    let titles = THESIS.claims.iter().map(|c| (c.number, &*c.title));
    listed(titles, &CLAIM_ROWS)
});

/// Every table, by number.
pub static TABLES: LazyLock<Vec<NumberedItem<Tabulate>>> = LazyLock::new(|| {
    let titles = THESIS.tables.iter().map(|t| (t.number, &*t.title));
    listed(titles, &TABLE_GRIDS)
});

/// Every figure, by number.
pub static FIGURES: LazyLock<Vec<NumberedItem<Draw>>> = LazyLock::new(|| {
    let titles = THESIS.figures.iter().map(|f| (f.number, &*f.title));
    listed(titles, &FIGURE_CHARTS)
});

/// Every measurement, by number.
pub static MEASUREMENTS: LazyLock<Vec<NumberedItem<Measure>>> = LazyLock::new(|| {
    let titles = THESIS.measurements.iter().map(|m| (m.number, &*m.title));
    listed(titles, &STUDIES)
});

const CLAIM_ROWS: [(u32, Rows); 29] = [
    (1, design::table_9_rows),
    (2, chip::ripple_rows),
    (3, chip::fig_54_rows),
    (4, chip::fig_48_rows),
    (5, chip::load_rows),
    (6, chip::area_rows),
    (7, photon_budget::signal_rows),
    (8, photon_budget::background_rows),
    (9, photon_budget::detection_rows),
    (10, precision::rows),
    (11, penalty::cycles_rows),
    (12, design::size_rows),
    (13, design::silicon_rows),
    (14, penalty::long_range_rows),
    (15, penalty::demonstrator_rows),
    (16, design::data_rows),
    (17, stereo::error_rows),
    (18, stereo::yaw_rows),
    (19, guided_bins::bin_rows),
    (20, delay_line::rows),
    (21, photon_budget::demonstrator_rows),
    (22, system::error_rows),
    (23, system::tracking_rows),
    (24, system::fog_rows),
    (25, demonstrator::glass_rows),
    (26, stereo::motion_rows),
    (27, system::frame_rows),
    (28, sensors::rows),
    (29, hslidar_modes::rows),
];

const TABLE_GRIDS: [(u32, Tabulate); 5] = [
    (7, penalty::charts::table_7),
    (9, design::table_9),
    (10, hslidar_modes::table_10),
    (16, sensors::table),
    (39, design::table_39),
];

const FIGURE_CHARTS: [(u32, Draw); 34] = [
    (20, photon_budget::figure_20),
    (28, sensors::figure_28),
    (32, photon_budget::figure_32),
    (33, precision::figure_33),
    (34, photon_budget::figure_34),
    (35, penalty::charts::figure_35),
    (36, silicon::figure_36),
    (37, silicon::figure_37),
    (38, silicon::figure_38),
    (39, silicon::figure_39),
    (40, silicon::figure_40),
    (41, silicon::figure_41),
    (42, penalty::charts::figure_42),
    (43, penalty::charts::figure_43),
    (44, penalty::charts::figure_44),
    (45, penalty::charts::figure_45),
    (56, chip::figure_56),
    (61, stereo::figure_61),
    (66, stereo::figure_66),
    (67, stereo::figure_67),
    (68, stereo::figure_68),
    (70, stereo::figure_70),
    (71, guided_bins::figure_71),
    (90, delay_line::figure_90),
    (91, delay_line::figure_91),
    (92, delay_line::figure_92),
    (93, delay_line::figure_93),
    (94, photon_budget::figure_94),
    (103, demonstrator::figure_103),
    (104, system::figure_104),
    (106, system::figure_106),
    (107, stereo::figure_107),
    (108, penalty::charts::figure_108),
    (109, penalty::charts::figure_109),
];

const STUDIES: [(u32, Measure); 4] = [
    (1, measured::detection::study),
    (2, measured::precision::study),
    (3, measured::penalty::study),
    (4, measured::partial::study),
];
