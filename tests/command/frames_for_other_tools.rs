//! Point clouds, arrays, pictures and recordings are read by tools that are not ours.

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

    // Without any package: every depth is a point, at its distance.
    python(
        here,
        &[],
        "\
import json, math, struct, zipfile
pixels = json.load(open('out/frame.json'))['macropixels']
wanted = {(i // 20, i % 20): m for i, m in enumerate(pixels) if m['measured_m'] is not None}
assert len(wanted) > 20
for name, end in (('frame.ply', b'end_header\\n'), ('frame.pcd', b'DATA binary\\n')):
    data = open('export/' + name, 'rb').read()
    data = data[data.index(end) + len(end):]
    points = list(struct.iter_unpack('<5f2H', data))
    assert len(points) == len(wanted), name
    for x, y, z, intensity, confidence, row, col in points:
        m = wanted[row, col]
        assert abs(math.hypot(x, y, z) - m['measured_m']) < 1e-4 * m['measured_m']
        assert (x > 0) == (col >= 10) and (y > 0) == (row >= 6) and z > 0
        assert intensity > 0 and abs(confidence - m['confidence']) < 1e-3
assert zipfile.ZipFile('export/frame.npz').testzip() is None
",
    );
    python(here, &["numpy"], "\
import json, numpy as np
f = np.load('export/frame.npz')
assert sorted(f.files) == ['confidence', 'depth_m', 'guide_m', 'histograms', 'in_window', 'no_depth', 'peak_m', 'start', 'truth_m']
assert f['histograms'].shape == (12, 20, 16)
assert (f['histograms'] == np.load('out/histograms.npy')).all()
d = np.load('export/depth.npy')
assert d.dtype == np.float32 and np.array_equal(d, f['depth_m'], equal_nan=True)
assert ((f['no_depth'] == 0) == ~np.isnan(d)).all()
");
    python(
        here,
        &["numpy", "PIL"],
        "\
import numpy as np
from PIL import Image
p = np.asarray(Image.open('export/depth16.png')).astype(float) / 256
d = np.load('export/depth.npy')
assert p.shape == d.shape and ((p == 0) == np.isnan(d)).all()
assert np.nanmax(abs(np.where(p == 0, np.nan, p) - d)) <= 1 / 512
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
    refused(&["export", "frame", "."], "frame.json: cannot be read");
    done(here, &FRAME);
    refused(
        &["export", "frame", "out", "--out", "out"],
        "is the folder of the frame itself",
    );
    refused(&["export", "frame", "out", "--format", "las"], "las");
    let histograms = here.join("out").join("histograms.npy");
    let bytes = fs::read(&histograms).unwrap();
    fs::write(&histograms, &bytes[..40]).unwrap();
    refused(
        &["export", "frame", "out"],
        "histograms.npy: is no NumPy file",
    );
    assert!(!here.join("export").exists());
}

#[test]
fn a_drive_is_played_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path();
    let drive = [
        "drive",
        "van",
        "--frames",
        "3",
        "--rows",
        "16",
        "--cols",
        "16",
        "--laser-cycles",
        "100",
        "--mcap",
    ];
    done(here, &drive);
    python(here, &["mcap"], "\
import base64, json, math, struct
from mcap.reader import make_reader
f = open('drive/drive.mcap', 'rb')
reader = make_reader(f, validate_crcs=True)
summary = reader.get_summary()
assert summary.statistics.message_count == 15 and len(summary.chunk_indexes) == 3
topics = {}
for schema, channel, message in reader.iter_messages():
    assert schema.encoding == 'jsonschema' and channel.message_encoding == 'json'
    json.loads(schema.data)
    topics.setdefault((channel.topic, schema.name), []).append((message.log_time, json.loads(message.data)))
assert sorted(topics) == [('/lidar/depth', 'foxglove.RawImage'), ('/lidar/picture', 'foxglove.CompressedImage'), ('/lidar/points', 'foxglove.PointCloud'), ('/lidar/windows', 'foxglove.SceneUpdate'), ('/tf', 'foxglove.FrameTransform')]
depths = open('drive/depth.npy', 'rb').read()[-3 * 256 * 4:]
for n, (time, m) in enumerate(topics['/lidar/depth', 'foxglove.RawImage']):
    assert base64.b64decode(m['data']) == depths[n * 1024:(n + 1) * 1024]
    assert m['timestamp']['sec'] * 10**9 + m['timestamp']['nsec'] == time
    there = sum(not math.isnan(d) for d, in struct.iter_unpack('<f', base64.b64decode(m['data'])))
    cloud = topics['/lidar/points', 'foxglove.PointCloud'][n][1]
    assert len(base64.b64decode(cloud['data'])) == there * cloud['point_stride']
    picture = base64.b64decode(topics['/lidar/picture', 'foxglove.CompressedImage'][n][1]['data'])
    assert picture == open('drive/depth_%05d.png' % n, 'rb').read()
times = [time for time, _ in topics['/tf', 'foxglove.FrameTransform']]
assert times == sorted(times) and len(set(times)) == 3
f.seek(0)
later = list(make_reader(f).iter_messages(start_time=times[1]))
assert len(later) == 10
");
}
