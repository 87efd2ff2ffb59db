//! Arrays of results that are read again, and counts of histograms that users give: NumPy files (`.npy`) of known shape.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::complaint::InputError;

type NpyFile = npyz::NpyFile<BufReader<File>>;

/// Reads an array of this shape, row-major, whose elements are of type `T`.
///
/// # Errors
/// When it cannot be read, is no such array, or has another shape or type.
pub(crate) fn read_array<T: npyz::Deserialize>(
    path: &Path,
    shape: &[usize],
) -> Result<Vec<T>, InputError> {
    let values = open(path, shape, "of the sensor and its frames")?.into_vec();
    values.map_err(|e| broken(path, &e))
}

/// Reads an array of this shape, row-major, whose elements are whole numbers from 0 to 65535 of any type; the last three axes are rows,
/// columns and bins.
///
/// # Errors
/// When it cannot be read, is no such array, or has another shape.
pub(crate) fn read_counts(path: &Path, shape: &[usize]) -> Result<Vec<u16>, InputError> {
    let file = open(path, shape, "rows, columns and bins of the sensor")?;
    let complain = |message: String| InputError::new(path.display(), message);
    let kind = file.dtype().descr();
    let file = match file.try_data::<u16>() {
        Ok(values) => {
            let counts = values.collect::<std::io::Result<_>>();
            return counts.map_err(|e| broken(path, &e));
        }
        Err(file) => file,
    };
    let counts = as_whole(file).ok_or_else(|| {
        complain(format!(
            "has elements of type {kind}; save it as whole numbers, as uint16"
        ))
    })?;
    let counts = counts.map_err(|e| broken(path, &e))?;
    let &[.., rows, cols, bins] = shape else {
        unreachable!("counts have rows, columns and bins");
    };
    let in_range = |(at, &count): (usize, &i64)| {
        u16::try_from(count).map_err(|_| {
            let [row, col] = [at / (cols * bins) % rows, at / bins % cols];
            complain(format!(
                "has {count} counts in bin {} of macropixel ({row}, {col}); give 0 to 65535",
                at % bins
            ))
        })
    };
    counts.iter().enumerate().map(in_range).collect()
}

/// The file, if it is an array of this shape, which is that of what `axes` says.
fn open(path: &Path, shape: &[usize], axes: &str) -> Result<NpyFile, InputError> {
    let file = File::open(path).map_err(|e| InputError::unreadable(path, &e))?;
    let file = npyz::NpyFile::new(BufReader::new(file)).map_err(|e| broken(path, &e))?;
    let wanted = shape.iter().map(|&n| n as u64);
    if file.shape().iter().copied().eq(wanted) && file.order() == npyz::Order::C {
        return Ok(file);
    }
    let order = match file.order() {
        npyz::Order::C => "",
        npyz::Order::Fortran => " in Fortran order",
    };
    let message = format!(
        "is an array of shape {:?}{order}; give one of {shape:?}, row-major: {axes}",
        file.shape()
    );
    Err(InputError::new(path.display(), message))
}

fn broken(path: &Path, error: &std::io::Error) -> InputError {
    let error = error.to_string().replace('\n', " ");
    let message = format!("is no NumPy file of such numbers ({error}); give a .npy");
    InputError::new(path.display(), message)
}

fn as_whole(file: NpyFile) -> Option<std::io::Result<Vec<i64>>> {
    macro_rules! as_one_of {
        ($file:expr, $($kind:ty),*) => {{
            let file = $file;
            $(let file = match file.try_data::<$kind>() {
                Ok(values) => return Some(values.map(|v| v.map(i64::from)).collect()),
                Err(file) => file,
            };)*
            match file.try_data::<u64>() {
                Ok(values) => {
                    Some(values.map(|v| v.map(|v| i64::try_from(v).unwrap_or(i64::MAX))).collect())
                }
                Err(_) => None,
            }
        }};
    }
    as_one_of!(file, u8, i8, i16, u32, i32, i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use npyz::WriterBuilder;

    fn written<T: npyz::AutoSerialize + Copy>(values: &[T], shape: &[u64]) -> tempfile::TempPath {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        let options = npyz::WriteOptions::new().default_dtype().shape(shape);
        let mut writer = options.writer(&mut file).begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
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
