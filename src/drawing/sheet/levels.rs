//! The paper's figure of examples, each variant by level: [`levels()`].

use std::collections::BTreeSet;

use super::{CELL, GAP, LINE, SheetCanvas, fitted, letter_width, lines, mean};
use crate::types::degradations::Axis;
use crate::types::{AxisLevel, Rgb};

/// The images of a frame at the levels of one axis.
#[derive(Debug, Clone)]
pub(crate) struct LevelBlock {
    /// The levels without L0, from left to right.
    pub levels: Vec<AxisLevel>,
    pub rows: Vec<LevelRow>,
}

/// The images of one kind of degradation, in one noise profile.
#[derive(Debug, Clone)]
pub(crate) struct LevelRow {
    pub name: String,
    /// One image for each level of the block.
    pub images: Vec<LevelImage>,
}

/// An image at a level.
#[derive(Debug, Clone)]
pub(crate) struct LevelImage {
    pub image: Rgb,
    /// How much darker than the frame it is shown, in EV.
    pub dark_ev: f64,
}

/// Letters of the longest names of the paper's rows.
const NAME: usize = 6;

/// A sheet with the frame and its levels, block below block and kind below kind, as the paper's figure of examples (DarkQA, Fig. 3);
/// `foot` stands below them.
///
/// Images are scaled down by means of pixels. As in the paper's insets, the lower right corner of L3, L4 and L5 shows the
/// middle of the image (half of each side, a quarter of the area) with 10, 20 and 50 times its light. Pixels of insets are
/// picked, not averaged, so that the noise keeps its strength. The paper says "pixel intensities amplified". Multiplied codes
/// would make a bright room white, so we take this to mean the light, and state it below the images.
#[must_use]
pub(crate) fn levels(clean: &Rgb, blocks: &[LevelBlock], foot: &str) -> Rgb {
    let size = fitted(clean.height(), clean.width());
    let [height, width] = size;
    let rows = blocks.iter().flat_map(|block| &block.rows);
    let letters = rows.map(|row| row.name.chars().count()).max();
    // A gap before a long name and behind it.
    let longest = letters.unwrap_or_default() * letter_width() + 2 * GAP;
    let margin = longest.max(NAME * letter_width() + GAP);
    // A label needs its width even if the image is small.
    let cell = width.max(CELL / 2);
    let columns = blocks.iter().map(|block| block.levels.len()).max();
    let row_height = GAP + height.max(LINE);
    let heights = blocks
        .iter()
        .map(|block| GAP + LINE + block.rows.len() * row_height);
    let sheet_width = margin + (columns.unwrap_or_default() + 1) * (cell + GAP);
    let foot = [foot.to_owned(), how_inset(blocks)];
    let foot: Vec<String> = foot
        .iter()
        .flat_map(|text| lines(text, sheet_width.saturating_sub(2 * GAP)))
        .collect();
    let below = heights.sum::<usize>() + GAP;
    let foot_height = match foot.len() {
        0 => 0,
        number => number * LINE + GAP,
    };
    let mut sheet = SheetCanvas::new(below + foot_height, sheet_width);
    let left = |column: usize| margin + column * (cell + GAP);
    let mut top = GAP;
    for block in blocks {
        sheet.write([top, left(0)], cell, "L0", [0; 3]);
        for (index, level) in block.levels.iter().enumerate() {
            sheet.write([top, left(index + 1)], cell, &label(*level), [0; 3]);
        }
        top += LINE + GAP;
        for row in &block.rows {
            let middle = top + height.saturating_sub(LINE) / 2;
            sheet.write([middle, GAP], margin, &row.name, [0; 3]);
            sheet.fill([top, left(0)], size, |y, x| mean(clean, size, y, x));
            for (index, LevelImage { image, dark_ev }) in row.images.iter().enumerate() {
                let place = [top, left(index + 1)];
                sheet.fill(place, size, |y, x| mean(image, size, y, x));
                if let Some(factor) = amplification(*dark_ev) {
                    inset(&mut sheet, place, size, image, factor);
                }
            }
            top += row_height;
        }
    }
    for (line, text) in foot.iter().enumerate() {
        sheet.write([below + line * LINE, GAP], sheet_width, text, [90; 3]);
    }
    sheet.finish()
}

