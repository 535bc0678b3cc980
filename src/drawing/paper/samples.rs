//! Samples of the images that models were sent, from the small copies that a run stores: [`samples`].

use std::collections::BTreeSet;
use std::sync::Arc;

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Mark, PAPER, Place, Sheet, Stroke, Turn};
use crate::drawing::figures::OverviewPanels;
use crate::error::{Error, Result};
use crate::types::{AxisLevel, EnhancerName, FrameId, Rgb, Thumbnail, Variant};

/// The levels that are shown where all of them were asked.
const LEVELS: [&str; 4] = ["L0", "L1", "L3", "L5"];
/// Room between tiles, in points.
const GAP: f64 = 2.0;

/// How the pixels of a `data:` URL are read.
pub(crate) type Pixels<'a> = &'a dyn Fn(&str) -> Result<Rgb>;

/// A sheet of one frame with its caption, or the reason why there is none.
type Samples = std::result::Result<(Sheet, String), &'static str>;

/// The levels of one frame in columns, raw above enhanced. The right half of a dark tile is the middle of the image, amplified by the
/// light that the level has taken; the gain stands above it.
///
/// # Errors
/// If a small copy cannot be read.
pub(super) fn samples(
    panels: &OverviewPanels,
    thumbnails: &[Thumbnail],
    look: &Look,
    letter: char,
    pixels: Pixels,
) -> Result<Samples> {
    let Some(variant) = &panels.variant else {
        return Ok(Err("no dark image was asked"));
    };
    let enhancer = panels.enhancer.as_ref();
    let stored = Stored {
        thumbnails,
        variant,
    };
    let Some((frame, levels)) = stored.best(enhancer.map(|(name, _)| name)) else {
        return Ok(Err("the runs stored no small copies of dark images"));
    };
    let mut rows: Vec<(String, Vec<Option<&Thumbnail>>)> = Vec::new();
    let raw = levels.iter().map(|level| stored.at(frame, *level, None));
    rows.push(("raw".to_owned(), raw.collect()));
    if let Some((name, shown)) = enhancer {
        let row: Vec<Option<&Thumbnail>> = levels
            .iter()
            .map(|level| stored.at(frame, *level, Some(name)))
            .collect();
        if row.iter().any(Option::is_some) {
            rows.push((shown.clone(), row));
        }
    }
    let title = format!("({letter}) {}", variant_title(variant));
    let sheet = drawn(&rows, &levels, (look, pixels), &title)?;
    let what = if rows.len() > 1 {
        format!("raw and with {}", rows[1].0)
    } else {
        "raw".to_owned()
    };
    let caption = format!(
        "The frame {frame} as models were sent it, {what}. The right half of a dark tile is the middle of the image, amplified in \
         linear light (gamma 2.2) by the EV above it."
    );
    Ok(Ok((sheet, caption)))
}

fn variant_title(variant: &Variant) -> String {
    format!("samples, {}{}", variant.title(), variant.group_suffix())
}

/// The small copies of the runs in one variant.
struct Stored<'a> {
    thumbnails: &'a [Thumbnail],
    variant: &'a Variant,
}

impl<'a> Stored<'a> {
    /// The first frame with the most levels, and these levels: those of [`LEVELS`], or up to four from the first to the last.
    fn best(&self, enhancer: Option<&EnhancerName>) -> Option<(&'a FrameId, Vec<AxisLevel>)> {
        let frames: BTreeSet<&FrameId> = self.thumbnails.iter().map(|of| &of.frame).collect();
        let mut best: Option<(usize, &FrameId, Vec<AxisLevel>)> = None;
        for frame in frames {
            let levels: BTreeSet<AxisLevel> = self
                .thumbnails
                .iter()
                .filter(|of| of.frame == *frame)
                .filter(|of| {
                    of.condition.enhancer.is_none()
                        && (of.condition.variant() == *self.variant
                            || of.condition.level() == AxisLevel::L0)
                })
                .map(|of| of.condition.level())
                .collect();
            let is_dark = levels.iter().any(|level| *level != AxisLevel::L0);
            let enhanced = levels
                .iter()
                .filter(|level| enhancer.is_some() && self.at(frame, **level, enhancer).is_some());
            let number = levels.len() + enhanced.count();
            if is_dark && best.as_ref().is_none_or(|(most, ..)| number > *most) {
                best = Some((number, frame, chosen(&levels)));
            }
        }
        best.map(|(_, frame, levels)| (frame, levels))
    }

    /// The small copy of a frame at a level; of L0 without an enhancer the untouched frame.
    fn at(
        &self,
        frame: &FrameId,
        level: AxisLevel,
        enhancer: Option<&EnhancerName>,
    ) -> Option<&'a Thumbnail> {
        self.thumbnails.iter().find(|of| {
            let condition = &of.condition;
            of.frame == *frame
                && condition.level() == level
                && condition.enhancer.as_ref() == enhancer
                && (level == AxisLevel::L0 || condition.variant() == *self.variant)
        })
    }
}

