//! A chart of lines at the width of a column: [`lines`].

use super::axes::Axes;
use super::legend::Legend;
use super::look::{Look, Pen};
use super::sheet::{Mark, PAPER, Place, Sheet, Stroke};
use super::title::Title;
use crate::drawing::chart::{Chart, DarkMark, LineStyle, Panel, PanelContent, PlotLine};
use crate::types::AxisLevel;
use darkqa_score::estimate::Estimate;

/// Least width of a panel, in heights of letters.
const LEAST: f64 = 14.0;
/// Height of a panel between its axes, in parts of its width, and the bounds of that height in heights of letters.
const RATIO: f64 = 0.62;
const HEIGHTS: [f64; 2] = [9.0, 17.0];
/// Room between panels, in heights of letters.
const GAP: f64 = 0.9;
/// Most curves of a panel whose intervals are bands; those of more curves are bars.
const MOST_BANDS: usize = 3;
/// Opacity of a band.
const BAND: f64 = 0.16;

/// The chart as a sheet. Each number is drawn where the axes say; the note of the chart is left to the caption.
pub(crate) fn lines(chart: &Chart, look: &Look) -> Sheet {
    let legend = Legend::for_chart(chart, look);
    let most = (look.width / (LEAST * look.letters)) as usize;
    let columns = chart.columns.min(most).min(chart.panels.len()).max(1);
    let (first, next) = margins(look);
    let margins = first + (columns - 1) as f64 * (next + GAP * look.letters) + 0.6 * look.letters;
    let width = (look.width - margins) / columns as f64;
    let [least, most] = HEIGHTS.map(|letters| letters * look.letters);
    let height = (RATIO * width).clamp(least, most);
    let mut sheet = Sheet::default();
    let mut top = 0.0;
    for row in chart.panels.chunks(columns) {
        let titles: Vec<Title> = row
            .iter()
            .map(|panel| Title::new(&panel.title, look, width))
            .collect();
        top += Title::highest(&titles, look) + 0.65 * look.letters;
        let mut left = first;
        for (index, (panel, title)) in row.iter().zip(&titles).enumerate() {
            let axes = Axes::new(panel, [left, top], [width, height]);
            let measure = if index == 0 { chart.measure } else { "" };
            draw_panel(&mut sheet, look, &axes, panel, measure, &legend);
            title.draw(&mut sheet, look, [left, top - 0.6 * look.letters]);
            left += width + GAP * look.letters + next;
        }
        top += height + Axes::foot(look) + 0.3 * look.letters;
    }
    legend.draw(&mut sheet, look, top);
    sheet.size = [look.width, top + legend.height];
    sheet
}

/// Room left of the axes of the first panel of a row, and of each other.
fn margins(look: &Look) -> (f64, f64) {
    let numbers = Axes::numbers_width(look);
    (numbers + 1.35 * look.letters, numbers)
}

fn draw_panel(
    sheet: &mut Sheet,
    look: &Look,
    axes: &Axes,
    panel: &Panel,
    measure: &str,
    legend: &Legend<'_>,
) {
    axes.draw(sheet, look, measure);
    let curves = panel
        .lines
        .iter()
        .filter(|line| matches!(line.content, PanelContent::Curve(_)));
    let intervals = if curves.count() > MOST_BANDS {
        Intervals::Bars
    } else {
        Intervals::Bands
    };
    for line in &panel.lines {
        match &line.content {
            PanelContent::Curve(points) => {
                draw_intervals(sheet, look, axes, (line, points), intervals);
            }
            PanelContent::Flat(share) => {
                let y = axes.y(*share);
                let ends = [[axes.left, y], [axes.left + axes.width, y]];
                sheet.line(&ends, &legend.flat(line.into(), look));
            }
            PanelContent::Marks(_) => {}
        }
    }
    for line in &panel.lines {
        match &line.content {
            PanelContent::Curve(points) => draw_curve(sheet, axes, look, line.style, points),
            PanelContent::Marks(marks) => {
                for mark in marks {
                    draw_dark(sheet, look, axes, line.style, mark);
                }
            }
            PanelContent::Flat(_) => {}
        }
    }
}

/// How the intervals of curves are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Intervals {
    Bands,
    Bars,
}

fn draw_intervals(
    sheet: &mut Sheet,
    look: &Look,
    axes: &Axes,
    (line, points): (&PlotLine, &[(AxisLevel, Estimate)]),
    intervals: Intervals,
) {
    let colour = look.colour(line.style);
    match intervals {
        Intervals::Bands => {
            let at = |(level, share): (AxisLevel, f64)| [axes.x(level.value()), axes.y(share)];
            let upper = points.iter().map(|(level, at)| (*level, at.high)).map(at);
            let lower = points
                .iter()
                .rev()
                .map(|(level, at)| (*level, at.low))
                .map(at);
            sheet.area(upper.chain(lower).collect(), colour, BAND);
        }
        Intervals::Bars => {
            for (level, share) in points {
                let x = axes.x(level.value());
                let ends = [[x, axes.y(share.low)], [x, axes.y(share.high)]];
                sheet.line(&ends, &look.thin(colour));
            }
        }
    }
}

fn draw_curve(
    sheet: &mut Sheet,
    axes: &Axes,
    look: &Look,
    style: LineStyle,
    points: &[(AxisLevel, Estimate)],
) {
    let Pen { stroke, .. } = &look.pen(style);
    let places: Vec<Place> = points
        .iter()
        .map(|(level, share)| [axes.x(level.value()), axes.y(share.value)])
        .collect();
    sheet.line(&places, stroke);
    for place in places {
        look.mark(sheet, &look.pen(style), place);
    }
}

