//! Figures: the layout of a chart's panels ([`sheet`]), and figures of reports at the width of a page ([`figure`],
//! [`point_figure`], [`count_figure`]).

use super::axes::{Axes, Margins, Title, plot_size};
use super::legend::Legend;
use super::page::figure_parts;
use super::panel::{Medium, PanelDrawing};
use super::{FigureColours, Look, Sheet, svg};
use crate::charts::chart::{Chart, Figure, Panel};
use darkqa_base::error::{Error, Result};

/// Width in points of a figure with several panels side by side or with names: an A4 page between margins of 15 mm.
const WIDE: f64 = 510.0;

/// Width in points of a figure with one panel in a row (chosen).
const NARROW: f64 = 340.0;

/// Width in points of a panel of points and lines (chosen).
const PANEL: f64 = 300.0;

/// Font size in points.
const FONT_SIZE: f64 = 8.5;

/// Draws a figure of a report. The note of the chart is appended to the caption.
///
/// # Errors
/// None in practice: only an embedded image can fail, and charts have none.
pub fn figure(name: &'static str, caption: &str, chart: &Chart) -> Result<Figure> {
    let is_narrow = chart.columns.min(chart.panels.len()) == 1 && !chart.panels.iter().any(Panel::has_names);
    Ok(Figure {
        name,
        caption: format!("{caption} ({}.)", chart.note),
        svg: to_svg(sheet(chart, &look(if is_narrow { NARROW } else { WIDE })))?,
        parts: figure_parts(chart)?,
    })
}

/// Draws panels of points and lines side by side, each with its legend, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub fn point_figure(panels: Vec<Panel>) -> Result<String> {
    let columns = panels.len().max(1);
    let look = look(PANEL * columns as f64);
    let parts = panels.into_iter().map(|panel| single_panel(panel, &column_look(columns, &look)));
    to_svg(arrange_in_rows(parts, columns, &look))
}

/// Draws panels of counts in two columns, as SVG.
///
/// # Errors
/// None in practice: only an embedded image can fail, and the panels have none.
pub fn count_figure(panels: Vec<Panel>) -> Result<String> {
    to_svg(pack(panels, &look(WIDE)))
}

fn look(width: f64) -> Look {
    Look { width, font_size: FONT_SIZE, palette: FigureColours::Colour }
}

/// SVG of a sheet without images, on a white background.
fn to_svg(sheet: Sheet) -> Result<String> {
    svg(&sheet.on_paper(), &|_| Err(Error::data("figure", "has no pictures")))
}

/// Minimum width of a panel in em.
const MIN_WIDTH: f64 = 14.0;

/// Space between panels in em.
const GAP: f64 = 0.9;

/// Number of panels in a row of a chart, as far as they fit.
pub(super) fn fitting_columns(chart: &Chart, look: &Look) -> usize {
    let fitting = (look.width / (MIN_WIDTH * look.font_size)) as usize;
    chart.columns.min(fitting).min(chart.panels.len()).max(1)
}

/// Draws a chart as a sheet, with the legend below the panels. The first panel of a row has the title of the vertical
/// axes. The note of the chart is not drawn; it belongs to the caption.
pub fn sheet(chart: &Chart, look: &Look) -> Sheet {
    let em = look.font_size;
    let legend = Legend::for_chart(chart, look);
    let columns = fitting_columns(chart, look);
    let margins: Vec<Margins> = chart.panels.iter().map(|panel| Margins::new(panel, look)).collect();
    let widest = |margin: fn(&Margins) -> f64| margins.iter().map(margin).fold(0.0, f64::max);
    let (first, next) = (widest(|margins| margins.with_title), widest(|margins| margins.left));
    let right = widest(|margins| margins.right);
    let width = (look.width - first - (columns - 1) as f64 * (next + GAP * em) - right) / columns as f64;
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for (row, row_margins) in chart.panels.chunks(columns).zip(margins.chunks(columns)) {
        let sizes: Vec<[f64; 2]> = row.iter().map(|panel| plot_size(panel, look, width)).collect();
        let titles: Vec<Title> = row.iter().map(|panel| Title::new(&panel.title, look, width)).collect();
        top += Title::max_height(&titles, look) + 0.65 * em;
        let mut left = first;
        for (index, ((panel, title), size)) in row.iter().zip(&titles).zip(&sizes).enumerate() {
            let axes = Axes::new(panel, [left, top], *size);
            let drawing = PanelDrawing { look, axes: &axes, panel, legend: &legend, medium: Medium::Paper };
            drawing.draw(&mut sheet, index == 0);
            title.draw(&mut sheet, look, [left, top - 0.6 * em]);
            left += width + GAP * em + next;
        }
        let height = sizes.iter().map(|[_, height]| *height).fold(0.0, f64::max);
        let bottom = row_margins.iter().map(|margins| margins.bottom).fold(0.0, f64::max);
        top += height + bottom + 0.3 * em;
    }
    legend.draw(&mut sheet, look, top);
    sheet.size = [look.width, top + legend.height];
    sheet
}

