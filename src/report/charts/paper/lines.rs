//! Drawing of line charts over the levels: [`lines`].

use super::legend::Legend;
use super::look::Look;
use super::sheet::{PAPER, Point, Shape, Sheet, Stroke};
use super::title::{Axes, Title};
use crate::report::charts::chart::{Chart, DarkMark, LineContent, LineStyle, Panel};
use crate::types::AxisLevel;
use darkqa_score::estimate::Estimate;

/// Minimum width of a panel in em.
const MIN_WIDTH: f64 = 14.0;

/// Height of the plot area as a share of its width.
const RATIO: f64 = 0.62;

/// Minimum and maximum height of the plot area in em.
const HEIGHTS: [f64; 2] = [9.0, 17.0];

/// Space between panels in em.
const GAP: f64 = 0.9;

/// Intervals are drawn as bands in panels of up to this many curves, and as bars in others.
const MAX_BANDS: usize = 3;

/// Opacity of a band.
const BAND: f64 = 0.16;

/// Draws a line chart, with the legend below the panels. The note of the chart is not drawn; it belongs to the caption.
pub(crate) fn lines(chart: &Chart, look: &Look) -> Sheet {
    let legend = Legend::for_chart(chart, look);
    let fitting = (look.width / (MIN_WIDTH * look.font_size)) as usize;
    let columns = chart.columns.min(fitting).min(chart.panels.len()).max(1);
    let (first, next) = margins(look);
    let margins = first + (columns - 1) as f64 * (next + GAP * look.font_size) + 0.6 * look.font_size;
    let width = (look.width - margins) / columns as f64;
    let [min_height, max_height] = HEIGHTS.map(|em| em * look.font_size);
    let height = (RATIO * width).clamp(min_height, max_height);
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for row in chart.panels.chunks(columns) {
        let titles: Vec<Title> = row.iter().map(|panel| Title::new(&panel.title, look, width)).collect();
        top += Title::max_height(&titles, look) + 0.65 * look.font_size;
        let mut left = first;
        for (index, (panel, title)) in row.iter().zip(&titles).enumerate() {
            let axes = Axes::new(panel, [left, top], [width, height]);
            let measure = if index == 0 { chart.measure } else { "" };
            draw_panel(&mut sheet, look, &axes, panel, measure, &legend);
            title.draw(&mut sheet, look, [left, top - 0.6 * look.font_size]);
            left += width + GAP * look.font_size + next;
        }
        top += height + Axes::foot_height(look) + 0.3 * look.font_size;
    }
    legend.draw(&mut sheet, look, top);
    sheet.size = [look.width, top + legend.height];
    sheet
}

/// Space left of the axes in points: of the first panel in a row, and of each other panel.
fn margins(look: &Look) -> (f64, f64) {
    let numbers = Axes::numbers_width(look);
    (numbers + 1.35 * look.font_size, numbers)
}

fn draw_panel(sheet: &mut Sheet, look: &Look, axes: &Axes, panel: &Panel, measure: &str, legend: &Legend<'_>) {
    axes.draw(sheet, look, measure);
    let curves = panel.lines.iter().filter(|line| matches!(line.content, LineContent::Curve(_))).count();
    let intervals = if curves > MAX_BANDS { Intervals::Bars } else { Intervals::Bands };
    for line in &panel.lines {
        match &line.content {
            LineContent::Curve(points) => {
                draw_intervals(sheet, look, axes, line.style, points, intervals);
            }
            LineContent::Flat(share) => {
                let y = axes.y(*share);
                let ends = [[axes.left, y], [axes.left + axes.width, y]];
                sheet.line(&ends, &legend.flat_stroke(line.into(), look));
            }
            LineContent::Marks(_) => {}
        }
    }
    for line in &panel.lines {
        match &line.content {
            LineContent::Curve(points) => draw_curve(sheet, axes, look, line.style, points),
            LineContent::Marks(marks) => {
                for mark in marks {
                    draw_photograph(sheet, look, axes, line.style, mark);
                }
            }
            LineContent::Flat(_) => {}
        }
    }
}

/// Style of the intervals of curves.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Intervals {
    Bands,
    Bars,
}

fn draw_intervals(
    sheet: &mut Sheet,
    look: &Look,
    axes: &Axes,
    style: LineStyle,
    points: &[(AxisLevel, Estimate)],
    intervals: Intervals,
) {
    let colour = look.colour(style);
    match intervals {
        Intervals::Bands => {
            let upper = points.iter().map(|(level, share)| [axes.x(level.value()), axes.y(share.high)]);
            let lower = points.iter().rev().map(|(level, share)| [axes.x(level.value()), axes.y(share.low)]);
            sheet.area(upper.chain(lower).collect(), colour, BAND);
        }
        Intervals::Bars => {
            for (level, share) in points {
                let x = axes.x(level.value());
                let ends = [[x, axes.y(share.low)], [x, axes.y(share.high)]];
                sheet.line(&ends, &look.thin_stroke(colour));
            }
        }
    }
}

fn draw_curve(sheet: &mut Sheet, axes: &Axes, look: &Look, style: LineStyle, points: &[(AxisLevel, Estimate)]) {
    let pen = look.pen(style);
    let positions: Vec<Point> =
        points.iter().map(|(level, share)| [axes.x(level.value()), axes.y(share.value)]).collect();
    sheet.line(&positions, &pen.stroke);
    for position in positions {
        look.draw_marker(sheet, &pen, position);
    }
}

