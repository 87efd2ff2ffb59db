//! What macropixels without a depth look like in every picture: in `depth.png`, on the page and in Python.
//!
//! | what happened | ground | reasons |
//! |---|---|---|
//! | there is nothing to see | white | no surface |
//! | the SPADs were off | dark | no guide, out of reach, SPADs off |
//! | the SPADs looked and no depth came of it | light | saturated, outside the window, no significant peak, behind the lidar |
//!
//! The three classes differ in their mean grey, too. Reasons that fill the first pictures of a user differ the most: no surface, no
//! guide, outside the window, no significant peak.

use super::pixel::NoDepth;
use crate::report::{Category, Pattern};

/// Darkest and lightest ink; neither is a colour of the depth scale.
const BLACK: u8 = 0;
const WHITE: u8 = 255;

impl NoDepth {
    /// What its macropixels look like.
    pub const fn pattern(self) -> Pattern {
        match self {
            NoDepth::NoSurface => Pattern::plain(WHITE),
            NoDepth::NoGuide => Pattern::tile(30, 190, [b"....", b".##.", b".##.", b"...."]),
            NoDepth::OutOfReach => Pattern::tile(50, 215, [b"....", b"####", b"....", b"...."]),
            NoDepth::SpadsOff => Pattern::plain(BLACK),
            NoDepth::Saturated => Pattern::tile(WHITE, BLACK, [b"##..", b"##..", b"..##", b"..##"]),
            NoDepth::OutsideWindow => {
                Pattern::tile(WHITE, 50, [b"..##", b".##.", b"##..", b"#..#"])
            }
            NoDepth::NoSignificantPeak => {
                Pattern::tile(WHITE, 50, [b"....", b".##.", b".##.", b"...."])
            }
            NoDepth::BehindLidar => Pattern::tile(210, BLACK, [b".#..", b"####", b".#..", b".#.."]),
        }
    }

    /// Names and patterns of [`NoDepth::ALL`], in that order.
    pub fn categories() -> [Category<'static>; 8] {
        Self::ALL.map(|why| Category {
            name: why.name(),
            pattern: why.pattern(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{DEPTH_COLOURS, lightness};

    /// CIE L* of a pattern's pixels.
    fn shades(pattern: Pattern) -> Vec<f64> {
        let levels = pattern.levels().concat();
        levels
            .into_iter()
            .map(|level| lightness([level; 3]))
            .collect()
    }

    fn mean(pattern: Pattern) -> f64 {
        lightness([pattern.mean(); 3])
    }

    /// Neither in print without colours, nor to eyes that see none.
    #[test]
    fn no_pattern_has_the_lightness_of_a_depth() {
        let [near, .., far] = DEPTH_COLOURS.map(lightness);
        for why in NoDepth::ALL {
            let shades = shades(why.pattern());
            let darkest = shades.iter().copied().fold(f64::INFINITY, f64::min);
            let lightest = shades.iter().copied().fold(0.0, f64::max);
            let is_outside = lightest < far - 8.0 || darkest > near + 8.0;
            // A depth is plain.
            let is_tiled = lightest - darkest > 45.0;
            assert!(is_outside || is_tiled, "{why:?}: {darkest} to {lightest}");
        }
    }

    /// Wherever the tile of the other begins: a quarter of the pixels differ by half the way from black to white.
    #[test]
    fn any_two_patterns_differ_in_every_cell() {
        for (number, one) in NoDepth::ALL.into_iter().enumerate() {
            for other in &NoDepth::ALL[number + 1..] {
                let (ones, others) = (shades(one.pattern()), shades(other.pattern()));
                for shift in 0..16 {
                    let moved = |pixel: usize| {
                        let (y, x) = (pixel / 4 + shift / 4, pixel % 4 + shift % 4);
                        others[y % 4 * 4 + x % 4]
                    };
                    let apart = ones.iter().enumerate();
                    let apart = apart.filter(|&(pixel, shade)| (shade - moved(pixel)).abs() > 50.0);
                    let apart = apart.count();
                    let means = (mean(one.pattern()) - mean(other.pattern())).abs();
                    assert!(
                        apart >= 4,
                        "{one:?} {other:?}: {apart} pixels, means {means}"
                    );
                }
            }
        }
    }

    /// Where cells are too small for a tile.
    #[test]
    fn classes_differ_in_their_mean_grey() {
        use NoDepth::*;
        let classes = [
            &[NoSurface][..],
            &[NoSignificantPeak, OutsideWindow, Saturated, BehindLidar],
            &[NoGuide, OutOfReach, SpadsOff],
        ];
        assert_eq!(classes.concat().len(), NoDepth::ALL.len());
        let means = classes.map(|class| {
            let means = class.iter().map(|why| mean(why.pattern()));
            means.fold((f64::INFINITY, 0.0f64), |(least, most), mean| {
                (least.min(mean), most.max(mean))
            })
        });
        for pair in means.windows(2) {
            assert!(pair[0].0 > pair[1].1 + 8.0, "{means:?}");
        }
    }
}
