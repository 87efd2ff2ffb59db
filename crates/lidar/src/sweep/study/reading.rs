//! A study's text: its keys, and everything that is wrong with it at once.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::files::{name_of, with_files_named};
use super::varied::varied;
use super::{MOST_POINTS, Study, StudyKind};
use crate::files::{InputError, instead_of};
use crate::request::{ReadAs, Spelling, refuse_other_kind};
use crate::settings::Range::Within;
use crate::settings::{Document, Fault, Section, Settings, keys, schema, words};
use crate::sweep::design::{MOST_SOBOL_AXES, SamplingDesign};
use crate::sweep::keys as names;
use crate::sweep::theory::TheorySettings;
use crate::sweep::values::{Axis, VariedKey};

words! {
    /// Words for [`SamplingDesign`].
    enum DesignWord {
        Grid = "grid",
        Latin = "latin",
        Sobol = "sobol",
    }
}

keys! {
    /// `[study]`.
    struct Head {
        /// Name of the study in reports; the file's name if left out.
        name: String = String::new();
        /// What is made of each point.
        kind: StudyKind = StudyKind::Frame;
        /// Folder for the results; `sweep-` and the name if left out.
        out: PathBuf = PathBuf::new();
        /// Which points are taken.
        design: DesignWord = DesignWord::Grid;
        /// How many, of a latin hypercube or a sobol sequence.
        points: Option<u64> = None, in Within(1.0, MOST_POINTS as f64);
        /// Seed of the first replica, and of the design.
        seed: u64 = 1, in Within(0.0, 9e15);
        /// How often each point is taken, with successive seeds.
        replicas: u64 = 1, in Within(1.0, 1e6);
    }
}

impl Study {
    /// Keys of a study file that are no other file's: of `[study]`, and of what theory is asked.
    pub const SECTIONS: [Section; 2] = [
        Section {
            name: "study",
            what: "What is computed for each point, and which points are taken",
            keys: Head::KEYS,
        },
        Section {
            name: "theory",
            what: "Settings of theory",
            keys: TheorySettings::KEYS,
        },
    ];

