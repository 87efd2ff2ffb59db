//! The page that shows published against computed: Markdown, and HTML with its figures inside.

use std::fmt::Write;

use super::claim::{ClaimRow, Verdict, figure, overall};
use super::measured::MeasuredStudy;
use super::registry::NumberedItem;
use super::report::Report;
use super::thesis::Slip;
use crate::report::Grid;

/// The headings of a claim's table.
const HEADINGS: [&str; 7] = [
    "quantity",
    "published",
    "tolerance",
    "computed",
    "difference",
    "unit",
    "verdict",
];

/// A row as text, by [`HEADINGS`].
fn cells(row: &ClaimRow) -> [String; 7] {
    let difference = match row.difference() {
        Some((0.0, _)) => "0".into(),
        Some((absolute, _)) if !absolute.is_finite() => String::new(),
        Some((_, Some(relative))) => format!("{:+.1} %", 100.0 * relative),
        Some((absolute, None)) if absolute < 0.0 => figure(absolute),
        Some((absolute, None)) => format!("+{}", figure(absolute)),
        None => String::new(),
    };
    [
        row.what.clone(),
        row.published.text(),
        row.published.tolerance_text(),
        row.computed.map_or(String::new(), figure),
        difference,
        row.unit.to_owned(),
        row.verdict().text().to_owned(),
    ]
}

/// A claim's rows as a table.
pub fn grid(rows: &[ClaimRow]) -> Grid {
    let mut grid = Grid::new(HEADINGS);
    rows.iter().for_each(|row| grid.push(cells(row)));
    grid
}

/// How many rows of the report have each verdict, and how many claims.
pub fn tally(report: &Report) -> String {
    let row_verdicts: Vec<Verdict> = report.rows().map(ClaimRow::verdict).collect();
    let claim_verdicts: Vec<Verdict> = report.claims.iter().map(|c| overall(&c.rows)).collect();
    format!(
        "Of {} claims: {}.\nOf {} rows: {}.",
        claim_verdicts.len(),
        verdict_counts(&claim_verdicts).join(", "),
        row_verdicts.len(),
        verdict_counts(&row_verdicts).join(", "),
    )
}

/// "80 agree", "5 differ" and so on, of every verdict.
fn verdict_counts(verdicts: &[Verdict]) -> [String; Verdict::ALL.len()] {
    Verdict::ALL.map(|verdict| {
        let count = verdicts.iter().filter(|&&v| v == verdict).count();
        format!("{count} {}", plural(verdict))
    })
}

/// How many of a claim's published rows agree, for example "3 of 5".
fn agreeing(rows: &[ClaimRow]) -> String {
    let published = rows.iter().filter(|r| r.verdict() != Verdict::Ours);
    let agree = rows.iter().filter(|r| r.verdict() == Verdict::Agrees);
    format!("{} of {}", agree.count(), published.count())
}

fn plural(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agrees => "agree",
        Verdict::Differs => "differ",
        Verdict::NotShown => "not shown",
        Verdict::Given => "given",
        Verdict::Fails => "FAIL",
        Verdict::Ours => "ours alone",
        Verdict::NotModelled => "not modelled",
    }
}

const INTRODUCTION: &str = "Every published figure of the thesis that the model is held to, beside what the model \
gives. A row agrees when the computed value lies within the tolerance of what is printed (half a unit of the last \
digit, unless another is named; of words, the range that we read in them), and differs when it does not and the reason \
is known. A measured number whose 95 % interval lies partly in the tolerance and partly outside is not shown to do \
either. A number that was put into the model and comes out again is given, and shows nothing. Rows that are ours alone show another convention, or what the thesis left out. A claim's verdict is the worst of its published rows, \
asides left out: it counts as met only where all of them agree.";

/// What stands above the thesis's slips.
pub const SLIPS_TITLE: &str = "Slips of the thesis";

