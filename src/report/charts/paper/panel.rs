//! Drawing of one panel: its axes and its lines, whatever they are of ([`PanelDrawing`]).

use super::axes::Axes;
use super::legend::Legend;
use super::look::Look;
use super::sheet::{Anchor, Shape, ShapeGroup, Sheet, Stroke};
use crate::charts::chart::{INK, LineContent, LineStyle, Panel, PlotLine, Scale};
use crate::text::words::{percent, with_interval};
use darkqa_base::types::AxisLevel;
use darkqa_score::estimate::Estimate;
use darkqa_score::threshold::Threshold;

/// Intervals are drawn as bands in panels of up to this many curves, and as bars in others.
pub(super) const MAX_BANDS: usize = 3;

/// Opacity of a band.
const BAND: f64 = 0.16;

/// Opacity of a bar of a bar chart.
const BAR: f64 = 0.55;

/// Width of a bar as a share of the distance between bars.
const BAR_WIDTH: f64 = 0.6;

/// Height of a bar as a share of the height of its row.
const BAR_HEIGHT: f64 = 0.7;

/// Where a panel is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Medium {
    /// In a figure. Intervals are bands in panels of up to [`MAX_BANDS`] curves, and bars in others.
    Paper,
    /// Alone, on the page, whose script shows and hides groups: a panel has both bands and bars, and a cursor at each
    /// level.
    Page,
}

/// Space between the bars of two curves on the page in em, so that bars at one level do not hide each other.
const BAR_STEP: f64 = 0.28;

/// Radius of the area of a point on the page that can be clicked, in em.
const TARGET: f64 = 0.8;

/// Drawing of one panel.
pub(super) struct PanelDrawing<'a> {
    pub look: &'a Look,
    pub axes: &'a Axes<'a>,
    pub panel: &'a Panel,
    pub legend: &'a Legend<'a>,
    pub medium: Medium,
}

