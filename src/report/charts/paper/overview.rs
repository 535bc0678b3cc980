//! Drawing of the overview figure, which summarizes a run on one sheet: [`overview_sheet`].
//!
//! Panel of sample images as the models were sent them, from the thumbnails of a run: [`samples`].

use std::collections::BTreeSet;
use std::sync::Arc;

use super::figure::{arrange_in_rows, column_look, sheet};
use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, PAPER, Point, Shape, Sheet, Stroke, TextDirection};
use crate::charts::chart::Chart;
use crate::charts::figures::OverviewPanels;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{AxisLevel, Condition, EnhancerName, FrameId, Rgb, Thumbnail, Variant};

/// Number of panels in a row.
const COLUMNS: usize = 2;

/// The drawn overview, its caption, and the panels that are missing.
#[derive(Debug)]
pub struct OverviewSheet {
    pub sheet: Sheet,
    /// Letter and caption of each panel.
    pub caption: String,
    /// Name of each missing panel, and the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// The charts of the sheet, for output in other formats.
    pub charts: Vec<Chart>,
}

/// Draws up to four panels on one sheet, two in a row: the charts, then sample images. The panels that have data are
/// lettered in order.
///
/// # Errors
/// If a thumbnail that a run stored cannot be decoded.
pub fn overview_sheet(
    panels: &OverviewPanels,
    thumbnails: &[Thumbnail],
    look: &Look,
    pixels: DecodePixels,
) -> Result<OverviewSheet> {
    let half = column_look(COLUMNS, look);
    let mut parts: Vec<(Sheet, String)> = Vec::new();
    let (mut left_out, mut charts) = (Vec::new(), Vec::new());
    for (name, chart) in &panels.charts {
        match chart {
            Err(why) => left_out.push((*name, (*why).to_owned())),
            Ok((caption, chart)) => {
                let mut chart = chart.clone();
                for panel in &mut chart.panels {
                    panel.title = format!("({}) {}", letter(parts.len()), panel.title);
                }
                parts.push((sheet(&chart, &half), caption.clone()));
                charts.push(chart);
            }
        }
    }
    match samples(panels, thumbnails, &half, letter(parts.len()), pixels)? {
        Ok(part) => parts.push(part),
        Err(why) => left_out.push(("samples", why.to_owned())),
    }
    let captions: Vec<String> =
        parts.iter().enumerate().map(|(index, (_, caption))| format!("({}) {caption}", letter(index))).collect();
    Ok(OverviewSheet {
        caption: format!("{} ({}.)", captions.join(" "), panels.note),
        sheet: arrange_in_rows(parts.into_iter().map(|(sheet, _)| sheet), COLUMNS, look),
        left_out,
        charts,
    })
}

fn letter(index: usize) -> char {
    ('a'..='z').nth(index).unwrap_or('z')
}

/// Levels that are drawn if all of them were asked.
const LEVELS: [&str; 4] = ["L0", "L1", "L3", "L5"];

/// Space between tiles in points.
const GAP: f64 = 2.0;

/// Decoder of an image in a `data:` URL.
pub(super) type DecodePixels<'a> = &'a dyn Fn(&str) -> Result<Rgb>;

/// Sheet of one frame with its caption, or the reason why there is none.
type Samples = std::result::Result<(Sheet, String), &'static str>;

/// Draws the levels of one frame in columns, raw above enhanced. The right half of a dark tile is the middle of the
/// image, brightened by the exposure drop of its level; the gain is written above it.
///
/// # Errors
/// If a thumbnail cannot be decoded.
pub(super) fn samples(
    panels: &OverviewPanels,
    thumbnails: &[Thumbnail],
    look: &Look,
    letter: char,
    pixels: DecodePixels,
) -> Result<Samples> {
    let Some(variant) = &panels.variant else {
        return Ok(Err("no dark image was asked"));
    };
    let enhancer = panels.enhancer.as_ref();
    let stored = VariantThumbnails { thumbnails, variant };
    let Some((frame, levels)) = stored.best_frame(enhancer.map(|(name, _)| name)) else {
        return Ok(Err("the runs stored no small copies of dark images"));
    };
    let mut rows = vec![TileRow { name: "raw".to_owned(), tiles: stored.row(frame, &levels, None) }];
    if let Some((name, display_name)) = enhancer {
        let tiles = stored.row(frame, &levels, Some(name));
        if tiles.iter().any(Option::is_some) {
            rows.push(TileRow { name: display_name.clone(), tiles });
        }
    }
    let title = format!("({letter}) samples, {}{}", variant.title(), variant.group_suffix());
    let sheet = draw_rows(&rows, &levels, look, pixels, &title)?;
    let processing = match rows.get(1) {
        Some(enhanced) => format!("raw and with {}", enhanced.name),
        None => "raw".to_owned(),
    };
    let caption = format!(
        "The frame {frame} as models were sent it, {processing}. The right half of a dark tile is the middle of the image, amplified in \
         linear light (gamma 2.2) by the EV above it."
    );
    Ok(Ok((sheet, caption)))
}

