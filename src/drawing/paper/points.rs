//! A panel of points and lines over two axes of numbers: [`points`].

use super::font::Font;
use super::legend::{Entry, Legend, Sample};
use super::look::Look;
use super::sheet::{Anchor, GRID, Place, Sheet, Turn};
use super::title::Title;
use crate::drawing::chart::INK;
use crate::drawing::chart::points::{PointPanel, PointSeries};

/// Height of the panel between its axes, in parts of its width.
const RATIO: f64 = 0.75;
/// Share of a range that is added at both of its ends.
const MARGIN: f64 = 0.06;
/// Most distances between ticks on an axis.
const STEPS: f64 = 6.0;

/// The panel as a sheet, with its legend below.
pub(crate) fn points(panel: &PointPanel, look: &Look) -> Sheet {
    let (letters, small) = (look.letters, look.small());
    let [across, up] = [0, 1].map(|axis| Scale::new(panel.range(axis)));
    let font = Font::bundled();
    let numbers = up
        .ticks()
        .map(|(_, text)| font.width(&text, small))
        .fold(0.0, f64::max);
    let left = numbers + 0.55 * small + 1.35 * letters;
    let width = look.width - left - 0.6 * letters;
    let title = Title::new(&panel.title, look, width);
    let top = Title::highest(std::slice::from_ref(&title), look) + 0.65 * letters;
    let area = Area {
        corner: [left, top],
        size: [width, RATIO * width],
        scales: [across, up],
    };
    let mut sheet = Sheet::default();
    title.draw(&mut sheet, look, [left, top - 0.6 * letters]);
    area.draw_axes(&mut sheet, look);
    let bottom = top + area.size[1];
    let [below, beside] = panel.axes;
    let place = [left + width / 2.0, bottom + 1.3 * small + 0.95 * letters];
    sheet.words(below, place, letters, Anchor::Middle);
    let place = [
        left - numbers - 0.55 * small - 0.35 * letters,
        f64::midpoint(top, bottom),
    ];
    sheet.turned_words(beside, place, letters, Anchor::Middle, Turn::Up);
    for series in &panel.series {
        area.draw_series(&mut sheet, look, series);
    }
    let entries = panel.series.iter().map(|series| Entry {
        name: &series.name,
        style: series.style,
        sample: Sample::Curve,
    });
    let legend = Legend::new(entries, look);
    let end = bottom + 1.5 * small + 2.0 * letters;
    legend.draw(&mut sheet, look, end);
    sheet.size = [look.width, end + legend.height];
    sheet
}

/// The rectangle between the axes, in points.
struct Area {
    corner: Place,
    size: [f64; 2],
    /// Of the horizontal and the vertical axis.
    scales: [Scale; 2],
}

impl Area {
    fn place(&self, [x, y]: [f64; 2]) -> Place {
        let [across, up] = &self.scales;
        [
            self.corner[0] + self.size[0] * across.share(x),
            self.corner[1] + self.size[1] * (1.0 - up.share(y)),
        ]
    }

    fn draw_axes(&self, sheet: &mut Sheet, look: &Look) {
        let small = look.small();
        let [across, up] = &self.scales;
        let [left, bottom] = self.place([across.low, up.low]);
        let right = left + self.size[0];
        for (value, text) in up.ticks() {
            let [_, y] = self.place([across.low, value]);
            sheet.line(&[[left, y], [right, y]], &look.thin(GRID));
            let place = [left - 0.4 * small, y + 0.35 * small];
            sheet.words(&text, place, small, Anchor::End);
        }
        for (value, text) in across.ticks() {
            let [x, _] = self.place([value, up.low]);
            sheet.line(&[[x, bottom], [x, bottom + 0.25 * small]], &look.thin(INK));
            sheet.words(&text, [x, bottom + 1.15 * small], small, Anchor::Middle);
        }
        let axes = [[left, self.corner[1]], [left, bottom], [right, bottom]];
        sheet.line(&axes, &look.thin(INK));
    }

    fn draw_series(&self, sheet: &mut Sheet, look: &Look, series: &PointSeries) {
        let pen = look.pen(series.style);
        for line in &series.lines {
            let places: Vec<Place> = line.iter().map(|place| self.place(*place)).collect();
            sheet.line(&places, &pen.stroke);
        }
        for point in &series.points {
            look.mark(sheet, &pen, self.place(*point));
        }
    }
}

