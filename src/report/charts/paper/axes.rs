//! Axes of a panel ([`Axes`]), and the title above it ([`Title`]).

use super::font::Font;
use super::look::Look;
use super::sheet::{Anchor, GRID, Point, Sheet, TextDirection};
use crate::charts::chart::{INK, LineContent, Panel, Scale};

/// Distance between the baselines of two lines in em.
const LEADING: f64 = 1.15;

/// Lines of a title.
pub(super) struct Title(Vec<String>);

impl Title {
    /// Breaks a text into lines of at most `width` points.
    pub(super) fn new(text: &str, look: &Look, width: f64) -> Self {
        Self(Font::bundled().wrapped(text, look.font_size, width))
    }

    /// Height of the tallest title in points.
    pub(super) fn max_height(titles: &[Self], look: &Look) -> f64 {
        let lines = titles.iter().map(|title| title.0.len()).max().unwrap_or(0);
        lines as f64 * LEADING * look.font_size
    }

    /// Draws the lines from a left edge, the last line on a baseline.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, [left, baseline]: Point) {
        for (line, text) in self.0.iter().rev().enumerate() {
            let y = baseline - LEADING * line as f64 * look.font_size;
            sheet.label(text, [left, y], look.font_size, Anchor::Start);
        }
    }
}

/// Space between each end of an axis of levels and the nearest level, as a share of its length.
const INDENT: f64 = 0.035;

/// Margin at each end of an axis of numbers, as a share of the range of its values.
const MARGIN: f64 = 0.06;

/// Maximum number of intervals between ticks on an axis of numbers.
const MAX_STEPS: f64 = 6.0;

/// Labelled place on an axis.
#[derive(Debug, Clone, PartialEq)]
struct Tick {
    value: f64,
    label: String,
    /// Text below the label of a horizontal axis; empty for none.
    below: String,
}

impl Tick {
    fn new(value: f64, label: String) -> Self {
        Self { value, label, below: String::new() }
    }

    /// Half of the width of the wider text.
    fn half_width(&self, look: &Look) -> f64 {
        let font = Font::bundled();
        let width = font.width(&self.label, look.tick_font_size());
        width.max(font.width(&self.below, look.tick_font_size())) / 2.0
    }
}

/// Values at the ends of an axis, and its ticks.
#[derive(Debug, Clone)]
struct Ruler {
    low: f64,
    high: f64,
    /// Space before the lowest and after the highest value, as a share of the length.
    indent: f64,
    ticks: Vec<Tick>,
}

impl Ruler {
    fn new(panel: &Panel, scale: &Scale, axis: usize) -> Self {
        let plain = |low, high, ticks| Self { low, high, indent: 0.0, ticks };
        match scale {
            Scale::Levels { .. } => {
                let levels = panel.levels().into_iter();
                let tick = |(value, label): (f64, String)| Tick { value, label, below: value.to_string() };
                Self {
                    low: 0.0,
                    high: panel.axis_end(),
                    indent: INDENT,
                    ticks: levels.map(|level| tick((level.value(), level.to_string()))).collect(),
                }
            }
            Scale::Percent(_) => {
                plain(0.0, 1.0, (0..=5).map(|step| Tick::new(f64::from(step) / 5.0, (step * 20).to_string())).collect())
            }
            Scale::Numbers(_) => Self::for_range(panel.range(axis)),
            Scale::UpTo { end, step, .. } => {
                let ticks = (0..=*end as i32).step_by(usize::from(*step));
                plain(0.0, *end, ticks.map(|tick| Tick::new(f64::from(tick), tick.to_string())).collect())
            }
            Scale::Counts => {
                let largest = panel.lines.iter().filter_map(|line| match line.content {
                    LineContent::Bar { value, .. } => Some(value.value),
                    _ => None,
                });
                plain(0.0, largest.fold(0.0, f64::max), Vec::new())
            }
            Scale::Names => {
                let ticks: Vec<Tick> = panel
                    .places()
                    .enumerate()
                    .map(|(place, (name, text))| Tick {
                        value: place as f64,
                        label: text.to_owned(),
                        below: name.to_owned(),
                    })
                    .collect();
                plain(-0.5, ticks.len().max(1) as f64 - 0.5, ticks)
            }
        }
    }

