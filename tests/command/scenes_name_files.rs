//! Scenes and the files that they name, as users meet them: built-in ones by name, pictures, meshes and maps beside the
//! scene file, and what is wrong with them told with file, line and cure.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn scene(folder: &Path, name: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gdtof"))
        .args(["scene", "--scene", name])
        .current_dir(folder)
        .output()
        .unwrap()
}

fn refusal(folder: &Path, name: &str) -> String {
    let output = scene(folder, name);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(output.stdout.is_empty());
    error
}

fn write_object(folder: &Path, keys: &str) {
    let text = format!("[light]\n[[object]]\nname = \"it\"\nreflectivity = 0.5\n{keys}\n");
    fs::write(folder.join("s.toml"), text).unwrap();
}

#[test]
fn built_in_scenes_go_by_name_and_a_file_of_that_name_comes_first() {
    let folder = tempfile::tempdir().unwrap();
    let printed = |name: &str| String::from_utf8(scene(folder.path(), name).stdout).unwrap();
    assert!(printed("van").contains("name = \"van\""));
    assert!(!printed("empty").contains("[[object]]"));
    assert_eq!(printed("street"), printed("street"));
    let error = refusal(folder.path(), "vann");
    assert!(error.contains("did you mean `van`?"), "{error}");
    let error = refusal(folder.path(), "moon");
    assert!(
        error.contains("give street, warehouse, van, fog, glass, sweep, night or empty"),
        "{error}"
    );
    fs::create_dir(folder.path().join("night")).unwrap();
    assert!(printed("night").contains("name = \"pedestrian\""));
    fs::write(folder.path().join("van"), "[light]\nilluminance_klux = 7\n").unwrap();
    assert!(!printed("van").contains("name = \"van\""));
}

#[test]
fn a_scene_with_a_mesh_prints_itself_for_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("models")).unwrap();
    let mesh = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    fs::write(folder.path().join("models/m.obj"), mesh).unwrap();
    write_object(
        folder.path(),
        "kind = \"mesh\"\nfile = \"models/m.obj\"\ncentre_m = [0, 0, 9]",
    );
    let printed = scene(folder.path(), "s.toml");
    assert!(printed.status.success());
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("printed.toml"), &printed.stdout).unwrap();
    assert_eq!(
        scene(elsewhere.path(), "printed.toml").stdout,
        printed.stdout
    );
}

#[test]
fn files_that_cannot_be_used_are_refused_with_line_and_cure() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    // A PNG whose header promises 60 000 x 60 000 pixels of 16 bits.
    let header = [
        b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".as_slice(),
        &[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60, 16, 0, 0, 0, 0],
        &0xf529_f6dd_u32.to_be_bytes(),
    ];
    put("huge.png", &header.concat());
    put("broken.obj", b"v 0 0 0\nv 1 0\nf 1 2 3\n");
    put(
        "nan.pfm",
        &[b"Pf\n1 1\n-1\n".as_slice(), &f32::NAN.to_le_bytes()].concat(),
    );
    put(
        "fine.pfm",
        &[b"Pf\n1 1\n-1\n".as_slice(), &5f32.to_le_bytes()].concat(),
    );
    put(
        "behind.pfm",
        &[b"Pf\n1 1\n-1\n".as_slice(), &(-1f32).to_le_bytes()].concat(),
    );
    for (name, colour) in [
        ("grey.png", png::ColorType::Grayscale),
        ("colour.png", png::ColorType::Rgb),
    ] {
        let file = fs::File::create(folder.path().join(name)).unwrap();
        let mut encoder = png::Encoder::new(file, 1, 1);
        encoder.set_color(colour);
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut writer = encoder.write_header().unwrap();
        writer
            .write_image_data(&vec![1; 2 * colour.samples()])
            .unwrap();
    }
    put("wide.pfm", &[b"Pf\n2 1\n-1\n".as_slice(), &[0; 8]].concat());
    let map = |more: &str| format!("kind = \"map\"\nfocal_px = 50\n{more}");
    for (keys, says) in [
        (
            "kind = \"ground\"\ndepth_m = 1\ntexture = \"image\"\ntexture_file = \"huge.png\""
                .into(),
            "huge.png: has 60000 x 60000 pixels, of which at most",
        ),
        (
            "kind = \"ground\"\ndepth_m = 1\ntexture = \"image\"\ntexture_file = \"no.png\"".into(),
            "no.png: cannot be read",
        ),
        (
            "kind = \"mesh\"\ncentre_m = [0, 0, 1]\nfile = \"broken.obj\"".into(),
            "broken.obj:2: is a broken OBJ here",
        ),
        (
            "kind = \"mesh\"\ncentre_m = [0, 0, 1]".into(),
            "lacks `file`; add it",
        ),
        (
            map("depth_file = \"nan.pfm\""),
            "nan.pfm: has no surface in it",
        ),
        (
            map("depth_file = \"behind.pfm\""),
            "behind.pfm: has -1 at row 0, column 0; write 0 where there is no value",
        ),
        (
            map("depth_file = \"grey.png\""),
            "grey.png: has whole numbers, whose unit it does not say; give depth_unit_m (0.001 for millimetres",
        ),
        (
            map("depth_file = \"colour.png\"\ndepth_unit_m = 0.001"),
            "colour.png: is a picture in colour and no map",
        ),
        (
            map("depth_file = \"wide.pfm\""),
            "wide.pfm: has no surface in it",
        ),
        (
            map("depth_file = \"fine.pfm\"\nreflectivity_file = \"wide.pfm\""),
            "give maps of one shape",
        ),
        (
            "kind = \"map\"\nfocal_px = 0\ndepth_file = \"fine.pfm\"".into(),
            "focal_px = 0 is impossible; give above 0",
        ),
    ] {
        write_object(folder.path(), &keys);
        let error = refusal(folder.path(), "s.toml");
        assert!(error.contains("s.toml:"), "{error}");
        assert!(error.contains("(it), ") && error.contains(says), "{error}");
        assert!(!error.contains("panicked"), "{error}");
    }
}