/// The report in Markdown; figures are linked as the files beside it.
pub fn markdown(report: &Report) -> String {
    let mut out = format!(
        "# Published and computed\n\n{INTRODUCTION}\n\n{}\n\n",
        tally(report).replace('\n', "\n\n")
    );
    let mut glance = Grid::new(["claim", "rows that agree", "verdict"]);
    for result in &report.claims {
        glance.push([
            format!("{}. {}", result.claim.number, result.claim.title),
            agreeing(&result.rows),
            overall(&result.rows).text().to_owned(),
        ]);
    }
    if !report.claims.is_empty() {
        let _ = writeln!(out, "{}", glance.markdown());
    }
    for result in &report.claims {
        let claim = &result.claim;
        let _ = write!(
            out,
            "## Claim {}: {}\n\n{}\n\n",
            claim.number, claim.title, claim.source
        );
        let _ = writeln!(out, "{}", grid(&result.rows).markdown());
        for row in result.rows.iter().filter(|row| !row.notes().is_empty()) {
            let _ = writeln!(out, "* {}: {}", row.what, row.notes());
        }
        out.push('\n');
    }
    if !report.slips.is_empty() {
        let slips = slips(&report.slips).markdown();
        let _ = writeln!(out, "## {SLIPS_TITLE}\n\n{slips}");
    }
    for NumberedItem { number, title, it } in &report.tables {
        let _ = writeln!(out, "## Table {number}: {title}\n\n{}", it.markdown());
    }
    for result in &report.figures {
        let _ = write!(out, "## Fig. {}: {}\n\n", result.number, result.title);
        let _ = write!(out, "![{}]({}.svg)\n\n", result.it.title, result.file());
    }
    for result in &report.measurements {
        let _ = write!(out, "## {}\n\n", heading(result));
        for note in &result.it.notes {
            let _ = writeln!(out, "* {note}");
        }
        for (_, title, grid) in result.tables() {
            let _ = writeln!(out, "\n### {title}\n\n{}", grid.markdown());
        }
        for (file, chart) in result.files() {
            let _ = write!(out, "![{}]({file}.svg)\n\n", chart.title);
        }
    }
    out
}

/// The thesis's slips as a table.
pub fn slips(slips: &[Slip]) -> Grid {
    let mut grid = Grid::new(["where", "what is printed", "against", "what the model does"]);
    for slip in slips {
        grid.push([&slip.place, &slip.printed, &slip.against, &slip.model]);
    }
    grid
}

/// What stands above a measurement.
pub fn heading(result: &NumberedItem<MeasuredStudy>) -> String {
    format!(
        "The chip against its theory {}: {}",
        result.number, result.title
    )
}

