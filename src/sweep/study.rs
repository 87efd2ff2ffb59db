//! A study: what varies, over what, and what is made of each point.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::cell::{Column, Holds};
use super::design::{self, Design, MOST_SOBOL_AXES};
use super::keys::{self, Known};
use super::values::{Axis, Span, Values, Varied};
use crate::files::InputError;
use crate::settings::{Document, Fault, Key, Range, Section, schema};

/// What is made of each point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A guided frame.
    #[default]
    Frame,
    /// What theory says of one macropixel.
    Theory,
}

/// Points of a study at most: a study of more is a slip of the pen.
pub const MOST_POINTS: u64 = 100_000_000;

const fn key(name: &'static str, range: Range, what: &'static str) -> Key {
    Key {
        name,
        what,
        unit: "",
        range,
        source: "chosen",
    }
}

/// Keys of `[study]`.
const STUDY: &[Key] = &[
    key(
        "name",
        Range::Text,
        "What reports call it; the file's name without it",
    ),
    key(
        "kind",
        Range::OneOf(&["frame", "theory"]),
        "What is made of each point",
    ),
    key(
        "out",
        Range::Text,
        "Folder of its results; `sweep-` and the name without it",
    ),
    key(
        "design",
        Range::OneOf(&["grid", "latin", "sobol"]),
        "Which points are taken",
    ),
    key(
        "points",
        Range::Within(1.0, MOST_POINTS as f64),
        "How many, of a latin hypercube or a sobol sequence",
    ),
    key(
        "seed",
        Range::Within(0.0, 9e15),
        "Seed of the first replica, and of the design",
    ),
    key(
        "replicas",
        Range::Within(1.0, 1e6),
        "Times that each point is taken, with seeds one after the other",
    ),
];

/// `[study]`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Head {
    name: String,
    kind: Kind,
    out: PathBuf,
    design: String,
    points: Option<u64>,
    seed: u64,
    replicas: u64,
}

impl Default for Head {
    fn default() -> Self {
        Head {
            name: String::new(),
            kind: Kind::Frame,
            out: PathBuf::new(),
            design: "grid".into(),
            points: None,
            seed: 1,
            replicas: 1,
        }
    }
}

/// A range, as a study writes it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeEntry {
    from: Value,
    to: Value,
    steps: Option<u32>,
    #[serde(default)]
    scale: Scale,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Scale {
    #[default]
    Linear,
    Log,
}

/// A study that can be run.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// What reports call it.
    pub name: String,
    /// What is made of each point.
    pub kind: Kind,
    /// Folder of its results, as written: relative to the current one.
    pub out: PathBuf,
    /// Seed of the first replica.
    pub seed: u64,
    /// Times that each point is taken.
    pub replicas: u64,
    /// Which points are taken.
    pub design: Design,
    /// Its text, and what complaints call it.
    text: String,
    source: String,
    /// What files that it names are relative to.
    folder: PathBuf,
    fixed: Vec<(String, Value)>,
    axes: Vec<Axis>,
}

/// A point of a study: values of the keys that vary, and its seed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    /// In the order of [`Study::varied`].
    pub(super) values: Vec<Value>,
    pub(super) seed: u64,
}

impl Study {
    /// The JSON schema of a study file. What may stand in [fixed] and [vary] depends on the scene and its objects, and is left open.
    pub fn schema() -> serde_json::Value {
        let section = Section {
            name: "study",
            what: "What is made of each point, and which points are taken",
            keys: STUDY,
        };
        let numbers = ["points", "seed", "replicas"].map(|key| (key.to_owned(), Value::from(1)));
        let values = Table::from_iter([("study".to_owned(), Table::from_iter(numbers).into())]);
        let mut schema = schema("A study of gdtof", &[section], &values);
        for (name, what) in [
            (
                "fixed",
                "Values of keys that do not vary: sensor.KEY, scene.SECTION.KEY, guide, windows.KEY, frame.KEY, theory.KEY",
            ),
            (
                "vary",
                "Lists or ranges {from, to, steps, scale} of keys that do; [[vary.zip]] for keys that go together",
            ),
        ] {
            schema["properties"][name] =
                serde_json::json!({ "type": "object", "description": what });
        }
        schema
    }