fn single_panel(panel: Panel, look: &Look) -> Sheet {
    sheet(&Chart { panels: vec![panel], columns: 1, note: String::new() }, look)
}

/// Space between the two columns of packed panels, and below each panel, in em.
const PACK_GAP: f64 = 1.5;

/// Draws panels in two columns. Each panel goes into the column that is shorter so far.
fn pack(panels: Vec<Panel>, look: &Look) -> Sheet {
    let gap = PACK_GAP * look.font_size;
    let width = (look.width - gap) / 2.0;
    let mut sheet = Sheet::default();
    let mut heights = [0.0_f64; 2];
    for panel in panels {
        let column = usize::from(heights[1] < heights[0]);
        let part = single_panel(panel, &Look { width, ..*look });
        let corner = [column as f64 * (width + gap), heights[column]];
        heights[column] += part.size[1] + gap;
        sheet.insert(part, corner);
    }
    sheet.size = [look.width, heights[0].max(heights[1])];
    sheet
}

/// Space between two sheets in em.
const SHEET_GAP: f64 = 2.0;

/// Style of a sheet that fills one of several columns.
pub(super) fn column_look(columns: usize, look: &Look) -> Look {
    let between = SHEET_GAP * look.font_size * (columns - 1) as f64;
    let width = (look.width - between) / columns as f64;
    Look { width, ..*look }
}

