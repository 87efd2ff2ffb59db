//! Matrices of numbers from `.npy` files (NumPy's format, versions 1 to 3).

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use npyz::{NpyFile, Order};

use super::complaint::InputError;

/// Most elements of a matrix: 128 MB of double-precision numbers, beyond any camera.
const MOST_ELEMENTS: u64 = 1 << 24;

/// A matrix of numbers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub cols: usize,
    /// Elements, row by row, length rows·cols.
    pub elements: Vec<f64>,
}

impl Matrix {
    /// Reads a two-dimensional array of `float32` or `float64`, in C or Fortran order.
    ///
    /// # Errors
    /// When it cannot be read or is no such array.
    pub(crate) fn read_npy(path: &Path) -> Result<Self, InputError> {
        let complain = |message: String| InputError::new(path.display(), message);
        let unreadable = |e: std::io::Error| InputError::unreadable(path, &e);
        if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
            return Err(complain("is no file; give a .npy file".into()));
        }
        let file = BufReader::new(File::open(path).map_err(unreadable)?);
        let broken = |e: std::io::Error| {
            complain(format!(
                "is no whole .npy file ({e}); give one that numpy.save has written"
            ))
        };
        let npy = NpyFile::new(file).map_err(broken)?;
        let &[rows, cols] = npy.shape() else {
            return Err(complain(format!(
                "has {} dimensions; give an array of rows and columns",
                npy.shape().len()
            )));
        };
        if rows.checked_mul(cols).is_none_or(|n| n > MOST_ELEMENTS) {
            return Err(complain(format!(
                "has {rows}x{cols} elements; give at most {MOST_ELEMENTS}"
            )));
        }
        let is_transposed = npy.order() == Order::Fortran;
        let npy = match npy.try_data::<f64>() {
            Ok(data) => data.collect(),
            Err(npy) => match npy.try_data::<f32>() {
                Ok(data) => data.map(|x| x.map(f64::from)).collect(),
                Err(npy) => {
                    return Err(complain(format!(
                        "has elements of type {}; give float32 or float64",
                        npy.dtype().descr()
                    )));
                }
            },
        };
        let elements: std::io::Result<Vec<f64>> = npy;
        let (rows, cols) = (rows as usize, cols as usize);
        let mut elements = elements.map_err(broken)?;
        if is_transposed {
            let by_row = (0..rows * cols).map(|at| elements[at % cols * rows + at / cols]);
            elements = by_row.collect();
        }
        Ok(Matrix {
            rows,
            cols,
            elements,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use npyz::WriterBuilder;

    fn written<T: npyz::AutoSerialize + Copy>(
        order: Order,
        shape: &[u64],
        data: &[T],
    ) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .order(order)
            .shape(shape)
            .writer(file.reopen().unwrap())
            .begin_nd()
            .unwrap();
        writer.extend(data.iter().copied()).unwrap();
        writer.finish().unwrap();
        file
    }

    #[test]
    fn either_precision_and_either_order_come_row_by_row() {
        let expected = Matrix {
            rows: 2,
            cols: 3,
            elements: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        };
        let by_row = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let by_col = [1.0f32, 4.0, 2.0, 5.0, 3.0, 6.0];
        let file = written(Order::C, &[2, 3], &by_row);
        assert_eq!(Matrix::read_npy(file.path()).unwrap(), expected);
        let file = written(Order::Fortran, &[2, 3], &by_col);
        assert_eq!(Matrix::read_npy(file.path()).unwrap(), expected);
    }

    #[test]
    fn what_is_no_matrix_of_numbers_is_refused() {
        let says = |path: &Path| Matrix::read_npy(path).unwrap_err().to_string();
        let file = written(Order::C, &[2, 3, 1], &[0.0; 6]);
        assert!(says(file.path()).contains("3 dimensions"));
        let file = written(Order::C, &[2, 3], &[0u16; 6]);
        assert!(says(file.path()).contains("<u2"), "{}", says(file.path()));
        let bytes = std::fs::read(written(Order::C, &[2, 3], &[0.0; 6]).path()).unwrap();
        let cut = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(cut.path(), &bytes[..bytes.len() - 5]).unwrap();
        assert!(says(cut.path()).contains("whole .npy file"));
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (999999, 999999), }\n";
        let mut huge = b"\x93NUMPY\x01\x00".to_vec();
        huge.extend((header.len() as u16).to_le_bytes());
        huge.extend(header.as_bytes());
        std::fs::write(cut.path(), &huge).unwrap();
        assert!(says(cut.path()).contains("999999x999999"));
        std::fs::write(cut.path(), b"rows, cols\n").unwrap();
        assert!(says(cut.path()).contains("whole .npy file"));
        assert!(says(&std::env::temp_dir()).contains("is no file"));
        assert!(Matrix::read_npy(Path::new("/nonexistent.npy")).is_err());
    }
}
