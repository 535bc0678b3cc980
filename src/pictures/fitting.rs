//! Downscaling of images to a maximum side: [`fit`].

use std::borrow::Cow;
use std::num::NonZeroU32;

use image::{ImageBuffer, imageops};

use crate::encoding::{image_error, side};
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

/// Width and height of an image after [`fit`], in pixels: unchanged, or reduced.
#[must_use]
pub fn fitted_size(width: u32, height: u32, max_side: NonZeroU32) -> (u32, u32) {
    let (longer, max) = (u64::from(width.max(height)), u64::from(max_side.get()));
    if longer <= max {
        return (width, height);
    }
    let [width, height] = [width, height].map(|side| ((u64::from(side) * max + longer / 2) / longer).max(1) as u32);
    (width, height)
}

/// Reduces an image by a Lanczos filter (3 lobes) if its longer side has more than `max_side` pixels.
///
/// # Errors
/// If a side is too long for any format.
pub fn fit(image: &Rgb, max_side: NonZeroU32) -> Result<Cow<'_, Rgb>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let fitted = fitted_size(width, height, max_side);
    if fitted == (width, height) {
        return Ok(Cow::Borrowed(image));
    }
    let source = ImageBuffer::<image::Rgb<u8>, _>::from_raw(width, height, image.samples())
        .ok_or_else(|| image_error("its samples do not fill its sides"))?;
    let (width, height) = fitted;
    let smaller = imageops::resize(&source, width, height, imageops::FilterType::Lanczos3);
    Rgb::new(height as usize, width as usize, smaller.into_raw()).map(Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_shrink_to_the_side_and_never_grow() {
        let image = Rgb::black(30, 60);
        for (max_side, expected) in [(60, (60, 30)), (100, (60, 30)), (20, (20, 10)), (1, (1, 1))] {
            let fitted = fit(&image, NonZeroU32::new(max_side).unwrap()).unwrap();
            assert_eq!((fitted.width(), fitted.height()), expected);
        }
        let grey = Rgb::new(40, 40, vec![128; 4800]).unwrap();
        let fitted = fit(&grey, NonZeroU32::new(13).unwrap()).unwrap();
        assert!(fitted.samples().iter().all(|sample| *sample == 128));
    }
}