/// Draws the mark of photographs in the dark: a hollow marker at the median exposure drop, a horizontal bar from
/// quartile to quartile, and a vertical bar for the interval of the share.
fn draw_photograph(sheet: &mut Sheet, look: &Look, axes: &Axes, style: LineStyle, mark: &DarkMark) {
    let [low, middle, high] = mark.ev.map(|ev| axes.x(ev.max(0.0)));
    let y = axes.y(mark.share.value);
    let thin = look.thin_stroke(look.colour(style));
    sheet.line(&[[low, y], [high, y]], &thin);
    let ends = [mark.share.low, mark.share.high].map(|share| [middle, axes.y(share)]);
    sheet.line(&ends, &thin);
    look.draw_hollow_marker(sheet, style, [middle, y]);
}

impl Look {
    /// Draws a hollow marker.
    pub(super) fn draw_hollow_marker(&self, sheet: &mut Sheet, style: LineStyle, centre: Point) {
        sheet.shapes.push(Shape::Disc {
            centre,
            radius: 2.2 * self.line_scale(),
            fill: Some(PAPER),
            edge: Some(Stroke::solid(self.colour(style), 0.9 * self.line_scale())),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::charts::chart::PlotLine;
    use crate::report::charts::paper::font::Font;
    use crate::report::charts::paper::look::column_look as look;
    use crate::types::Severity;
    use crate::types::degradations::Kind;

    fn share(value: f64) -> Estimate {
        Estimate { value, low: value - 0.05, high: value + 0.03, n: 40 }
    }

    /// Chart of one panel with `curves` curves over L0, L1 and L5, and chance.
    fn chart(curves: usize) -> Chart {
        let levels =
            [AxisLevel::L0, AxisLevel::new(Kind::Sensor, Severity::L1), AxisLevel::new(Kind::Sensor, Severity::L5)];
        let mut lines: Vec<PlotLine> = (0..curves)
            .map(|line| PlotLine {
                name: format!("model {line}"),
                style: LineStyle(line),
                model: None,
                content: LineContent::Curve(
                    levels
                        .iter()
                        .enumerate()
                        .map(|(at, level)| (*level, share(0.9 - 0.07 * (line + 2 * at) as f64)))
                        .collect(),
                ),
                items: None,
            })
            .collect();
        lines.push(PlotLine {
            name: "chance".to_owned(),
            style: LineStyle::REFERENCE,
            content: LineContent::Flat(0.25),
            model: None,
            items: None,
        });
        Chart {
            measure: "accuracy in %",
            panels: vec![Panel { title: "a panel".to_owned(), lines, model: None, lux: None }],
            columns: 1,
            note: "a note".to_owned(),
        }
    }

    /// Exposure drops and shares of points on the sheet, read from the tick labels of the only panel.
    fn numbers(sheet: &Sheet, positions: &[Point]) -> Vec<[f64; 2]> {
        let [_, top] = sheet.label_position("100");
        let [_, bottom] = sheet.label_position("20");
        let [first, _] = sheet.label_position("L0");
        let [last, _] = sheet.label_position("L5");
        let offset = 0.35 * look().tick_font_size();
        positions
            .iter()
            .map(|[x, y]| {
                let share = 0.2 + 0.8 * (bottom - offset - y) / (bottom - top);
                [9.0 * (x - first) / (last - first), share]
            })
            .collect()
    }

    #[test]
    fn values_are_drawn_at_their_axis_positions() {
        for curves in [1, 3, 6] {
            let chart = chart(curves);
            let sheet = lines(&chart, &look());
            let drawn: Vec<Vec<[f64; 2]>> = sheet
                .shapes
                .iter()
                .filter_map(|shape| match shape {
                    Shape::Line { points, .. } if points.len() == 3 => Some(numbers(&sheet, points)),
                    _ => None,
                })
                .collect();
            assert_eq!(drawn.len(), curves);
            for (line, positions) in chart.panels[0].lines.iter().zip(drawn) {
                let LineContent::Curve(points) = &line.content else {
                    panic!("a curve comes before chance");
                };
                for ((level, expected), [ev, share]) in points.iter().zip(positions) {
                    assert!((ev - level.value()).abs() < 1e-9, "{ev}");
                    assert!((share - expected.value).abs() < 1e-9, "{share}");
                }
            }
            // A band over three levels has six corners; intervals of more curves are bars.
            let bands: Vec<Vec<[f64; 2]>> = sheet
                .shapes
                .iter()
                .filter_map(|shape| match shape {
                    Shape::Area { corners, .. } if corners.len() == 6 => Some(numbers(&sheet, corners)),
                    _ => None,
                })
                .collect();
            assert_eq!(bands.len(), if curves <= MAX_BANDS { curves } else { 0 });
            for (line, band) in bands.iter().enumerate() {
                let value = 0.9 - 0.07 * line as f64;
                assert!((band[0][1] - value - 0.03).abs() < 1e-9);
                assert!((band[5][1] - value + 0.05).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn labels_stay_on_the_sheet() {
        let mut chart = chart(6);
        chart.panels[0].lines[1].name = "a-model-with-a-name-of-many-letters-".repeat(3);
        for width in [219.1, 516.0] {
            let sheet = lines(&chart, &Look { width, ..look() });
            assert!((sheet.size[0] - width).abs() < 1e-9);
            for shape in &sheet.shapes {
                let Shape::Label(label) = shape else { continue };
                let [x, y] = label.start;
                let end = match label.direction {
                    super::super::sheet::TextDirection::Right => x + Font::bundled().width(&label.text, label.size),
                    super::super::sheet::TextDirection::Up => x,
                };
                let is_inside = x >= 0.0 && end <= width && y > 0.0 && y < sheet.size[1];
                assert!(is_inside, "{label:?} {:?}", sheet.size);
                assert_ne!(label.text, "a note");
            }
        }
    }
}
