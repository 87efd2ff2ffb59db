//! The built-in scenes, by name: the street, the warehouse, and what the demonstrator met (thesis 6.4.1).

use super::settings::Scene;
use crate::settings::{Document, Notes};

/// Names, what they show, and their files.
const SCENES: [(&str, &str, &str); 8] = [
    (
        "street",
        "a street on a bright day, 15 to 180 m",
        include_str!("../../../../vectors/scenes/outdoor.toml"),
    ),
    (
        "warehouse",
        "a forklift between pallet racks, 3 to 30 m, for vcsel_flash",
        include_str!("../../../../vectors/scenes/warehouse.toml"),
    ),
    (
        "van",
        "a van drives away to 75 m at 15 klux",
        include_str!("../../../../vectors/scenes/van.toml"),
    ),
    (
        "fog",
        "a pedestrian and a car that drives away to 60 m in fog",
        include_str!("../../../../vectors/scenes/fog.toml"),
    ),
    (
        "glass",
        "a figure behind a glass door",
        include_str!("../../../../vectors/scenes/glass.toml"),
    ),
    (
        "sweep",
        "a target at 72 klux",
        include_str!("../../../../vectors/scenes/sweep.toml"),
    ),
    (
        "night",
        "a pedestrian crosses a street at night",
        include_str!("../../../../vectors/scenes/night.toml"),
    ),
    (
        "empty",
        "nothing but sky",
        include_str!("../../../../vectors/scenes/empty.toml"),
    ),
];

impl Scene {
    /// Names of the built-in scenes and what they show.
    pub fn built_in() -> impl Iterator<Item = (&'static str, &'static str)> {
        SCENES.iter().map(|(name, shows, _)| (*name, *shows))
    }

    /// The file of a built-in scene, to be changed by `--set`; `None` if there is none of this name.
    pub fn built_in_document(name: &str) -> Option<Document> {
        let (_, _, text) = SCENES.iter().find(|(known, ..)| *known == name)?;
        let source = format!("the built-in {name}");
        Some(Document::parse(source, text).expect("the built-in scenes are tested"))
    }

    /// Why the values of a built-in scene were chosen; `None` if there is none of this name.
    pub fn built_in_notes(name: &str) -> Option<Notes> {
        let (_, _, text) = SCENES.iter().find(|(known, ..)| *known == name)?;
        Some(Notes::read(text, Scene::named(name)?.table()))
    }

    /// A built-in scene; `None` if there is none of this name.
    pub fn named(name: &str) -> Option<Self> {
        let document = Scene::built_in_document(name)?;
        Some(Scene::read(&document).expect("the built-in scenes are tested"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{GroundTruth, Lidar};

    #[test]
    fn every_built_in_scene_reads_and_prints_itself() {
        for (name, shows) in Scene::built_in() {
            let scene = Scene::named(name).unwrap();
            assert!(!shows.is_empty());
            assert_eq!(Scene::parse(name, &scene.commented()).unwrap(), scene);
            let text = scene.commented_with(&Scene::built_in_notes(name).unwrap());
            assert_eq!(Scene::parse(name, &text).unwrap(), scene, "{name}");
            if !["street", "warehouse"].contains(&name) {
                assert_eq!(scene.lidar, Lidar::demonstrator(), "{name}");
            }
        }
        assert!(Scene::named("strret").is_none());
    }

    /// Every comment of the files is printed.
    #[test]
    fn no_comment_is_lost() {
        for (name, _, file) in SCENES {
            let scene = Scene::named(name).unwrap();
            let text = scene.commented_with(&Scene::built_in_notes(name).unwrap());
            let comments = file.lines().filter_map(|line| line.split_once('#'));
            for (_, comment) in comments {
                assert!(text.contains(comment.trim()), "{name}: {comment}");
            }
        }
    }

    /// Macropixels of HSLIDAR's array that see an object at a time, and how far it is.
    fn pixels_and_range(scene: &str, object: &str, time_s: f64) -> (usize, f64) {
        let scene = Scene::named(scene).unwrap().snapshot(time_s);
        let truth = GroundTruth::render(&scene, 32, 64);
        let is_it = |index: &Option<usize>| index.is_some_and(|i| scene.objects[i].name == object);
        let ranges = truth.object.iter().zip(&truth.range_m);
        let ranges: Vec<f64> = ranges
            .filter(|(o, _)| is_it(o))
            .filter_map(|(_, r)| *r)
            .collect();
        let least = ranges.iter().copied().fold(f64::MAX, f64::min);
        (ranges.len(), least)
    }

    #[test]
    fn what_the_demonstrator_met_is_in_view_where_the_thesis_says() {
        for (scene, object, time_s, range_m) in [
            ("van", "van", 0.0, 20.0),
            ("van", "van", 11.0, 75.0),
            ("fog", "car", 0.0, 30.0),
            ("fog", "car", 6.0, 60.0),
            ("fog", "pedestrian", 2.0, 17.8),
            ("glass", "figure", 0.0, 16.8),
            ("sweep", "target", 0.0, 20.0),
            ("night", "pedestrian", 1.0, 29.8),
        ] {
            let (pixels, least_m) = pixels_and_range(scene, object, time_s);
            assert!(pixels >= 9, "{object}: {pixels} macropixels");
            assert!((least_m - range_m).abs() < 0.3, "{object}: {least_m} m");
        }
        assert_eq!(pixels_and_range("empty", "", 0.0).0, 0);
    }
}
