//! Planar images of 32-bit floats, for resizing and expressions: [`Planes`].

use image::imageops::{FilterType, resize};
use image::{ImageBuffer, Luma};

use super::conventions::{Channels, Rounding};
use super::expressions::PixelValue;
use darkqa_base::types::Rgb;

/// Planar image with samples in 0..1: red, green and blue planes, or a single plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Planes {
    pub(super) height: usize,
    pub(super) width: usize,
    /// The samples, channels × height × width.
    pub(super) samples: Vec<f32>,
}

impl Planes {
    /// The planes of an image, its bytes divided by 255.
    pub(super) fn from_rgb(image: &Rgb) -> Self {
        let pixels = image.samples().chunks_exact(3);
        let samples =
            (0..3).flat_map(|channel| pixels.clone().map(move |pixel| f32::from(pixel[channel]) / 255.0)).collect();
        Self { height: image.height(), width: image.width(), samples }
    }

    /// Height and width in pixels.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    /// The image with its luma replaced by the single plane `luma`. The difference is added to each channel, which
    /// keeps the chroma.
    pub(super) fn with_luma(&self, luma: &Self) -> Self {
        let plane = self.height * self.width;
        let changes: Vec<f32> = (0..plane).map(|pixel| luma.samples[pixel] - self.sample(pixel).luma()).collect();
        Self {
            samples: self.samples.iter().zip(changes.iter().cycle()).map(|(sample, change)| sample + change).collect(),
            ..*self
        }
    }

    /// Value of the pixel with this index, counted row by row.
    pub(super) fn sample(&self, pixel: usize) -> PixelValue {
        let plane = self.height * self.width;
        match self.samples.get(2 * plane + pixel) {
            Some(blue) => PixelValue::Three([self.samples[pixel], self.samples[plane + pixel], *blue]),
            None => PixelValue::One(self.samples[pixel]),
        }
    }

    /// The image with three planes; a single plane is repeated.
    pub(super) fn spread(mut self) -> Self {
        if self.samples.len() == self.height * self.width {
            self.samples = self.samples.repeat(3);
        }
        self
    }

    /// The image with these channels: as it is, or its luma.
    pub(super) fn with_channels(self, channels: Channels) -> Self {
        match channels {
            Channels::Rgb => self,
            Channels::Y => {
                let samples = (0..self.height * self.width).map(|pixel| self.sample(pixel).luma()).collect();
                Self { samples, ..self }
            }
        }
    }

    /// The image in bytes: each sample is clamped to 0..1 and multiplied by 255. `None` for an image without pixels.
    pub(super) fn to_rgb(&self, rounding: Rounding) -> Option<Rgb> {
        let plane = self.height * self.width;
        let mut samples = vec![0; 3 * plane];
        for (channel, plane) in self.samples.chunks_exact(plane).take(3).enumerate() {
            for (pixel, sample) in samples.chunks_exact_mut(3).zip(plane) {
                let code = sample.clamp(0.0, 1.0) * 255.0;
                pixel[channel] = match rounding {
                    Rounding::Round => code.round() as u8,
                    Rounding::Truncate => code as u8,
                };
            }
        }
        Rgb::new(self.height, self.width, samples).ok()
    }

    /// The image resized to another height and width; its samples are clamped to 0..1 first.
    ///
    /// The filter is bilinear, with its support widened by the ratio when the image shrinks. Unlike sharper filters it
    /// never leaves the range of the image's values, so it makes no haloes. Samples stay floats, because the few codes
    /// of a dark image would be rounded twice in bytes.
    pub(super) fn resized(&self, height: usize, width: usize) -> Result<Self, String> {
        let (old_height, old_width) = (side_as_u32(self.height)?, side_as_u32(self.width)?);
        let (new_height, new_width) = (side_as_u32(height)?, side_as_u32(width)?);
        let mut samples = Vec::with_capacity(3 * height * width);
        for plane in self.samples.chunks_exact(self.height * self.width) {
            let plane = plane.iter().map(|sample| sample.clamp(0.0, 1.0)).collect();
            let plane = ImageBuffer::<Luma<f32>, Vec<f32>>::from_raw(old_width, old_height, plane)
                .ok_or("a plane has another size than its image")?;
            samples.extend(resize(&plane, new_width, new_height, FilterType::Triangle).into_raw());
        }
        Ok(Self { height, width, samples })
    }
}

fn side_as_u32(side: usize) -> Result<u32, String> {
    u32::try_from(side).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image whose neighbouring samples all differ.
    fn image(height: usize, width: usize) -> Rgb {
        let samples = (0..height * width * 3).map(|i| (i * 37 % 256) as u8);
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    #[test]
    fn planes_are_red_green_blue() {
        let image = Rgb::new(1, 2, vec![0, 51, 102, 153, 204, 255]).unwrap();
        let planes = Planes::from_rgb(&image);
        assert_eq!(planes.samples, [0.0, 0.6, 0.2, 0.8, 0.4, 1.0]);
        assert_eq!((planes.height, planes.width), (1, 2));
    }

    #[test]
    fn every_byte_comes_back() {
        let image = image(11, 24);
        assert_eq!(Planes::from_rgb(&image).to_rgb(Rounding::Round).unwrap(), image);
    }

    #[test]
    fn samples_are_clamped_and_rounded() {
        let planes =
            Planes { height: 1, width: 2, samples: vec![-0.1, 1.1, 0.5, f32::INFINITY, 1.4 / 255.0, 1.6 / 255.0] };
        // 0.5 · 255 = 127.5 is rounded up
        assert_eq!(planes.to_rgb(Rounding::Round).unwrap().samples(), [0, 128, 1, 255, 255, 2]);
    }

    #[test]
    fn resizing_preserves_flat_colours_and_the_range() {
        let flat = Rgb::new(9, 7, [3, 120, 255].repeat(63)).unwrap();
        let resized = Planes::from_rgb(&flat).resized(4, 16).unwrap();
        assert_eq!((resized.height, resized.width, resized.samples.len()), (4, 16, 192));
        assert_eq!(resized.resized(9, 7).unwrap().to_rgb(Rounding::Round).unwrap(), flat);
        let mut too_large = Planes::from_rgb(&image(8, 8));
        too_large.samples[0] = 5.0;
        let resized = too_large.resized(16, 5).unwrap();
        assert!(resized.samples.iter().all(|x| (0.0..=1.0).contains(x)));
    }

    #[test]
    fn resizing_keeps_pixels_in_their_places() {
        let halves: Vec<u8> = (0..16).flat_map(|i| [if i % 4 < 2 { 0 } else { 255 }; 3]).collect();
        let small = Planes::from_rgb(&Rgb::new(4, 4, halves).unwrap()).resized(2, 2).unwrap();
        for row in small.samples.chunks_exact(2) {
            assert!(row[0] < 0.2 && row[1] > 0.8, "{row:?}");
        }
    }
}
