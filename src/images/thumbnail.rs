//! Small copies of the images that were sent, for the report: [`thumbnail`], [`thumbnail_of_all`], and those not made yet: [`MissingThumbnails`].

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU32;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::images::montage::{columns, montage};
use crate::picture::{Payload, PayloadFormat, Scaling};
use crate::types::outlines::PixelBox;
use crate::types::{Condition, Digest, FrameId, ObjectCrop, Rgb, RunQuestion, Thumbnail};

/// Version of small copies, raised whenever a byte of one changes, so that older ones are not taken from an image store.
pub(crate) const VERSION: u32 = 1;

/// Maximum number of frames with thumbnails, so that the report of a large run stays small; chosen.
const MAX_FRAMES: usize = 48;
/// Longest side of a small copy, in pixels; chosen.
const SIDE: u32 = 240;
/// Maximum number of images beside each other in one small copy; chosen, so that each keeps a third of its side.
const MOST_TILES: usize = 9;
/// Side of the crop, in pixels; chosen.
const CROP: usize = 96;
/// Format of the small copy and of the crop.
const FORMAT: &str = "jpeg:72";

/// Least and largest side of the crop of a thing, in pixels; chosen.
const OBJECT: [usize; 2] = [64, 160];
/// Room around a thing in its crop, as a share of its sides; chosen.
const AROUND: f64 = 0.2;
/// Maximum number of things of a frame with crops; chosen, so that the page has room for many frames.
const MAX_OBJECTS: usize = 3;

/// The thumbnails that a run folder does not have yet.
#[derive(Debug, Default)]
pub(crate) struct MissingThumbnails {
    frames: BTreeSet<FrameId>,
    objects: BTreeMap<FrameId, Vec<PixelBox>>,
    present: BTreeSet<(FrameId, Condition)>,
}

impl MissingThumbnails {
    /// The missing thumbnails of all frames or, if there are too many, of those with the lowest digests. This choice does not
    /// depend on order or shards.
    pub(crate) fn new<'a>(
        frames: impl IntoIterator<Item = &'a FrameId>,
        present: Vec<Thumbnail>,
    ) -> Self {
        let frames: BTreeSet<&FrameId> = frames.into_iter().collect();
        let mut ranked: Vec<&FrameId> = frames.into_iter().collect();
        ranked.sort_by_cached_key(|frame| *Digest::from_bytes(frame.0.as_bytes()).as_bytes());
        let present = present
            .into_iter()
            .map(|thumbnail| (thumbnail.frame, thumbnail.condition));
        Self {
            frames: ranked.into_iter().take(MAX_FRAMES).cloned().collect(),
            objects: BTreeMap::new(),
            present: present.collect(),
        }
    }

    /// The same thumbnails with crops of the things that these questions are about; of the first few of a frame.
    pub(crate) fn with_objects<'a>(
        mut self,
        questions: impl IntoIterator<Item = &'a RunQuestion>,
    ) -> Self {
        for question in questions {
            let Some(object) = question.object().filter(|_| self.wants(&question.frame)) else {
                continue;
            };
            let objects = self.objects.entry(question.frame.clone()).or_default();
            if objects.len() < MAX_OBJECTS && !objects.contains(&object) {
                objects.push(object);
            }
        }
        self
    }

    /// The things of a frame that have crops.
    pub(crate) fn objects(&self, frame: &FrameId) -> &[PixelBox] {
        self.objects.get(frame).map_or(&[], Vec::as_slice)
    }

    /// Whether a frame has thumbnails in the report.
    pub(crate) fn wants(&self, frame: &FrameId) -> bool {
        self.frames.contains(frame)
    }

    /// Whether the thumbnail of a frame in a condition is wanted and missing.
    pub(crate) fn lacks(&self, frame: &FrameId, condition: &Condition) -> bool {
        self.wants(frame) && !self.present.contains(&(frame.clone(), condition.clone()))
    }
}

/// A small copy of an image as it was sent, and a crop of its middle; of several images small copies beside each other, and a crop of
/// the one in the middle. Of more than [`MOST_TILES`] the one in the middle stands for all. `None` without images.
pub(crate) fn thumbnail_of_all(
    frame: &FrameId,
    condition: &Condition,
    sent: &[Arc<Payload>],
) -> Result<Option<Thumbnail>> {
    let Some(middle) = sent.get(sent.len() / 2) else {
        return Ok(None);
    };
    let mut thumbnail = thumbnail(frame, condition, middle, None, None)?;
    thumbnail.image = Payload::joint_digest(sent).unwrap_or(thumbnail.image);
    if (2..=MOST_TILES).contains(&sent.len()) {
        let side = SIDE / columns(sent.len()) as u32;
        let tiles = sent.iter().map(|image| {
            let image = image.decode()?;
            small(&image, side).map(Cow::into_owned)
        });
        thumbnail.small = url(&montage(&tiles.collect::<Result<Vec<Rgb>>>()?)?)?;
    }
    Ok(Some(thumbnail))
}

