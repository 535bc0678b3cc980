//! The paper's figure of examples, both variants by level: [`levels()`].

use super::{CELL, GAP, LINE, SheetCanvas, fitted, letter_width, lines, mean};
use crate::types::degradation::Axis;
use crate::types::{AxisLevel, Rgb};

/// The images of a frame at one level.
#[derive(Debug, Clone)]
pub(crate) struct LevelColumn {
    pub level: AxisLevel,
    /// An image for each row.
    pub images: Vec<Rgb>,
}

/// A sheet with the frame and its levels, exposure drop above noise, as the paper's figure of examples (DarkQA, Fig. 3); `rows` are
/// the names of the rows, and `foot` stands below them.
///
/// Images are scaled down by means of pixels. As in the paper's insets, the lower right corner of L3, L4 and L5 shows the
/// middle of the image (half of each side, a quarter of the area) with 10, 20 and 50 times its light. Pixels of insets are
/// picked, not averaged, so that the noise keeps its strength. The paper says "pixel intensities amplified". Multiplied codes
/// would make a bright room white, so we take this to mean the light, and say so below the images.
#[must_use]
pub(crate) fn levels(clean: &Rgb, rows: &[String], columns: &[LevelColumn], foot: &str) -> Rgb {
    let size = fitted(clean.height(), clean.width());
    let [height, width] = size;
    let longest = rows.iter().map(|row| row.chars().count()).max();
    let margin = (longest.unwrap_or(0) + 1) * letter_width() + GAP;
    // A label needs its width even if the image is small.
    let cell = width.max(CELL / 2);
    let below = GAP + LINE + GAP + rows.len() * (GAP + height.max(LINE));
    let sheet_width = margin + (columns.len() + 1) * (cell + GAP);
    let levels: Vec<AxisLevel> = columns.iter().map(|column| column.level).collect();
    let foot = [foot.to_owned(), how_inset(&levels)];
    let foot: Vec<String> = foot
        .iter()
        .flat_map(|text| lines(text, sheet_width))
        .collect();
    let mut sheet = SheetCanvas::new(below + foot.len() * LINE + GAP, sheet_width);
    let top = |row: usize| GAP + LINE + GAP + row * (GAP + height.max(LINE));
    for (row, name) in rows.iter().enumerate() {
        let middle = top(row) + height.saturating_sub(LINE) / 2;
        sheet.write([middle, GAP], margin, name, [0; 3]);
    }
    let left = |column: usize| margin + column * (cell + GAP);
    sheet.write([GAP, left(0)], cell, "L0", [0; 3]);
    for row in 0..rows.len() {
        sheet.fill([top(row), left(0)], size, |row, column| {
            mean(clean, size, row, column)
        });
    }
    for (index, column) in columns.iter().enumerate() {
        let left = left(index + 1);
        let unit = column.level.axis().unwrap_or(Axis::LIGHT).unit;
        let label = format!("{} -{} {unit}", column.level, column.level.value());
        sheet.write([GAP, left], cell, &label, [0; 3]);
        for (row, image) in column.images.iter().enumerate() {
            let top = top(row);
            sheet.fill([top, left], size, |row, column| {
                mean(image, size, row, column)
            });
            if let Some(factor) = amplification(column.level) {
                inset(&mut sheet, [top, left], size, image, factor);
            }
        }
    }
    for (line, text) in foot.iter().enumerate() {
        sheet.write([below + line * LINE, GAP], sheet_width, text, [90; 3]);
    }
    sheet.finish()
}

/// The factors of light of the insets at these levels, without duplicates.
#[must_use]
pub(crate) fn insets(levels: &[AxisLevel]) -> Vec<u16> {
    let mut factors: Vec<u16> = levels.iter().copied().filter_map(amplification).collect();
    factors.dedup();
    factors
}

/// What the insets show; empty without one.
fn how_inset(levels: &[AxisLevel]) -> String {
    let factors = insets(levels);
    if factors.is_empty() {
        return String::new();
    }
    let factors: Vec<String> = factors.iter().map(|factor| format!("×{factor}")).collect();
    format!(
        "Insets: the middle of the image, linear light {}",
        factors.join(", ")
    )
}

/// Factor by which the light of an inset is amplified; `None` below 5 EV, where the image itself is visible.
fn amplification(level: AxisLevel) -> Option<u16> {
    match level.value() {
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
    use crate::types::degradation::Kind;

    fn grey(height: usize, width: usize, code: u8) -> Rgb {
        Rgb::new(height, width, vec![code; height * width * 3]).unwrap()
    }

    fn sheet(height: usize, width: usize, levels_of: &[Severity]) -> Rgb {
        let column = |level: &Severity| LevelColumn {
            level: AxisLevel::new(Kind::ALL[0], *level),
            images: vec![grey(height, width, 3), grey(height, width, 4)],
        };
        let columns: Vec<_> = levels_of.iter().map(column).collect();
        let rows = ["EV", "noise"].map(str::to_owned);
        levels(&grey(height, width, 100), &rows, &columns, "paper: K 0.77")
    }

    #[test]
    fn insets_are_amplified_by_their_level() {
        let sheet = sheet(100, 300, &[Severity::L1, Severity::L5]);
        let has = |code: u8| {
            let pixels = sheet.samples().chunks(3);
            pixels.filter(|pixel| **pixel == [code; 3]).count()
        };
        // The clean frame twice; the cells, less the quarter of the amplified inset and its edge.
        assert!(has(100) >= 2 * 100 * 300);
        assert!(has(3) > 100 * 300 && has(3) < 2 * 100 * 300);
        assert!(has(18) > 4000 && has(24) > 4000);
    }

    #[test]
    fn each_reading_has_a_row_and_the_insets_are_explained() {
        let image = || grey(100, 300, 3);
        let columns = [LevelColumn {
            level: AxisLevel::new(Kind::ALL[0], Severity::L5),
            images: vec![image(), image(), image()],
        }];
        let rows = ["EV", "noise", "@physical"].map(str::to_owned);
        let of = |rows: &[String]| levels(&grey(100, 300, 100), rows, &columns, "paper").height();
        assert_eq!(of(&rows) - of(&rows[..2]), 100 + GAP);
        assert_eq!(
            how_inset(&[columns[0].level]),
            "Insets: the middle of the image, linear light ×50"
        );
        assert_eq!(how_inset(&[AxisLevel::L0]), "");
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
