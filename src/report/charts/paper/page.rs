//! Parts of a figure for the page: [`figure_parts`]. Each panel is an SVG of its own, so that the page arranges panels by
//! its width and scales them, and its script has nothing to draw.

use std::collections::BTreeSet;

use super::axes::{Axes, Margins, plot_size};
use super::legend::Legend;
use super::panel::{Medium, PanelDrawing};
use super::sheet::{Anchor, Point, Shape, ShapeGroup, Sheet};
use super::svg::{escape_attribute, page_svg};
use super::{FigureColours, Look};
use crate::charts::chart::{Chart, FigureParts, INK, LineContent, PageLine, PagePanel, Panel, PlotLine, Scale};
use crate::charts::figures::short_form;
use crate::charts::paper::font::Font;
use darkqa_base::error::Result;
use darkqa_base::types::{Axis, AxisLevel};

/// Size of a panel in its own units; the style sheet scales it.
const LOOK: Look = Look { width: 340.0, font_size: 12.5, palette: FigureColours::Colour };

/// Maximum number of names side by side in a panel of the usual width (chosen).
const FEW_NAMES: usize = 5;

/// Size of a panel with rows or many names, which needs more room.
const WIDE_LOOK: Look = Look { width: 560.0, ..LOOK };

/// Width of the names right of a panel, in the units of the panel; the style sheet keeps as much free.
const NAMES: f64 = 124.0;

/// Maximum number of lines with names at their ends.
const MAX_NAMES: usize = 14;

/// Draws the parts of a chart.
///
/// # Errors
/// None in practice: only an image cannot be drawn.
pub(super) fn figure_parts(chart: &Chart) -> Result<FigureParts> {
    let legend = Legend::for_chart(chart, &LOOK);
    let lines = || chart.panels.iter().flat_map(|panel| &panel.lines);
    let levels: BTreeSet<AxisLevel> = chart.panels.iter().flat_map(Panel::levels).collect();
    let levels: Vec<AxisLevel> = levels.into_iter().collect();
    let last = chart.panels.iter().find_map(|panel| panel.levels().last().copied());
    let has_end_names = chart.is_over_levels() && matches!(&*chart.panels, [panel] if panel.lines.len() <= MAX_NAMES);
    Ok(FigureParts {
        measure: chart.panels.first().map_or_else(String::new, |panel| panel.y.title(panel)),
        legend: legend
            .samples(&LOOK)
            .map(|(entry, sample)| {
                let line = lines().find(|line| line.name == entry.name);
                Ok(PageLine {
                    name: entry.name.to_owned(),
                    model: line.and_then(|line| line.model.clone()),
                    kind: entry.kind(),
                    sample: page_svg(&sample, LOOK.font_size, " class=\"key\" aria-hidden=\"true\"")?,
                })
            })
            .collect::<Result<_>>()?,
        panels: chart.panels.iter().map(|panel| page_panel(panel, &legend, has_end_names)).collect::<Result<_>>()?,
        at: last.and_then(|last| levels.iter().position(|level| *level == last)).unwrap_or(0),
        levels: levels.into_iter().map(|level| level_text(level, &chart.panels)).collect(),
        has_end_names,
    })
}

/// A level with its severity, as in `L3 (6 EV)`. L0 has the unit of the first panel.
fn level_text(level: AxisLevel, panels: &[Panel]) -> String {
    let axis = level.axis().or_else(|| panels.iter().flat_map(Panel::levels).find_map(AxisLevel::axis));
    format!("{level} ({} {})", level.value(), axis.unwrap_or(Axis::LIGHT).unit)
}

fn page_panel(panel: &Panel, legend: &Legend<'_>, has_end_names: bool) -> Result<PagePanel> {
    let look = if is_wide(panel) { WIDE_LOOK } else { LOOK };
    let (margins, top) = (Margins::new(panel, &look), 0.5 * look.font_size);
    let size = plot_size(panel, &look, look.width - margins.with_title - margins.right);
    let axes = Axes::new(panel, [margins.with_title, top], size);
    let mut sheet = Sheet::default();
    PanelDrawing { look: &look, axes: &axes, panel, legend, medium: Medium::Page }.draw(&mut sheet, true);
    sheet.size = [look.width, axes.bottom() + margins.bottom + 0.3 * look.font_size];
    if has_end_names {
        draw_end_names(&mut sheet, &axes, &panel.lines);
    }
    let attributes = format!(" role=\"img\" aria-label=\"{}\"", escape_attribute(&description(panel)));
    Ok(PagePanel {
        title: panel.title.clone(),
        model: panel.model.clone(),
        is_wide: is_wide(panel),
        svg: page_svg(&sheet, look.tick_font_size(), &attributes)?,
    })
}

/// True for a panel of rows or of many names.
fn is_wide(panel: &Panel) -> bool {
    panel.y == Scale::Names || (panel.x == Scale::Names && panel.places().count() > FEW_NAMES)
}

/// Text about a panel for readers who do not see it.
fn description(panel: &Panel) -> String {
    let (x, y) = (panel.x.title(panel), panel.y.title(panel));
    match panel.x {
        Scale::Levels { .. } => format!("{}: {y} by level", panel.title),
        _ if panel.has_names() => {
            let values: Vec<String> = panel.places().map(|(name, text)| format!("{name} {text}")).collect();
            let title = if panel.title.is_empty() { x } else { panel.title.clone() };
            format!("{title}: {}", values.join("; "))
        }
        _ => format!("{}: {y} over {x}", panel.title),
    }
}