    /// The JSON schema of a study file. What may stand in `[fixed]` and `[vary]` depends on the scene and its objects, and is left open.
    pub fn schema() -> serde_json::Value {
        let numbers = ["points", "seed", "replicas"].map(|key| (key.to_owned(), Value::from(1)));
        let values = Table::from_iter([("study".to_owned(), Table::from_iter(numbers).into())]);
        let mut schema = schema("A study of gdtof", &Self::SECTIONS[..1], &values);
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
        let text = Document::text(path)?;
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
        let document = Document::parse(&source, &with_files_named(text))?;
        if document.table.is_empty() {
            let message = "has no settings; give what varies, below [vary]";
            return Err(InputError::new(source, message));
        }
        refuse_other_kind(&document, ReadAs::Study, Spelling::Options)?;
        let mut faults = Vec::new();
        let mut fault = |path: &str, message: String| {
            let path = path.to_owned();
            faults.push(Fault { path, message });
        };
        let nothing = Table::new();
        let section = |name: &str| match document.table.get(name) {
            None => Ok(&nothing),
            Some(Value::Table(table)) => Ok(table),
            Some(_) => Err(format!(
                "{name}: this must be a section; write its name in brackets, and its keys below"
            )),
        };
        for name in document.table.keys() {
            if !["study", "fixed", "vary"].contains(&name.as_str()) {
                fault(
                    name,
                    format!(
                        "{name}: unknown section; {}",
                        instead_of(name, ["study", "vary", "fixed"])
                    ),
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
        let head = document.section::<Head>("study", study, &mut study_faults);
        let head: Head = head.try_into().expect("every value has been tried");

        let mut assignments = Vec::new();
        flatten("", fixed, &mut |name, value| {
            let path = format!("fixed.{name}");
            let name = name_of(name);
            match names::find(head.kind, name).and_then(|known| names::checked(&known, value)) {
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
        axes.extend(zipped_axes(&document, head.kind, zipped, &mut fault));
        axes.sort_by_key(|(line, _)| *line);
        let axes: Vec<Axis> = axes.into_iter().map(|(_, axis)| axis).collect();

        check_once(&assignments, &axes, &mut fault);
        let design = design_of(&head, &axes, &mut fault);
        if head.kind == StudyKind::Theory && head.replicas > 1 {
            fault(
                "study.replicas",
                "replicas: theory has no random numbers, so replicas would be equal; leave it out"
                    .into(),
            );
        }
        faults.extend(study_faults);
        let any = !faults.is_empty();
        document.complain(faults)?;
        debug_assert!(!any);
        let name = if head.name.is_empty() {
            name.to_owned()
        } else {
            head.name
        };
        // A folder is called by it.
        if name.contains(['/', '\\', '\0']) {
            let message = format!(
                "name = {name:?} is impossible; give a name without / and \\, and say where results go with out"
            );
            let mut error = InputError::new(source, message);
            error.line = document.line("study.name");
            return Err(error);
        }
        let study = Study {
            out: if head.out.as_os_str().is_empty() {
                format!("sweep-{name}").into()
            } else {
                head.out
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
}

/// The axes of `[[vary.zip]]`, each with the line that it begins at.
fn zipped_axes(
    document: &Document,
    kind: StudyKind,
    zipped: Option<&Value>,
    fault: &mut impl FnMut(&str, String),
) -> Vec<(Option<usize>, Axis)> {
    let mut axes = Vec::new();
    let groups = match zipped {
        None => &Vec::new(),
        Some(Value::Array(groups)) => groups,
        Some(_) => {
            fault(
                "vary.zip",
                "zip is not a list; write each group as a section [[vary.zip]]".into(),
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
            &mut |name, value| match varied(kind, name, value) {
                Ok(varied) => members.push((document.line(&format!("{place}.{name}")), varied)),
                Err(message) => fault(&format!("{place}.{name}"), message),
            },
        );
        members.sort_by_key(|(line, _)| *line);
        let members: Vec<VariedKey> = members.into_iter().map(|(_, varied)| varied).collect();
        let Some(first) = members.first() else {
            continue;
        };
        if let Some(other) = members.iter().find(|other| other.len() != first.len()) {
            let count = |varied: &VariedKey| match varied.len() {
                Some(1) => format!("{} has 1 value", varied.name),
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
    axes
}

/// Complains of keys that have values in two places.
fn check_once(
    assignments: &[(String, Value)],
    axes: &[Axis],
    fault: &mut impl FnMut(&str, String),
) {
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
}

/// Which points are taken; a grid where that is at fault.
fn design_of(head: &Head, axes: &[Axis], fault: &mut impl FnMut(&str, String)) -> SamplingDesign {
    let drawn = match (head.design, head.points) {
        (DesignWord::Grid, None) => {
            for varied in axes.iter().flat_map(|axis| &axis.0) {
                if varied.len().is_none() {
                    let message = format!(
                        "{}: a grid needs steps; give steps, or design = \"latin\" or \"sobol\"",
                        varied.name
                    );
                    fault(&format!("vary.{}", varied.name), message);
                }
            }
            return SamplingDesign::Grid;
        }
        (DesignWord::Grid, Some(_)) => {
            let message = "points: the values determine the number of points of a grid; leave it out, or give design = \"latin\" or \"sobol\"";
            fault("study.points", message.into());
            return SamplingDesign::Grid;
        }
        (design, None) => {
            fault(
                "study.design",
                format!(
                    "design = {:?} needs the number of points; give points",
                    design.name()
                ),
            );
            return SamplingDesign::Grid;
        }
        (DesignWord::Latin, Some(points)) => SamplingDesign::Latin(points),
        (DesignWord::Sobol, Some(points)) => SamplingDesign::Sobol(points),
    };
    if axes.is_empty() {
        fault(
            "study.design",
            "design: nothing varies; give keys in [vary]".into(),
        );
    }
    if matches!(drawn, SamplingDesign::Sobol(_)) && axes.len() > MOST_SOBOL_AXES {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schema_has_every_key_of_a_study() {
        let schema = Study::schema();
        for key in Head::KEYS {
            assert!(schema["properties"]["study"]["properties"][key.name].is_object());
        }
        assert!(schema["properties"]["vary"].is_object());
    }
}
