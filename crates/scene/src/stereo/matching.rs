//! A matcher at work: two images in, disparities out.

use super::disparity::DisparityMap;
use super::image::GreyImage;
use super::settings::{MatchError, Matcher, Workspace};
use super::sweep;

impl Matcher {
    /// The disparity of every pixel of `left`, at column x, whose partner in `right` is at column x minus the disparity in the same row.
    /// Runs on rayon's threads; their number changes nothing in the result.
    ///
    /// # Errors
    /// Images of different size, or impossible settings.
    pub fn match_pair(
        &self,
        left: &GreyImage,
        right: &GreyImage,
    ) -> Result<DisparityMap, MatchError> {
        self.match_pair_in(&mut Workspace::default(), left, right)
    }

    /// As [`Matcher::match_pair`], with memory that is kept for the next pair.
    ///
    /// # Errors
    /// As [`Matcher::match_pair`].
    pub fn match_pair_in(
        &self,
        workspace: &mut Workspace,
        left: &GreyImage,
        right: &GreyImage,
    ) -> Result<DisparityMap, MatchError> {
        self.check(left, right)?;
        Ok(sweep::match_images(self, workspace, left, right))
    }
}