/// Draws the names of lines right of the panel, pushed apart, each with a leader from the end of its line.
fn draw_end_names(sheet: &mut Sheet, axes: &Axes<'_>, lines: &[PlotLine]) {
    let size = LOOK.tick_font_size();
    let right = LOOK.width;
    let mut ends: Vec<(&PlotLine, Point)> =
        lines.iter().filter_map(|line| Some((line, end(axes, &line.content)?))).collect();
    ends.sort_by(|(_, a), (_, b)| a[1].total_cmp(&b[1]));
    let heights = spread(&ends.iter().map(|(_, [_, y])| *y).collect::<Vec<_>>(), 1.25 * size, axes.bottom());
    for ((line, [x, y]), height) in ends.into_iter().zip(heights) {
        let mut name = Sheet::default();
        let colour = match line.content {
            LineContent::Flat(_) => INK,
            _ => LOOK.colour(line.style),
        };
        name.line(&[[x + 0.4 * size, y], [right + 0.1 * size, height]], &LOOK.thin_stroke(colour));
        let text = end_name(&short_name(line), size);
        name.label(&text, [right + 0.4 * size, height + 0.35 * size], size, Anchor::Start);
        let model = line.model.iter().map(|model| ("model", model.clone()));
        sheet.shapes.push(Shape::Group(ShapeGroup {
            class: "end-name",
            data: std::iter::once(("line", line.name.clone())).chain(model).collect(),
            shapes: name.shapes,
            ..ShapeGroup::default()
        }));
    }
}

/// Position of the right end of a line; `None` without a point.
fn end(axes: &Axes<'_>, content: &LineContent) -> Option<Point> {
    match content {
        LineContent::Flat(share) => Some([axes.right(), axes.y(*share)]),
        LineContent::Curve(points) => points.last().map(|(level, share)| [axes.x(level.value()), axes.y(share.value)]),
        LineContent::Marks(marks) => marks.last().map(|mark| [axes.x(mark.ev[1]), axes.y(mark.share.value)]),
        _ => None,
    }
}

/// Name of a line with the short form of its model.
fn short_name(line: &PlotLine) -> String {
    match line.model.as_deref().and_then(|model| Some((model, line.name.strip_prefix(model)?))) {
        Some((model, rest)) => format!("{}{rest}", short_form(model)),
        None => line.name.clone(),
    }
}

/// Shortens a name to the space right of the panel; the name of a model without images stays recognizable.
fn end_name(name: &str, size: f64) -> String {
    const WITHOUT: &str = " without images";
    const BRIEF: &str = ", no image";
    let (font, room) = (Font::bundled(), NAMES - 0.5 * size);
    match name.strip_suffix(WITHOUT) {
        Some(model) if font.width(name, size) > room => {
            format!("{}{BRIEF}", font.shortened(model, size, room - font.width(BRIEF, size)))
        }
        _ => font.shortened(name, size, room),
    }
}

/// Moves ascending positions apart by at least `step`, none of them beyond `end` if they fit.
fn spread(positions: &[f64], step: f64, end: f64) -> Vec<f64> {
    let mut spread: Vec<f64> = Vec::new();
    for position in positions {
        let least = spread.last().map_or(*position, |last| last + step);
        spread.push(position.max(least));
    }
    let mut most = end;
    for position in spread.iter_mut().rev() {
        *position = position.min(most);
        most = *position - step;
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::chart::LineStyle;
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;
    use darkqa_score::estimate::Estimate;

    fn parts(line: PlotLine) -> FigureParts {
        let panel = Panel::over_levels("accuracy in %", "a panel".to_owned(), vec![line, PlotLine::chance(0.25)]);
        figure_parts(&Chart { panels: vec![panel], columns: 1, note: String::new() }).unwrap()
    }

    #[test]
    fn lines_and_levels_are_named_for_the_script() {
        let level = AxisLevel::new(Kind::Sensor, Severity::L5);
        let share = Estimate { value: 0.5, low: 0.4, high: 0.6, n: 40 };
        let curve = LineContent::Curve(vec![(AxisLevel::L0, share), (level, share)]);
        let model = Some("a<b\"".to_owned());
        let line = PlotLine { model, ..PlotLine::new("a<b\" raw".to_owned(), LineStyle(1), curve) };
        let parts = parts(line);
        assert_eq!(parts.levels, ["L0 (0 EV)", "L5 (9 EV)"]);
        assert_eq!((parts.at, parts.has_end_names), (1, true));
        let svg = &parts.panels[0].svg;
        let group = "<g class=\"curve\" data-line=\"a&lt;b&quot; raw\" data-model=\"a&lt;b&quot;\">";
        assert!(svg.contains(group), "{svg}");
        assert!(svg.contains("<g data-level=\"L5\"><title>50.0 [40.0, 60.0]</title>"), "{svg}");
        assert!(svg.contains("<title>25.0</title>") && svg.contains("var(--line-1)") && !svg.contains('#'), "{svg}");
    }

    #[test]
    fn end_names_fit_and_say_what_they_are() {
        let (font, size) = (Font::bundled(), LOOK.tick_font_size());
        assert_eq!(end_name("raw", size), "raw");
        let name = end_name("a-model-of-many-letters without images", size);
        assert!(name.ends_with(", no image") && font.width(&name, size) < NAMES, "{name}");
    }

    #[test]
    fn names_are_moved_apart() {
        assert_eq!(spread(&[1.0, 2.0, 20.0], 5.0, 100.0), [1.0, 6.0, 20.0]);
        assert_eq!(spread(&[8.0, 9.0, 9.5], 5.0, 10.0), [0.0, 5.0, 10.0]);
    }
}