/// The range of an axis, and the distance of its ticks.
struct Scale {
    low: f64,
    high: f64,
    step: f64,
}

impl Scale {
    /// The scale that holds a range with margins; without a range, from 0 to 1.
    fn new(range: Option<[f64; 2]>) -> Self {
        let [low, high] = range.unwrap_or([0.0, 1.0]);
        let margin = if high > low {
            MARGIN * (high - low)
        } else {
            1.0
        };
        let (low, high) = (low - margin, high + margin);
        let least = (high - low) / STEPS;
        let power = libm::pow(10.0, libm::log10(least).floor());
        let steps = [1.0, 2.0, 5.0].map(|factor| factor * power);
        let step = steps.into_iter().find(|step| *step >= least);
        Self {
            low,
            high,
            step: step.unwrap_or(10.0 * power),
        }
    }

    /// Place of a value between the ends of the axis, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// The ticks and their texts.
    fn ticks(&self) -> impl Iterator<Item = (f64, String)> {
        let decimals = (-libm::log10(self.step * 1.001).floor()).max(0.0) as usize;
        let first = (self.low / self.step).ceil() as i64;
        let last = (self.high / self.step).floor() as i64;
        (first..=last).map(move |index| {
            let value = index as f64 * self.step;
            (value, format!("{value:.decimals$}").replace('-', "−"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::chart::LineStyle;
    use crate::drawing::paper::look::column_look as look;
    use crate::drawing::paper::sheet::Mark;

    fn panel(series: Vec<PointSeries>) -> PointPanel {
        PointPanel {
            title: "a panel".to_owned(),
            axes: ["ln K", "ln σ"],
            series,
        }
    }

    /// The place of a text by the middle of its letters.
    fn middle(sheet: &Sheet, text: &str) -> Place {
        sheet
            .marks
            .iter()
            .find_map(|mark| match mark {
                Mark::Words(words) if words.text == text => {
                    let width = Font::bundled().width(text, words.size);
                    Some([words.start[0] + width / 2.0, words.start[1]])
                }
                _ => None,
            })
            .unwrap()
    }

    #[test]
    fn points_lie_where_the_axes_say() {
        let line = vec![[6.0, -2.0], [8.0, 1.0], [10.0, 4.0]];
        let sheet = points(
            &panel(vec![PointSeries {
                name: "a".to_owned(),
                style: LineStyle(0),
                points: vec![[8.0, 1.0]],
                lines: vec![line],
            }]),
            &look(),
        );
        let drawn: Vec<&Vec<Place>> = sheet
            .marks
            .iter()
            .filter_map(|mark| match mark {
                Mark::Line { places, stroke } if places.len() == 3 && stroke.colour != INK => {
                    Some(places)
                }
                _ => None,
            })
            .collect();
        assert_eq!(drawn.len(), 1);
        let [first, second, third] = [drawn[0][0], drawn[0][1], drawn[0][2]];
        assert!((first[0] - middle(&sheet, "6")[0]).abs() < 1e-9);
        assert!((third[0] - middle(&sheet, "10")[0]).abs() < 1e-9);
        let height = |text: &str| middle(&sheet, text)[1] - 0.35 * look().small();
        assert!((first[1] - height("−2")).abs() < 1e-9);
        assert!((third[1] - height("4")).abs() < 1e-9);
        let is_at_second = |mark: &Mark| {
            matches!(mark, Mark::Disc { centre, .. } if (centre[0] - second[0]).abs() < 1e-9
                && (centre[1] - second[1]).abs() < 1e-9)
        };
        assert!(sheet.marks.iter().any(is_at_second));
    }

    #[test]
    fn ticks_are_few_round_and_inside() {
        for (range, texts) in [
            (None, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"].as_slice()),
            (Some([3.0, 3.0]), &["2.0", "2.5", "3.0", "3.5", "4.0"]),
            (Some([-7.0, 0.0]), &["−6", "−4", "−2", "0"]),
            (
                Some([0.001, 0.002]),
                &["0.0010", "0.0012", "0.0014", "0.0016", "0.0018", "0.0020"],
            ),
        ] {
            let ticks: Vec<String> = Scale::new(range).ticks().map(|(_, text)| text).collect();
            assert_eq!(ticks, texts, "{range:?}");
        }
    }

    #[test]
    fn a_panel_without_points_is_drawn() {
        assert!(points(&panel(Vec::new()), &look()).size[1] > 100.0);
    }
}
