//! Images of 16-bit codes: [`Codes16`].

use std::fmt;

use crate::error::Error;

/// 16-bit sRGB codes of an image, height × width × 3, at least one pixel.
#[derive(Clone, PartialEq, Eq)]
pub struct Codes16 {
    height: usize,
    width: usize,
    samples: Vec<u16>,
}

impl Codes16 {
    /// Takes height × width × 3 samples, row by row, red first.
    ///
    /// # Errors
    /// If the number of samples is not `height * width * 3`, or is zero.
    pub fn new(height: usize, width: usize, samples: Vec<u16>) -> Result<Self, Error> {
        let found = samples.len();
        let expected = height.checked_mul(width).and_then(|n| n.checked_mul(3));
        if found == 0 || expected != Some(found) {
            let problem =
                format_args!("{found} samples do not make a {height} × {width} image of 16 bits");
            return Err(Error::data("image", problem));
        }
        Ok(Self {
            height,
            width,
            samples,
        })
    }

    /// The height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The samples, row by row, red first.
    #[must_use]
    pub fn samples(&self) -> &[u16] {
        &self.samples
    }
}

impl fmt::Debug for Codes16 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Codes16({} × {})", self.height, self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_16_bits_are_checked() {
        assert!(Codes16::new(2, 2, vec![0; 12]).is_ok());
        for (height, width, samples) in [(2, 2, 11), (0, 2, 0), (usize::MAX, 2, 12), (2, 2, 13)] {
            assert!(Codes16::new(height, width, vec![0; samples]).is_err());
        }
    }
}
