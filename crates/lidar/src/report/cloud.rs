//! Point clouds for CloudCompare, MeshLab, Open3D, PCL and Foxglove: PLY and PCD, binary, little endian.
//!
//! Both have the same fields: x right, y down, z forward (m, from the lidar), intensity (photons a laser cycle), confidence (−log₁₀ of the chance
//! that light without this echo makes such counts), row and column of the macropixel, and which of its returns the point is, from 1.

use std::path::Path;

use crate::files::{InputError, OutputFile};

/// A point of a cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    /// x right, y down, z forward, m.
    pub(crate) at_m: [f32; 3],
    /// Photons of its echo that the SPADs would detect in a laser cycle without dead time.
    pub(crate) intensity: f32,
    /// −log₁₀ of the chance that it is none.
    pub(crate) confidence: f32,
    /// Row and column of its macropixel.
    pub(crate) pixel: [u16; 2],
    /// Which return of its macropixel it is, from 1: the depth's.
    pub number: u16,
}

impl CloudPoint {
    /// Names of the fields of four bytes, which come first.
    pub const FLOATS: [&str; 5] = ["x", "y", "z", "intensity", "confidence"];
    /// Names of the fields of two bytes.
    pub const SHORTS: [&str; 3] = ["row", "col", "return"];
    /// Bytes of a point.
    pub const BYTES: usize = 4 * Self::FLOATS.len() + 2 * Self::SHORTS.len();

    /// Its fields one after the other, little endian.
    pub fn bytes(&self) -> [u8; Self::BYTES] {
        let [x, y, z] = self.at_m;
        let [row, col] = self.pixel;
        let mut bytes = [0; Self::BYTES];
        for (place, number) in
            bytes
                .chunks_exact_mut(4)
                .zip([x, y, z, self.intensity, self.confidence])
        {
            place.copy_from_slice(&number.to_le_bytes());
        }
        bytes[20..22].copy_from_slice(&row.to_le_bytes());
        bytes[22..24].copy_from_slice(&col.to_le_bytes());
        bytes[24..].copy_from_slice(&self.number.to_le_bytes());
        bytes
    }
}

/// Writes a cloud as PLY.
///
/// # Errors
/// When the file cannot be written.
pub fn write_ply(path: &Path, points: &[CloudPoint]) -> Result<(), InputError> {
    OutputFile::write_with(path, |out| {
        writeln!(out, "ply\nformat binary_little_endian 1.0")?;
        writeln!(out, "comment x right, y down, z forward, m, from the lidar")?;
        writeln!(out, "element vertex {}", points.len())?;
        for (kind, names) in [
            ("float", &CloudPoint::FLOATS[..]),
            ("ushort", &CloudPoint::SHORTS),
        ] {
            for name in names {
                writeln!(out, "property {kind} {name}")?;
            }
        }
        writeln!(out, "end_header")?;
        points
            .iter()
            .try_for_each(|point| out.write_all(&point.bytes()))
    })
}

/// Writes a cloud as PCD 0.7.
///
/// # Errors
/// When the file cannot be written.
pub fn write_pcd(path: &Path, points: &[CloudPoint]) -> Result<(), InputError> {
    let count = points.len();
    OutputFile::write_with(path, |out| {
        writeln!(
            out,
            "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7"
        )?;
        writeln!(
            out,
            "FIELDS {} {}",
            CloudPoint::FLOATS.join(" "),
            CloudPoint::SHORTS.join(" ")
        )?;
        writeln!(
            out,
            "SIZE 4 4 4 4 4 2 2 2\nTYPE F F F F F U U U\nCOUNT 1 1 1 1 1 1 1 1"
        )?;
        writeln!(out, "WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0")?;
        writeln!(out, "POINTS {count}\nDATA binary")?;
        points
            .iter()
            .try_for_each(|point| out.write_all(&point.bytes()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_say_how_many_bytes_follow() {
        let point = CloudPoint {
            at_m: [1.0, -2.0, 30.5],
            intensity: 17.0,
            confidence: 4.5,
            pixel: [3, 300],
            number: 2,
        };
        let dir = tempfile::tempdir().unwrap();
        for (name, write, end) in [
            (
                "a.ply",
                write_ply as fn(&Path, &[CloudPoint]) -> _,
                "end_header\n",
            ),
            ("a.pcd", write_pcd, "DATA binary\n"),
        ] {
            for count in [0, 1, 5] {
                let path = dir.path().join(name);
                write(&path, &vec![point; count]).unwrap();
                let bytes = std::fs::read(&path).unwrap();
                let at = bytes
                    .windows(end.len())
                    .position(|w| w == end.as_bytes())
                    .unwrap();
                let (header, data) = bytes.split_at(at + end.len());
                assert_eq!(data, [point.bytes()].repeat(count).concat());
                let header = std::str::from_utf8(header).unwrap();
                assert!(header.contains(&format!(" {count}\n")), "{header}");
            }
        }
        assert_eq!(point.bytes()[8..12], 30.5f32.to_le_bytes());
        assert_eq!(point.bytes()[22..], [44, 1, 2, 0]);
    }
}
