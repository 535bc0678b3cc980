//! Drawing of count panels as horizontal bars with counts and shares: [`counts`].

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, Sheet};
use crate::report::charts::chart::LineStyle;
use crate::report::charts::chart::counts::CountPanel;

/// Height of a row in em.
const ROW: f64 = 1.5;
/// Space between the two columns of panels, and below each panel, in em.
const GAP: f64 = 1.5;
/// Maximum width of the names as a share of the panel's width.
const NAMES: f64 = 0.4;

/// Draws the panels in two columns. Each panel goes into the column that is shorter so far.
pub(crate) fn counts(panels: &[CountPanel], look: &Look) -> Sheet {
    let gap = GAP * look.font_size;
    let width = (look.width - gap) / 2.0;
    let mut sheet = Sheet::default();
    let mut heights = [0.0_f64; 2];
    for panel in panels {
        let column = usize::from(heights[1] < heights[0]);
        let part = draw_panel(panel, &Look { width, ..*look });
        let corner = [column as f64 * (width + gap), heights[column]];
        heights[column] += part.size[1] + gap;
        sheet.insert(part, corner);
    }
    sheet.size = [look.width, heights[0].max(heights[1])];
    sheet
}

fn draw_panel(panel: &CountPanel, look: &Look) -> Sheet {
    let (font, small, row) = (Font::bundled(), look.tick_font_size(), ROW * look.font_size);
    let total: u64 = panel.bars.iter().map(|(_, count)| count).sum();
    let highest = panel.bars.iter().map(|(_, count)| *count).max();
    let names = panel.bars.iter().map(|(name, _)| font.width(name, small)).fold(0.0, f64::max).min(NAMES * look.width);
    let left = names + 0.6 * small;
    let widest_label = count_label(highest.unwrap_or(0), total);
    let labels = font.width(&widest_label, small) + 0.6 * small;
    let longest = look.width - left - labels;
    let mut sheet = Sheet::default();
    sheet.label(&panel.title, [0.0, look.font_size], look.font_size, Anchor::Start);
    let mut top = row;
    for (name, count) in &panel.bars {
        let base = top + row / 2.0 + 0.35 * small;
        let name = font.shortened(name, small, names);
        sheet.label(&name, [names, base], small, Anchor::End);
        let end = left + longest * *count as f64 / highest.unwrap_or(1) as f64;
        let (above, below) = (top + 0.15 * row, top + 0.85 * row);
        let corners = vec![[left, above], [end, above], [end, below], [left, below]];
        sheet.area(corners, look.colour(LineStyle(0)), 0.55);
        sheet.label(&count_label(*count, total), [end + 0.4 * small, base], small, Anchor::Start);
        top += row;
    }
    if panel.bars.is_empty() {
        sheet.label("none", [0.0, top + row / 2.0], small, Anchor::Start);
        top += row;
    }
    sheet.size = [look.width, top];
    sheet
}

/// Count with its share of the total, as in `3 (75.0 %)`.
fn count_label(count: u64, total: u64) -> String {
    let share = 100.0 * count as f64 / total.max(1) as f64;
    format!("{count} ({share:.1} %)")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::paper::Palette;
    use crate::report::charts::paper::sheet::Shape;

    #[test]
    fn bar_lengths_are_proportional_to_counts() {
        let look = Look { width: 510.0, font_size: 8.5, palette: Palette::Colour };
        let many = (0..40_u64).map(|number| (format!("class {number:02}"), number + 1));
        let panels = [
            CountPanel::from_counts("two", [("a".to_owned(), 3), ("b".to_owned(), 1)].into_iter()),
            CountPanel::from_counts("many", many),
            CountPanel::from_counts("empty", [("c".to_owned(), 0)].into_iter()),
        ];
        let sheet = counts(&panels, &look);
        let lengths: Vec<f64> = sheet
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Area { corners, .. } => Some(corners[1][0] - corners[0][0]),
                _ => None,
            })
            .collect();
        assert_eq!(lengths.len(), 2 + 24);
        assert!((lengths[0] / lengths[1] - 3.0).abs() < 1e-9, "{lengths:?}");
        for text in ["3 (75.0 %)", "17 others", "none"] {
            let is_written =
                sheet.shapes.iter().any(|shape| matches!(shape, Shape::Label(label) if label.text == text));
            assert!(is_written, "{text}");
        }
        for shape in &sheet.shapes {
            let Shape::Label(label) = shape else { continue };
            let end = label.start[0] + Font::bundled().width(&label.text, label.size);
            assert!(label.start[0] >= 0.0 && end <= look.width, "{label:?}");
        }
    }
}
