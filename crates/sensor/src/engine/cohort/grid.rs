//! Cells of time in which a SPAD is followed through a window: edges of all CLK periods, bends of the light, and edges in
//! between, each repeated every dead time, so that what fires in a cell is ready again exactly in the cell as many
//! further on.

use super::cycles::{Class, CohortLight};

/// Cells of a CLK period on the coarsest grid, at least.
pub(super) const CELLS: f64 = 4.0;

/// Edges that are closer than that are one, fs.
const CLOSE_FS: f64 = 0.01;

/// Where a narrow pulse is cut, in standard deviations: cells within it are shorter than it.
const BENDS: [f64; 13] = [
    -4.5, -3.5, -2.75, -2.0, -1.4, -0.7, 0.0, 0.7, 1.4, 2.0, 2.75, 3.5, 4.5,
];

/// Cells of time, which repeat every dead time.
pub(super) struct Grid {
    /// Edges, fs after the start of the window.
    pub edges: Vec<f64>,
    /// Cells in a dead time.
    pub per_dead_time: usize,
    /// Edge at the start of every CLK period: those that are remembered at the start of the window, the window's, and one
    /// more.
    pub periods: Vec<usize>,
}

impl Grid {
    /// From `since_fs` before the window on.
    pub(super) fn new(
        scene: &CohortLight,
        class: &Class,
        since_fs: f64,
        memory: usize,
        halvings: u32,
    ) -> Self {
        let (dead_fs, period_fs) = (scene.dead_fs, scene.period_fs);
        let start_fs = -since_fs;
        let period = |number: usize| match number.checked_sub(memory) {
            Some(bin) if bin <= scene.bins => scene.edge_fs(bin),
            _ => (number as f64 - memory as f64) * period_fs,
        };
        let periods = 0..memory + scene.bins + 1;
        let until_fs = scene.edge_fs(scene.bins);
        let mut bends: Vec<f64> = periods.clone().map(period).collect();
        let lit_fs = &class.extent.lit_fs;
        bends.extend([lit_fs.start, lit_fs.end].map(|end| end - scene.from_fs));
        let stretch_fs = scene.from_fs + start_fs..scene.until_fs();
        for (number, echo) in scene.light.sent(stretch_fs.clone(), &class.extent) {
            let (centre_fs, sigma_fs) = (echo.centre_fs(number) - scene.from_fs, echo.sigma_fs());
            if sigma_fs * CELLS < period_fs {
                bends.extend(BENDS.map(|bend| centre_fs + bend * sigma_fs));
                // A pulse without width is somewhere within a femtosecond.
                bends.push(centre_fs + 1.0);
            }
        }
        let uneven = scene.light.bends_fs(stretch_fs, &class.extent);
        bends.extend(uneven.into_iter().map(|bend_fs| bend_fs - scene.from_fs));
        bends.retain(|bend| (start_fs..=until_fs).contains(bend));
        let mut phases: Vec<f64> = bends
            .iter()
            .map(|bend| (bend - start_fs).rem_euclid(dead_fs))
            .collect();
        phases.push(0.0);
        phases.retain(|phase| *phase < dead_fs - CLOSE_FS);
        phases.sort_unstable_by(f64::total_cmp);
        phases.dedup_by(|later, earlier| *later - *earlier < CLOSE_FS);
        let longest_fs = period_fs / CELLS;
        let mut cells = Vec::with_capacity(phases.len() << halvings);
        for (i, &phase) in phases.iter().enumerate() {
            let next = phases.get(i + 1).copied().unwrap_or(dead_fs);
            let parts = ((next - phase) / longest_fs).ceil() * f64::from(1u32 << halvings);
            cells.extend(
                (0..parts as usize).map(|part| phase + (next - phase) * part as f64 / parts),
            );
        }
        let dead_times = ((until_fs - start_fs) / dead_fs).ceil() as usize + 1;
        let repeated = (0..dead_times).flat_map(|n| cells.iter().map(move |cell| (n, *cell)));
        let all = repeated.map(|(n, cell)| start_fs + n as f64 * dead_fs + cell);
        let edges: Vec<f64> = all.take_while(|edge| *edge < until_fs + CLOSE_FS).collect();
        let edge_of =
            |number: usize| edges.partition_point(|edge| *edge < period(number) - CLOSE_FS);
        Grid {
            periods: periods.map(edge_of).collect(),
            per_dead_time: cells.len(),
            edges,
        }
    }
}