    /// Reads a study file.
    ///
    /// # Errors
    /// As [`Study::parse`], or when it cannot be read.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let text = crate::files::read_text(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(path.display(), &text, folder, &stem)
    }

    /// Reads a study; `source` names it in complaints, files that it names are relative to `folder`, and `name` is what it is called if
    /// it does not say.
    ///
    /// # Errors
    /// No TOML; unknown keys, values that no sensor, scene or frame takes, empty lists, more points than [`MOST_POINTS`]: all of them
    /// at once, with their lines.
    pub fn parse(
        source: impl std::fmt::Display,
        text: &str,
        folder: &Path,
        name: &str,
    ) -> Result<Self, InputError> {
        let document = Document::parse(&source, text)?;
        let mut faults = Vec::new();
        let mut fault = |path: &str, message: String| {
            let path = path.to_owned();
            faults.push(Fault { path, message });
        };
        let nothing = Table::new();
        let section = |name: &str| match document.table().get(name) {
            None => Ok(&nothing),
            Some(Value::Table(table)) => Ok(table),
            Some(_) => Err(format!(
                "{name}: this must be a section; write its name in brackets, and its keys below"
            )),
        };
        for name in document.table().keys() {
            if !["study", "fixed", "vary"].contains(&name.as_str()) {
                fault(
                    name,
                    format!("{name}: unknown section; give [study], [vary] or [fixed]"),
                );
            }
        }
        let mut sections = ["study", "fixed", "vary"].map(|name| {
            section(name).unwrap_or_else(|message| {
                fault(name, message);
                &nothing
            })
        });
        let [study, fixed, vary] = &mut sections;
        let mut study_faults = Vec::new();
        let head = document.section::<Head>("study", study, STUDY, &nothing, &mut study_faults);
        let head: Head = head.try_into().expect("every value has been tried");

        let mut assignments = Vec::new();
        flatten("", fixed, &mut |name, value| {
            let path = format!("fixed.{name}");
            match keys::find(head.kind, name).and_then(|known| keys::checked(&known, value)) {
                Ok(value) => assignments.push((name.to_owned(), value)),
                Err(message) => fault(&path, message),
            }
        });

        // In the order in which they are written: the first one varies slowest.
        let mut axes: Vec<(Option<usize>, Axis)> = Vec::new();
        let is_zip = |(name, _): &(&String, &Value)| *name == "zip";
        let zipped = vary.iter().find(is_zip).map(|(_, value)| value);
        let alone: Table = (vary.iter().filter(|entry| !is_zip(entry)))
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        flatten("", &alone, &mut |name, value| {
            let path = format!("vary.{name}");
            match varied(head.kind, name, value) {
                Ok(varied) => axes.push((document.line(&path), Axis(vec![varied]))),
                Err(message) => fault(&path, message),
            }
        });
        let groups = match zipped {
            None => &Vec::new(),
            Some(Value::Array(groups)) => groups,
            Some(_) => {
                fault(
                    "vary.zip",
                    "zip is no list; write each group as a section [[vary.zip]]".into(),
                );
                &Vec::new()
            }
        };
        for (index, group) in groups.iter().enumerate() {
            let place = format!("vary.zip.{index}");
            let Value::Table(group) = group else {
                fault(
                    &place,
                    "this must be a section; write [[vary.zip]], and its keys below".into(),
                );
                continue;
            };
            let mut members = Vec::new();
            flatten(
                "",
                group,
                &mut |name, value| match varied(head.kind, name, value) {
                    Ok(varied) => members.push((document.line(&format!("{place}.{name}")), varied)),
                    Err(message) => fault(&format!("{place}.{name}"), message),
                },
            );
            members.sort_by_key(|(line, _)| *line);
            let members: Vec<Varied> = members.into_iter().map(|(_, varied)| varied).collect();
            let Some(first) = members.first() else {
                continue;
            };
            if let Some(other) = members.iter().find(|other| other.len() != first.len()) {
                let count = |varied: &Varied| match varied.len() {
                    Some(n) => format!("{} has {n} values", varied.name),
                    None => format!("{} has no steps", varied.name),
                };
                fault(
                    &place,
                    format!(
                        "{} and {}; give as many of each",
                        count(first),
                        count(other)
                    ),
                );
                continue;
            }
            axes.push((document.line(&place), Axis(members)));
        }
        axes.sort_by_key(|(line, _)| *line);
        let axes: Vec<Axis> = axes.into_iter().map(|(_, axis)| axis).collect();

        let names: Vec<&str> = axes
            .iter()
            .flat_map(|a| &a.0)
            .map(|v| v.name.as_str())
            .collect();
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                fault(
                    &format!("vary.{name}"),
                    format!("{name} varies twice; leave one out"),
                );
            }
            if assignments.iter().any(|(fixed, _)| fixed == name) {
                fault(
                    &format!("fixed.{name}"),
                    format!("{name} is fixed and varies, too; leave one out"),
                );
            }
        }
        let design = design_of(&head, &axes, &mut fault);
        if head.kind == Kind::Theory && head.replicas > 1 {
            fault(
                "study.replicas",
                "replicas: theory has no chance in it, and replicas would be alike; leave it out"
                    .into(),
            );
        }
        faults.extend(study_faults);
        let any = !faults.is_empty();
        document.complain(faults)?;
        debug_assert!(!any);
        let name = match head.name.is_empty() {
            true => name.to_owned(),
            false => head.name,
        };
        let study = Study {
            out: match head.out.as_os_str().is_empty() {
                true => format!("sweep-{name}").into(),
                false => head.out,
            },
            name,
            kind: head.kind,
            seed: head.seed,
            replicas: head.replicas,
            design,
            text: text.to_owned(),
            source: source.to_string(),
            folder: folder.to_owned(),
            fixed: assignments,
            axes,
        };
        let points = study.points().ok_or_else(|| {
            let message = format!(
                "has more than {MOST_POINTS} points; give fewer values, or a design with points"
            );
            InputError::new(&study.source, message)
        })?;
        debug_assert!(points > 0);
        Ok(study)
    }

    /// Its points; `None` for more than [`MOST_POINTS`].
    fn points(&self) -> Option<u64> {
        let places = match self.design {
            Design::Grid => self.axes.iter().try_fold(1u64, |product, axis| {
                product.checked_mul(axis.len().expect("checked"))
            })?,
            Design::Latin(points) | Design::Sobol(points) => points,
        };
        places
            .checked_mul(self.replicas)
            .filter(|n| *n <= MOST_POINTS)
    }

    /// How many points it has.
    pub fn len(&self) -> u64 {
        self.points().expect("checked when it was read")
    }

    /// Never: a study has at least one point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its text, as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What complaints call it.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// What files that it names are relative to.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keys that do not vary, with their values.
    pub(super) fn fixed(&self) -> &[(String, Value)] {
        &self.fixed
    }

    /// Keys that vary, in the order of the points' values.
    pub(super) fn varied(&self) -> impl Iterator<Item = &Varied> {
        self.axes.iter().flat_map(|axis| &axis.0)
    }

    /// The point of this number.
    pub(super) fn point(&self, index: u64) -> Point {
        let (place, replica) = (index / self.replicas, index % self.replicas);
        let mut values = Vec::new();
        match self.design {
            Design::Grid => {
                let mut rest = place;
                for axis in self.axes.iter().rev() {
                    let len = axis.len().expect("checked");
                    let at = rest % len;
                    rest /= len;
                    values.extend(axis.0.iter().rev().map(|varied| varied.value(at)));
                }
                values.reverse();
            }
            design => {
                for (number, axis) in self.axes.iter().enumerate() {
                    let share = design::share(design, self.seed, number, place);
                    values.extend(axis.0.iter().map(|varied| varied.value_at(share)));
                }
            }
        }
        let seed = self.seed + replica;
        Point { values, seed }
    }

    /// Whether an axis is a range in equal ratios.
    pub(super) fn is_log(&self, column: &str) -> bool {
        let mut varied = self.varied();
        let found = varied.find(|varied| varied.column.name == column);
        matches!(found, Some(Varied { values: Values::Range(span), .. }) if span.is_log)
    }
}

