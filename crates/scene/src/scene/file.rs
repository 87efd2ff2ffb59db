//! Scene files: reading them, all faults at once, and printing them.

use std::path::Path;

use toml::{Table, Value};

use super::curve::{CurveSetting, read_file};
use super::entry::ObjectEntry;
use super::interferer::Interferer;
use super::medium::Medium;
use super::object::Object;
use super::rig::Rig;
use super::rules::{check_object, check_rig, check_stereo};
use super::settings::{Lidar, Light, Scene, Stereo};
use super::words::FilterWord;
use crate::files::{InputError, nearest};
use crate::settings::{
    Document, Fault, Key, Notes, Range, Section, Settings, commented, remarks, schema,
};

impl Scene {
    /// The built-in street, from 15 to 180 m, 50 klux.
    pub fn outdoor() -> Self {
        Scene::named("street").expect("the street is built in")
    }

    /// The file of the built-in street, to be changed by `--set`.
    pub fn outdoor_document() -> Document {
        Scene::built_in_document("street").expect("the street is built in")
    }

    /// Reads a scene file. Files that it names are relative to its folder.
    ///
    /// # Errors
    /// As [`Scene::read`], or when the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Scene::read(&Document::load(path)?)
    }

    /// Reads a scene from TOML text; `source` names it in complaints.
    ///
    /// # Errors
    /// As [`Scene::read`], each fault with its line.
    pub fn parse(source: &str, text: &str) -> Result<Self, InputError> {
        Scene::read(&Document::parse(source, text)?)
    }

    /// Reads a scene from its document. Keys that are left out have their default: that of
    /// [`Lidar`](super::Lidar), [`Stereo`](super::Stereo) and [`Light`](super::Light); a document without objects is a scene without any.
    ///
    /// # Errors
    /// Syntax errors; unknown keys, keys that an object lacks, and impossible values, all of them at once.
    pub fn read(document: &Document) -> Result<Self, InputError> {
        if document.is_empty() {
            let message = "has no settings; give at least one, or leave the scene out for the built-in street";
            document.complain(vec![Fault::new("", message)])?;
        }
        let mut faults = Vec::new();
        let mut scene = Scene::default();
        for (name, value) in &document.table {
            let faults = &mut faults;
            let wrong = |message: &str| Fault::new(name, format!("{name}: {message}"));
            match (name.as_str(), value) {
                ("lidar", Value::Table(given)) => {
                    let given = with_curves(document, name, given, faults);
                    let before = faults.len();
                    scene.lidar = section(document, name, &given, faults);
                    if faults.len() == before {
                        faults.extend(scene.lidar.fault());
                    }
                }
                ("stereo", Value::Table(given)) => {
                    scene.stereo = section(document, name, given, faults)
                }
                ("light", Value::Table(given)) => {
                    scene.light = section(document, name, given, faults)
                }
                ("medium", Value::Table(given)) => {
                    scene.medium = section(document, name, given, faults)
                }
                ("rig", Value::Table(given)) => scene.rig = section(document, name, given, faults),
                ("object", Value::Array(items)) => {
                    for (index, item) in items.iter().enumerate() {
                        let path = format!("object.{index}");
                        scene.objects.extend(object(document, &path, item, faults));
                    }
                }
                ("interferer", Value::Array(items)) => {
                    for (index, item) in items.iter().enumerate() {
                        let path = format!("interferer.{index}");
                        let read = interferer(document, &path, item, faults);
                        scene.interferers.extend(read);
                    }
                }
                ("object" | "interferer", _) => faults.push(wrong(&format!(
                    "{name} is not a list; write each as a section [[{name}]]",
                ))),
                ("lidar" | "stereo" | "light" | "medium" | "rig", _) => faults.push(wrong(
                    "this must be a section; write its name in brackets, and its keys below",
                )),
                _ => faults.push(wrong(&instead_of_section(name))),
            }
        }
        if !faults.iter().any(|fault| fault.path.starts_with("stereo.")) {
            faults.extend(check_stereo(&scene.stereo));
        }
        faults.extend(check_rig(&scene.rig));
        faults.extend(check_wavelengths(&scene));
        for fault in &mut faults {
            if let Some((key, meant)) = key_of_other_section(&fault.path) {
                fault.message = format!("unknown key `{key}`; did you mean {meant}?");
            }
            fault.message = place(document, &fault.path) + &fault.message;
        }
        document.complain(faults)?;
        Ok(scene)
    }

    /// What there is to know of a key, by section and name as `lidar.pde`, or of an object as `object.car.reflectivity`; nothing if it is
    /// no key.
    pub fn key(path: &str) -> Option<Key> {
        let (section, name) = path.split_once('.')?;
        let name = match section {
            "object" | "interferer" => name.rsplit_once('.')?.1,
            _ => name,
        };
        let section = Scene::SECTIONS.iter().find(|known| known.name == section)?;
        section.keys.iter().find(|key| key.name == name).copied()
    }

    /// Sentences on values that are probably in another unit than their key has, on a filter that is not for the laser, and on a pulse with
    /// which depths have no bounds.
    pub fn remarks(&self) -> Vec<String> {
        let of_units = remarks(Scene::SECTIONS, &self.table());
        of_units
            .into_iter()
            .chain(self.lidar.remark_on_filter())
            .chain(self.remark_on_pulse())
            .collect()
    }

    /// All values as a TOML table.
    pub(super) fn table(&self) -> Table {
        Table::try_from(self).expect("a scene is numbers and texts")
    }

    /// The scene as a commented file, which [`Scene::parse`] reads back.
    pub fn commented(&self) -> String {
        self.commented_with(&Notes::default())
    }

    /// As [`Scene::commented`], with reasons for values, which [`Scene::built_in_notes`] has.
    pub fn commented_with(&self, notes: &Notes) -> String {
        let left_out = Scene::default().table();
        commented(Scene::SECTIONS, &self.table(), &left_out, notes)
    }

    /// The JSON schema of a scene file.
    pub fn schema() -> serde_json::Value {
        schema(
            "A scene of gdtof",
            Scene::SECTIONS,
            &Scene::default().table(),
        )
    }
}

