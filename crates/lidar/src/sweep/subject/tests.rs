//! Points share what is the same, keys of results follow their settings, and rows are those of journals.

use super::*;

fn study(text: &str) -> Study {
    Study::parse("study.toml", text, Path::new(""), "test").unwrap()
}

#[test]
fn points_of_one_sensor_share_it() {
    let study = study("[vary]\nscene.lidar.pde = [0.1, 0.2]\nsensor.clk_hz = [\"384 MHz\", 3e8]\n");
    let subject = Subject::new(&study);
    let sensor = |index| {
        // Each point on a thread of its own, as it were.
        let ready = subject.ready(&study.point(index), &mut Scratch::default());
        match ready.unwrap().task {
            Task::Frame(world, _) => world.sensor.clone(),
            Task::Theory(_) => unreachable!("frames are asked for"),
        }
    };
    let sensors: Vec<Sensor> = (0..study.len()).map(sensor).collect();
    assert_eq!(sensors.len(), 4);
    for one in &sensors {
        let same: Vec<&Sensor> = sensors.iter().filter(|other| *other == one).collect();
        assert_eq!(same.len(), 2);
        assert!(same.iter().all(|s| std::ptr::eq(s.timing(), one.timing())));
    }
}

#[test]
fn theory_refuses_by_its_key_what_it_leaves_out() {
    for (key, what) in [
        ("scene.lidar.spad_tail_share", "Gaussian pulses"),
        ("sensor.dead_time_spread", "SPADs that are alike"),
    ] {
        let fixed = "[study]\nkind = \"theory\"\n[fixed]\nscene.lidar.spad_tail_ps = 300\n";
        let study = study(&format!("{fixed}[vary]\n{key} = [0, 0.1]\n"));
        let subject = Subject::new(&study);
        let ready = |index| subject.ready(&study.point(index), &mut Scratch::default());
        assert!(ready(0).is_ok());
        let refusal = ready(1).err().unwrap().to_string();
        let named = format!("{key}: theory is of {what}");
        assert!(refusal.contains(&named), "{refusal}");
    }
}

fn keys(text: &str) -> Vec<Key> {
    let study = study(text);
    let subject = Subject::new(&study);
    let mut scratch = Scratch::default();
    let key = |index| {
        subject
            .ready(&study.point(index), &mut scratch)
            .unwrap()
            .key
    };
    (0..study.len()).map(key).collect()
}

#[test]
fn what_says_the_same_has_the_same_key() {
    let varied =
        keys("[vary]\nframe.laser_cycles = [500, 1000]\nsensor.clk_hz = [\"384 MHz\", 3e8]\n");
    assert_eq!(varied.len(), 4);
    let default = keys("[fixed]\nframe.laser_cycles = 1000\n");
    assert_eq!(varied[2], default[0]);
    let other_way = keys(
        "[study]\nseed = 1\n[fixed]\nscene = \"street\"\nwindows.overlap = 0.25\n[vary]\nsensor.clk_hz = [0.3e9]\n",
    );
    assert_eq!(varied[3], other_way[0]);
    let seeds = keys("[study]\nseed = 1\nreplicas = 2\n");
    assert_eq!(seeds[0], default[0]);
    let mut all = [varied, seeds].concat();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), 5);
}

#[test]
fn a_file_that_changes_makes_another_point() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = "v 0 0 10\nv 1 0 10\nv 0 1 10\nf 1 2 3\n";
    let key = |mesh: &str| {
        std::fs::write(dir.path().join("a.obj"), mesh).unwrap();
        let scene = "[[object]]\nname = \"a\"\nkind = \"mesh\"\nfile = \"a.obj\"\ncentre_m = [0, 0, 5]\nreflectivity = 0.5\n";
        std::fs::write(dir.path().join("scene.toml"), scene).unwrap();
        let study =
            Study::parse("s", "[fixed]\nscene = \"scene.toml\"\n", dir.path(), "s").unwrap();
        let subject = Subject::new(&study);
        subject
            .ready(&study.point(0), &mut Scratch::default())
            .unwrap()
            .key
    };
    let first = key(mesh);
    assert_eq!(key(mesh), first);
    assert_ne!(key(&mesh.replace("10", "11")), first);
}

/// A change of what a frame counts, or of how a row is made from it, makes rows in existing journals wrong: then
/// `RESULTS` in `row.rs` must be raised, and the numbers here be those of the new program.
#[test]
fn rows_are_those_that_journals_keep() {
    let study = study(
        "[fixed]\nsensor.rows = 8\nsensor.cols = 8\nframe.laser_cycles = 200\nframe.engine = \"cohort\"\nscene = \"night\"\n",
    );
    let subject = Subject::new(&study);
    let mut scratch = Scratch::default();
    let ready = subject.ready(&study.point(0), &mut scratch).unwrap();
    let row = subject.compute_row(ready, &mut scratch).unwrap();
    assert_eq!(row.error, None);
    let number = |name: &str| {
        let at = frame_columns().iter().position(|c| c.name == name).unwrap();
        row.cells[at].number().unwrap()
    };
    assert_eq!((number("depths"), number("counts")), (28.0, 6745.0));
    let error_m = number("rms_error_m");
    assert!((error_m - 13.252_88).abs() < 1e-4, "{error_m}");
}
