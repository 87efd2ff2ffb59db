//! Arrays of results that are read again, and counts of histograms that users give: NumPy files (`.npy`) of known shape.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use femtogate::{InputError, in_words};

use super::guarded::open_input;
use super::npy::{Element, NpyHead, Number};

/// Reads an array of this shape, row-major, whose elements are of type `T`.
///
/// # Errors
/// When it cannot be read, is no such array, or has another shape or type.
pub fn read_array<T: Element>(path: &Path, shape: &[usize]) -> Result<Vec<T>, InputError> {
    let (head, mut reader) = open(path, shape, "of the sensor and its frames")?;
    let other = || io::Error::other(format!("its elements are of type {}", head.descr));
    let numbers = if head.is_of::<T>() {
        head.numbers(&mut reader).unwrap_or_else(|| Err(other()))
    } else {
        Err(other())
    };
    let numbers = numbers.map_err(|e| broken(path, &e))?;
    Ok(numbers.into_iter().filter_map(T::from_number).collect())
}

/// Reads an array of this shape, row-major, whose elements are whole numbers from 0 to 65535 of any type; the last three axes are rows,
/// columns and bins.
///
/// # Errors
/// When it cannot be read, is no such array, or has another shape.
pub fn read_counts(path: &Path, shape: &[usize]) -> Result<Vec<u16>, InputError> {
    let (head, mut reader) = open(path, shape, "rows, columns and bins of the sensor")?;
    let complain = |message: String| InputError::new(path.display(), message);
    let of_other_type = || {
        let kind = &head.descr;
        complain(format!(
            "has elements of type {kind}; save it as whole numbers, as uint16"
        ))
    };
    let numbers = head.numbers(&mut reader).ok_or_else(of_other_type)?;
    let numbers = numbers.map_err(|e| broken(path, &e))?;
    let &[.., rows, cols, bins] = shape else {
        unreachable!("counts have rows, columns and bins");
    };
    let in_range = |(at, &number): (usize, &Number)| {
        let Number::Whole(count) = number else {
            return Err(of_other_type());
        };
        u16::try_from(count).map_err(|_| {
            let [row, col] = [at / (cols * bins) % rows, at / bins % cols];
            complain(format!(
                "has {count} counts in bin {} of macropixel ({row}, {col}); give 0 to 65535",
                at % bins
            ))
        })
    };
    numbers.iter().enumerate().map(in_range).collect()
}

/// The file, if it is an array of this shape, which is that of what `axes` says, and its elements.
fn open(
    path: &Path,
    shape: &[usize],
    axes: &str,
) -> Result<(NpyHead, BufReader<File>), InputError> {
    let file = open_input(path)?;
    let mut reader = BufReader::new(file);
    let head = NpyHead::read(&mut reader).map_err(|e| broken(path, &e))?;
    if head.shape == shape && !head.is_fortran {
        return Ok((head, reader));
    }
    let order = if head.is_fortran {
        " in Fortran order"
    } else {
        ""
    };
    let found = head.shape;
    let message =
        format!("is an array of shape {found:?}{order}; give one of {shape:?}, row-major: {axes}");
    Err(InputError::new(path.display(), message))
}

fn broken(path: &Path, error: &std::io::Error) -> InputError {
    let error = in_words(error);
    let message = format!("is not a NumPy file of such numbers ({error}); give a .npy");
    InputError::new(path.display(), message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_npy;

    fn written<T: Element>(values: &[T], shape: &[usize]) -> tempfile::TempPath {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        write_npy(&mut file, shape, values).unwrap();
        file.into_temp_path()
    }

    #[test]
    fn whole_numbers_of_any_type_are_counts() {
        let shape = [1, 2, 3];
        let given = [1u16, 2, 3, 4, 5, 6];
        let narrow = written(&given, &[1, 2, 3]);
        assert_eq!(read_counts(&narrow, &shape).unwrap(), given);
        let wide = written(&given.map(i64::from), &[1, 2, 3]);
        assert_eq!(read_counts(&wide, &shape).unwrap(), given);
    }

    #[test]
    fn what_cannot_be_counts_is_refused_in_one_sentence() {
        let shape = [1, 2, 3];
        for (file, says) in [
            (written(&[1u16; 6], &[2, 1, 3]), "shape [2, 1, 3]"),
            (
                written(&[1.0f64; 6], &[1, 2, 3]),
                "save it as whole numbers",
            ),
            (
                written(&[0i32, 0, 0, 0, -1, 0], &[1, 2, 3]),
                "-1 counts in bin 1 of macropixel (0, 1)",
            ),
            (
                written(&[70_000u64; 6], &[1, 2, 3]),
                "70000 counts in bin 0 of macropixel (0, 0)",
            ),
        ] {
            let sentence = read_counts(&file, &shape).unwrap_err().to_string();
            assert!(sentence.contains(says), "{sentence}");
            assert_eq!(sentence.lines().count(), 1);
        }
    }
}