/// A small copy of an image as it was sent, and a crop of its middle. The crop of a degraded image without an enhancer is amplified by
/// the light that the level has taken; other crops are unchanged. With the `encoded` pixels, a PNG need not be decoded.
pub(crate) fn thumbnail(
    frame: &FrameId,
    condition: &Condition,
    sent: &Payload,
    encoded: Option<&Rgb>,
    shown: Option<ShownObjects<'_>>,
) -> Result<Thumbnail> {
    let image = sent.received(encoded)?;
    let ev = match condition.enhancer {
        // Of automatic exposure, what the camera left dark.
        None => match (condition.degradation(), sent.facts().exposure) {
            (Some(_), Some(exposure)) => exposure.dark.unwrap_or_default() as f32,
            (Some(how), None) => how.kind().relight(how.severity()),
            // Of a pair, as much darker as its photograph is.
            (None, _) => sent
                .facts()
                .pair
                .and_then(|pair| pair.ev())
                .unwrap_or(0.0)
                .max(0.0) as f32,
        },
        Some(_) => 0.0,
    };
    Ok(Thumbnail {
        frame: frame.clone(),
        condition: condition.clone(),
        image: sent.facts().digest,
        small: url(&*small(&image, SIDE)?)?,
        crop: url(&middle(&image, ev)?)?,
        stops: ev,
        size: shown.map(|shown| shown.size),
        objects: match shown {
            None => Vec::new(),
            Some(shown) => shown
                .objects
                .iter()
                .map(|object| {
                    let crop = url(&amplified(
                        &image,
                        object_place(&image, *object, shown.size),
                        ev,
                    )?)?;
                    let object = *object;
                    Ok(ObjectCrop { object, crop })
                })
                .collect::<Result<_>>()?,
        },
    })
}

/// The things of a frame that have crops, and its width and height in pixels, in which their boxes are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShownObjects<'a> {
    pub(crate) size: [u32; 2],
    pub(crate) objects: &'a [PixelBox],
}

/// A part of an image: top, left, height and width, in pixels.
type Place = [usize; 4];

/// A square around the middle of a thing, with some room around it; within the image.
fn object_place(image: &Rgb, object: PixelBox, size: [u32; 2]) -> Place {
    let sides = [image.width(), image.height()];
    let scale = [0, 1].map(|axis| sides[axis] as f64 / f64::from(size[axis].max(1)));
    let ends =
        [0, 1].map(|axis| [object[axis], object[axis + 2]].map(|end| f64::from(end) * scale[axis]));
    let longer = (ends[0][1] - ends[0][0]).max(ends[1][1] - ends[1][0]);
    let side = (longer * (1.0 + 2.0 * AROUND)).round() as usize;
    let side = side.clamp(OBJECT[0], OBJECT[1]);
    let [[left, width], [top, height]] = [0, 1].map(|axis| {
        let length = side.min(sides[axis]);
        let start = f64::midpoint(ends[axis][0], ends[axis][1]) - length as f64 / 2.0;
        [
            (start.max(0.0).round() as usize).min(sides[axis] - length),
            length,
        ]
    });
    [top, left, height, width]
}

/// The `data:` URL of a picture.
fn url(image: &Rgb) -> Result<String> {
    let jpeg: PayloadFormat = FORMAT
        .parse()
        .map_err(|e| Error::data("the format of thumbnails", e))?;
    let url = Payload::encode(image, jpeg)?.data_url();
    Ok(String::from_utf8_lossy(&url).into_owned())
}

/// The image with a longer side of at most `side` pixels. Each pixel is the mean of those that it replaces. This is four times as
/// fast as `image::imageops::thumbnail`.
fn small(image: &Rgb, side: u32) -> Result<Cow<'_, Rgb>> {
    let (height, width) = (image.height(), image.width());
    let scaling = NonZeroU32::new(side).map_or(Scaling::Never, Scaling::MaxSide);
    let (columns, rows) = scaling.size((width as u32, height as u32));
    if (columns, rows) == (width, height) {
        return Ok(Cow::Borrowed(image));
    }
    let mut samples = Vec::with_capacity(columns * rows * 3);
    let mut sums = vec![0_u32; width * 3];
    for row in 0..rows {
        let (top, end) = (row * height / rows, (row + 1) * height / rows);
        sums.fill(0);
        for line in image.samples()[top * width * 3..end * width * 3].chunks_exact(width * 3) {
            for (sum, code) in sums.iter_mut().zip(line) {
                *sum += u32::from(*code);
            }
        }
        for column in 0..columns {
            let (left, right) = (column * width / columns, (column + 1) * width / columns);
            let count = ((end - top) * (right - left)) as u32;
            let pixels = || sums[left * 3..right * 3].chunks_exact(3);
            samples.extend([0, 1, 2].map(|channel| {
                let sum: u32 = pixels().map(|pixel| pixel[channel]).sum();
                ((sum + count / 2) / count) as u8
            }));
        }
    }
    Rgb::new(rows, columns, samples).map(Cow::Owned)
}

