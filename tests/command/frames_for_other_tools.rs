//! Point clouds are read by a parser that is not ours; NumPy, Pillow, MCAP and Foxglove read the rest in `python/tests`.

use std::fs;
use std::path::Path;

use super::tools::{gdtof, python};

fn done(folder: &Path, arguments: &[&str]) {
    let output = gdtof(folder, arguments);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

const FRAME: [&str; 10] = [
    "frame",
    "--rows",
    "12",
    "--cols",
    "20",
    "--probe",
    "none",
    "--laser-cycles",
    "300",
    "--seed=3",
];

#[test]
fn a_frame_is_read_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    done(here, &FRAME);
    done(here, &["export", "frame", "out"]);
    let mut names: Vec<_> = fs::read_dir(here.join("export"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "depth.npy",
            "depth16.png",
            "frame.npz",
            "frame.pcd",
            "frame.ply",
            "manifest.json"
        ]
    );
    done(
        here,
        &[
            "export", "frame", "out", "--format", "pcd,npy", "--out", "some",
        ],
    );
    assert_eq!(fs::read_dir(here.join("some")).unwrap().count(), 3);

    // Every return is a point, at its distance.
    python(
        here,
        "\
import json, math, struct, zipfile
pixels = json.load(open('out/frame.json'))['macropixels']
wanted = {(i // 20, i % 20, 1 + n): r for i, m in enumerate(pixels) for n, r in enumerate(m.get('returns', []))}
assert len(wanted) > 20 and any(n == 2 for _, _, n in wanted)
assert all(r['depth_m'] == pixels[i * 20 + k]['measured_m'] for (i, k, n), r in wanted.items() if n == 1)
for name, end in (('frame.ply', b'end_header\\n'), ('frame.pcd', b'DATA binary\\n')):
    data = open('export/' + name, 'rb').read()
    data = data[data.index(end) + len(end):]
    points = list(struct.iter_unpack('<5f3H', data))
    assert len(points) == len(wanted), name
    for x, y, z, intensity, confidence, row, col, number in points:
        m = wanted[row, col, number]
        assert abs(math.hypot(x, y, z) - m['depth_m']) < 1e-4 * m['depth_m']
        assert (x > 0) == (col >= 10) and (y > 0) == (row >= 6) and z > 0
        assert abs(intensity - m['photons']) < 1e-4 * m['photons'] and abs(confidence - m['confidence']) < 1e-3
assert zipfile.ZipFile('export/frame.npz').testzip() is None
",
    );
}

#[test]
fn a_folder_without_a_frame_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let refused = |arguments: &[&str], says: &str| {
        let output = gdtof(here, arguments);
        let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{sentence}");
        assert!(sentence.contains(says), "{sentence}");
    };
    refused(
        &["export", "frame", "."],
        ".: has no frame.json; give a folder",
    );
    done(here, &FRAME);
    refused(
        &["export", "frame", "out", "--out", "out"],
        "out: holds the results of `gdtof frame`, which `gdtof export frame` does not replace",
    );
    refused(&["export", "frame", "out", "--format", "las"], "las");
    let histograms = here.join("out").join("histograms.npy");
    let bytes = fs::read(&histograms).unwrap();
    fs::write(&histograms, &bytes[..40]).unwrap();
    refused(
        &["export", "frame", "out"],
        "histograms.npy: is not a NumPy file",
    );
    assert!(!here.join("export").exists());
}
