//! A drive for Foxglove and other players: points, depths, pictures and windows as messages with Foxglove's schemas.

use std::io::Read;
use std::path::Path;

use serde_json::{Value, json};

use crate::files::{InputError, OutputFile, open_file};
use crate::report::{Channel, CloudPoint, Mcap};
use crate::scene::{DVec3, PinholeCamera};
use crate::system::{DriveFrame, DriveSettings, point_cloud};

const TRANSFORM: usize = 0;
const POINTS: usize = 1;
const DEPTHS: usize = 2;
const PICTURE: usize = 3;
const WINDOWS: usize = 4;

/// A topic with the schema of one of Foxglove's messages.
macro_rules! channel {
    ($topic:literal, $schema:literal) => {
        Channel {
            topic: $topic,
            schema: concat!("foxglove.", $schema),
            json_schema: include_str!(concat!("foxglove/", $schema, ".json")),
        }
    };
}

/// What a recording has, with the schemas of Foxglove's messages.
const CHANNELS: [Channel; 5] = [
    channel!("/tf", "FrameTransform"),
    channel!("/lidar/points", "PointCloud"),
    channel!("/lidar/depth", "RawImage"),
    channel!("/lidar/picture", "CompressedImage"),
    channel!("/lidar/windows", "SceneUpdate"),
];

/// Windows are drawn of every fourth macropixel of every fourth row: all of them hide what they are about.
const WINDOW_STEP: usize = 4;

/// Foxglove's number for a field of four bytes, and of two.
const FLOAT32: u8 = 7;
const UINT16: u8 = 3;

/// A recording of a drive.
pub(super) struct Foxglove {
    mcap: Mcap<OutputFile>,
    camera: PinholeCamera,
    cols: usize,
    begin_s: f64,
}

impl Foxglove {
    /// Begins `path`.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn begin(path: &Path, settings: &DriveSettings) -> Result<Self, InputError> {
        let sensor = &settings.frame.sensor;
        let (rows, cols) = (sensor.rows, sensor.cols);
        let camera = settings.frame.scene.lidar_camera(rows as u32, cols as u32);
        let mcap = Mcap::begin(OutputFile::create(path)?, &CHANNELS);
        Ok(Foxglove {
            mcap: mcap.map_err(|e| InputError::unwritable(path, &e))?,
            camera,
            cols,
            begin_s: settings.start_s,
        })
    }

    /// Records a frame at the middle of its exposure, with its picture if there is one.
    ///
    /// # Errors
    /// When it cannot be written, or the picture not be read.
    pub(super) fn add(
        &mut self,
        frame: &DriveFrame,
        picture: Option<&Path>,
    ) -> std::io::Result<()> {
        let time_ns = ((frame.times.middle_s() - self.begin_s).max(0.0) * 1e9).round() as u64;
        let time = json!({"sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000});
        // Optical axes (x right, y down, z forward) in a world whose z is up.
        let transform = json!({
            "timestamp": time, "parent_frame_id": "world", "child_frame_id": "lidar",
            "translation": xyz(DVec3::ZERO),
            "rotation": {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5},
        });
        let fields = CloudPoint::FLOATS.iter().enumerate();
        let fields = fields
            .map(|(number, name)| json!({"name": name, "offset": 4 * number, "type": FLOAT32}));
        let shorts = CloudPoint::SHORTS.iter().enumerate();
        let shorts = shorts.map(|(number, name)| {
            json!({"name": name, "offset": 4 * CloudPoint::FLOATS.len() + 2 * number, "type": UINT16})
        });
        let points = point_cloud(&self.camera, self.cols, &frame.pixels);
        let points: Vec<u8> = points.iter().flat_map(CloudPoint::bytes).collect();
        let points = json!({
            "timestamp": time, "frame_id": "lidar", "pose": pose(),
            "point_stride": CloudPoint::BYTES, "fields": fields.chain(shorts).collect::<Vec<_>>(),
            "data": base64(&points),
        });
        let depths = frame
            .pixels
            .iter()
            .map(|pixel| pixel.measured_m.map_or(f32::NAN, |m| m as f32));
        let depths: Vec<u8> = depths.flat_map(f32::to_le_bytes).collect();
        let depths = json!({
            "timestamp": time, "frame_id": "lidar", "width": self.cols, "height": frame.pixels.len() / self.cols,
            "encoding": "32FC1", "step": 4 * self.cols, "data": base64(&depths),
        });
        let mut messages = vec![(TRANSFORM, transform), (POINTS, points), (DEPTHS, depths)];
        if let Some(picture) = picture {
            let mut bytes = Vec::new();
            open_file(picture)
                .map_err(std::io::Error::other)?
                .read_to_end(&mut bytes)?;
            let picture = base64(&bytes);
            messages.push((
                PICTURE,
                json!({"timestamp": time, "frame_id": "lidar", "data": picture, "format": "png"}),
            ));
        }
        messages.push((WINDOWS, self.windows(frame, &time)));
        self.mcap.moment(time_ns, &messages)
    }

    /// A stroke along the ray from where a window opens to where it closes.
    fn windows(&self, frame: &DriveFrame, time: &Value) -> Value {
        let shown = |pixel: &usize| {
            (pixel / self.cols).is_multiple_of(WINDOW_STEP)
                && (pixel % self.cols).is_multiple_of(WINDOW_STEP)
        };
        let ends = (0..frame.windows_m.len())
            .filter(shown)
            .filter_map(|pixel| {
                let (from_m, to_m) = frame.windows_m[pixel]?;
                let ray = self
                    .camera
                    .direction((pixel / self.cols, pixel % self.cols));
                Some([from_m, to_m].map(|m| xyz(ray * m)))
            });
        let none = json!([]);
        json!({"deletions": none, "entities": [{
            "timestamp": time, "frame_id": "lidar", "id": "windows",
            "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": true, "metadata": none,
            "arrows": none, "cubes": none, "spheres": none, "cylinders": none,
            "lines": [{
                // A list of strokes.
                "type": 2, "pose": pose(), "thickness": 1.5, "scale_invariant": true,
                "points": ends.flatten().collect::<Vec<_>>(),
                "color": {"r": 0.2, "g": 0.6, "b": 1.0, "a": 0.6}, "colors": none, "indices": none,
            }],
            "triangles": none, "texts": none, "models": none,
        }]})
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn finish(self, path: &Path) -> Result<(), InputError> {
        let file = self.mcap.finish();
        file.map_err(|e| InputError::unwritable(path, &e))?.commit()
    }
}

fn xyz(point: DVec3) -> Value {
    // Millimetres are more than enough, and keep the text short.
    let [x, y, z] = point.to_array().map(|x| (x * 1e3).round() / 1e3);
    json!({"x": x, "y": y, "z": z})
}

fn pose() -> Value {
    json!({"position": xyz(DVec3::ZERO), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}})
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |at: usize| u32::from(chunk.get(at).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for letter in 0..4 {
            text.push(if letter <= chunk.len() {
                LETTERS[(word >> (18 - 6 * letter)) as usize & 63] as char
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_rfc_4648() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn schemas_are_json() {
        for channel in CHANNELS {
            let schema: Value = serde_json::from_str(channel.json_schema).unwrap();
            assert_eq!(schema["title"], channel.schema);
        }
    }
}
