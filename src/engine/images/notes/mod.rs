//! Notes about images for the report: thumbnails and fidelity.
//!
//! Several images in one picture, arranged in rows: [`montage`].
//!
//! Thumbnails of sent images for the report: [`thumbnail`] and [`thumbnail_of_all`] make them.

mod image_notes;

use std::borrow::Cow;
use std::num::NonZeroU32;
use std::sync::Arc;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::PixelBox;
use darkqa_base::types::{Condition, FrameId, ObjectCrop, Rgb, Thumbnail};
use darkqa_pictures::{Payload, PayloadFormat, Scaling};

pub use image_notes::{ImageNotes, MissingNotes};

pub(super) use image_notes::{WantedNotes, fidelity, similarity};

/// Width of the gap between two images, in pixels; chosen.
const GAP: usize = 2;

/// Grey code of the background; chosen so that dark and bright images stand out.
const GREY: u8 = 128;

/// The smallest number of columns for which there are at most as many rows as columns.
fn columns(images: usize) -> usize {
    (1..=images).find(|columns| columns * columns >= images).unwrap_or(1)
}

/// Arranges images in rows, unscaled. Each cell has the width of the widest image and the height of the highest.
///
/// # Errors
/// None in practice: the number of samples follows from the sides.
pub fn montage(images: &[Rgb]) -> Result<Rgb> {
    let height = images.iter().map(Rgb::height).max().unwrap_or(1);
    let width = images.iter().map(Rgb::width).max().unwrap_or(1);
    let columns = columns(images.len());
    let rows = images.len().div_ceil(columns).max(1);
    let picture_height = rows * (height + GAP) - GAP;
    let picture_width = columns * (width + GAP) - GAP;
    let mut samples = vec![GREY; picture_height * picture_width * 3];
    for (index, image) in images.iter().enumerate() {
        let top = index / columns * (height + GAP);
        let left = index % columns * (width + GAP);
        let lines = image.samples().chunks_exact(image.width() * 3);
        for (row, line) in lines.enumerate() {
            let start = ((top + row) * picture_width + left) * 3;
            samples[start..start + line.len()].copy_from_slice(line);
        }
    }
    Rgb::new(picture_height, picture_width, samples)
}

/// Version of the thumbnails. Raise it whenever a byte of one changes, so that older thumbnails in an image store are
/// not reused.
pub const VERSION: u32 = 1;

/// Maximum side of a small copy, in pixels. An arbitrary choice.
const COPY_SIDE: u32 = 240;

/// Maximum number of images side by side in one small copy. Chosen so that each image has a third of the copy's side.
const MAX_TILES: usize = 9;

/// Side of the centre crop, in pixels. An arbitrary choice.
const CROP_SIDE: usize = 96;

/// Format of small copies and crops.
const FORMAT: &str = "jpeg:72";

/// Minimum and maximum side of an object crop, in pixels. An arbitrary choice.
const OBJECT_CROP_SIDES: [usize; 2] = [64, 160];

/// Margin on each side of an object in its crop, as a share of the object's longer side. An arbitrary choice.
const OBJECT_MARGIN: f64 = 0.2;

/// Makes one thumbnail of images as they were sent together. The crop is of the middle image. Up to [`MAX_TILES`]
/// images are shown side by side in the small copy; of more, only the middle image is shown. `None` without images.
pub fn thumbnail_of_all(frame: &FrameId, condition: &Condition, sent: &[Arc<Payload>]) -> Result<Option<Thumbnail>> {
    let Some(middle) = sent.get(sent.len() / 2) else {
        return Ok(None);
    };
    let mut thumbnail = thumbnail(frame, condition, middle, None, None)?;
    thumbnail.image = Payload::joint_digest(sent).unwrap_or(thumbnail.image);
    if (2..=MAX_TILES).contains(&sent.len()) {
        let side = COPY_SIDE / columns(sent.len()) as u32;
        let tiles = sent
            .iter()
            .map(|payload| {
                let image = payload.decode()?;
                downscaled(&image, side).map(Cow::into_owned)
            })
            .collect::<Result<Vec<Rgb>>>()?;
        thumbnail.small = jpeg_data_url(&montage(&tiles)?)?;
    }
    Ok(Some(thumbnail))
}

