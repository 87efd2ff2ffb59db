//! A guide's map from a file: what another program, or an instrument, makes of the scene.

use std::path::Path;

use super::{Guide, GuideError, GuideInput, GuideMap};
use crate::files::{InputError, Raster};

/// A map that was read: distances in metres, 0 where there is no estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct FileMap {
    source: String,
    rows: usize,
    cols: usize,
    estimates: Vec<Option<(f64, f64)>>,
}

/// How sure the map is of its ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FileSigma<'a> {
    /// The same standard deviation everywhere, m.
    Same(f64),
    /// A map of standard deviations in a file of its own, m.
    Map(&'a Path),
}

impl FileMap {
    /// A map of one's own; `source` is what complaints call it. Pairs of range and standard deviation, m, row by row; `None` where there
    /// is no estimate.
    ///
    /// # Panics
    /// When there are not rows·cols of them.
    pub fn new(
        source: impl Into<String>,
        (rows, cols): (usize, usize),
        estimates: Vec<Option<(f64, f64)>>,
    ) -> Self {
        assert_eq!(estimates.len(), rows * cols);
        FileMap {
            source: source.into(),
            rows,
            cols,
            estimates,
        }
    }

    /// Reads a file of distances from the lidar along the ray, rows × cols, m (`.npy`, PFM or EXR). There is no estimate where it or the map of standard
    /// deviations has no value ([`Raster::read_map`]).
    ///
    /// # Errors
    /// When a file cannot be read or is no such array, and when a number is negative.
    pub(crate) fn read(path: &Path, sigma: FileSigma<'_>) -> Result<Self, InputError> {
        let ranges = Raster::read_map(path, None, "metres")?;
        let (rows, cols) = (ranges.height, ranges.width);
        let sigmas = match sigma {
            FileSigma::Same(sigma_m) => vec![sigma_m; rows * cols],
            FileSigma::Map(sigma_path) => {
                // A standard deviation of 0 is one.
                let sigmas = Raster::read_numbers(sigma_path, None, "metres")?;
                let complain = |message| Err(InputError::new(sigma_path.display(), message));
                if (sigmas.height, sigmas.width) != (rows, cols) {
                    return complain(format!(
                        "is {}x{}, and the ranges in {} are {rows}x{cols}; give arrays of one shape",
                        sigmas.height,
                        sigmas.width,
                        path.display()
                    ));
                }
                sigmas.values.iter().map(|&m| m.into()).collect()
            }
        };
        let ranges_m = ranges.values.iter().map(|&m| f64::from(m));
        let is_known = |&(range_m, sigma_m): &(f64, f64)| range_m > 0.0 && sigma_m.is_finite();
        let pairs = ranges_m.zip(sigmas);
        Ok(FileMap {
            source: path.display().to_string(),
            rows,
            cols,
            estimates: pairs.map(|pair| is_known(&pair).then_some(pair)).collect(),
        })
    }
}

impl Guide for FileMap {
    fn name(&self) -> &str {
        "file"
    }

    fn estimate(&self, input: &GuideInput<'_>) -> Result<GuideMap, GuideError> {
        let (rows, cols) = (input.rows as usize, input.cols as usize);
        if (self.rows, self.cols) != (rows, cols) {
            return Err(GuideError::Shape {
                source_name: self.source.clone(),
                found_rows: self.rows,
                found_cols: self.cols,
                rows,
                cols,
            });
        }
        let estimates = self.estimates.iter().copied();
        Ok(GuideMap::new(input.rows, input.cols, estimates))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_npy;
    use crate::guide::test_scenes::wall_at;

    fn written(rows: usize, cols: usize, data: &[f64]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        write_npy(&mut file.reopen().unwrap(), &[rows, cols], data).unwrap();
        file
    }

    #[test]
    fn a_map_in_memory_is_given_as_it_is() {
        let estimates = vec![Some((10.0, 0.5)), None];
        let map = FileMap::new("mine", (1, 2), estimates);
        let scene = crate::scene::Scene::outdoor();
        assert_eq!((map.name(), map.reach(&scene)), ("file", None));
        let found = map.estimate(&GuideInput::still(&scene, 1, 2, 0)).unwrap();
        assert_eq!(found.range_m, [Some(10.0), None]);
        assert_eq!(found.sigma_m, [0.5, f64::INFINITY]);
        let refused = map.estimate(&GuideInput::still(&scene, 2, 2, 0));
        assert!(refused.unwrap_err().to_string().starts_with("mine: "));
    }

    #[test]
    fn a_map_comes_as_it_was_written_and_zero_is_no_estimate() {
        let ranges = written(2, 2, &[10.0, 0.0, 30.0, 40.0]);
        let sigmas = written(2, 2, &[0.125, 0.25, 0.5, 0.75]);
        let scene = wall_at(60.0);
        let input = GuideInput::still(&scene, 2, 2, 0);
        let read = |sigma| FileMap::read(ranges.path(), sigma).unwrap();
        let map = read(FileSigma::Map(sigmas.path()))
            .estimate(&input)
            .unwrap();
        assert_eq!(map.range_m, [Some(10.0), None, Some(30.0), Some(40.0)]);
        assert_eq!(map.sigma_m, [0.125, f64::INFINITY, 0.5, 0.75]);
        let map = read(FileSigma::Same(0.7)).estimate(&input).unwrap();
        assert_eq!(map.sigma_m, [0.7, f64::INFINITY, 0.7, 0.7]);
        let wrong = GuideInput::still(&scene, 4, 4, 0);
        let refused = read(FileSigma::Same(0.7)).estimate(&wrong).unwrap_err();
        let says = "2x2 macropixels and the sensor 4x4; give one of the sensor's shape";
        assert!(refused.to_string().contains(says), "{refused}");
    }

    #[test]
    fn where_a_map_has_no_value_there_is_no_estimate() {
        let none = [f64::NAN, f64::INFINITY, 0.0, 7.0, 8.0];
        let ranges = written(1, 5, &none);
        let sigmas = written(1, 5, &[1.0, 1.0, 1.0, f64::NAN, 0.0]);
        let map = FileMap::read(ranges.path(), FileSigma::Map(sigmas.path())).unwrap();
        assert_eq!(map.estimates, [None, None, None, None, Some((8.0, 0.0))]);
    }

    #[test]
    fn negative_numbers_are_refused_with_their_place() {
        let file = written(2, 3, &[1.0, 2.0, 3.0, 4.0, -1.0, 6.0]);
        let good = written(2, 3, &[1.0; 6]);
        for (ranges, sigma) in [
            (&file, FileSigma::Same(1.0)),
            (&good, FileSigma::Map(file.path())),
        ] {
            let refused = FileMap::read(ranges.path(), sigma).unwrap_err();
            assert!(refused.to_string().contains("row 1, column 1"), "{refused}");
        }
        let (ranges, sigmas) = (written(1, 2, &[1.0; 2]), written(2, 1, &[1.0; 2]));
        let refused = FileMap::read(ranges.path(), FileSigma::Map(sigmas.path())).unwrap_err();
        assert!(
            refused.to_string().contains("is 2x1, and the ranges"),
            "{refused}"
        );
    }
}
