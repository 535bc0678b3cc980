//! Small copies of the images that were sent, for the report: [`thumbnail`], and which of them are still [`Wanted`].

use std::collections::BTreeSet;
use std::num::NonZeroU32;

use crate::ask::{Format, Payload};
use crate::error::Result;
use crate::types::{Condition, Digest, FrameId, Rgb, Thumbnail};

/// Copies of so many frames are kept, so that a report stays small whatever the run's size.
const MOST_FRAMES: usize = 48;
/// The longest side of a copy, in pixels.
const SIDE: u32 = 240;
/// The side of the crop, in pixels.
const CROP: usize = 96;
/// The format of both.
const FORMAT: &str = "jpeg:72";

/// The copies that a run has yet to keep.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    frames: BTreeSet<FrameId>,
    there: BTreeSet<(FrameId, Condition)>,
}

impl Wanted {
    /// Those of all frames where there are few, else of those with the lowest digests, whatever the order or shard in which
    /// they come; but for those that are there.
    pub(crate) fn new<'a>(
        frames: impl IntoIterator<Item = &'a FrameId>,
        there: Vec<Thumbnail>,
    ) -> Self {
        let frames: BTreeSet<&FrameId> = frames.into_iter().collect();
        let mut ranked: Vec<&FrameId> = frames.into_iter().collect();
        ranked.sort_by_cached_key(|frame| *Digest::of(frame.0.as_bytes()).as_bytes());
        let there = there.into_iter().map(|kept| (kept.frame, kept.condition));
        Self {
            frames: ranked.into_iter().take(MOST_FRAMES).cloned().collect(),
            there: there.collect(),
        }
    }

    /// Whether copies of a frame are wanted at all.
    pub(crate) fn wants(&self, frame: &FrameId) -> bool {
        self.frames.contains(frame)
    }

    /// A copy of an image as it was sent, if it is wanted. One that cannot be made is said and left out: a picture for the report is
    /// worth no failed answer.
    pub(crate) fn of(
        &self,
        frame: &FrameId,
        condition: &Condition,
        sent: &Payload,
    ) -> Option<Thumbnail> {
        let wanted = self.frames.contains(frame)
            && !self.there.contains(&(frame.clone(), condition.clone()));
        let made = wanted.then(|| thumbnail(frame, condition, sent))?;
        made.inspect_err(|problem| {
            tracing::warn!("no small copy of {frame} at {condition} is kept: {problem}");
        })
        .ok()
    }
}

/// A small copy of an image as it was sent, and the middle of it: raw dark images with the light given back that the level
/// has taken, all others as they are.
fn thumbnail(frame: &FrameId, condition: &Condition, sent: &Payload) -> Result<Thumbnail> {
    let image = sent.decode()?;
    let stops = match condition.enhancer {
        None => condition
            .degradation
            .as_ref()
            .map_or(0.0, |how| how.kind().relight(how.severity())),
        Some(_) => 0.0,
    };
    let jpeg: Format = FORMAT.parse()?;
    let url = |image: &Rgb, side| -> Result<String> {
        let url = Payload::encode(image, jpeg, side)?.data_url();
        Ok(String::from_utf8_lossy(&url).into_owned())
    };
    Ok(Thumbnail {
        frame: frame.clone(),
        condition: condition.clone(),
        image: sent.facts().digest,
        small: url(&image, NonZeroU32::new(SIDE))?,
        crop: url(&middle(&image, stops)?, None)?,
        stops,
    })
}

/// The middle of an image, its linear light (gamma 2.2) amplified by so many EV.
fn middle(image: &Rgb, stops: f32) -> Result<Rgb> {
    let (height, width) = (image.height().min(CROP), image.width().min(CROP));
    let (top, left) = ((image.height() - height) / 2, (image.width() - width) / 2);
    let scale = libm::exp2(f64::from(stops) / 2.2);
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

    #[test]
    fn the_middle_is_shown_in_the_light_it_had() {
        let mut image = Rgb::black(100, 200);
        image.samples_mut().fill(10);
        let crop = middle(&image, 2.2).unwrap();
        assert_eq!((crop.height(), crop.width()), (CROP, CROP));
        assert!(crop.samples().iter().all(|code| *code == 20));
        let small = middle(&Rgb::black(3, 2), 9.0).unwrap();
        assert_eq!((small.height(), small.width()), (3, 2));
    }
}