/// Makes the thumbnail of an image as it was sent: a small copy, a centre crop, and crops of the `shown` objects. Crops
/// are brightened by [`crop_gain`]. With the `encoded` pixels, a PNG is not decoded.
pub fn thumbnail(
    frame: &FrameId,
    condition: &Condition,
    sent: &Payload,
    encoded: Option<&Rgb>,
    shown: Option<ShownObjects<'_>>,
) -> Result<Thumbnail> {
    let image = sent.received_pixels(encoded)?;
    let ev = crop_gain(condition, sent);
    Ok(Thumbnail {
        frame: frame.clone(),
        condition: condition.clone(),
        image: sent.facts().digest,
        small: jpeg_data_url(&*downscaled(&image, COPY_SIDE)?)?,
        crop: jpeg_data_url(&centre_crop(&image, ev)?)?,
        stops: ev,
        size: shown.map(|shown| shown.size),
        objects: match shown {
            None => Vec::new(),
            Some(shown) => shown
                .objects
                .iter()
                .map(|object| object_crop(&image, *object, shown.size, ev))
                .collect::<Result<_>>()?,
        },
    })
}

/// Gain of the crops, in EV: the light that a degraded image or a dark photograph lacks. 0 for enhanced images.
fn crop_gain(condition: &Condition, sent: &Payload) -> f32 {
    if condition.enhancer.is_some() {
        return 0.0;
    }
    match (condition.degradation(), sent.facts().exposure) {
        // Automatic exposure: only the darkness that the camera did not compensate.
        (Some(_), Some(exposure)) => exposure.dark.unwrap_or_default() as f32,
        (Some(degradation), None) => degradation.kind().display_gain(degradation.severity()),
        // Photograph of a pair: its drop in light.
        (None, _) => sent.facts().pair.and_then(|pair| pair.ev()).unwrap_or(0.0).max(0.0) as f32,
    }
}

/// Objects of a frame to crop.
#[derive(Debug, Clone, Copy)]
pub struct ShownObjects<'a> {
    /// Width and height of the frame, in pixels.
    pub size: [u32; 2],
    /// Boxes of the objects, in pixels of the frame.
    pub objects: &'a [PixelBox],
}

/// A rectangle in an image: top, left, height and width, in pixels.
type CropRect = [usize; 4];

/// Crops an object, brightened by `ev`. The box is in pixels of a frame of width and height `frame_size`.
fn object_crop(image: &Rgb, object: PixelBox, frame_size: [u32; 2], ev: f32) -> Result<ObjectCrop> {
    let rect = object_rect(image, object, frame_size);
    let crop = jpeg_data_url(&brightened_crop(image, rect, ev)?)?;
    Ok(ObjectCrop { object, crop })
}

/// Square around the centre of an object, with a margin, within the image. The box is in pixels of a frame of width and
/// height `frame_size`.
fn object_rect(image: &Rgb, object: PixelBox, frame_size: [u32; 2]) -> CropRect {
    let image_size = [image.width(), image.height()];
    let scale = [0, 1].map(|axis| image_size[axis] as f64 / f64::from(frame_size[axis].max(1)));
    let extents = [0, 1].map(|axis| [object[axis], object[axis + 2]].map(|end| f64::from(end) * scale[axis]));
    let longer = (extents[0][1] - extents[0][0]).max(extents[1][1] - extents[1][0]);
    let side = (longer * (1.0 + 2.0 * OBJECT_MARGIN)).round() as usize;
    let side = side.clamp(OBJECT_CROP_SIDES[0], OBJECT_CROP_SIDES[1]);
    let [[left, width], [top, height]] = [0, 1].map(|axis| {
        let length = side.min(image_size[axis]);
        let start = f64::midpoint(extents[axis][0], extents[axis][1]) - length as f64 / 2.0;
        [(start.max(0.0).round() as usize).min(image_size[axis] - length), length]
    });
    [top, left, height, width]
}

