//! Grey images of 8 to 16 bits a pixel.

/// An image row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    width: usize,
    height: usize,
    bits: u32,
    pixels: Vec<u16>,
}

/// Why pixels are no image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// Too few or too many pixels, or none.
    #[error("{pixels} pixels do not make {width} x {height}")]
    Size {
        /// Columns asked for.
        width: usize,
        /// Rows asked for.
        height: usize,
        /// Pixels given.
        pixels: usize,
    },
    /// Neither 8 nor 16 bits nor between.
    #[error("{bits} bits a pixel are impossible; give 8 to 16")]
    Bits {
        /// Bits asked for.
        bits: u32,
    },
    /// A pixel brighter than its bits can say.
    #[error("pixel value {value} does not fit into {bits} bits")]
    Value {
        /// The first such value.
        value: u16,
        /// Bits of the image.
        bits: u32,
    },
}

impl GreyImage {
    /// An image of `width` × `height` pixels of `bits` bits (8 to 16).
    ///
    /// # Errors
    /// When the pixels are not width × height, or more than that many bits.
    pub fn new(
        width: usize,
        height: usize,
        bits: u32,
        pixels: Vec<u16>,
    ) -> Result<Self, ImageError> {
        if pixels.is_empty() || Some(pixels.len()) != width.checked_mul(height) {
            let pixels = pixels.len();
            return Err(ImageError::Size {
                width,
                height,
                pixels,
            });
        }
        if !(8..=16).contains(&bits) {
            return Err(ImageError::Bits { bits });
        }
        match pixels.iter().find(|&&v| u32::from(v) >> bits != 0) {
            Some(&value) => Err(ImageError::Value { value, bits }),
            None => Ok(GreyImage {
                width,
                height,
                bits,
                pixels,
            }),
        }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    pub(crate) fn pixels(&self) -> &[u16] {
        &self.pixels
    }

    /// The pixels of row `y`.
    pub(crate) fn row(&self, y: usize) -> &[u16] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// The eight highest bits of every pixel.
    pub(crate) fn as_8_bit(&self) -> Vec<u8> {
        let shift = self.bits - 8;
        self.pixels.iter().map(|v| (v >> shift) as u8).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_are_no_image_are_refused() {
        let size = ImageError::Size {
            width: 2,
            height: 2,
            pixels: 3,
        };
        assert_eq!(GreyImage::new(2, 2, 8, vec![0; 3]), Err(size));
        assert!(GreyImage::new(0, 2, 8, vec![]).is_err());
        assert!(GreyImage::new(usize::MAX, 2, 8, vec![0; 2]).is_err());
        let bits = ImageError::Bits { bits: 17 };
        assert_eq!(GreyImage::new(1, 1, 17, vec![0]), Err(bits));
        let value = ImageError::Value {
            value: 256,
            bits: 8,
        };
        assert_eq!(GreyImage::new(1, 1, 8, vec![256]), Err(value));
    }

    #[test]
    fn the_highest_bits_are_kept() {
        let white = GreyImage::new(2, 2, 16, vec![u16::MAX; 4]).unwrap();
        assert_eq!(white.as_8_bit(), [255; 4]);
    }
}