/// The middle of an image, with its linear light (gamma 2.2) amplified by `ev`.
fn middle(image: &Rgb, ev: f32) -> Result<Rgb> {
    let (height, width) = (image.height().min(CROP), image.width().min(CROP));
    let (top, left) = ((image.height() - height) / 2, (image.width() - width) / 2);
    amplified(image, [top, left, height, width], ev)
}

/// A part of an image, with its linear light (gamma 2.2) amplified by `ev`.
fn amplified(image: &Rgb, [top, left, height, width]: Place, ev: f32) -> Result<Rgb> {
    let scale = libm::exp2(f64::from(ev) / 2.2);
    let amplified: [u8; 256] =
        std::array::from_fn(|code| (code as f64 * scale).round().min(255.0) as u8);
    let rows = (top..top + height).flat_map(|row| {
        let first = (row * image.width() + left) * 3;
        &image.samples()[first..first + width * 3]
    });
    Rgb::new(
        height,
        width,
        rows.map(|code| amplified[usize::from(*code)]).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::fit;

    #[test]
    fn a_small_pixel_is_the_mean_of_those_it_replaces() {
        let mut image = Rgb::black(3, 480);
        for (i, pixel) in image.samples_mut().chunks_exact_mut(3).enumerate() {
            let (row, column) = (i / 480, i % 480);
            pixel.fill((10 * row + 3 * (column % 2) + column / 4) as u8);
        }
        // 240 × 2: the first row replaces one row of the image, the second two.
        let copy = small(&image, SIDE).unwrap();
        assert_eq!((copy.height(), copy.width()), (2, 240));
        let at = |row: usize, column: usize| copy.samples()[(row * 240 + column) * 3];
        assert_eq!([at(0, 0), at(0, 3), at(1, 0)], [2, 3, 17]);
        let fits = Rgb::black(2, 240);
        assert!(matches!(small(&fits, SIDE).unwrap(), Cow::Borrowed(_)));
    }

    #[test]
    fn thumbnails_show_the_image_as_it_was_sent() {
        let samples = (0..300 * 400 * 3_u64).map(|i| (i * i % 251) as u8);
        let image = Rgb::new(300, 400, samples.collect()).unwrap();
        let (frame, condition) = (FrameId("f".into()), "L3-ev".parse().unwrap());
        for (format, side) in [
            ("png", 400),
            ("png", 301),
            ("jpeg:50", 400),
            ("jpeg:50", 301),
        ] {
            let scaled = fit(&image, NonZeroU32::new(side).unwrap()).unwrap();
            let sent = Payload::encode(&scaled, format.parse().unwrap()).unwrap();
            let copy = |encoded| thumbnail(&frame, &condition, &sent, encoded, None).unwrap();
            assert_eq!(copy(Some(&*scaled)), copy(None), "{format} {side}");
        }
    }

    #[test]
    fn the_place_of_a_thing_is_around_it_and_within_the_image() {
        let image = Rgb::black(300, 400);
        let place = |object| object_place(&image, object, [800, 600]);
        // Half the size of the frame: a box of 40 × 20 pixels has its least crop, one of 100 × 60 has room around it.
        assert_eq!(place([200, 200, 280, 240]), [78, 88, 64, 64]);
        assert_eq!(place([200, 200, 400, 320]), [60, 80, 140, 140]);
        // At the edge, and larger than a crop.
        assert_eq!(place([760, 560, 800, 600]), [236, 336, 64, 64]);
        assert_eq!(place([0, 0, 800, 600]), [70, 120, 160, 160]);
        assert_eq!(
            object_place(&Rgb::black(40, 50), [0, 0, 5, 5], [50, 40]),
            [0, 0, 40, 50]
        );
    }

    #[test]
    fn the_middle_is_amplified_by_the_light_that_was_taken() {
        let mut image = Rgb::black(100, 200);
        image.samples_mut().fill(10);
        let crop = middle(&image, 2.2).unwrap();
        assert_eq!((crop.height(), crop.width()), (CROP, CROP));
        assert!(crop.samples().iter().all(|code| *code == 20));
        let small = middle(&Rgb::black(3, 2), 9.0).unwrap();
        assert_eq!((small.height(), small.width()), (3, 2));
    }
}
