//! Arrays for NumPy and MATLAB: the NPY format, version 1.0, little endian, C order.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use npyz::{AutoSerialize, NpyWriter, WriterBuilder};

use crate::files::{InputError, OutputFile};

/// Writes `data` as a `uint16` array of `shape`, last axis fastest.
///
/// # Errors
/// When the file cannot be written; no part of it is then left behind.
///
/// # Panics
/// When `shape` does not have as many elements as `data`.
pub(crate) fn write_npy_u16(path: &Path, shape: &[u64], data: &[u16]) -> Result<(), InputError> {
    write_npy(path, shape, data)
}

/// Writes `data` as a `float32` array of `shape`, last axis fastest.
///
/// # Errors
/// When the file cannot be written; no part of it is then left behind.
///
/// # Panics
/// When `shape` does not have as many elements as `data`.
pub(crate) fn write_npy_f32(path: &Path, shape: &[u64], data: &[f32]) -> Result<(), InputError> {
    write_npy(path, shape, data)
}

fn write_npy<T: npyz::AutoSerialize + Copy>(
    path: &Path,
    shape: &[u64],
    data: &[T],
) -> Result<(), InputError> {
    let elements: u64 = shape.iter().product();
    assert_eq!(
        elements,
        data.len() as u64,
        "shape {shape:?} does not fit the data"
    );
    OutputFile::write_with(path, |file| {
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(shape)
            .writer(file)
            .begin_nd()?;
        writer.extend(data.iter().copied())?;
        writer.finish()?;
        io::Result::Ok(())
    })
}

/// Steps of a metre in pictures of depths: 256 m are as far as they go (as in KITTI's).
const PNG_STEPS: f32 = 256.0;

/// Writes depths, row-major, m, as a PNG of 16 bits in steps of 1/256 m; 0 where there is none, the last step beyond 255.996 m.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn write_depth_png(path: &Path, cols: usize, depths: &[f32]) -> Result<(), InputError> {
    let step = |depth: &f32| match depth.is_finite() {
        // A depth is never 0, which would be none.
        true => (depth * PNG_STEPS).round().clamp(1.0, 65_535.0) as u16,
        false => 0,
    };
    let bytes: Vec<u8> = depths
        .iter()
        .flat_map(|depth| step(depth).to_be_bytes())
        .collect();
    OutputFile::write_with(path, |out| {
        let mut encoder = png::Encoder::new(out, cols as u32, (depths.len() / cols) as u32);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&bytes)?;
        writer.finish()?;
        Ok(())
    })
}

/// An array that is written piece by piece along its first axis.
pub(crate) struct NpyStack<T: AutoSerialize>(NpyWriter<T, BufWriter<File>>);

impl<T: AutoSerialize> NpyStack<T> {
    /// Begins an array of `shape`, last axis fastest.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn begin(path: &Path, shape: &[u64]) -> Result<Self, InputError> {
        let begun = File::create(path).and_then(|file| {
            npyz::WriteOptions::new()
                .default_dtype()
                .shape(shape)
                .writer(BufWriter::new(file))
                .begin_nd()
        });
        let writer = begun.map_err(|e| InputError::unwritable(path, &e))?;
        Ok(NpyStack(writer))
    }

    /// Writes the next elements.
    ///
    /// # Errors
    /// When they cannot be written.
    pub(crate) fn extend(&mut self, elements: impl IntoIterator<Item = T>) -> io::Result<()> {
        self.0.extend(elements)
    }

    /// Ends the array, which must have all its elements.
    ///
    /// # Errors
    /// When they cannot be written, or there are fewer.
    pub(crate) fn finish(self) -> io::Result<()> {
        self.0.finish()
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
        let read = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(read.shape(), [3, 2]);
        let values = read.into_vec::<f32>().unwrap();
        assert!(values[4] == 2.0 && values[5].is_nan());
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
        let bytes = std::fs::read(&path).unwrap();
        let read = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(read.shape(), [2, 3, 4]);
        assert_eq!(read.order(), npyz::Order::C);
        assert_eq!(read.into_vec::<u16>().unwrap(), data);
    }

    #[test]
    fn empty_arrays_are_files_too() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("empty.npy");
        write_npy_u16(&path, &[0, 16], &[]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(npyz::NpyFile::new(&bytes[..]).unwrap().shape(), [0, 16]);
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        assert!(write_npy_u16(Path::new("/nonexistent/a.npy"), &[1], &[1]).is_err());
    }
}
