//! Images of three channels: 8-bit codes ([`Rgb`]), 16-bit codes ([`Rgb16Image`]) and linear light ([`Light`]).

use std::fmt;

use crate::error::Error;

/// An image of height × width × 3 samples and at least one pixel.
#[derive(Clone, PartialEq, Eq)]
pub struct Image<T> {
    height: usize,
    width: usize,
    samples: Vec<T>,
}

/// An 8-bit sRGB image.
pub type Rgb = Image<u8>;

/// An image of 16-bit sRGB codes.
pub type Rgb16Image = Image<u16>;

/// Linear light of an image, with the primaries of sRGB; black is 0, white is 1.
///
/// Either the light of a scene, or the light that a display emits for codes: their gamma is undone, the tone curve of
/// the camera is not.
pub type Light = Image<f32>;

/// A sample of an [`Image`].
pub trait Sample: Copy + Default + fmt::Display {
    /// Description of such an image, for messages.
    const IMAGE: &str;
    /// Name of the image type, for `Debug`.
    const NAME: &str;

    /// True if the value is allowed in an image.
    fn is_valid(self) -> bool {
        true
    }
}

impl Sample for u8 {
    const IMAGE: &str = "RGB image";
    const NAME: &str = "Rgb";
}

impl Sample for u16 {
    const IMAGE: &str = "image of 16 bits";
    const NAME: &str = "Rgb16Image";
}

impl Sample for f32 {
    const IMAGE: &str = "image of light";
    const NAME: &str = "Light";

    fn is_valid(self) -> bool {
        self.is_finite() && self >= 0.0
    }
}

impl<T: Sample> Image<T> {
    /// An image from height × width × 3 samples, row by row, red first.
    ///
    /// # Errors
    /// If the number of samples is not `height * width * 3`, or is zero, or a sample of light is not a finite number of
    /// at least 0.
    pub fn new(height: usize, width: usize, samples: Vec<T>) -> Result<Self, Error> {
        let found = samples.len();
        let expected = height.checked_mul(width).and_then(|n| n.checked_mul(3));
        if found == 0 || expected != Some(found) {
            let image = T::IMAGE;
            return Err(Error::data("image", format_args!("{found} samples do not make a {height} × {width} {image}")));
        }
        if let Some(sample) = samples.iter().find(|sample| !sample.is_valid()) {
            return Err(Error::data(
                "image",
                format_args!("{sample} is not an amount of light; expected a finite number of at least 0"),
            ));
        }
        Ok(Self { height, width, samples })
    }

    /// A black image of at least one pixel.
    #[must_use]
    pub fn black(height: usize, width: usize) -> Self {
        let (height, width) = (height.max(1), width.max(1));
        Self { height, width, samples: vec![T::default(); height * width * 3] }
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
    pub fn samples(&self) -> &[T] {
        &self.samples
    }

    /// Converts the image into its samples.
    #[must_use]
    pub fn into_samples(self) -> Vec<T> {
        self.samples
    }

    /// The samples, to change them in place.
    #[must_use]
    pub fn samples_mut(&mut self) -> &mut [T] {
        &mut self.samples
    }
}

impl<T: Sample> fmt::Debug for Image<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}({} × {})", T::NAME, self.height, self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked() {
        assert!(Rgb::new(2, 2, vec![0; 12]).is_ok());
        assert!(Rgb16Image::new(2, 2, vec![0; 12]).is_ok());
        assert!(Light::new(2, 2, vec![0.5; 12]).is_ok());
        for (height, width, samples) in [(2, 2, 11), (0, 2, 0), (usize::MAX, 2, 12), (2, 2, 13)] {
            assert!(Rgb::new(height, width, vec![0; samples]).is_err());
            assert!(Rgb16Image::new(height, width, vec![0; samples]).is_err());
            assert!(Light::new(height, width, vec![0.5; samples]).is_err());
        }
    }

    #[test]
    fn amounts_of_light_are_checked() {
        for wrong in [f32::NAN, f32::INFINITY, -0.01] {
            let error = Light::new(1, 1, vec![0.5, wrong, 0.5]).unwrap_err();
            assert!(error.to_string().contains("not an amount of light"));
        }
        assert!(Light::new(1, 1, vec![0.0, 1.0, 16.0]).is_ok());
    }
}