/// The key at `path`, if its section has none of a name like that, and the key of another section that has.
fn key_of_other_section(path: &str) -> Option<(&str, String)> {
    let (section, rest) = path.split_once('.')?;
    let key = rest.rsplit('.').next()?;
    let (own, others): (Vec<&Section>, Vec<&Section>) =
        (Scene::SECTIONS.iter()).partition(|other| other.name == section);
    let names = |section: &'static Section| section.keys.iter().map(|key| key.name);
    let has_own = |own: &&'static Section| {
        names(own).any(|name| name == key) || nearest(key, names(own)).is_some()
    };
    if own.is_empty() || own.iter().any(has_own) {
        return None;
    }
    let meant = nearest(key, others.iter().flat_map(|section| names(section)))?;
    let section = others
        .iter()
        .find(|section| names(section).any(|name| name == meant))?;
    Some((
        key,
        match section.name {
            list @ ("object" | "interferer") => format!("`{meant}` of an [[{list}]]"),
            name => format!("`{meant}` of [{name}]"),
        },
    ))
}

/// What to do about the name of a section that is none.
fn instead_of_section(name: &str) -> String {
    let has_key = |section: &&Section| section.keys.iter().any(|key| key.name == name);
    if let Some(section) = Scene::SECTIONS.iter().find(has_key) {
        let section = section.name;
        return format!(
            "a key of [{section}] without its section; did you mean scene.{section}.{name}?"
        );
    }
    let sections = Scene::SECTIONS.iter().map(|section| section.name);
    match nearest(name, sections) {
        Some(meant) => format!("unknown section; did you mean [{meant}]?"),
        None => "unknown section; give [lidar], [stereo], [light], [medium], [rig], [[object]] or [[interferer]]".to_owned(),
    }
}

/// The lidar's section with what is in the files that it names, in the place of their names.
fn with_curves(document: &Document, name: &str, given: &Table, faults: &mut Vec<Fault>) -> Table {
    let mut read = given.clone();
    let is_curve = |key: &&Key| matches!(key.range, Range::WordOrCurve(..));
    for key in Lidar::KEYS.iter().filter(is_curve) {
        let path = format!("{name}.{}", key.name);
        let Some(value) = given.get(key.name) else {
            continue;
        };
        match read_file(value, &document.folder) {
            Ok(None) => (),
            Ok(Some(curve)) => drop(read.insert(key.name.into(), curve)),
            Err(why) => {
                read.remove(key.name);
                let message = format!("{}: {why}", key.name);
                faults.push(Fault { path, message });
            }
        }
    }
    read
}

