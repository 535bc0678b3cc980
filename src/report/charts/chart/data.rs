//! Data of a line chart for the page's script, which redraws it at the available width: [`ChartData`].

use serde::Serialize;

use super::{Chart, LineContent, LineItems, Panel, PlotLine};
use crate::error::Result;
use crate::report::text::script::to_script_json;
use crate::report::text::words::{percent, with_interval};
use crate::types::degradations::Axis;

/// A line chart as data. Shares are between 0 and 1. Texts are formatted as in tables, so that the script rounds
/// nothing.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ChartData {
    measure: &'static str,
    panels: Vec<PanelData>,
}

#[derive(Debug, Clone, Serialize)]
struct PanelData {
    title: String,
    /// The model of all lines; `None` if there are several.
    model: Option<String>,
    /// Title of the horizontal axis.
    axis: String,
    unit: &'static str,
    levels: Vec<LevelData>,
    /// Right end of the horizontal axis, in its unit.
    end: f64,
    lines: Vec<LineData>,
}

#[derive(Debug, Clone, Serialize)]
struct LevelData {
    name: String,
    value: f64,
}

#[derive(Debug, Clone, Serialize)]
struct LineData {
    name: String,
    /// Number of the line's style: colour, dash and mark.
    style: usize,
    model: Option<String>,
    /// Filter for the list of items, applied when a point is clicked.
    #[serde(skip_serializing_if = "Option::is_none")]
    items: Option<LineItems>,
    #[serde(flatten)]
    content: ContentData,
}

#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum ContentData {
    /// Points over the levels.
    Curve { points: Vec<PointData> },
    /// One share at all levels.
    Flat { share: f64, text: String },
    /// Photographs in the dark, which are not at a level.
    Marks { points: Vec<PointData> },
}

#[derive(Debug, Clone, Serialize)]
struct PointData {
    /// Position on the horizontal axis, in its unit: lower end, middle and upper end.
    x: [f64; 3],
    /// Share, and both ends of its interval.
    y: [f64; 3],
    /// Share with its interval, as in tables.
    text: String,
}

impl ChartData {
    /// Serializes a chart as JSON that can be embedded in a page's script.
    ///
    /// # Errors
    /// None in practice: JSON can represent every value of a chart.
    pub(crate) fn json(chart: &Chart) -> Result<String> {
        to_script_json(&Self::new(chart))
    }

    fn new(chart: &Chart) -> Self {
        Self { measure: chart.measure, panels: chart.panels.iter().map(panel_data).collect() }
    }
}

fn panel_data(panel: &Panel) -> PanelData {
    let levels = panel.levels();
    let axis = levels.iter().find_map(|level| level.axis());
    PanelData {
        title: panel.title.clone(),
        model: panel.model.clone(),
        axis: panel.axis_title(),
        unit: axis.unwrap_or(Axis::LIGHT).unit,
        levels: levels.iter().map(|level| LevelData { name: level.to_string(), value: level.value() }).collect(),
        end: panel.axis_end(),
        lines: panel.lines.iter().map(line_data).collect(),
    }
}

fn line_data(line: &PlotLine) -> LineData {
    let content = match &line.content {
        LineContent::Flat(share) => ContentData::Flat { share: *share, text: percent(*share) },
        LineContent::Curve(points) => ContentData::Curve {
            points: points
                .iter()
                .map(|(level, share)| PointData {
                    x: [level.value(); 3],
                    y: [share.value, share.low, share.high],
                    text: with_interval(*share),
                })
                .collect(),
        },
        LineContent::Marks(marks) => ContentData::Marks {
            points: marks
                .iter()
                .map(|mark| PointData {
                    x: mark.ev,
                    y: [mark.share.value, mark.share.low, mark.share.high],
                    text: with_interval(mark.share),
                })
                .collect(),
        },
    };
    LineData {
        name: line.name.clone(),
        style: line.style.0,
        model: line.model.clone(),
        items: line.items.clone(),
        content,
    }
}