/// Encodes an image in [`FORMAT`], as a `data:` URL.
fn jpeg_data_url(image: &Rgb) -> Result<String> {
    let jpeg: PayloadFormat = FORMAT.parse().map_err(|e| Error::data("the format of thumbnails", e))?;
    let url = Payload::encode(image, jpeg)?.data_url();
    Ok(String::from_utf8_lossy(&url).into_owned())
}

/// Scales an image down to a longer side of at most `max_side` pixels. Each pixel is the mean of the pixels that it
/// replaces. Four times as fast as `image::imageops::thumbnail`.
fn downscaled(image: &Rgb, max_side: u32) -> Result<Cow<'_, Rgb>> {
    let (height, width) = (image.height(), image.width());
    let scaling = NonZeroU32::new(max_side).map_or(Scaling::Never, Scaling::MaxSide);
    let (columns, rows) = scaling.size(width as u32, height as u32);
    if (columns, rows) == (width, height) {
        return Ok(Cow::Borrowed(image));
    }
    let mut samples = Vec::with_capacity(columns * rows * 3);
    let mut column_sums = vec![0_u32; width * 3];
    for row in 0..rows {
        let (top, bottom) = (row * height / rows, (row + 1) * height / rows);
        column_sums.fill(0);
        for line in image.samples()[top * width * 3..bottom * width * 3].chunks_exact(width * 3) {
            for (sum, code) in column_sums.iter_mut().zip(line) {
                *sum += u32::from(*code);
            }
        }
        for column in 0..columns {
            let (left, right) = (column * width / columns, (column + 1) * width / columns);
            let count = ((bottom - top) * (right - left)) as u32;
            let replaced = &column_sums[left * 3..right * 3];
            samples.extend([0, 1, 2].map(|channel| {
                let sum: u32 = replaced.chunks_exact(3).map(|pixel| pixel[channel]).sum();
                ((sum + count / 2) / count) as u8
            }));
        }
    }
    Rgb::new(rows, columns, samples).map(Cow::Owned)
}

/// Crops the centre of an image, with its linear light (gamma 2.2) amplified by `ev`.
fn centre_crop(image: &Rgb, ev: f32) -> Result<Rgb> {
    let height = image.height().min(CROP_SIDE);
    let width = image.width().min(CROP_SIDE);
    let top = (image.height() - height) / 2;
    let left = (image.width() - width) / 2;
    brightened_crop(image, [top, left, height, width], ev)
}