/// One row of tiles: raw, or with an enhancer.
struct TileRow<'a> {
    name: String,
    /// A thumbnail for each level; `None` if the run stored none.
    tiles: Vec<Option<&'a Thumbnail>>,
}

/// Thumbnails of the runs, with the variant whose images are used.
struct VariantThumbnails<'a> {
    thumbnails: &'a [Thumbnail],
    variant: &'a Variant,
}

impl<'a> VariantThumbnails<'a> {
    /// The frame with the most thumbnails, and the levels to draw: [`LEVELS`], or up to four from the first to the
    /// last. The first such frame is used; `None` without a dark image.
    fn best_frame(&self, enhancer: Option<&EnhancerName>) -> Option<(&'a FrameId, Vec<AxisLevel>)> {
        let frames: BTreeSet<&FrameId> = self.thumbnails.iter().map(|thumbnail| &thumbnail.frame).collect();
        let mut best: Option<(usize, &FrameId, Vec<AxisLevel>)> = None;
        for frame in frames {
            let levels: BTreeSet<AxisLevel> = self
                .thumbnails
                .iter()
                .filter(|thumbnail| thumbnail.frame == *frame)
                .map(|thumbnail| &thumbnail.condition)
                .filter(|condition| {
                    condition.enhancer.is_none()
                        && (condition.variant() == *self.variant || condition.level() == AxisLevel::L0)
                })
                .map(Condition::level)
                .collect();
            let is_dark = levels.iter().any(|level| *level != AxisLevel::L0);
            let enhanced =
                levels.iter().filter(|level| enhancer.is_some() && self.at(frame, **level, enhancer).is_some());
            let number = levels.len() + enhanced.count();
            if is_dark && best.as_ref().is_none_or(|(most, ..)| number > *most) {
                best = Some((number, frame, select_levels(&levels)));
            }
        }
        best.map(|(_, frame, levels)| (frame, levels))
    }

    /// Thumbnails of a frame, one for each level.
    fn row(
        &self,
        frame: &FrameId,
        levels: &[AxisLevel],
        enhancer: Option<&EnhancerName>,
    ) -> Vec<Option<&'a Thumbnail>> {
        levels.iter().map(|level| self.at(frame, *level, enhancer)).collect()
    }

    /// Thumbnail of a frame at a level; at L0 without an enhancer, the clean frame.
    fn at(&self, frame: &FrameId, level: AxisLevel, enhancer: Option<&EnhancerName>) -> Option<&'a Thumbnail> {
        self.thumbnails.iter().find(|thumbnail| {
            let condition = &thumbnail.condition;
            thumbnail.frame == *frame
                && condition.level() == level
                && condition.enhancer.as_ref() == enhancer
                && (level == AxisLevel::L0 || condition.variant() == *self.variant)
        })
    }
}

/// Selects [`LEVELS`] if all of them occur, else up to four levels evenly from the first to the last.
fn select_levels(levels: &BTreeSet<AxisLevel>) -> Vec<AxisLevel> {
    let all: Vec<AxisLevel> = levels.iter().copied().collect();
    let named: Vec<AxisLevel> = all.iter().copied().filter(|level| LEVELS.contains(&&*level.to_string())).collect();
    if named.len() == LEVELS.len() {
        return named;
    }
    if all.len() <= LEVELS.len() {
        return all;
    }
    let last = LEVELS.len() - 1;
    (0..LEVELS.len()).map(|index| all[index * (all.len() - 1) / last]).collect()
}