/// Up to four of these levels.
fn chosen(levels: &BTreeSet<AxisLevel>) -> Vec<AxisLevel> {
    let all: Vec<AxisLevel> = levels.iter().copied().collect();
    let named: Vec<AxisLevel> = all
        .iter()
        .copied()
        .filter(|level| LEVELS.contains(&&*level.to_string()))
        .collect();
    if named.len() == LEVELS.len() || all.len() <= LEVELS.len() {
        return if named.len() == LEVELS.len() {
            named
        } else {
            all
        };
    }
    let last = LEVELS.len() - 1;
    (0..LEVELS.len())
        .map(|place| all[place * (all.len() - 1) / last])
        .collect()
}

fn drawn(
    rows: &[(String, Vec<Option<&Thumbnail>>)],
    levels: &[AxisLevel],
    (look, pixels): (&Look, Pixels),
    title: &str,
) -> Result<Sheet> {
    let (letters, small) = (look.letters, look.small());
    let left = 1.3 * small;
    let width = (look.width - left + GAP) / levels.len() as f64 - GAP;
    let mut sheet = Sheet::default();
    let title = Font::bundled().shortened(title, letters, look.width - left);
    sheet.words(&title, [left, letters], letters, Anchor::Start);
    let mut top = 1.5 * letters + 1.25 * small;
    for (column, level) in levels.iter().enumerate() {
        let x = left + column as f64 * (width + GAP);
        let gain = rows[0].1[column].map_or(0.0, |of| of.stops);
        let y = top - 0.3 * small;
        if gain > 0.0 {
            let gain = format!("+{} EV", (f64::from(gain) * 100.0).round() / 100.0);
            sheet.words(
                &level.to_string(),
                [x + width / 4.0, y],
                small,
                Anchor::Middle,
            );
            sheet.words(&gain, [x + width * 0.75, y], small, Anchor::Middle);
        } else {
            sheet.words(
                &level.to_string(),
                [x + width / 2.0, y],
                small,
                Anchor::Middle,
            );
        }
    }
    for (name, tiles) in rows {
        let mut height = 0.0_f64;
        for (column, tile) in tiles.iter().enumerate() {
            let Some(tile) = tile else { continue };
            let corner = [left + column as f64 * (width + GAP), top];
            height = height.max(draw_tile(&mut sheet, tile, pixels, (corner, width))?);
        }
        let name = Font::bundled().shortened(name, small, height);
        let place = [0.9 * small, top + height / 2.0];
        sheet.turned_words(&name, place, small, Anchor::Middle, Turn::Up);
        top += height + GAP;
    }
    sheet.size = [look.width, top];
    Ok(sheet)
}

/// Draws a tile `width` points wide; returns its height. A tile with a gain is split.
fn draw_tile(
    sheet: &mut Sheet,
    tile: &Thumbnail,
    pixels: Pixels,
    ([x, y], width): (Place, f64),
) -> Result<f64> {
    let whole = read(tile, &tile.small, pixels)?;
    let height = width * whole.height() as f64 / whole.width() as f64;
    if tile.stops <= 0.0 {
        picture(sheet, whole, [x, y], [width, height]);
        return Ok(height);
    }
    let left = part(&whole, [0, 0], [whole.width().div_ceil(2), whole.height()])?;
    let crop = read(tile, &tile.crop, pixels)?;
    // The middle of the crop, in the shape of half a tile.
    let shape = width / 2.0 / height;
    let high = crop.height().min((crop.width() as f64 / shape) as usize);
    let wide = ((high as f64 * shape).round() as usize).clamp(1, crop.width());
    let high = high.max(1);
    let corner = [(crop.width() - wide) / 2, (crop.height() - high) / 2];
    let right = part(&crop, corner, [wide, high])?;
    picture(sheet, left, [x, y], [width / 2.0, height]);
    picture(sheet, right, [x + width / 2.0, y], [width / 2.0, height]);
    let middle = x + width / 2.0;
    sheet.line(
        &[[middle, y], [middle, y + height]],
        &Stroke::solid(PAPER, 0.6),
    );
    Ok(height)
}

fn picture(sheet: &mut Sheet, image: Rgb, corner: Place, size: [f64; 2]) {
    sheet.marks.push(Mark::Picture {
        corner,
        size,
        image: Arc::new(image),
    });
}

/// Part of an image, from a corner (across, down), with a size (width, height) in pixels.
fn part(image: &Rgb, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Result<Rgb> {
    let rows = (top..top + height).flat_map(|row| {
        let first = (row * image.width() + left) * 3;
        &image.samples()[first..first + width * 3]
    });
    Rgb::new(height, width, rows.copied().collect())
}

/// The pixels of a small copy.
fn read(tile: &Thumbnail, url: &str, pixels: Pixels) -> Result<Rgb> {
    pixels(url).map_err(|problem| {
        let place = format!("small copy of {} at {}", tile.frame, tile.condition);
        Error::data(place, problem)
    })
}