    /// Axis of a range with margins; from 0 to 1 with margins if there is no range. The ticks are at multiples of 1, 2
    /// or 5 times a power of ten.
    fn for_range(range: Option<[f64; 2]>) -> Self {
        let [low, high] = range.unwrap_or([0.0, 1.0]);
        let margin = if high > low { MARGIN * (high - low) } else { 1.0 };
        let (low, high) = (low - margin, high + margin);
        let min_step = (high - low) / MAX_STEPS;
        let power = libm::pow(10.0, libm::log10(min_step).floor());
        let step = [1.0, 2.0, 5.0].map(|factor| factor * power).into_iter().find(|step| *step >= min_step);
        let step = step.unwrap_or(10.0 * power);
        let decimals = (-libm::log10(step * 1.001).floor()).max(0.0) as usize;
        let ticks = ((low / step).ceil() as i64..=(high / step).floor() as i64).map(|index| {
            let value = index as f64 * step;
            Tick::new(value, format!("{value:.decimals$}").replace('-', "−"))
        });
        Self { low, high, indent: 0.0, ticks: ticks.collect() }
    }

    /// Position of a value along the axis, from 0 to 1; a value beyond an end is at that end.
    fn share(&self, value: f64) -> f64 {
        if self.high <= self.low {
            return 0.5;
        }
        let share = (value.clamp(self.low, self.high) - self.low) / (self.high - self.low);
        self.indent + (1.0 - 2.0 * self.indent) * share
    }

    /// Width of the widest label.
    fn label_width(&self, look: &Look) -> f64 {
        max_width(self.ticks.iter().map(|tick| &*tick.label), look.tick_font_size())
    }
}

/// Space around the plot area of a panel in points.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Margins {
    /// Left, if the panel has the title of its vertical axis.
    pub with_title: f64,
    /// Left, without that title.
    pub left: f64,
    pub right: f64,
    pub bottom: f64,
}

/// Maximum width of the names of rows as a share of the panel's width.
const NAMES: f64 = 0.42;

/// Height of a row in em.
const ROW: f64 = 1.5;

/// Height of bars above their names in em.
const BARS: f64 = 11.0;

/// Maximum side of a square in em.
const SQUARE: f64 = 22.0;

/// Height of the plot area as a share of its width: over levels, and of numbers.
const RATIOS: [f64; 2] = [0.62, 0.75];

/// Minimum and maximum height of the plot area over levels in em.
const HEIGHTS: [f64; 2] = [9.0, 17.0];

impl Margins {
    /// Margins of a panel of the width of `look`.
    pub(super) fn new(panel: &Panel, look: &Look) -> Self {
        let (em, small) = (look.font_size, look.tick_font_size());
        let has_title = !panel.x.title(panel).is_empty();
        let bottom = match panel.x {
            Scale::Counts => 0.0,
            Scale::Levels { .. } | Scale::Names => 2.35 * small,
            Scale::Percent(_) | Scale::Numbers(_) | Scale::UpTo { .. } => 1.3 * small,
        } + if has_title { 1.5 * em } else { 0.3 * small };
        if panel.y != Scale::Names {
            let left = Ruler::new(panel, &panel.y, 1).label_width(look) + 0.55 * small;
            let title = if panel.y.title(panel).is_empty() { 0.0 } else { 1.35 * em };
            return Self { with_title: left + title, left, right: 0.6 * em, bottom };
        }
        let names = max_width(panel.places().map(|(name, _)| name), small).min(NAMES * look.width) + 0.8 * small;
        let right = max_width(panel.places().map(|(_, text)| text), small) + 1.6 * small;
        Self { with_title: names, left: names, right, bottom: if panel.x == Scale::Counts { 0.0 } else { bottom } }
    }
}

/// Width in points of the widest text.
fn max_width<'t>(texts: impl Iterator<Item = &'t str>, size: f64) -> f64 {
    let font = Font::bundled();
    texts.map(|text| font.width(text, size)).fold(0.0, f64::max)
}