fn design_of(head: &Head, axes: &[Axis], fault: &mut impl FnMut(&str, String)) -> Design {
    let drawn = match (head.design.as_str(), head.points) {
        ("grid", None) => {
            for varied in axes.iter().flat_map(|axis| &axis.0) {
                if varied.len().is_none() {
                    let message = format!(
                        "{}: a grid goes in steps; give steps, or design = \"latin\" or \"sobol\"",
                        varied.name
                    );
                    fault(&format!("vary.{}", varied.name), message);
                }
            }
            return Design::Grid;
        }
        ("grid", Some(_)) => {
            let message = "points: a grid has as many as its values make; leave it out, or give design = \"latin\" or \"sobol\"";
            fault("study.points", message.into());
            return Design::Grid;
        }
        (design, None) => {
            fault(
                "study.design",
                format!("design = \"{design}\" takes so many points as it is told; give points"),
            );
            return Design::Grid;
        }
        ("latin", Some(points)) => Design::Latin(points),
        (_, Some(points)) => Design::Sobol(points),
    };
    if axes.is_empty() {
        fault(
            "study.design",
            "design: nothing varies; give keys in [vary]".into(),
        );
    }
    if matches!(drawn, Design::Sobol(_)) && axes.len() > MOST_SOBOL_AXES {
        let message = format!(
            "design = \"sobol\" has directions for {MOST_SOBOL_AXES} keys, and {} vary; give design = \"latin\"",
            axes.len()
        );
        fault("study.design", message);
    }
    drawn
}

