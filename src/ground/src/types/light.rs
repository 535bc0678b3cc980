//! Images as floating-point light: [`Light`].

use std::fmt;

use crate::error::Error;

/// Linear light of an image, height × width × 3, with the primaries of sRGB; black is 0, white is 1.
///
/// It is either the light of a scene, or the light that the display shows for codes: their gamma is undone, the tone curve of the
/// camera is not.
#[derive(Clone, PartialEq)]
pub struct Light {
    height: usize,
    width: usize,
    samples: Vec<f32>,
}

impl Light {
    /// Takes height × width × 3 samples, row by row, red first.
    ///
    /// # Errors
    /// If the number of samples is not `height * width * 3`, or is zero, or a sample is not a finite number of at least 0.
    pub fn new(height: usize, width: usize, samples: Vec<f32>) -> Result<Self, Error> {
        let wrong = |problem: fmt::Arguments<'_>| Error::data("image", problem);
        let found = samples.len();
        let expected = height.checked_mul(width).and_then(|n| n.checked_mul(3));
        if found == 0 || expected != Some(found) {
            return Err(wrong(format_args!(
                "{found} samples do not make a {height} × {width} image of light"
            )));
        }
        if let Some(sample) = samples
            .iter()
            .find(|sample| !sample.is_finite() || **sample < 0.0)
        {
            return Err(wrong(format_args!(
                "{sample} is not an amount of light; expected a finite number of at least 0"
            )));
        }
        Ok(Self {
            height,
            width,
            samples,
        })
    }

    /// A black image of at least one pixel.
    #[must_use]
    pub fn black(height: usize, width: usize) -> Self {
        let (height, width) = (height.max(1), width.max(1));
        Self {
            height,
            width,
            samples: vec![0.0; height * width * 3],
        }
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
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// The samples, to change them in place.
    #[must_use]
    pub fn samples_mut(&mut self) -> &mut [f32] {
        &mut self.samples
    }
}

impl fmt::Debug for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Light({} × {})", self.height, self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_light_are_checked() {
        assert!(Light::new(2, 2, vec![0.5; 12]).is_ok());
        for (height, width, samples) in [(2, 2, 11), (0, 2, 0), (usize::MAX, 2, 12), (2, 2, 13)] {
            assert!(Light::new(height, width, vec![0.5; samples]).is_err());
        }
        for wrong in [f32::NAN, f32::INFINITY, -0.01] {
            let error = Light::new(1, 1, vec![0.5, wrong, 0.5]).unwrap_err();
            assert!(error.to_string().contains("not an amount of light"));
        }
        assert!(Light::new(1, 1, vec![0.0, 1.0, 16.0]).is_ok());
    }
}
