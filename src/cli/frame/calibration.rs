//! Calibration of a rectified camera pair, from a TOML of ours or as data sets give it.
//!
//! | file | intrinsics | baseline |
//! |---|---|---|
//! | TOML | `left`, `right`: 3 x 3, px | `baseline_m` |
//! | Middlebury 2014 and 2021, `calib.txt` | `cam0=[f 0 u; 0 f v; 0 0 1]`, `cam1=…`; `doffs` is the difference of their u | `baseline`, mm |
//! | KITTI, `calib.txt`, `calib_cam_to_cam.txt` | `P2: …`, `P3: …` or `P_rect_02: …`: 3 x 4 projections, of the colour cameras if they are there | the difference of the fourth columns over the focal length, m |
//!
//! Which of them it is, is told by its keys.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DMat3;

use crate::files::{InputError, parse_toml};
use crate::scene::{DVec3, MOST_BASELINE_M};
use crate::settings::Document;

/// Most disparities that are searched.
const MOST_DISPARITIES: f64 = 256.0;

/// What a calibration file holds.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct Calibration {
    left: [[f64; 3]; 3],
    right: Option<[[f64; 3]; 3]>,
    pub(super) baseline_m: f64,
    pub(super) disparities: Option<usize>,
    pub(super) min_disparity: Option<i32>,
    pub(super) lidar_position_m: Option<DVec3>,
    pub(super) lidar_fov_deg: Option<f64>,
    /// Width and height of the pictures, where a data set's file says it.
    #[serde(skip)]
    pub(super) size_px: Option<(usize, usize)>,
}

/// Focal length and principal point, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::cli) struct Intrinsics {
    pub(super) focal_px: f64,
    pub(super) principal_px: (f64, f64),
}

/// What a calibration file holds, and the intrinsics of left and right camera, px.
///
/// # Errors
/// A file that cannot be read, or whose pair is impossible.
pub(in crate::cli) fn read_calibration(
    path: &Path,
) -> Result<(Calibration, [Intrinsics; 2]), InputError> {
    let complain = |message: String| InputError::new(path.display(), message);
    let text = Document::text(path)?;
    let begins = |key: &str| text.lines().any(|line| line.trim_start().starts_with(key));
    let calibration = if begins("cam0=") || begins("cam0 =") {
        of_middlebury(&text).map_err(complain)?
    } else if ["P0:", "P2:", "P_rect_00:", "P_rect_02:"]
        .into_iter()
        .any(begins)
    {
        of_kitti(&text).map_err(complain)?
    } else {
        parse_toml(path.display(), &text)?
    };
    let own = intrinsics("left", calibration.left).map_err(complain)?;
    let other = match calibration.right {
        Some(right) => intrinsics("right", right).map_err(complain)?,
        None => own,
    };
    check(&calibration, own, other).map_err(complain)?;
    Ok((calibration, [own, other]))
}

/// Values by their names; `sign` stands between.
fn entries(text: &str, sign: char) -> BTreeMap<&str, &str> {
    let pairs = text.lines().filter_map(|line| line.split_once(sign));
    pairs
        .map(|(key, value)| (key.trim(), value.trim()))
        .collect()
}

fn of_middlebury(text: &str) -> Result<Calibration, String> {
    let entries = entries(text, '=');
    let number = |key: &str| entries.get(key).and_then(|value| value.parse::<f64>().ok());
    let matrix = |key: &str| -> Option<[[f64; 3]; 3]> {
        let value = entries.get(key)?.strip_prefix('[')?.strip_suffix(']')?;
        let rows = value.split(';').map(|row| numbers(row)?.try_into().ok());
        rows.collect::<Option<Vec<[f64; 3]>>>()?.try_into().ok()
    };
    let needed = |what: &str| format!("has no {what}; give the calib.txt as the data set has it");
    let left = matrix("cam0").ok_or_else(|| needed("cam0=[f 0 u; 0 f v; 0 0 1]"))?;
    let right = matrix("cam1").ok_or_else(|| needed("cam1=[f 0 u; 0 f v; 0 0 1]"))?;
    let baseline_mm = number("baseline").ok_or_else(|| needed("baseline in mm"))?;
    let offset = right[0][2] - left[0][2];
    if let Some(doffs) = number("doffs").filter(|doffs| (doffs - offset).abs() > 0.5) {
        return Err(format!(
            "has doffs={doffs}, and cam1 and cam0 differ by {offset} px in u; give numbers that agree"
        ));
    }
    // The bounds of true disparities are closer than the number to search, where a file has them.
    let (begin, disparities) = match (number("vmin"), number("vmax"), number("ndisp")) {
        (Some(least), Some(most), _) if least <= most => {
            (least.floor(), most.ceil() - least.floor() + 1.0)
        }
        (_, _, Some(disparities)) => (0.0, disparities),
        _ => (0.0, 64.0),
    };
    let size = [number("width"), number("height")].map(|n| n.map(|n| n as usize));
    Ok(Calibration {
        left,
        right: Some(right),
        baseline_m: 1e-3 * baseline_mm,
        disparities: Some(disparities.clamp(1.0, MOST_DISPARITIES) as usize),
        min_disparity: Some(begin as i32),
        lidar_position_m: None,
        lidar_fov_deg: None,
        size_px: size[0].zip(size[1]),
    })
}

