//! Arrays for NumPy and MATLAB: the NPY format, version 1.0, little endian, C order.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::marker::PhantomData;
use std::path::Path;

use super::image::of_png;
use crate::files::{Element, InputError, OutputFile, write_npy_elements, write_npy_head};

/// Writes `data` as a `uint16` array of `shape`, last axis fastest.
///
/// # Errors
/// When the file cannot be written; no part of it is then left behind.
///
/// # Panics
/// When `shape` does not have as many elements as `data`.
pub fn write_npy_u16(path: &Path, shape: &[usize], data: &[u16]) -> Result<(), InputError> {
    write_npy(path, shape, data)
}

/// Writes `data` as a `float32` array of `shape`, last axis fastest.
///
/// # Errors
/// When the file cannot be written; no part of it is then left behind.
///
/// # Panics
/// When `shape` does not have as many elements as `data`.
pub fn write_npy_f32(path: &Path, shape: &[usize], data: &[f32]) -> Result<(), InputError> {
    write_npy(path, shape, data)
}

fn write_npy<T: Element>(path: &Path, shape: &[usize], data: &[T]) -> Result<(), InputError> {
    OutputFile::write_with(path, |file| crate::files::write_npy(file, shape, data))
}

/// Steps of a metre in pictures of depths: 256 m are as far as they go (as in KITTI's).
const PNG_STEPS: f32 = 256.0;

/// Writes depths, row-major, m, as a PNG of 16 bits in steps of 1/256 m; 0 where there is none, the last step beyond 255.996 m.
///
/// # Errors
/// When the file cannot be written.
pub fn write_depth_png(path: &Path, cols: usize, depths: &[f32]) -> Result<(), InputError> {
    let step = |depth: &f32| {
        if depth.is_finite() {
            // A depth is never 0, which would be none.
            (depth * PNG_STEPS).round().clamp(1.0, 65_535.0) as u16
        } else {
            0
        }
    };
    let bytes: Vec<u8> = depths
        .iter()
        .flat_map(|depth| step(depth).to_be_bytes())
        .collect();
    OutputFile::write_with(path, |out| {
        let mut encoder = png::Encoder::new(out, cols as u32, (depths.len() / cols) as u32);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut writer = encoder.write_header().map_err(of_png)?;
        writer.write_image_data(&bytes).map_err(of_png)?;
        writer.finish().map_err(of_png)?;
        Ok(())
    })
}

/// An array that is written piece by piece along its first axis.
pub struct NpyStack<T> {
    out: BufWriter<File>,
    /// Elements that are still to come.
    left: usize,
    _of: PhantomData<T>,
}

impl<T: Element> NpyStack<T> {
    /// Begins an array of `shape`, last axis fastest.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn begin(path: &Path, shape: &[usize]) -> Result<Self, InputError> {
        let begun = File::create(path).and_then(|file| {
            let mut out = BufWriter::new(file);
            write_npy_head::<T>(&mut out, shape)?;
            Ok(out)
        });
        Ok(NpyStack {
            out: begun.map_err(|e| InputError::unwritable(path, &e))?,
            left: shape.iter().product(),
            _of: PhantomData,
        })
    }

    /// Writes the next elements.
    ///
    /// # Errors
    /// When they cannot be written, or are more than the array has.
    pub fn extend(&mut self, elements: impl IntoIterator<Item = T>) -> io::Result<()> {
        let written = write_npy_elements(&mut self.out, elements)?;
        let left = self.left.checked_sub(written);
        self.left = left.ok_or_else(|| io::Error::other("more elements than the array has"))?;
        Ok(())
    }

    /// Ends the array, which must have all its elements.
    ///
    /// # Errors
    /// When they cannot be written, or there are fewer.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()?;
        match self.left {
            0 => Ok(()),
            left => Err(io::Error::other(format!("{left} elements are missing"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_is_the_array_of_its_pieces() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("stack.npy");
        let mut stack = NpyStack::begin(&path, &[3, 2]).unwrap();
        for n in 0..3 {
            stack.extend([n as f32, f32::NAN]).unwrap();
        }
        stack.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let mut pieces = Vec::new();
        let whole = [0.0, f32::NAN, 1.0, f32::NAN, 2.0, f32::NAN];
        crate::files::write_npy(&mut pieces, &[3, 2], &whole).unwrap();
        assert_eq!(bytes, pieces);
        let mut short = NpyStack::begin(&path, &[2]).unwrap();
        short.extend([1u16]).unwrap();
        assert!(short.finish().is_err());
    }

    #[test]
    fn an_array_comes_back_as_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let data: Vec<u16> = (0..24).map(|i| i * 2_730).collect();
        write_npy_u16(&path, &[2, 3, 4], &data).unwrap();
        assert_eq!(
            crate::files::read_array::<u16>(&path, &[2, 3, 4]).unwrap(),
            data
        );
    }

    #[test]
    fn empty_arrays_are_files_too() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("empty.npy");
        write_npy_u16(&path, &[0, 16], &[]).unwrap();
        assert!(
            crate::files::read_array::<u16>(&path, &[0, 16])
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        assert!(write_npy_u16(Path::new("/nonexistent/a.npy"), &[1], &[1]).is_err());
    }
}
