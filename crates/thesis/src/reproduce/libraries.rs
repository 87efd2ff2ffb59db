//! What cell libraries say of the thesis's figures: published, built-in cells, and one column for each Liberty file. Nothing is tuned.

use std::path::{Path, PathBuf};

use crate::analysis::{
    Capacitances, LoadTiming, MacropixelPower, MacropixelTiming, phases, shortest_period,
};
use crate::chip::{CellLibrary, Exposure, Limits, SensorConfig, Silicon};
use crate::files::InputError;
use crate::netlist::CellKind;
use crate::report::Grid;
use crate::units::Time;

/// Name of each figure, its unit and what the thesis prints (4.4 to 4.6).
const FIGURES: [(&str, &str); 9] = [
    ("CLK's fall to LOCAL_STOP, ns", "1.2"),
    ("shortest CLK period by twice that, ns", "about 2.4"),
    ("shortest that any STOP phase allows, limits kept, ns", ""),
    ("left over of the reset pulse, ps", ""),
    ("shortest LOAD_CLK period, ns", ""),
    ("flip-flop with set over one without, area", "about 3"),
    ("P-counter and its timing, area in the library's unit", ""),
    ("their share of the macropixel's area, %", "< 5"),
    ("their share of its energy in the dark, %", ""),
];

/// CLK of the run that energies are from, slow enough for any library, and CLK periods in its laser cycles at 80 kHz.
const ENERGY_RUN: (f64, u32) = (50e6, 625);

/// The table.
///
/// # Errors
/// Files that cannot be read or are no libraries.
pub fn libraries(files: &[PathBuf]) -> Result<Grid, InputError> {
    let mut headings = vec![
        "".to_owned(),
        "thesis".to_owned(),
        "built-in cells".to_owned(),
    ];
    let mut columns = vec![column(Path::new(""))?.1];
    for file in files {
        let (name, figures) = column(file)?;
        headings.push(name);
        columns.push(figures);
    }
    let mut grid = Grid::new(headings);
    for (row, (what, published)) in FIGURES.iter().enumerate() {
        let cells = columns.iter().map(|figures| figures[row].clone());
        grid.push(
            [(*what).to_owned(), (*published).to_owned()]
                .into_iter()
                .chain(cells),
        );
    }
    Ok(grid)
}

/// A library's name and figures.
fn column(file: &Path) -> Result<(String, [String; FIGURES.len()]), InputError> {
    let config = SensorConfig {
        liberty: file.to_owned(),
        ..SensorConfig::default()
    };
    let library = CellLibrary::from_config(&config)
        .map_err(|(_, fault)| InputError::new("--liberty", fault))?;
    let silicon = Silicon::new(&config);
    let timing = MacropixelTiming::analyse(&config, &silicon, Limits::Kept, (0, 0));
    let below = timing.forbidden(0).0 - Time::from_ps(2);
    let any_phase = shortest_period(below, |p| phases(p).any(|phase| timing.works(p, phase)));
    let load = LoadTiming::analyse(&config, &silicon, Limits::Kept).period();
    let slow = SensorConfig {
        clk_hz: ENERGY_RUN.0,
        ..config.clone()
    };
    let exposure = Exposure::new(&slow, ENERGY_RUN.1, 2);
    let start = slow.largest_start() / 2 + 1;
    let power = MacropixelPower::simulate(&slow, &exposure, start, &[], &Capacitances::default());
    let ripple = timing.ripple.delay().as_ns();
    let reset_ps = (timing.reset_width() - timing.reset_need()).as_ns() * 1e3;
    let ns = |time: Option<Time>| time.map_or("none".to_owned(), |t| format!("{:.2}", t.as_ns()));
    let blocks = ["p_counter", "p_counter_timing"];
    let share = |block_value: &dyn Fn(&str) -> f64| {
        let whole: f64 = block_value("macropixel");
        100.0 * blocks.iter().map(|block| block_value(block)).sum::<f64>() / whole
    };
    let (name, ratio, area, shares) = match library.from_file() {
        None => {
            let transistors = |kind: CellKind| f64::from(kind.transistors());
            let ratio = transistors(CellKind::Dffsr) / transistors(CellKind::Dffr);
            let energy = 100.0 * power.of_blocks_j(&blocks) / power.cycle_j();
            (String::new(), ratio, None, [None, Some(energy)])
        }
        Some(read) => {
            let ratio = read.liberty.area(CellKind::Dffsr) / read.liberty.area(CellKind::Dffr);
            let block_silicon = |block: &str| {
                let mut blocks = power.silicon.iter();
                blocks.find(|of| of.block == block).expect("a library's")
            };
            let area = |block: &str| block_silicon(block).area;
            let energy =
                |block: &str| block_silicon(block).internal_j + block_silicon(block).loads_j;
            let both = area(blocks[0]) + area(blocks[1]);
            let shares = [Some(share(&area)), Some(share(&energy))];
            (read.liberty.name.clone(), ratio, Some(both), shares)
        }
    };
    let number = |value: Option<f64>, digits: usize| {
        value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let figures = [
        format!("{ripple:.2}"),
        format!("{:.2}", 2.0 * ripple),
        ns(any_phase),
        format!("{reset_ps:.0}"),
        ns(load),
        format!("{ratio:.2}"),
        number(area, 0),
        number(shares[0], 1),
        number(shares[1], 1),
    ];
    Ok((name, figures))
}