/// The factors of light of the insets of some images, without duplicates.
fn insets(blocks: &[LevelBlock]) -> Vec<u16> {
    let factors: BTreeSet<u16> = blocks
        .iter()
        .flat_map(|block| &block.rows)
        .flat_map(|row| &row.images)
        .filter_map(|image| amplification(image.dark_ev))
        .collect();
    factors.into_iter().collect()
}

/// Describes the insets; empty without one.
fn how_inset(blocks: &[LevelBlock]) -> String {
    let factors = insets(blocks);
    if factors.is_empty() {
        return String::new();
    }
    let factors: Vec<String> = factors.iter().map(|factor| format!("×{factor}")).collect();
    format!(
        "Insets: the middle of the image, linear light {}",
        factors.join(", ")
    )
}

/// A level above its column, as `L3 -6 EV` or `T33.33 ms`.
pub(super) fn label(level: AxisLevel) -> String {
    let axis = level.axis().unwrap_or(Axis::LIGHT);
    if axis == Axis::LIGHT {
        format!("{level} -{} {}", level.value(), axis.unit)
    } else {
        format!("{level} {}", axis.unit)
    }
}

/// Factor by which the light of an inset is amplified; `None` below 5 EV, where the image itself is visible.
fn amplification(dark_ev: f64) -> Option<u16> {
    match dark_ev {
        ..5.0 => None,
        5.0..7.0 => Some(10),
        7.0..8.5 => Some(20),
        _ => Some(50),
    }
}

/// Draws the amplified middle of the image in the lower right corner of a cell, with a white edge and its factor.
fn inset(
    sheet: &mut SheetCanvas,
    [top, left]: [usize; 2],
    size: [usize; 2],
    image: &Rgb,
    factor: u16,
) {
    let [height, width] = size.map(|side| side / 2);
    if height < 4 || width < 4 {
        return;
    }
    let (top, left) = (top + size[0] - height, left + size[1] - width);
    sheet.fill([top - 1, left - 1], [height + 1, width + 1], |_, _| {
        [255; 3]
    });
    let brightened = brightened(factor);
    let source = |at: usize, of: usize, side: usize| side / 4 + at * (side / 2) / of;
    sheet.fill([top, left], [height, width], |row, column| {
        let (y, x) = (
            source(row, height, image.height()),
            source(column, width, image.width()),
        );
        let at = (y * image.width() + x) * 3;
        [0, 1, 2].map(|channel| brightened[usize::from(image.samples()[at + channel])])
    });
    let label = format!("×{factor}");
    let label_width = label.chars().count() * letter_width();
    if height > LINE && width > label_width {
        sheet.fill([top, left], [LINE, label_width + 2], |_, _| [0; 3]);
        sheet.write([top, left + 1], label_width, &label, [255; 3]);
    }
}

