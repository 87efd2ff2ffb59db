//! The ripple of every macropixel of a mismatched array: table and plot.

use std::f64::consts::TAU;
use std::path::Path;

use super::section::{Section, SectionCell};
use crate::analysis::{Spread, spread};
use crate::chip::{SensorConfig, Silicon};
use crate::cli::voice::progress;
use crate::files::InputError;
use crate::report::{Axis, Chart};

/// Bars of the plot.
const BARS: usize = 48;

/// Analyses all macropixels, with a bar on a terminal.
pub(super) fn analyse(config: &SensorConfig, silicon: &Silicon) -> Spread {
    let template = "analysing {bar:40} {pos}/{len} macropixels";
    let progress = progress(config.pixels() as u64, template);
    let found = spread(config, silicon, || progress.inc(1));
    progress.finish_and_clear();
    found
}

/// Statistics and how many macropixels fail.
pub(super) fn table(config: &SensorConfig, found: &Spread) -> Section {
    let title = format!(
        "Mismatch: ripple CLK fall to LOCAL_STOP of {} macropixels at {} MHz",
        found.pixels.len(),
        config.clk_hz * 1e-6
    );
    let mut section = Section::new("spread", title, &["", "value"]);
    let ps = |seconds: f64| SectionCell::Number(Some(seconds * 1e12), 3);
    let count = |number: usize| SectionCell::Number(Some(number as f64), 0);
    let (slowest, tightest) = (found.slowest(), found.tightest());
    let fails = |works: fn(&crate::analysis::PixelTiming) -> bool| {
        count(found.pixels.iter().filter(|p| !works(p)).count())
    };
    section.push(["mean ripple (ps)".into(), ps(found.mean_s)]);
    section.push(["standard deviation (ps)".into(), ps(found.sigma_s)]);
    let name = format!(
        "longest ripple (ps), row {} column {}",
        slowest.row, slowest.col
    );
    section.push([name.into(), ps(slowest.ripple.as_s())]);
    let name = format!(
        "least slack (ps), row {} column {}",
        tightest.row, tightest.col
    );
    section.push([name.into(), ps(tightest.slack.as_s())]);
    section.push([
        "macropixels that break a limit".into(),
        fails(|p| p.keeps_limits),
    ]);
    section.push([
        "macropixels that count into the wrong bins".into(),
        fails(|p| p.counts_right),
    ]);
    section
}

/// Writes the distribution with the normal curve of its mean and deviation.
pub(super) fn plot(config: &SensorConfig, found: &Spread, path: &Path) -> Result<(), InputError> {
    let ripples: Vec<f64> = found
        .pixels
        .iter()
        .map(|p| p.ripple.as_s() * 1e12)
        .collect();
    let least = ripples.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ripples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let width = ((most - least) / BARS as f64).max(1e-3);
    let mut counts = [0.0; BARS];
    for ripple in &ripples {
        counts[(((ripple - least) / width) as usize).min(BARS - 1)] += 1.0;
    }
    let centre = |bar: usize| least + (bar as f64 + 0.5) * width;
    let (mean, sigma) = (found.mean_s * 1e12, (found.sigma_s * 1e12).max(1e-9));
    let normal = |x: f64| {
        let deviation = (x - mean) / sigma;
        ripples.len() as f64 * width / (sigma * TAU.sqrt())
            * libm::exp(-0.5 * deviation * deviation)
    };
    let curve = (0..=4 * BARS).map(|i| least + i as f64 * width / 4.0);
    let title = format!(
        "Ripple of {} macropixels: mean {mean:.1} ps, sigma {sigma:.2} ps; {} MHz fails in {}",
        ripples.len(),
        config.clk_hz * 1e-6,
        found.pixels.iter().filter(|p| !p.keeps_limits).count()
    );
    let x = Axis::linear("CLK fall to LOCAL_STOP (ps)");
    Chart::new(title, x, Axis::linear("macropixels"))
        .bars(
            "macropixels",
            (0..BARS).map(|bar| (centre(bar), counts[bar])),
        )
        .line("normal", curve.map(|x| (x, normal(x))))
        .write(path)
}
