//! Images made smaller to fit a longest side: [`fit`].

use std::borrow::Cow;
use std::num::NonZeroU32;

use image::{ImageBuffer, imageops};

use crate::encoding::{image_error, side};
use darkqa_ground::error::Result;
use darkqa_ground::types::Rgb;

/// The width and height of an image that fits a longest side, in pixels: unchanged, or reduced.
#[must_use]
pub fn fitted_size((width, height): (u32, u32), max_side: NonZeroU32) -> (u32, u32) {
    let (longer, max) = (u64::from(width.max(height)), u64::from(max_side.get()));
    if longer <= max {
        return (width, height);
    }
    let scaled = |side: u32| ((u64::from(side) * max + longer / 2) / longer).max(1) as u32;
    (scaled(width), scaled(height))
}

/// The image, reduced by a Lanczos filter of three lobes if its longer side has more than `max_side` pixels.
///
/// # Errors
/// If a side is too long for any format.
pub fn fit(image: &Rgb, max_side: NonZeroU32) -> Result<Cow<'_, Rgb>> {
    let from = (side(image.width())?, side(image.height())?);
    let (width, height) = fitted_size(from, max_side);
    if (width, height) == from {
        return Ok(Cow::Borrowed(image));
    }
    let source = ImageBuffer::<image::Rgb<u8>, _>::from_raw(from.0, from.1, image.samples());
    let source = source.ok_or_else(|| image_error("its samples do not fill its sides"))?;
    let smaller = imageops::resize(&source, width, height, imageops::FilterType::Lanczos3);
    Rgb::new(height as usize, width as usize, smaller.into_raw()).map(Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_shrink_to_the_side_and_never_grow() {
        let image = Rgb::black(30, 60);
        for (most, expected) in [(60, (60, 30)), (100, (60, 30)), (20, (20, 10)), (1, (1, 1))] {
            let fitted = fit(&image, NonZeroU32::new(most).unwrap()).unwrap();
            assert_eq!((fitted.width(), fitted.height()), expected);
        }
        let grey = Rgb::new(40, 40, vec![128; 4800]).unwrap();
        let fitted = fit(&grey, NonZeroU32::new(13).unwrap()).unwrap();
        assert!(fitted.samples().iter().all(|sample| *sample == 128));
    }
}