/// A section whose keys all have defaults.
fn section<T: Settings>(
    document: &Document,
    name: &str,
    given: &Table,
    faults: &mut Vec<Fault>,
) -> T {
    let read = document.section::<T>(name, given, faults);
    read.try_into().unwrap_or_default()
}

/// The object at `path`, if it has no fault.
fn object(
    document: &Document,
    path: &str,
    item: &Value,
    faults: &mut Vec<Fault>,
) -> Option<Object> {
    let fault = |message: String| Fault::new(path, message);
    let Value::Table(given) = item else {
        let message = "this must be a section [[object]]; write its keys below";
        faults.push(fault(message.into()));
        return None;
    };
    let needed = ["name", "kind", "reflectivity"];
    let lacks = needed.iter().find(|key| !given.contains_key(**key));
    faults.extend(lacks.map(|key| fault(format!("lacks `{key}`; add it"))));
    let before = faults.len();
    let read = document.section::<ObjectEntry>(path, given, faults);
    if lacks.is_some() || faults.len() > before {
        return None;
    }
    let entry = read.try_into::<ObjectEntry>();
    let entry = entry.map_err(|e: toml::de::Error| e.message().trim().to_owned());
    let object = entry.and_then(|e| e.object(&document.folder));
    let object = object.map_err(fault);
    let checked = object.and_then(|o| check_object(path, &o).map_or(Ok(o), Err));
    checked.map_err(|fault| faults.push(fault)).ok()
}

/// The lidar of another at `path`, if it has no fault.
fn interferer(
    document: &Document,
    path: &str,
    item: &Value,
    faults: &mut Vec<Fault>,
) -> Option<Interferer> {
    let before = faults.len();
    let complaint = match item {
        Value::Table(given)
            if ["name", "place_m"]
                .iter()
                .all(|key| given.contains_key(*key)) =>
        {
            let other: Interferer = section(document, path, given, faults);
            if faults.len() == before {
                faults.extend(other.fault(path));
            }
            return (faults.len() == before).then_some(other);
        }
        Value::Table(_) => "lacks `name` or `place_m`; add both",
        _ => "this must be a section [[interferer]]; write its keys below",
    };
    faults.push(Fault::new(path, complaint));
    None
}

/// What other lidars' wavelengths ask of the filter.
fn check_wavelengths(scene: &Scene) -> Option<Fault> {
    if scene.lidar.filter != CurveSetting::Word(FilterWord::Irradiance) {
        return None;
    }
    let index = scene
        .interferers
        .iter()
        .position(|other| other.wavelength_nm.is_some())?;
    let path = format!("interferer.{index}.wavelength_nm");
    let message = "wavelength_nm means nothing where lidar.filter is irradiance, which says no wavelengths; give the filter's shape or curve";
    Some(Fault::new(path, message))
}

/// Where a fault is, as the beginning of a sentence.
fn place(document: &Document, path: &str) -> String {
    let mut names = path.split('.');
    match (names.next(), names.next()) {
        (Some(list @ ("object" | "interferer")), Some(index)) => {
            let index: usize = index.parse().unwrap_or(0);
            let item = document.table.get(list).and_then(|list| list.get(index));
            let name = item.and_then(|item| item.get("name")?.as_str());
            let name = name.map_or(String::new(), |name| format!(" ({name})"));
            format!("in [[{list}]] number {}{name}, ", index + 1)
        }
        (Some(section), Some(_)) => format!("in [{section}], "),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests;

impl Scene {
    /// The sections of a scene file.
    pub const SECTIONS: &'static [Section] = &[
        Section::new("lidar", "Laser, lens and SPADs of the lidar", Lidar::KEYS),
        Section::new(
            "stereo",
            "The camera pair that guides the lidar",
            Stereo::KEYS,
        ),
        Section::new("light", "Sunlight", Light::KEYS),
        Section::new("medium", "What is in the air", Medium::KEYS),
        Section::new(
            "rig",
            "Motion of lidar and cameras together; the scene is described at time 0",
            Rig::KEYS,
        ),
        Section::new(
            "object",
            "What there is to see: any number of objects, none if left out. Metres; x right, y down, z forward; the lidar is at the origin",
            ObjectEntry::KEYS,
        ),
        Section::new(
            "interferer",
            "Lidars of other vehicles: any number, none if left out",
            Interferer::KEYS,
        ),
    ];
}
