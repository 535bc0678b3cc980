//! Panels of bars with counts and shares: [`counts`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Sheet};
use crate::drawing::chart::LineStyle;
use crate::drawing::chart::counts::CountPanel;

/// Height of a row, in heights of letters.
const ROW: f64 = 1.5;
/// Room between the two columns of panels, and below each panel, in heights of letters.
const GAP: f64 = 1.5;
/// Most of the width of a panel that the names take.
const NAMES: f64 = 0.4;

/// The panels as a sheet of two columns, each panel in the shorter one.
pub(crate) fn counts(panels: &[CountPanel], look: &Look) -> Sheet {
    let gap = GAP * look.letters;
    let width = (look.width - gap) / 2.0;
    let mut sheet = Sheet::default();
    let mut heights = [0.0_f64; 2];
    for panel in panels {
        let column = usize::from(heights[1] < heights[0]);
        let part = bars(panel, &Look { width, ..*look });
        let place = [column as f64 * (width + gap), heights[column]];
        heights[column] += part.size[1] + gap;
        sheet.place(part, place);
    }
    sheet.size = [look.width, heights[0].max(heights[1])];
    sheet
}

fn bars(panel: &CountPanel, look: &Look) -> Sheet {
    let (font, small, row) = (Font::bundled(), look.small(), ROW * look.letters);
    let total: u64 = panel.bars.iter().map(|(_, count)| count).sum();
    let highest = panel.bars.iter().map(|(_, count)| *count).max();
    let label = |count: u64| {
        let share = 100.0 * count as f64 / total.max(1) as f64;
        format!("{count} ({share:.1} %)")
    };
    let names = panel
        .bars
        .iter()
        .map(|(name, _)| font.width(name, small))
        .fold(0.0, f64::max)
        .min(NAMES * look.width);
    let left = names + 0.6 * small;
    let labels = font.width(&label(highest.unwrap_or(0)), small) + 0.6 * small;
    let longest = look.width - left - labels;
    let mut sheet = Sheet::default();
    sheet.words(
        &panel.title,
        [0.0, look.letters],
        look.letters,
        Anchor::Start,
    );
    let mut top = row;
    for (name, count) in &panel.bars {
        let base = top + row / 2.0 + 0.35 * small;
        let name = font.shortened(name, small, names);
        sheet.words(&name, [names, base], small, Anchor::End);
        let end = left + longest * *count as f64 / highest.unwrap_or(1) as f64;
        let (above, below) = (top + 0.15 * row, top + 0.85 * row);
        let corners = vec![[left, above], [end, above], [end, below], [left, below]];
        sheet.area(corners, look.colour(LineStyle(0)), 0.55);
        sheet.words(
            &label(*count),
            [end + 0.4 * small, base],
            small,
            Anchor::Start,
        );
        top += row;
    }
    if panel.bars.is_empty() {
        sheet.words("none", [0.0, top + row / 2.0], small, Anchor::Start);
        top += row;
    }
    sheet.size = [look.width, top];
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::paper::Palette;
    use crate::drawing::paper::sheet::Mark;

    #[test]
    fn bars_are_as_long_as_their_counts_and_few() {
        let look = Look {
            width: 510.0,
            letters: 8.5,
            palette: Palette::Colour,
        };
        let many = (0..40_u64).map(|number| (format!("class {number:02}"), number + 1));
        let panels = [
            CountPanel::ranked(
                "two",
                [("a".to_owned(), 3), ("b".to_owned(), 1)].into_iter(),
            ),
            CountPanel::ranked("many", many),
            CountPanel::ranked("empty", [("c".to_owned(), 0)].into_iter()),
        ];
        let sheet = counts(&panels, &look);
        let lengths: Vec<f64> = sheet
            .marks
            .iter()
            .filter_map(|mark| match mark {
                Mark::Area { corners, .. } => Some(corners[1][0] - corners[0][0]),
                _ => None,
            })
            .collect();
        assert_eq!(lengths.len(), 2 + 24);
        assert!((lengths[0] / lengths[1] - 3.0).abs() < 1e-9, "{lengths:?}");
        let is_written = |text: &str| {
            let is_it = |mark: &Mark| matches!(mark, Mark::Words(words) if words.text == text);
            sheet.marks.iter().any(is_it)
        };
        for text in ["3 (75.0 %)", "17 others", "none"] {
            assert!(is_written(text), "{text}");
        }
        for mark in &sheet.marks {
            let Mark::Words(words) = mark else { continue };
            let end = words.start[0] + Font::bundled().width(&words.text, words.size);
            assert!(words.start[0] >= 0.0 && end <= look.width, "{words:?}");
        }
    }
}