/// For each code, the code of `factor` times its light: the code times factor^(1/2.2).
fn brightened(factor: u16) -> [u8; 256] {
    let scale = libm::pow(f64::from(factor), 1.0 / 2.2);
    std::array::from_fn(|code| (code as f64 * scale).round().min(255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Severity;
    use crate::types::degradations::Kind;

    fn grey(height: usize, width: usize, code: u8) -> Rgb {
        Rgb::new(height, width, vec![code; height * width * 3]).unwrap()
    }

    fn sheet(height: usize, width: usize, severities: &[Severity]) -> Rgb {
        let row = |code: u8| LevelRow {
            name: code.to_string(),
            images: severities
                .iter()
                .map(|severity| LevelImage {
                    image: grey(height, width, code),
                    dark_ev: severity.value(),
                })
                .collect(),
        };
        let block = LevelBlock {
            levels: severities
                .iter()
                .map(|severity| AxisLevel::new(Kind::Exposure, *severity))
                .collect(),
            rows: vec![row(3), row(4)],
        };
        levels(&grey(height, width, 100), &[block], "paper: K 0.77")
    }

    #[test]
    fn insets_are_amplified_by_their_level() {
        let sheet = sheet(100, 300, &[Severity::L1, Severity::L5]);
        let has = |code: u8| {
            sheet
                .samples()
                .chunks(3)
                .filter(|pixel| **pixel == [code; 3])
                .count()
        };
        // The clean frame twice; the cells, less the quarter of the amplified inset and its edge.
        assert!(has(100) >= 2 * 100 * 300);
        assert!(has(3) > 100 * 300 && has(3) < 2 * 100 * 300);
        assert!(has(18) > 4000 && has(24) > 4000);
    }

    #[test]
    fn blocks_stand_below_each_other() {
        let block = |kind: Kind, code| LevelBlock {
            levels: vec![AxisLevel::new(kind, kind.ladder()[2])],
            rows: vec![LevelRow {
                name: kind.word().to_owned(),
                images: vec![LevelImage {
                    image: grey(50, 80, code),
                    dark_ev: 0.0,
                }],
            }],
        };
        let both = levels(
            &grey(50, 80, 100),
            &[block(Kind::Auto, 7), block(Kind::Motion, 9)],
            "",
        );
        let one = levels(&grey(50, 80, 100), &[block(Kind::Auto, 7)], "");
        assert_eq!(both.height() - GAP, 2 * (one.height() - GAP));
        let rows = both.samples().chunks(3 * both.width());
        let first = |code: u8| {
            let mut rows = rows.clone();
            let cells = |row: &[u8]| row.chunks(3).filter(|pixel| *pixel == [code; 3]).count();
            rows.position(|row| cells(row) == 80)
        };
        assert!(first(7).unwrap() + 50 < first(9).unwrap());
        assert_eq!(
            label(AxisLevel::new(Kind::Motion, Severity::TIMES[2])),
            "T33.33 ms"
        );
        assert_eq!(label(AxisLevel::new(Kind::Auto, Severity::L3)), "L3 -6 EV");
    }

    #[test]
    fn a_long_name_does_not_touch_the_picture() {
        let block = LevelBlock {
            levels: vec![AxisLevel::new(Kind::Sensor, Severity::L5)],
            rows: vec![LevelRow {
                name: "noise@physical".to_owned(),
                images: vec![LevelImage {
                    image: grey(60, 80, 3),
                    dark_ev: 0.0,
                }],
            }],
        };
        let sheet = levels(&grey(60, 80, 100), &[block], "");
        let rows: Vec<&[u8]> = sheet.samples().chunks(3 * sheet.width()).collect();
        let is_frame = |row: &&[u8]| {
            row.windows(3 * 80)
                .step_by(3)
                .position(|run| run.iter().all(|sample| *sample == 100))
        };
        let frame: Vec<(&[u8], usize)> = rows
            .iter()
            .filter_map(|row| Some((*row, is_frame(row)?)))
            .collect();
        assert_eq!(frame.len(), 60);
        for (row, left) in frame {
            let before = row[3 * (left - GAP)..3 * left].iter();
            assert!(before.into_iter().all(|sample| *sample == 255));
        }
    }

    #[test]
    fn every_size_has_a_sheet() {
        for (height, width) in [(1, 1), (3, 500), (500, 3), (7, 7), (720, 1280)] {
            for levels in [&[][..], &[Severity::L4], &Severity::LADDER] {
                let sheet = sheet(height, width, levels);
                assert!(sheet.width() <= 2400, "{}", sheet.width());
            }
        }
    }
}