/// Arranges sheets of the width of a column (see [`column_look`]) in rows.
pub(super) fn arrange_in_rows(parts: impl IntoIterator<Item = Sheet>, columns: usize, look: &Look) -> Sheet {
    let gap = SHEET_GAP * look.font_size;
    let step = (look.width + gap) / columns as f64;
    let mut sheet = Sheet::default();
    let (mut top, mut parts) = (0.0, parts.into_iter());
    loop {
        let row: Vec<Sheet> = parts.by_ref().take(columns).collect();
        if row.is_empty() {
            break;
        }
        top += if top > 0.0 { gap / 2.0 } else { 0.0 };
        let tallest = row.iter().map(|part| part.size[1]).fold(0.0, f64::max);
        for (column, part) in row.into_iter().enumerate() {
            sheet.insert(part, [step * column as f64, top]);
        }
        top += tallest;
    }
    sheet.size = [look.width, top];
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::chart::{LineContent, LineStyle, PlotLine, Scale};
    use crate::charts::paper::font::Font;
    use crate::charts::paper::look::column_look as look;
    use crate::charts::paper::sheet::{Point, Shape};
    use darkqa_score::estimate::Estimate;

    #[test]
    fn bar_lengths_are_proportional_to_counts() {
        let look = Look { width: 510.0, font_size: 8.5, palette: FigureColours::Colour };
        let many = (0..40_u64).map(|number| (format!("class {number:02}"), number + 1));
        let panels = [
            Panel::from_counts("two", [("a".to_owned(), 3), ("b".to_owned(), 1)].into_iter()),
            Panel::from_counts("many", many),
            Panel::from_counts("empty", [("c".to_owned(), 0)].into_iter()),
        ];
        let sheet = pack(panels.into(), &look);
        let lengths: Vec<f64> = sheet
            .ungrouped()
            .into_iter()
            .filter_map(|shape| match shape {
                Shape::Area { corners, .. } => Some(corners[1][0] - corners[0][0]),
                _ => None,
            })
            .collect();
        assert_eq!(lengths.len(), 2 + 24);
        assert!((lengths[0] / lengths[1] - 3.0).abs() < 1e-9, "{lengths:?}");
        for text in ["3 (75.0 %)", "17 others", "none"] {
            let is_written =
                sheet.ungrouped().into_iter().any(|shape| matches!(shape, Shape::Label(label) if label.text == text));
            assert!(is_written, "{text}");
        }
        for shape in sheet.ungrouped() {
            let Shape::Label(label) = shape else { continue };
            let end = label.start[0] + Font::bundled().width(&label.text, label.size);
            assert!(label.start[0] >= 0.0 && end <= look.width, "{label:?}");
        }
    }

    fn panel(lines: Vec<PlotLine>) -> Panel {
        let (x, y) = (Scale::Numbers("ln K"), Scale::Numbers("ln σ"));
        Panel { title: "a panel".to_owned(), x, y, lines, model: None }
    }

    #[test]
    fn points_are_drawn_at_their_axis_positions() {
        let path = LineContent::Path(vec![[6.0, -2.0], [8.0, 1.0], [10.0, 4.0]]);
        let lines = [path, LineContent::points(vec![[8.0, 1.0]])]
            .map(|content| PlotLine::new("a".to_owned(), LineStyle(0), content));
        let sheet = single_panel(panel(lines.into()), &look());
        let drawn: Vec<&Vec<Point>> = sheet
            .ungrouped()
            .into_iter()
            .filter_map(|shape| match shape {
                Shape::Line { points, stroke } if points.len() == 3 && stroke.colour != [34; 3] => Some(points),
                _ => None,
            })
            .collect();
        assert_eq!(drawn.len(), 1);
        let [first, second, third] = [drawn[0][0], drawn[0][1], drawn[0][2]];
        assert!((first[0] - sheet.label_position("6")[0]).abs() < 1e-9);
        assert!((third[0] - sheet.label_position("10")[0]).abs() < 1e-9);
        let baseline = 0.35 * look().tick_font_size();
        assert!((first[1] - (sheet.label_position("−2")[1] - baseline)).abs() < 1e-9);
        assert!((third[1] - (sheet.label_position("4")[1] - baseline)).abs() < 1e-9);
        let has_marker = sheet.ungrouped().into_iter().any(|shape| {
            matches!(shape, Shape::Disc { centre, .. } if (centre[0] - second[0]).abs() < 1e-9
                && (centre[1] - second[1]).abs() < 1e-9)
        });
        assert!(has_marker);
    }

    #[test]
    fn a_panel_without_points_is_drawn() {
        assert!(single_panel(panel(Vec::new()), &look()).size[1] > 100.0);
    }

    fn share(value: f64) -> Estimate {
        Estimate { value, low: value - 0.2, high: value + 0.1, n: 40 }
    }

    #[test]
    fn curves_and_intervals_share_one_scale() {
        let bins = vec![(0.25, share(0.5)), (0.75, share(0.6)), (1.0, share(0.8))];
        let path: Vec<[f64; 2]> = bins.iter().map(|(confidence, accuracy)| [*confidence, accuracy.value]).collect();
        let lines = ["L0", "L5"].into_iter().enumerate().flat_map(|(style, name)| {
            [LineContent::Path(path.clone()), LineContent::Points(bins.clone())]
                .map(|content| PlotLine::new(name.to_owned(), LineStyle(style), content))
        });
        let panel = Panel {
            title: "a model".to_owned(),
            x: Scale::Percent("confidence in %"),
            y: Scale::Percent("accuracy in %"),
            lines: lines.collect(),
            model: None,
        };
        let sheet = single_panel(panel, &look());
        let curves: Vec<&Vec<Point>> = sheet
            .ungrouped()
            .into_iter()
            .filter_map(|shape| match shape {
                Shape::Line { points, .. } if points.len() == 3 => Some(points),
                _ => None,
            })
            .collect();
        // One curve per level. Both axes have the same scale in points per unit.
        assert_eq!(curves.len(), 2);
        let [first, second, last] = [curves[0][0], curves[0][1], curves[0][2]];
        let scale = (second[0] - first[0]) / 0.5;
        assert!(((last[0] - second[0]) / 0.25 - scale).abs() < 1e-9);
        assert!(((first[1] - second[1]) / 0.1 - scale).abs() < 1e-9);
        assert!(((second[1] - last[1]) / 0.2 - scale).abs() < 1e-9);
        let interval = sheet.ungrouped().into_iter().find_map(|shape| match shape {
            Shape::Line { points, .. }
                if points.len() == 2 && points.iter().all(|position| (position[0] - first[0]).abs() < 1e-9) =>
            {
                Some(points.clone())
            }
            _ => None,
        });
        let interval = interval.expect("the first bin has an interval");
        assert!(((interval[0][1] - interval[1][1]) / 0.3 - scale).abs() < 1e-9);
        for name in ["L0", "L5", "a model"] {
            let count = sheet
                .ungrouped()
                .into_iter()
                .filter(|shape| matches!(shape, Shape::Label(label) if label.text == name))
                .count();
            assert_eq!(count, 1, "{name}");
        }
    }
}