/// Tells `found` of every value of nested tables, its names joined by dots. A range counts as a value.
fn flatten(prefix: &str, table: &Table, found: &mut dyn FnMut(&str, &Value)) {
    for (name, value) in table {
        let name = match prefix {
            "" => name.clone(),
            _ => format!("{prefix}.{name}"),
        };
        match value {
            Value::Table(inner) if !inner.contains_key("from") && !inner.contains_key("to") => {
                flatten(&name, inner, found);
            }
            _ => found(&name, value),
        }
    }
}

/// What `[vary]` says of a key.
fn varied(kind: Kind, name: &str, value: &Value) -> Result<Varied, String> {
    let known = keys::find(kind, name)?;
    let values = match value {
        Value::Array(list) if list.is_empty() => {
            return Err(format!("{name} has no values; give at least one"));
        }
        Value::Array(list) => {
            let list: Result<_, String> = list
                .iter()
                .map(|value| keys::checked(&known, value))
                .collect();
            Values::List(list?)
        }
        Value::Table(range) => Values::Range(span(&known, name, range)?),
        _ => {
            return Err(format!(
                "{name} has one value; give a list or a range, or write it below [fixed]"
            ));
        }
    };
    let is_list = |value: &Value| value.is_array();
    let holds = match &values {
        // A position is no number that one could plot.
        Values::List(list) if list.iter().any(is_list) => Holds::Word,
        _ => known.holds,
    };
    Ok(Varied {
        name: name.to_owned(),
        column: Column::new(name, known.key.unit, holds),
        values,
    })
}