/// Crops an image, with its linear light (gamma 2.2) amplified by `ev`.
fn brightened_crop(image: &Rgb, [top, left, height, width]: CropRect, ev: f32) -> Result<Rgb> {
    let scale = libm::exp2(f64::from(ev) / 2.2);
    let brightened_codes: [u8; 256] = std::array::from_fn(|code| (code as f64 * scale).round().min(255.0) as u8);
    let samples: Vec<u8> = (top..top + height)
        .flat_map(|row| {
            let first = (row * image.width() + left) * 3;
            &image.samples()[first..first + width * 3]
        })
        .map(|code| brightened_codes[usize::from(*code)])
        .collect();
    Rgb::new(height, width, samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_pictures::fit;

    fn filled(height: usize, width: usize, code: u8) -> Rgb {
        Rgb::new(height, width, vec![code; height * width * 3]).unwrap()
    }

    #[test]
    fn images_are_arranged_in_rows() {
        let images = [filled(2, 3, 1), filled(4, 2, 2), filled(1, 1, 3)];
        let picture = montage(&images).unwrap();
        assert_eq!((picture.height(), picture.width()), (4 + GAP + 4, 3 + GAP + 3));
        let code = |[row, column]: [usize; 2]| picture.samples()[(row * picture.width() + column) * 3];
        assert_eq!([[1, 2], [3, 3 + GAP + 1], [4 + GAP, 0]].map(code), [1, 2, 3]);
        assert_eq!([[2, 0], [0, 3], [4, 0], [9, 7]].map(code), [GREY; 4]);
    }

    #[test]
    fn columns_are_the_smallest_number_not_below_rows() {
        let found = [0, 1, 2, 3, 4, 5, 9, 10].map(columns);
        assert_eq!(found, [1, 1, 2, 2, 2, 3, 3, 4]);
    }

    #[test]
    fn downscaling_averages_the_replaced_pixels() {
        let mut image = Rgb::black(3, 480);
        for (i, pixel) in image.samples_mut().chunks_exact_mut(3).enumerate() {
            let (row, column) = (i / 480, i % 480);
            pixel.fill((10 * row + 3 * (column % 2) + column / 4) as u8);
        }
        // 240 × 2: the first row replaces one row of the image, the second two.
        let copy = downscaled(&image, COPY_SIDE).unwrap();
        assert_eq!((copy.height(), copy.width()), (2, 240));
        let codes = [[0, 0], [0, 3], [1, 0]].map(|[row, column]| copy.samples()[(row * 240 + column) * 3]);
        assert_eq!(codes, [2, 3, 17]);
        let fits = Rgb::black(2, 240);
        assert!(matches!(downscaled(&fits, COPY_SIDE).unwrap(), Cow::Borrowed(_)));
    }

    #[test]
    fn thumbnails_show_the_image_as_it_was_sent() {
        let samples = (0..300 * 400 * 3_u64).map(|i| (i * i % 251) as u8);
        let image = Rgb::new(300, 400, samples.collect()).unwrap();
        let (frame, condition) = (FrameId("f".into()), "L3-ev".parse().unwrap());
        for (format, side) in [("png", 400), ("png", 301), ("jpeg:50", 400), ("jpeg:50", 301)] {
            let scaled = fit(&image, NonZeroU32::new(side).unwrap()).unwrap();
            let sent = Payload::encode(&scaled, format.parse().unwrap()).unwrap();
            let [from_pixels, from_file] =
                [Some(&*scaled), None].map(|encoded| thumbnail(&frame, &condition, &sent, encoded, None).unwrap());
            assert_eq!(from_pixels, from_file, "{format} {side}");
        }
    }

    #[test]
    fn an_object_crop_is_around_the_object_and_within_the_image() {
        let image = Rgb::black(300, 400);
        // The image has half the size of the frame: a box of 40 × 20 pixels has the smallest crop, one of 100 × 60 has
        // a margin. The last two are a box at the edge, and one larger than a crop.
        for (object, expected) in [
            ([200, 200, 280, 240], [78, 88, 64, 64]),
            ([200, 200, 400, 320], [60, 80, 140, 140]),
            ([760, 560, 800, 600], [236, 336, 64, 64]),
            ([0, 0, 800, 600], [70, 120, 160, 160]),
        ] {
            assert_eq!(object_rect(&image, object, [800, 600]), expected);
        }
        assert_eq!(object_rect(&Rgb::black(40, 50), [0, 0, 5, 5], [50, 40]), [0, 0, 40, 50]);
    }

    #[test]
    fn the_centre_crop_is_brightened() {
        let mut image = Rgb::black(100, 200);
        image.samples_mut().fill(10);
        let crop = centre_crop(&image, 2.2).unwrap();
        assert_eq!((crop.height(), crop.width()), (CROP_SIDE, CROP_SIDE));
        assert!(crop.samples().iter().all(|code| *code == 20));
        let small = centre_crop(&Rgb::black(3, 2), 9.0).unwrap();
        assert_eq!((small.height(), small.width()), (3, 2));
    }
}
