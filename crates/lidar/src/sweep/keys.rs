//! The names that a study may give values to: keys of sensor, scene, windows, frame and theory.

use toml::{Table, Value};

use super::StudyKind;
use super::cell::Holds;
use super::theory::TheorySettings;
use crate::chip::SensorConfig;
use crate::files::{instead_of, nearest};
use crate::request::{FrameRequest, scene_key_named};
use crate::scene::Scene;
use crate::settings::{Key, Range, Settings};
use crate::system::WindowPolicy;

const SENSOR: Key = Key::chosen("sensor", Range::Text, "Chip or sensor file");
const SCENE: Key = Key::chosen("scene", Range::Text, "Built-in scene or scene file");
const GUIDE: Key = Key::chosen(
    "guide",
    Range::Text,
    "What guides the windows, one or a list of several",
);
const WINDOWS: Key = Key::chosen("windows", Range::Text, "How windows are chosen");

/// A key, and what its values are.
#[derive(Debug, Clone, Copy)]
pub(super) struct TypedKey {
    pub(super) key: Key,
    pub(super) holds: Holds,
}

/// The key of this name.
///
/// # Errors
/// There is none: what there is instead.
pub(super) fn find(kind: StudyKind, name: &str) -> Result<TypedKey, String> {
    let (group, rest) = name.split_once('.').unwrap_or((name, ""));
    let none = |there_are: String| {
        let meant = key_elsewhere(name);
        let there_are = meant.map_or(there_are, |meant| format!("did you mean `{meant}`?"));
        Err(format!("{name} is not a key of a study; {there_are}"))
    };
    let all = |keys: &[Key]| -> String {
        let names: Vec<String> = keys.iter().map(|k| format!("{group}.{}", k.name)).collect();
        instead_of(name, names.iter().map(String::as_str))
    };
    let among = |keys: &[Key]| keys.iter().find(|key| key.name == rest).copied();
    let (found, defaults) = match (group, rest, kind) {
        ("sensor", "", _) => (Some(SENSOR), Table::new()),
        ("scene", "", _) => (Some(SCENE), Table::new()),
        ("guide", "", StudyKind::Frame) => (Some(GUIDE), Table::new()),
        ("windows", "", StudyKind::Frame) => (Some(WINDOWS), Table::new()),
        ("sensor", key, _) => {
            let Some(found) = SensorConfig::key(key) else {
                return none(
                    match nearest(key, SensorConfig::KEYS.iter().map(|key| key.name)) {
                        Some(meant) => format!("did you mean `sensor.{meant}`?"),
                        None => "`gdtof sensor` lists those of the sensor".into(),
                    },
                );
            };
            let defaults = Table::try_from(SensorConfig::default()).expect("numbers and words");
            (Some(found), defaults)
        }
        ("scene", path, _) => {
            let Some(found) = Scene::key(path) else {
                let (section, key) = path.rsplit_once('.').unwrap_or(("", path));
                let sections = Scene::SECTIONS.iter();
                let sections = sections
                    .filter(|s| section.is_empty() || section.split('.').next() == Some(s.name));
                let known = sections.flat_map(|s| s.keys.iter().map(move |key| (s.name, key.name)));
                let meant = nearest(key, known.clone().map(|(_, key)| key));
                if let Some((name, key)) =
                    meant.and_then(|meant| known.clone().find(|(_, key)| *key == meant))
                {
                    let section = if section.is_empty() { name } else { section };
                    return none(format!("did you mean `scene.{section}.{key}`?"));
                }
                return none("`gdtof scene` lists those of the scene, section and key joined by a dot; an object goes by its name, as scene.object.car.reflectivity".into());
            };
            let section = path.split('.').next().unwrap_or_default();
            let defaults = Table::try_from(Scene::default()).expect("numbers and words");
            let defaults = defaults.get(section).and_then(Value::as_table);
            (Some(found), defaults.cloned().unwrap_or_default())
        }
        ("windows", _, StudyKind::Frame) => match among(WindowPolicy::KEYS) {
            None => return none(all(WindowPolicy::KEYS)),
            found => {
                let defaults = Table::try_from(WindowPolicy::for_sequences());
                (found, defaults.expect("numbers and words"))
            }
        },
        ("frame", "seed", _) => {
            return none("seeds are those of [study]: seed and replicas".into());
        }
        ("frame", "guides" | "windows", _) => {
            return none("guide and windows stand for themselves".into());
        }
        ("frame", _, StudyKind::Frame) => match among(FrameRequest::KEYS) {
            None => return none(all(FrameRequest::KEYS)),
            found => {
                let all = FrameRequest::default();
                (found, Table::try_from(all).expect("numbers and words"))
            }
        },
        ("theory", _, StudyKind::Theory) => match among(TheorySettings::KEYS) {
            None => return none(all(TheorySettings::KEYS)),
            found => (
                found,
                Table::try_from(TheorySettings::default()).expect("numbers and words"),
            ),
        },
        (_, _, StudyKind::Frame) => {
            return none("give one that begins with sensor, scene, guide, windows or frame".into());
        }
        (_, _, StudyKind::Theory) => {
            return none("give one that begins with theory, sensor or scene".into());
        }
    };
    let key = found.expect("every other arm has returned");
    let holds = match key.range {
        Range::Within(..) | Range::Above(..) | Range::Limited(..) => match defaults.get(key.name) {
            Some(Value::Integer(_)) => Holds::Whole,
            _ => Holds::Number,
        },
        Range::Switch => Holds::Truth,
        Range::OneOf(_) | Range::WordOrCurve(..) | Range::Text => Holds::Word,
    };
    Ok(TypedKey { key, holds })
}

