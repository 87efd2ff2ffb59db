//! Ranges and sources that several keys of a scene file have.

use crate::settings::Range;

/// Beyond a million metres the squares in the geometry lose the small lengths.
const FAR_M: f64 = 1e6;

pub(super) const CHOSEN: &str = "chosen for the street";
pub(super) const TABLE_12: &str = "thesis Table 12";
pub(super) const LENGTH: Range = Range::Above(0.0, FAR_M);
pub(super) const POSITION: Range = Range::Within(-FAR_M, FAR_M);
pub(super) const SHARE: Range = Range::Within(0.0, 1.0);
pub(super) const SPEED: Range = Range::Within(-1e4, 1e4);
pub(super) const PLACES: Range = Range::Within(-FAR_M, FAR_M);