fn of_kitti(text: &str) -> Result<Calibration, String> {
    let entries = entries(text, ':');
    let projection = |camera: u8| {
        let names = [format!("P{camera}"), format!("P_rect_0{camera}")];
        let value = names.iter().find_map(|name| entries.get(name.as_str()))?;
        let numbers: [f64; 12] = numbers(value)?.try_into().ok()?;
        Some(numbers)
    };
    let has_colour = entries.contains_key("P2") || entries.contains_key("P_rect_02");
    let left = if has_colour { 2 } else { 0 };
    let needed = |camera: u8| {
        projection(camera).ok_or_else(|| {
            format!("has no projection P{camera} of twelve numbers; give the calibration as the data set has it")
        })
    };
    let (left, right) = (needed(left)?, needed(left + 1)?);
    let rows = |p: [f64; 12]| [[p[0], p[1], p[2]], [p[4], p[5], p[6]], [p[8], p[9], p[10]]];
    let size = entries.get("S_rect_02").or(entries.get("S_rect_00"));
    let size = size.and_then(|value| <[f64; 2]>::try_from(numbers(value)?).ok());
    Ok(Calibration {
        left: rows(left),
        right: Some(rows(right)),
        baseline_m: (left[3] - right[3]) / left[0],
        disparities: Some(128),
        min_disparity: None,
        lidar_position_m: None,
        lidar_fov_deg: None,
        size_px: size.map(|[width, height]| (width as usize, height as usize)),
    })
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    let words = text.split([' ', ',', '\t']).filter(|word| !word.is_empty());
    words.map(|word| word.parse().ok()).collect()
}

fn intrinsics(name: &str, matrix: [[f64; 3]; 3]) -> Result<Intrinsics, String> {
    let columns = DMat3::from_cols_array_2d(&matrix);
    let [[fx, skew, u], [zero, fy, v], last] = matrix;
    if !matrix.iter().flatten().all(|x| x.is_finite()) || columns.determinant().abs() < 1e-9 {
        return Err(format!(
            "the {name} intrinsics {matrix:?} are singular; give [[f, 0, u], [0, f, v], [0, 0, 1]] in pixels"
        ));
    }
    let plain = fx > 0.0 && skew == 0.0 && zero == 0.0 && last == [0.0, 0.0, 1.0];
    if !plain || (fy / fx - 1.0).abs() > 0.01 {
        return Err(format!(
            "the {name} intrinsics {matrix:?} are not those of a rectified camera with square pixels; give [[f, 0, u], [0, f, v], [0, 0, 1]]"
        ));
    }
    Ok(Intrinsics {
        focal_px: fx,
        principal_px: (u, v),
    })
}