impl PanelDrawing<'_> {
    /// Draws axes and lines. `has_title`: with the title of the vertical axis.
    pub(super) fn draw(&self, sheet: &mut Sheet, has_title: bool) {
        self.axes.draw(sheet, self.look, has_title);
        if self.medium == Medium::Page {
            self.draw_cursors(sheet);
        }
        let curves = self.curve_count();
        let mut place = 0;
        for line in &self.panel.lines {
            Self::push(sheet, line, self.background(line, curves, place));
            place += usize::from(line.has_place());
        }
        let mut curve = 0;
        for line in &self.panel.lines {
            let beside = BAR_STEP * self.look.font_size * (f64::from(curve) - (curves as f64 - 1.0) / 2.0);
            Self::push(sheet, line, self.foreground(line, beside));
            curve += i32::from(line.is_curve());
        }
    }

    fn curve_count(&self) -> usize {
        self.panel.lines.iter().filter(|line| line.is_curve()).count()
    }

    /// Adds the group of a line, if it has shapes.
    fn push(sheet: &mut Sheet, line: &PlotLine, group: ShapeGroup) {
        if group.shapes.is_empty() {
            return;
        }
        let mut data = vec![("line", line.name.clone())];
        data.extend(line.model.iter().map(|model| ("model", model.clone())));
        data.extend(group.data);
        sheet.shapes.push(Shape::Group(ShapeGroup { data, ..group }));
    }

    /// Lines at all levels, of which the script shows one.
    fn draw_cursors(&self, sheet: &mut Sheet) {
        for level in self.panel.levels() {
            let x = self.axes.x(level.value());
            let stroke = self.look.thin_stroke(INK);
            sheet.shapes.push(Shape::Group(ShapeGroup {
                class: "cursor-line",
                data: vec![("level", level.to_string())],
                shapes: vec![Shape::Line { points: vec![[x, self.axes.top], [x, self.axes.bottom()]], stroke }],
                ..ShapeGroup::default()
            }));
        }
    }

    /// Background of a line, below all curves: a horizontal line, the band of a curve, on paper the bars of one of many curves, or the
    /// bar or range of a name, of which `place` come before it.
    fn background(&self, line: &PlotLine, curves: usize, place: usize) -> ShapeGroup {
        match &line.content {
            LineContent::Flat(share) => {
                let y = self.axes.y(*share);
                let stroke = self.legend.flat_stroke(line.into(), self.look);
                let shapes = vec![Shape::Line { points: vec![[self.axes.left, y], [self.axes.right(), y]], stroke }];
                ShapeGroup { class: "flat", title: percent(*share), shapes, ..ShapeGroup::default() }
            }
            LineContent::Curve(points) if points.is_empty() => ShapeGroup::default(),
            LineContent::Curve(points) if self.medium == Medium::Page || curves <= MAX_BANDS => {
                ShapeGroup { class: "band", shapes: vec![self.band(line.style, points)], ..ShapeGroup::default() }
            }
            LineContent::Curve(points) => ShapeGroup {
                shapes: points
                    .iter()
                    .map(|(level, share)| self.interval(line.style, level.value(), 0.0, *share))
                    .collect(),
                ..ShapeGroup::default()
            },
            LineContent::Bar { value, text } => self.bar(line.style, *value, text, place as f64),
            LineContent::Range { threshold, text } => self.range(line.style, *threshold, text, place as f64),
            LineContent::Marks(_) | LineContent::Points(_) | LineContent::Path(_) => ShapeGroup::default(),
        }
    }

    fn foreground(&self, line: &PlotLine, beside: f64) -> ShapeGroup {
        match &line.content {
            LineContent::Curve(_) => self.curve(line, beside),
            LineContent::Marks(_) => self.photographs(line),
            LineContent::Points(points) => self.points(line.style, points),
            LineContent::Path(points) => {
                let points = points.iter().map(|[x, y]| [self.axes.x(*x), self.axes.y(*y)]).collect();
                // A line without a name is one to compare with, such as a diagonal.
                let stroke =
                    if line.name.is_empty() { self.look.dotted_stroke() } else { self.look.pen(line.style).stroke };
                ShapeGroup { shapes: vec![Shape::Line { points, stroke }], ..ShapeGroup::default() }
            }
            LineContent::Flat(_) | LineContent::Bar { .. } | LineContent::Range { .. } => ShapeGroup::default(),
        }
    }

    /// The bar of a name with its interval: upwards, or to the right in a row with its text at the end.
    fn bar(&self, style: LineStyle, value: Estimate, text: &str, place: f64) -> ShapeGroup {
        let (axes, fill) = (self.axes, self.look.colour(style));
        let mut bar = Sheet::default();
        if self.panel.y == Scale::Names {
            let (small, half) = (self.look.tick_font_size(), BAR_HEIGHT * axes.row() / 2.0);
            let (y, end) = (axes.y(place), axes.x(value.value));
            let corners = vec![[axes.left, y - half], [end, y - half], [end, y + half], [axes.left, y + half]];
            bar.area(corners, fill, BAR);
            bar.label(text, [end + 0.4 * small, y + 0.35 * small], small, Anchor::Start);
        } else {
            let half = axes.step().min(6.0 * self.look.font_size) * BAR_WIDTH / 2.0;
            let (x, top, bottom) = (axes.x(place), axes.y(value.value), axes.bottom());
            bar.area(vec![[x - half, bottom], [x - half, top], [x + half, top], [x + half, bottom]], fill, BAR);
            bar.line(&[[x, axes.y(value.low)], [x, axes.y(value.high)]], &self.look.pen(style).stroke);
        }
        ShapeGroup { title: text.to_owned(), shapes: bar.shapes, ..ShapeGroup::default() }
    }

    /// The interval of a row, with its text at the right. An arrow marks an interval that goes beyond the axis.
    fn range(&self, style: LineStyle, threshold: Threshold, text: &str, row: f64) -> ShapeGroup {
        let (axes, small, scale) = (self.axes, self.look.tick_font_size(), self.look.line_scale());
        let (colour, y) = (self.look.colour(style), axes.y(row));
        let mut range = Sheet::default();
        let ends = [[axes.x(threshold.low), y], [axes.x(threshold.high), y]];
        range.line(&ends, &Stroke::solid(colour, 1.1 * scale));
        if threshold.high.is_infinite() {
            let (end, tip) = (axes.right(), 2.2 * scale);
            range.area(vec![[end + 1.6 * tip, y], [end, y - tip], [end, y + tip]], colour, 1.0);
        }
        if threshold.value.is_finite() {
            let centre = [axes.x(threshold.value), y];
            range.shapes.push(Shape::Disc { centre, radius: 2.0 * scale, fill: Some(colour), edge: None });
        }
        range.label(text, [axes.right() + 1.2 * small, y + 0.35 * small], small, Anchor::Start);
        ShapeGroup { title: text.to_owned(), shapes: range.shapes, ..ShapeGroup::default() }
    }

    /// Separate points with their intervals.
    fn points(&self, style: LineStyle, points: &[(f64, Estimate)]) -> ShapeGroup {
        let pen = self.look.pen(style);
        let shapes = points.iter().map(|(x, value)| {
            let mut point = Sheet::default();
            if value.low < value.high {
                point.shapes.push(self.interval(style, *x, 0.0, *value));
            }
            self.look.draw_marker(&mut point, &pen, [self.axes.x(*x), self.axes.y(value.value)]);
            let title = match self.panel.y {
                Scale::Percent(_) => with_interval(*value),
                _ => String::new(),
            };
            Shape::Group(ShapeGroup { title, shapes: point.shapes, ..ShapeGroup::default() })
        });
        ShapeGroup { shapes: shapes.collect(), ..ShapeGroup::default() }
    }

    fn band(&self, style: LineStyle, points: &[(AxisLevel, Estimate)]) -> Shape {
        let upper = points.iter().map(|(level, share)| [self.axes.x(level.value()), self.axes.y(share.high)]);
        let lower = points.iter().rev().map(|(level, share)| [self.axes.x(level.value()), self.axes.y(share.low)]);
        Shape::Area { corners: upper.chain(lower).collect(), fill: self.look.colour(style), opacity: BAND }
    }

    /// The interval of a share as a vertical line, `beside` points right of its place.
    fn interval(&self, style: LineStyle, value: f64, beside: f64, share: Estimate) -> Shape {
        let x = self.axes.x(value) + beside;
        let points = vec![[x, self.axes.y(share.low)], [x, self.axes.y(share.high)]];
        Shape::Line { points, stroke: self.look.thin_stroke(self.look.colour(style)) }
    }

    /// A curve with a marker at each point; on the page, with the bar of each point beside it.
    fn curve(&self, line: &PlotLine, beside: f64) -> ShapeGroup {
        let LineContent::Curve(points) = &line.content else {
            return ShapeGroup::default();
        };
        if points.is_empty() {
            return ShapeGroup::default();
        }
        let pen = self.look.pen(line.style);
        let position = |level: AxisLevel, share: Estimate| [self.axes.x(level.value()), self.axes.y(share.value)];
        let path = points.iter().map(|(level, share)| position(*level, *share)).collect();
        let mut shapes = vec![Shape::Line { points: path, stroke: pen.stroke.clone() }];
        for (level, share) in points {
            let mut point = Sheet::default();
            if self.medium == Medium::Page {
                let bar = self.interval(line.style, level.value(), beside, *share);
                point.group("interval", [bar]);
                if line.items.is_some() {
                    let centre = position(*level, *share);
                    let radius = TARGET * self.look.font_size;
                    point.group("target", [Shape::Disc { centre, radius, fill: None, edge: None }]);
                }
            }
            self.look.draw_marker(&mut point, &pen, position(*level, *share));
            shapes.push(Shape::Group(ShapeGroup {
                class: if line.items.is_some() { "to-items" } else { "" },
                data: vec![("level", level.to_string())],
                title: with_interval(*share),
                shapes: point.shapes,
            }));
        }
        let items = line.items.iter().flat_map(|items| {
            let family = items.family.iter().map(|family| ("family", family.clone()));
            [("items", items.model.clone()), ("light", items.light.clone())].into_iter().chain(family)
        });
        ShapeGroup { class: "curve", data: items.collect(), shapes, ..ShapeGroup::default() }
    }

    /// Marks of photographs in the dark: a hollow marker at the median exposure drop, a horizontal bar from quartile to
    /// quartile, and a vertical bar for the interval of the share.
    fn photographs(&self, line: &PlotLine) -> ShapeGroup {
        let LineContent::Marks(marks) = &line.content else {
            return ShapeGroup::default();
        };
        let shapes = marks.iter().map(|mark| {
            let mut point = Sheet::default();
            let [low, middle, high] = mark.ev.map(|ev| self.axes.x(ev.max(0.0)));
            let y = self.axes.y(mark.share.value);
            let thin = self.look.thin_stroke(self.look.colour(line.style));
            point.line(&[[low, y], [high, y]], &thin);
            point.shapes.push(self.interval(line.style, mark.ev[1].max(0.0), 0.0, mark.share));
            self.look.draw_hollow_marker(&mut point, line.style, [middle, y]);
            let title = with_interval(mark.share);
            Shape::Group(ShapeGroup { title, shapes: point.shapes, ..ShapeGroup::default() })
        });
        ShapeGroup { class: "marks", shapes: shapes.collect(), ..ShapeGroup::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::chart::Chart;
    use crate::charts::paper::figure::sheet;
    use crate::charts::paper::font::Font;
    use crate::charts::paper::look::column_look as look;
    use crate::charts::paper::sheet::{Point, TextDirection};
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;

    fn share(value: f64) -> Estimate {
        Estimate { value, low: value - 0.05, high: value + 0.03, n: 40 }
    }

    /// Chart of one panel with `curves` curves over L0, L1 and L5, and chance.
    fn chart(curves: usize) -> Chart {
        let levels =
            [AxisLevel::L0, AxisLevel::new(Kind::Sensor, Severity::L1), AxisLevel::new(Kind::Sensor, Severity::L5)];
        let mut lines: Vec<PlotLine> = (0..curves)
            .map(|line| {
                let points = levels.iter().enumerate();
                let points = points.map(|(at, level)| (*level, share(0.9 - 0.07 * (line + 2 * at) as f64)));
                let content = LineContent::Curve(points.collect());
                PlotLine::new(format!("model {line}"), LineStyle(line), content)
            })
            .collect();
        lines.push(PlotLine::chance(0.25));
        Chart {
            panels: vec![Panel::over_levels("accuracy in %", "a panel".to_owned(), lines)],
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
            let sheet = sheet(&chart, &look());
            let drawn: Vec<Vec<[f64; 2]>> = sheet
                .ungrouped()
                .into_iter()
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
                .ungrouped()
                .into_iter()
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
            let sheet = sheet(&chart, &Look { width, ..look() });
            assert!((sheet.size[0] - width).abs() < 1e-9);
            for shape in sheet.ungrouped() {
                let Shape::Label(label) = shape else { continue };
                let [x, y] = label.start;
                let end = match label.direction {
                    TextDirection::Right => x + Font::bundled().width(&label.text, label.size),
                    TextDirection::Up => x,
                };
                let is_inside = x >= 0.0 && end <= width && y > 0.0 && y < sheet.size[1];
                assert!(is_inside, "{label:?} {:?}", sheet.size);
                assert_ne!(label.text, "a note");
            }
        }
    }
}