/// The report in one HTML file.
pub fn html(report: &Report) -> String {
    let mut body = String::new();
    let _ = writeln!(
        body,
        "<h1>Published and computed</h1>\n<p class=lead>{}</p>\n<p class=tally>{}</p>",
        escaped(INTRODUCTION),
        tallies(report)
    );
    if !report.claims.is_empty() {
        body += &glance(report);
    }
    for result in &report.claims {
        let claim = &result.claim;
        let _ = writeln!(
            body,
            "<section id=c{0}><h2><span class='badge {2}'>{3}</span> {0}. {1}</h2>\n<p class=source>{4}</p>",
            claim.number,
            escaped(claim.title),
            class(overall(&result.rows)),
            overall(&result.rows).text(),
            escaped(claim.source),
        );
        body += &claim_table(&result.rows);
        body += "</section>\n";
    }
    if !report.slips.is_empty() {
        let _ = writeln!(
            body,
            "<section id=slips><h2>{SLIPS_TITLE}</h2>\n<div class=words>{}</div></section>",
            grid_html(&slips(&report.slips))
        );
    }
    for NumberedItem { number, title, it } in &report.tables {
        let _ = writeln!(
            body,
            "<section id=t{number}><h2>Table {number}: {}</h2>\n{}</section>",
            escaped(title),
            grid_html(it)
        );
    }
    for NumberedItem { number, title, it } in &report.figures {
        let _ = writeln!(
            body,
            "<section id=f{number}><h2>Fig. {number}: {}</h2>\n<figure>{}</figure>\n</section>",
            escaped(title),
            scalable(&it.svg())
        );
    }
    for result in &report.measurements {
        let _ = writeln!(
            body,
            "<section id=m{}><h2>{}</h2>\n<ul class=source>",
            result.number,
            escaped(&heading(result))
        );
        for note in &result.it.notes {
            let _ = writeln!(body, "<li>{}</li>", escaped(note));
        }
        body += "</ul>\n";
        for (_, title, grid) in result.tables() {
            let _ = writeln!(
                body,
                "<h3>{}</h3>\n<div class=wide>{}</div>",
                escaped(title),
                grid_html(grid)
            );
        }
        for (_, chart) in result.files() {
            let _ = writeln!(body, "<figure>{}</figure>", scalable(&chart.svg()));
        }
        body += "</section>\n";
    }
    format!(
        "<!DOCTYPE html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n<meta name=viewport content='width=device-width'>\n\
         <title>Published and computed</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )
}

/// One coloured cell for every claim, and links to tables and figures.
fn glance(report: &Report) -> String {
    let mut out = String::from("<div class=glance>\n");
    for result in &report.claims {
        let verdict = overall(&result.rows);
        let _ = writeln!(
            out,
            "<a class='{}' href='#c{}'><b>{}</b> {}<i>{}; {} rows agree</i></a>",
            class(verdict),
            result.claim.number,
            result.claim.number,
            escaped(result.claim.title),
            verdict.text(),
            agreeing(&result.rows),
        );
    }
    out += "</div>\n<p class=links>";
    for table in &report.tables {
        let _ = write!(out, "<a href='#t{0}'>Table {0}</a> ", table.number);
    }
    for figure in &report.figures {
        let _ = write!(out, "<a href='#f{0}'>Fig. {0}</a> ", figure.number);
    }
    for result in &report.measurements {
        let _ = write!(out, "<a href='#m{0}'>Measured {0}</a> ", result.number);
    }
    out + "</p>\n"
}

fn tallies(report: &Report) -> String {
    let claims: Vec<Verdict> = report.claims.iter().map(|c| overall(&c.rows)).collect();
    let rows: Vec<Verdict> = report.rows().map(ClaimRow::verdict).collect();
    let badges = |verdicts: &[Verdict]| {
        let badges = verdict_counts(verdicts).into_iter().zip(Verdict::ALL);
        let badges =
            badges.map(|(text, v)| format!("<span class='badge {}'>{text}</span> ", class(v)));
        badges.collect::<String>()
    };
    format!(
        "{} claims: {}<br>{} rows: {}",
        claims.len(),
        badges(&claims),
        rows.len(),
        badges(&rows)
    )
}

fn claim_table(rows: &[ClaimRow]) -> String {
    let mut out = String::from("<table>\n<tr>");
    for heading in HEADINGS.iter().take(6) {
        let _ = write!(out, "<th>{heading}</th>");
    }
    out += "<th>within tolerance</th><th>verdict</th></tr>\n";
    for row in rows {
        let verdict = row.verdict();
        let cells = cells(row);
        let _ = write!(out, "<tr class={}>", class(verdict));
        for cell in &cells[..6] {
            let _ = write!(out, "<td>{}</td>", escaped(cell));
        }
        let _ = writeln!(
            out,
            "<td>{}</td><td><span class='badge {}'>{}</span></td></tr>",
            gauge(row),
            class(verdict),
            verdict.text()
        );
        let notes = row.notes();
        if !notes.is_empty() {
            let _ = writeln!(
                out,
                "<tr class=note><td colspan=8>{}</td></tr>",
                escaped(&notes)
            );
        }
    }
    out + "</table>\n"
}

/// Where the computed value lies in the published range: a band for the tolerance, a dot for ours. The picture spans
/// three tolerances either way; what is farther off is drawn at its edge.
fn gauge(row: &ClaimRow) -> String {
    let (Some(computed), Some((low, high))) = (row.computed, row.published.range()) else {
        return String::new();
    };
    // A bound has one end: the dot lies as far inside or outside as its relative distance.
    let position = match (low.is_finite(), high.is_finite()) {
        (true, true) if low == high => 3.0 * (computed - low).signum() * f64::from(computed != low),
        (true, true) => (computed - 0.5 * (low + high)) / (0.5 * (high - low)),
        (true, false) => 2.0 * (computed / low - 1.0) - 1.0,
        _ => 2.0 * (computed / high - 1.0) + 1.0,
    };
    let (left, right) = match (low.is_finite(), high.is_finite()) {
        (true, true) => (40.0, 80.0),
        (true, false) => (40.0, 120.0),
        _ => (0.0, 80.0),
    };
    let x = 60.0 + 20.0 * position.clamp(-2.8, 2.8);
    format!(
        "<svg class=gauge viewBox='0 0 120 14' width=120 height=14><rect x=0 y=6 width=120 height=2 fill=#ddd />\
         <rect x={left} y=3 width={} height=8 fill=#bfe3cf /><circle cx={x:.1} cy=7 r=4 fill={} /></svg>",
        right - left,
        match row.verdict() {
            Verdict::Agrees => "#0b7a45",
            Verdict::Fails => "#c01818",
            Verdict::Given => "#8a8a8a",
            _ => "#d98200",
        }
    )
}

fn grid_html(grid: &Grid) -> String {
    let mut out = String::from("<table class=plain>\n");
    for (index, row) in grid.lines().enumerate() {
        let cell = if index == 0 { "th" } else { "td" };
        out += "<tr>";
        for text in row {
            let _ = write!(out, "<{cell}>{}</{cell}>", escaped(text));
        }
        out += "</tr>\n";
    }
    out + "</table>\n"
}

/// An SVG that fits its container.
fn scalable(svg: &str) -> String {
    svg.replacen("width=\"900\" height=\"560\"", "class=\"chart\"", 1)
}

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Agrees => "agrees",
        Verdict::Differs => "differs",
        Verdict::NotShown => "unsure",
        Verdict::Given => "given",
        Verdict::Fails => "fails",
        Verdict::Ours => "ours",
        Verdict::NotModelled => "none",
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

const STYLE: &str = include_str!("page.css");