/// Width and height of the plot area of a panel in a space of `width` points.
pub(super) fn plot_size(panel: &Panel, look: &Look, width: f64) -> [f64; 2] {
    let em = look.font_size;
    match (&panel.x, &panel.y) {
        (_, Scale::Names) => [width, ROW * em * panel.places().count().max(1) as f64],
        (Scale::Names, _) => [width, BARS * em],
        (Scale::Percent(_), Scale::Percent(_)) => [width.min(SQUARE * em); 2],
        (Scale::Levels { .. }, _) => [width, (RATIOS[0] * width).clamp(HEIGHTS[0] * em, HEIGHTS[1] * em)],
        _ => [width, RATIOS[1] * width],
    }
}

/// Plot area of a panel in points, with its axes.
#[derive(Debug)]
pub(super) struct Axes<'a> {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
    panel: &'a Panel,
    horizontal: Ruler,
    vertical: Ruler,
}

impl<'a> Axes<'a> {
    /// Axes of a panel whose plot area has its upper left corner at a point.
    pub(super) fn new(panel: &'a Panel, [left, top]: Point, [width, height]: [f64; 2]) -> Self {
        let (horizontal, vertical) = (Ruler::new(panel, &panel.x, 0), Ruler::new(panel, &panel.y, 1));
        Self { left, top, width, height, panel, horizontal, vertical }
    }

    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Horizontal position of a value, or of the place of a name.
    pub(super) fn x(&self, value: f64) -> f64 {
        self.left + self.width * self.horizontal.share(value)
    }

    /// Vertical position of a value, or of the row of a name.
    pub(super) fn y(&self, value: f64) -> f64 {
        let share = self.vertical.share(value);
        self.top + self.height * if self.panel.y == Scale::Names { share } else { 1.0 - share }
    }

    /// Height of a row.
    pub(super) fn row(&self) -> f64 {
        self.height / self.vertical.ticks.len().max(1) as f64
    }

    /// Distance between two names on the horizontal axis.
    pub(super) fn step(&self) -> f64 {
        self.width / self.horizontal.ticks.len().max(1) as f64
    }

    /// Draws grid, ticks and titles. `has_title`: with the title of the vertical axis.
    pub(super) fn draw(&self, sheet: &mut Sheet, look: &Look, has_title: bool) {
        if self.panel.y == Scale::Names {
            self.draw_row_names(sheet, look);
        } else {
            self.draw_vertical(sheet, look, has_title);
        }
        self.draw_horizontal(sheet, look);
    }

    fn draw_row_names(&self, sheet: &mut Sheet, look: &Look) {
        let small = look.tick_font_size();
        let right = self.left - 0.8 * small;
        for tick in &self.vertical.ticks {
            // The widest name has this width but for rounding.
            let name = Font::bundled().shortened(&tick.below, small, right + 0.01);
            sheet.label(&name, [right, self.y(tick.value) + 0.35 * small], small, Anchor::End);
        }
        if self.vertical.ticks.is_empty() {
            sheet.label("none", [0.0, self.y(0.0) + 0.35 * small], small, Anchor::Start);
        }
    }

    fn draw_vertical(&self, sheet: &mut Sheet, look: &Look, has_title: bool) {
        let (small, em) = (look.tick_font_size(), look.font_size);
        for tick in &self.vertical.ticks {
            let y = self.y(tick.value);
            sheet.line(&[[self.left, y], [self.right(), y]], &look.thin_stroke(GRID));
            sheet.label(&tick.label, [self.left - 0.4 * small, y + 0.35 * small], small, Anchor::End);
        }
        if matches!(self.panel.y, Scale::Numbers(_)) {
            sheet.line(&[[self.left, self.top], [self.left, self.bottom()]], &look.thin_stroke(INK));
        }
        if has_title {
            let x = self.left - self.vertical.label_width(look) - 0.55 * small - 0.35 * em;
            let title = self.panel.y.title(self.panel);
            let position = [x, self.top + self.height / 2.0];
            sheet.rotated_label(&title, position, em, Anchor::Middle, TextDirection::Up);
        }
    }