fn draw_rows(
    rows: &[TileRow<'_>],
    levels: &[AxisLevel],
    look: &Look,
    pixels: DecodePixels,
    title: &str,
) -> Result<Sheet> {
    let (font_size, small) = (look.font_size, look.tick_font_size());
    let left = 1.3 * small;
    let width = (look.width - left + GAP) / levels.len() as f64 - GAP;
    let mut sheet = Sheet::default();
    let title = Font::bundled().shortened(title, font_size, look.width - left);
    sheet.label(&title, [left, font_size], font_size, Anchor::Start);
    let mut top = 1.5 * font_size + 1.25 * small;
    for (column, level) in levels.iter().enumerate() {
        let x = left + column as f64 * (width + GAP);
        let gain = rows[0].tiles[column].map_or(0.0, |thumbnail| thumbnail.stops);
        let y = top - 0.3 * small;
        if gain > 0.0 {
            let gain = format!("+{} EV", (f64::from(gain) * 100.0).round() / 100.0);
            sheet.label(&level.to_string(), [x + width / 4.0, y], small, Anchor::Middle);
            sheet.label(&gain, [x + width * 0.75, y], small, Anchor::Middle);
        } else {
            sheet.label(&level.to_string(), [x + width / 2.0, y], small, Anchor::Middle);
        }
    }
    for row in rows {
        let mut height = 0.0_f64;
        for (column, tile) in row.tiles.iter().enumerate() {
            let Some(tile) = tile else { continue };
            let corner = [left + column as f64 * (width + GAP), top];
            height = height.max(draw_tile(&mut sheet, tile, pixels, corner, width)?);
        }
        let name = Font::bundled().shortened(&row.name, small, height);
        let position = [0.9 * small, top + height / 2.0];
        sheet.rotated_label(&name, position, small, Anchor::Middle, TextDirection::Up);
        top += height + GAP;
    }
    sheet.size = [look.width, top];
    Ok(sheet)
}

/// Draws a tile `width` points wide and returns its height. A tile with a gain is split: the left half of the image,
/// and its brightened middle.
fn draw_tile(sheet: &mut Sheet, tile: &Thumbnail, pixels: DecodePixels, [x, y]: Point, width: f64) -> Result<f64> {
    let whole = decode(tile, &tile.small, pixels)?;
    let height = width * whole.height() as f64 / whole.width() as f64;
    if tile.stops <= 0.0 {
        push_picture(sheet, whole, [x, y], [width, height]);
        return Ok(height);
    }
    let left = crop_image(&whole, [0, 0], [whole.width().div_ceil(2), whole.height()])?;
    let middle = decode(tile, &tile.crop, pixels)?;
    // Crop to the aspect ratio of half a tile.
    let ratio = width / 2.0 / height;
    let crop_height = middle.height().min((middle.width() as f64 / ratio) as usize);
    let crop_width = ((crop_height as f64 * ratio).round() as usize).clamp(1, middle.width());
    let crop_height = crop_height.max(1);
    let corner = [(middle.width() - crop_width) / 2, (middle.height() - crop_height) / 2];
    let right = crop_image(&middle, corner, [crop_width, crop_height])?;
    push_picture(sheet, left, [x, y], [width / 2.0, height]);
    push_picture(sheet, right, [x + width / 2.0, y], [width / 2.0, height]);
    let middle = x + width / 2.0;
    sheet.line(&[[middle, y], [middle, y + height]], &Stroke::solid(PAPER, 0.6));
    Ok(height)
}

fn push_picture(sheet: &mut Sheet, image: Rgb, corner: Point, size: [f64; 2]) {
    sheet.shapes.push(Shape::Picture { corner, size, image: Arc::new(image) });
}

/// Cuts a rectangle out of an image: upper left corner and size (width, height) in pixels.
fn crop_image(image: &Rgb, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Result<Rgb> {
    let samples = (top..top + height)
        .flat_map(|row| {
            let first = (row * image.width() + left) * 3;
            &image.samples()[first..first + width * 3]
        })
        .copied()
        .collect();
    Rgb::new(height, width, samples)
}

/// Decodes an image of a thumbnail.
fn decode(tile: &Thumbnail, url: &str, pixels: DecodePixels) -> Result<Rgb> {
    pixels(url).map_err(|problem| {
        let position = format!("small copy of {} at {}", tile.frame, tile.condition);
        Error::data(position, problem)
    })
}