fn check(calibration: &Calibration, left: Intrinsics, right: Intrinsics) -> Result<(), String> {
    // The thesis's rig has 1 m; files in millimetres have a hundred and more.
    if !(calibration.baseline_m > 0.0 && calibration.baseline_m <= MOST_BASELINE_M) {
        let baseline_m = calibration.baseline_m;
        return Err(format!(
            "baseline_m = {baseline_m} is impossible; give metres above 0, up to {MOST_BASELINE_M} (193 mm are 0.193)"
        ));
    }
    if (right.focal_px / left.focal_px - 1.0).abs() > 1e-3 {
        return Err(
            "focal lengths differ by more than a thousandth; give those of the rectified pair"
                .into(),
        );
    }
    if (right.principal_px.1 - left.principal_px.1).abs() > 1.0 {
        return Err("principal points are not in one row; give those of the rectified pair".into());
    }
    let place = calibration.lidar_position_m.unwrap_or(DVec3::ZERO);
    if !(place.is_finite() && place.length() <= 1e3) {
        return Err(format!(
            "lidar_position_m = {place} is impossible; give metres, up to 1000"
        ));
    }
    match calibration.lidar_fov_deg {
        Some(fov) if !(fov > 0.0 && fov < 180.0) => Err(format!(
            "lidar_fov_deg = {fov} is impossible; give degrees above 0, below 180"
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIDDLEBURY: &str = "cam0=[3979.911 0 1244.772; 0 3979.911 1019.507; 0 0 1]
cam1=[3979.911 0 1369.115; 0 3979.911 1019.507; 0 0 1]
doffs=124.343
baseline=193.001
width=2964
height=1988
ndisp=280
isint=0
vmin=31
vmax=257
";

    const KITTI: &str = "P0: 7.2e+02 0 6.1e+02 0 0 7.2e+02 1.7e+02 0 0 0 1 0
P1: 7.2e+02 0 6.1e+02 -3.888e+02 0 7.2e+02 1.7e+02 0 0 0 1 0
P2: 7.2e+02 0 6.1e+02 4.5e+01 0 7.2e+02 1.7e+02 2e-01 0 0 1 3e-03
P3: 7.2e+02 0 6.1e+02 -3.15e+02 0 7.2e+02 1.7e+02 2e+00 0 0 1 3e-03
";

    fn read(text: &str) -> Result<(Calibration, [Intrinsics; 2]), String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib.txt");
        std::fs::write(&path, text).unwrap();
        read_calibration(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn middlebury_s_is_in_mm_with_an_offset() {
        let (calibration, [left, right]) = read(MIDDLEBURY).unwrap();
        assert!((calibration.baseline_m - 0.193001).abs() < 1e-12);
        assert_eq!(left.focal_px, 3979.911);
        assert!((right.principal_px.0 - left.principal_px.0 - 124.343).abs() < 1e-9);
        assert_eq!(
            (calibration.min_disparity, calibration.disparities),
            (Some(31), Some(227))
        );
        assert_eq!(calibration.size_px, Some((2964, 1988)));
    }

    #[test]
    fn kitti_s_baseline_is_in_its_projections() {
        let (calibration, [left, _]) = read(KITTI).unwrap();
        assert!((calibration.baseline_m - 0.5).abs() < 1e-12);
        assert_eq!(left.principal_px, (610.0, 170.0));
        let grey = KITTI.lines().take(2).collect::<Vec<_>>().join("\n");
        assert!((read(&grey).unwrap().0.baseline_m - 0.54).abs() < 1e-12);
        let raw = KITTI
            .replace("P2:", "P_rect_02:")
            .replace("P3:", "P_rect_03:");
        let raw = format!("calib_time: 09-Jan-2012\nS_rect_02: 1.242e+03 3.75e+02\n{raw}");
        assert_eq!(read(&raw).unwrap().0.size_px, Some((1242, 375)));
    }

    #[test]
    fn what_does_not_agree_is_said() {
        let said = |text: &str| read(text).unwrap_err();
        assert!(said(&MIDDLEBURY.replace("doffs=124", "doffs=24")).contains("doffs"));
        assert!(said(&MIDDLEBURY.replace("cam1", "cam9")).contains("cam1"));
        assert!(said(&MIDDLEBURY.replace("baseline=", "base=")).contains("baseline in mm"));
        assert!(said(&MIDDLEBURY.replace("3979.911 0 1244", "3979.911 x 1244")).contains("cam0"));
        assert!(said(&KITTI.replace("P3: 7.2e+02", "P3:")).contains("P3 of twelve"));
        assert!(said(&KITTI.replace("-3.15e+02", "1.15e+02")).contains("baseline"));
        assert!(said("P2: 1 2 3\n").contains("twelve numbers"));
    }
}