    fn draw_horizontal(&self, sheet: &mut Sheet, look: &Look) {
        let (small, em, bottom) = (look.tick_font_size(), look.font_size, self.bottom());
        let scale = &self.panel.x;
        if !matches!(scale, Scale::UpTo { .. } | Scale::Counts) {
            sheet.line(&[[self.left, bottom], [self.right(), bottom]], &look.thin_stroke(INK));
        }
        let labelled = self.labelled(look);
        for tick in &self.horizontal.ticks {
            let x = self.x(tick.value);
            match scale {
                Scale::UpTo { .. } => sheet.line(&[[x, self.top], [x, bottom]], &look.thin_stroke(GRID)),
                Scale::Names => {}
                _ => sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin_stroke(INK)),
            }
            if labelled.contains(&tick) {
                let room = if *scale == Scale::Names { 0.95 * self.step() } else { f64::INFINITY };
                let below = Font::bundled().shortened(&tick.below, small, room);
                sheet.label(&tick.label, [x, bottom + 1.15 * small], small, Anchor::Middle);
                sheet.label(&below, [x, bottom + 2.2 * small], small, Anchor::Middle);
            }
        }
        let lines = if matches!(scale, Scale::Levels { .. }) { 2.35 } else { 1.3 };
        let title = scale.title(self.panel);
        let title = Font::bundled().shortened(&title, em, self.width * 1.15);
        // A long title stays within the margin at the right.
        let half = Font::bundled().width(&title, em) / 2.0;
        let x = (self.left + self.width / 2.0).min(self.right() + 0.6 * em - half);
        sheet.label(&title, [x, bottom + lines * small + 0.95 * em], em, Anchor::Middle);
    }

    /// Ticks that get a label, from the first: a label that would touch the one before is left out. Names are
    /// shortened, so that all of them have one.
    fn labelled(&self, look: &Look) -> Vec<&Tick> {
        if self.panel.x == Scale::Names {
            return self.horizontal.ticks.iter().collect();
        }
        let mut labelled: Vec<&Tick> = Vec::new();
        for tick in &self.horizontal.ticks {
            let start = self.x(tick.value) - tick.half_width(look);
            let end =
                labelled.last().map(|last| self.x(last.value) + last.half_width(look) + 0.2 * look.tick_font_size());
            if end.is_none_or(|end| end < start) {
                labelled.push(tick);
            }
        }
        labelled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::chart::{LineStyle, PlotLine};
    use crate::charts::paper::look::column_look as look;
    use darkqa_base::types::degradations::Kind;
    use darkqa_base::types::{AxisLevel, Severity};
    use darkqa_score::estimate::Estimate;

    /// Names of the labelled levels on an axis of L0 and the given exposure drops, in hundredths of an EV.
    fn labelled(drops: impl IntoIterator<Item = u16>) -> Vec<String> {
        let points = std::iter::once(AxisLevel::L0)
            .chain(drops.into_iter().map(|drop| AxisLevel::new(Kind::Sensor, Severity::from_hundredths(drop))))
            .map(|level| (level, Estimate::exact(0.5, 1)));
        let line = PlotLine {
            name: String::new(),
            style: LineStyle(0),
            content: LineContent::Curve(points.collect()),
            model: None,
            items: None,
        };
        let panel = Panel::over_levels("", String::new(), vec![line]);
        let axes = Axes::new(&panel, [0.0, 0.0], [200.0, 1.0]);
        axes.labelled(&look()).iter().map(|tick| tick.label.clone()).collect()
    }

    #[test]
    fn labels_of_levels_do_not_overlap() {
        let paper_levels = [200, 400, 600, 750, 900];
        assert_eq!(labelled(paper_levels), ["L0", "L1", "L2", "L3", "L4", "L5"]);
        let half_stops = labelled((1..=20).map(|step| 50 * step));
        assert!(half_stops.len() > 5 && half_stops.len() < 15, "{half_stops:?}");
        assert_eq!(labelled([1, 900]), ["L0", "L5"]);
    }

    #[test]
    fn ticks_are_few_and_round() {
        for (range, texts) in [
            (None, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"].as_slice()),
            (Some([3.0, 3.0]), &["2.0", "2.5", "3.0", "3.5", "4.0"]),
            (Some([-7.0, 0.0]), &["−6", "−4", "−2", "0"]),
            (Some([0.001, 0.002]), &["0.0010", "0.0012", "0.0014", "0.0016", "0.0018", "0.0020"]),
        ] {
            let ticks: Vec<String> = Ruler::for_range(range).ticks.into_iter().map(|tick| tick.label).collect();
            assert_eq!(ticks, texts, "{range:?}");
        }
    }
}