/// The name in a study of the key whose last part is that of `name`, if there is one.
fn key_elsewhere(name: &str) -> Option<String> {
    let key = name.rsplit('.').next()?;
    let is_of = |keys: &[Key]| keys.iter().any(|known| known.name == key);
    let of_group = |group: &str, keys: &[Key]| is_of(keys).then(|| format!("{group}.{key}"));
    of_group("sensor", SensorConfig::KEYS)
        .or_else(|| scene_key_named(key))
        .or_else(|| of_group("windows", WindowPolicy::KEYS))
        .filter(|meant| meant != name)
}

/// A value of a key, as a plain number where it is a quantity.
///
/// # Errors
/// What is wrong with it: nothing that depends on other keys.
pub(super) fn checked(known: &TypedKey, value: &Value) -> Result<Value, String> {
    let TypedKey { key, holds } = known;
    let plain = match key.plain(value)? {
        Value::Float(x) if *holds == Holds::Whole && x.fract() == 0.0 => Value::Integer(x as i64),
        plain => plain,
    };
    let wrong = |wanted: &str| {
        Err(format!(
            "{} = {value} is impossible; give {wanted}",
            key.name
        ))
    };
    match (&plain, holds, key.range) {
        (Value::Float(_), Holds::Whole, _) => return wrong("a whole number"),
        (Value::Integer(_) | Value::Float(_), Holds::Whole | Holds::Number, _) => {}
        // Positions and such: lists of numbers.
        (Value::Array(items), Holds::Number, _)
            if items.iter().all(|i| i.is_integer() || i.is_float()) => {}
        (_, Holds::Whole | Holds::Number, _) => return wrong("a number"),
        (Value::Boolean(_), Holds::Truth, _) => {}
        (_, Holds::Truth, _) => return wrong("true or false"),
        (Value::String(word), _, Range::OneOf(words)) if !words.contains(&word.as_str()) => {
            return wrong(&words.join(", "));
        }
        (Value::String(_), Holds::Word, _) => {}
        (Value::Array(items), Holds::Word, _)
            if key.name == GUIDE.name || matches!(key.range, Range::WordOrCurve(..)) =>
        {
            if key.name == GUIDE.name && !items.iter().all(Value::is_str) {
                return wrong("guides as text");
            }
        }
        (_, Holds::Word, _) => return wrong("text"),
    }
    match key.fault(&plain) {
        Some(fault) => Err(fault),
        None => Ok(plain),
    }
}