/// A photograph in the dark: a hollow mark at its median drop, a bar from quartile to quartile and one for its interval.
fn draw_dark(sheet: &mut Sheet, look: &Look, axes: &Axes, style: LineStyle, mark: &DarkMark) {
    let [low, middle, high] = mark.ev.map(|ev| axes.x(ev.max(0.0)));
    let y = axes.y(mark.share.value);
    let thin = look.thin(look.colour(style));
    sheet.line(&[[low, y], [high, y]], &thin);
    let ends = [mark.share.low, mark.share.high].map(|share| [middle, axes.y(share)]);
    sheet.line(&ends, &thin);
    look.hollow(sheet, style, [middle, y]);
}

impl Look {
    /// Draws a hollow mark.
    pub(super) fn hollow(&self, sheet: &mut Sheet, style: LineStyle, centre: Place) {
        sheet.marks.push(Mark::Disc {
            centre,
            radius: 2.2 * self.weight(),
            fill: Some(PAPER),
            edge: Some(Stroke::solid(self.colour(style), 0.9 * self.weight())),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::paper::font::Font;
    use crate::drawing::paper::look::column_look as look;
    use crate::types::Severity;
    use crate::types::degradations::Kind;

    fn share(value: f64) -> Estimate {
        Estimate {
            value,
            low: value - 0.05,
            high: value + 0.03,
            n: 40,
        }
    }

    /// A chart of one panel with `curves` lines over L0, L1 and L5, and chance.
    fn chart(curves: usize) -> Chart {
        let level = |drop| AxisLevel::new(Kind::Sensor, Severity::from_hundredths(drop));
        let levels = [AxisLevel::L0, level(200), level(900)];
        let mut lines: Vec<PlotLine> = (0..curves)
            .map(|line| PlotLine {
                name: format!("model {line}"),
                style: LineStyle(line),
                model: None,
                content: PanelContent::Curve(
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
            content: PanelContent::Flat(0.25),
            model: None,
            items: None,
        });
        Chart {
            measure: "accuracy in %",
            panels: vec![Panel {
                title: "a panel".to_owned(),
                lines,
                model: None,
            }],
            columns: 1,
            note: "a note".to_owned(),
        }
    }

    /// The shares and exposure drops of places, by the axes of the only panel.
    fn numbers(sheet: &Sheet, places: &[Place]) -> Vec<[f64; 2]> {
        let grid = |value: &str| {
            let words = sheet.marks.iter().find_map(|mark| match mark {
                Mark::Words(words) if words.text == value => Some(words.start[1]),
                _ => None,
            });
            words.unwrap()
        };
        let (top, bottom) = (grid("100"), grid("20"));
        let offset = 0.35 * look().small();
        let tick = |value: &str| {
            let words = sheet.marks.iter().find_map(|mark| match mark {
                Mark::Words(words) if words.text == value => Some(words),
                _ => None,
            });
            let words = words.unwrap();
            words.start[0] + Font::bundled().width(value, words.size) / 2.0
        };
        let (first, last) = (tick("L0"), tick("L5"));
        places
            .iter()
            .map(|[x, y]| {
                let share = 0.2 + 0.8 * (bottom - offset - y) / (bottom - top);
                [9.0 * (x - first) / (last - first), share]
            })
            .collect()
    }

    #[test]
    fn every_number_is_drawn_where_the_axes_say() {
        for curves in [1, 3, 6] {
            let chart = chart(curves);
            let sheet = lines(&chart, &look());
            let drawn: Vec<Vec<[f64; 2]>> = sheet
                .marks
                .iter()
                .filter_map(|mark| match mark {
                    Mark::Line { places, .. } if places.len() == 3 => Some(numbers(&sheet, places)),
                    _ => None,
                })
                .collect();
            assert_eq!(drawn.len(), curves);
            for (line, places) in chart.panels[0].lines.iter().zip(drawn) {
                let PanelContent::Curve(points) = &line.content else {
                    panic!("a curve comes before chance");
                };
                for ((level, of), [ev, share]) in points.iter().zip(places) {
                    assert!((ev - level.value()).abs() < 1e-9, "{ev}");
                    assert!((share - of.value).abs() < 1e-9, "{share}");
                }
            }
            // Bands have an upper and a lower edge; bars of more curves have two ends.
            let bands: Vec<Vec<[f64; 2]>> = sheet
                .marks
                .iter()
                .filter_map(|mark| match mark {
                    Mark::Area { corners, .. } if corners.len() == 6 => {
                        Some(numbers(&sheet, corners))
                    }
                    _ => None,
                })
                .collect();
            assert_eq!(bands.len(), if curves <= MOST_BANDS { curves } else { 0 });
            for (line, band) in bands.iter().enumerate() {
                let value = 0.9 - 0.07 * line as f64;
                assert!((band[0][1] - value - 0.03).abs() < 1e-9);
                assert!((band[5][1] - value + 0.05).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn words_stay_on_the_sheet_and_the_note_is_left_to_the_caption() {
        let mut chart = chart(6);
        chart.panels[0].lines[1].name = "a-model-with-a-name-of-many-letters-".repeat(3);
        for width in [219.1, 516.0] {
            let sheet = lines(&chart, &Look { width, ..look() });
            assert!((sheet.size[0] - width).abs() < 1e-9);
            for mark in &sheet.marks {
                let Mark::Words(words) = mark else { continue };
                let [x, y] = words.start;
                let end = match words.turn {
                    super::super::sheet::Turn::Right => {
                        x + Font::bundled().width(&words.text, words.size)
                    }
                    super::super::sheet::Turn::Up => x,
                };
                let is_inside = x >= 0.0 && end <= width && y > 0.0 && y < sheet.size[1];
                assert!(is_inside, "{words:?} {:?}", sheet.size);
                assert_ne!(words.text, "a note");
            }
        }
    }
}