fn span(known: &Known, name: &str, range: &Table) -> Result<Span, String> {
    let RangeEntry {
        from,
        to,
        steps,
        scale,
    } = range.clone().try_into().map_err(|e: toml::de::Error| {
        let message = e.message().trim().replace('\n', " ");
        format!(
            "{name}: {message}; give {{from = …, to = …, steps = …, scale = \"linear\" or \"log\"}}"
        )
    })?;
    let ends = [from, to].map(|end| -> Result<f64, String> {
        let end = keys::checked(known, &end)?;
        let number = end.as_integer().map(|n| n as f64).or(end.as_float());
        number.ok_or_else(|| format!("{name} takes no numbers; give a list of its values"))
    });
    let [from, to] = ends;
    let (from, to) = (from?, to?);
    if steps == Some(0) || (steps == Some(1) && from != to) {
        return Err(format!(
            "{name}: a range has 2 steps at least, its ends; give steps"
        ));
    }
    if scale == Scale::Log && !(from > 0.0 && to > 0.0) {
        return Err(format!(
            "{name}: equal ratios never come to {}; give ends above 0, or scale = \"linear\"",
            from.min(to)
        ));
    }
    Ok(Span {
        from,
        to,
        steps,
        is_log: scale == Scale::Log,
        is_whole: known.holds == Holds::Whole,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(text: &str) -> Study {
        Study::parse("study.toml", text, Path::new(""), "test").unwrap()
    }

    fn numbers(study: &Study, index: u64) -> Vec<f64> {
        let values = study.point(index).values.into_iter();
        let number = |value: Value| value.as_float().or(value.as_integer().map(|n| n as f64));
        values.map(|value| number(value).unwrap()).collect()
    }

    #[test]
    fn the_first_key_varies_slowest_and_seeds_fastest() {
        let study = study(
            "[study]\nseed = 7\nreplicas = 2\n[vary]\nsensor.rows = [4, 8]\n[[vary.zip]]\nsensor.bins = [8, 16, 32]\n\
             frame.laser_cycles = { from = 10, to = 1000, steps = 3, scale = \"log\" }\n",
        );
        assert_eq!(study.len(), 12);
        let all: Vec<_> = (0..12)
            .map(|index| (numbers(&study, index), study.point(index).seed))
            .collect();
        assert_eq!(all[0], (vec![4.0, 8.0, 10.0], 7));
        assert_eq!(all[1], (vec![4.0, 8.0, 10.0], 8));
        assert_eq!(all[3], (vec![4.0, 16.0, 100.0], 8));
        assert_eq!(all[11], (vec![8.0, 32.0, 1000.0], 8));
    }

    #[test]
    fn drawn_points_stay_within_their_ranges_and_keys_that_count_are_whole() {
        for design in ["latin", "sobol"] {
            let text = format!(
                "[study]\ndesign = \"{design}\"\npoints = 64\n[vary]\nsensor.clk_hz = {{ from = \"100 MHz\", to = 4e8 }}\n\
                 sensor.threshold = [1, 2, 3, 4]\nframe.laser_cycles = {{ from = 1, to = 1000, scale = \"log\" }}\n"
            );
            let study = study(&text);
            let points: Vec<_> = (0..64).map(|index| numbers(&study, index)).collect();
            for point in &points {
                assert!((1e8..=4e8).contains(&point[0]) && (1.0..=1000.0).contains(&point[2]));
                assert_eq!(point[2].fract(), 0.0);
            }
            // In equal ratios: as many of them below the geometric mean as above.
            let low = points.iter().filter(|point| point[2] < 31.6).count();
            assert!((28..=36).contains(&low), "{design}: {low}");
            for threshold in 1..=4 {
                let of = points
                    .iter()
                    .filter(|point| point[1] == f64::from(threshold));
                assert_eq!(of.count(), 16, "{design}");
            }
        }
    }

    #[test]
    fn the_schema_has_every_key_of_a_study() {
        let schema = Study::schema();
        for key in STUDY {
            assert!(schema["properties"]["study"]["properties"][key.name].is_object());
        }
        assert!(schema["properties"]["vary"].is_object());
    }
}
