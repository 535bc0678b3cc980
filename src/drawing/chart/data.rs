//! The data of a chart for the script of the page, which draws it again at the available width: [`ChartData`].

use serde::Serialize;

use super::{Chart, LineItems, PanelContent, PlotLine};
use crate::error::Result;
use crate::text::script::to_script_json;
use crate::text::words::{percent, with_interval};
use crate::types::degradations::Axis;
use darkqa_score::estimate::Estimate;

/// A chart as data. Shares are between 0 and 1; texts are those of tables, so that the script rounds nothing.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ChartData {
    measure: &'static str,
    panels: Vec<PanelData>,
}

#[derive(Debug, Clone, Serialize)]
struct PanelData {
    title: String,
    /// The model that all lines are about; `None` if there are several.
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
    /// Number of the style: colour, dash and mark.
    style: usize,
    model: Option<String>,
    /// The items behind its points; a click on a point shows them.
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
    /// Points at a darkness that is no level.
    Marks { points: Vec<PointData> },
}

#[derive(Debug, Clone, Serialize)]
struct PointData {
    /// The place on the horizontal axis, in its unit: lower end, middle and upper end.
    x: [f64; 3],
    /// The share, and both ends of its interval.
    y: [f64; 3],
    /// The share with its interval, as in tables.
    text: String,
}

impl ChartData {
    /// The data of a chart as JSON for a script of a page.
    ///
    /// # Errors
    /// None in practice: a chart has no value that JSON cannot hold.
    pub(crate) fn json(chart: &Chart) -> Result<String> {
        to_script_json(&Self::new(chart))
    }

    fn new(chart: &Chart) -> Self {
        let panels = chart.panels.iter().map(|panel| {
            let levels = panel.levels();
            let axis = levels.iter().find_map(|level| level.axis());
            PanelData {
                title: panel.title.clone(),
                model: panel.model.clone(),
                axis: panel.axis_title(),
                unit: axis.unwrap_or(Axis::LIGHT).unit,
                levels: levels
                    .iter()
                    .map(|level| LevelData {
                        name: level.to_string(),
                        value: level.value(),
                    })
                    .collect(),
                end: panel.farthest(),
                lines: panel.lines.iter().map(line).collect(),
            }
        });
        Self {
            measure: chart.measure,
            panels: panels.collect(),
        }
    }
}

fn line(line: &PlotLine) -> LineData {
    let content = match &line.content {
        PanelContent::Flat(share) => ContentData::Flat {
            share: *share,
            text: percent(*share),
        },
        PanelContent::Curve(points) => ContentData::Curve {
            points: points
                .iter()
                .map(|(level, share)| PointData {
                    x: [level.value(); 3],
                    y: [share.value, share.low, share.high],
                    text: text(*share),
                })
                .collect(),
        },
        PanelContent::Marks(marks) => ContentData::Marks {
            points: marks
                .iter()
                .map(|mark| PointData {
                    x: mark.ev,
                    y: [mark.share.value, mark.share.low, mark.share.high],
                    text: text(mark.share),
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

/// A share as in tables; one that is known exactly has no interval.
fn text(share: Estimate) -> String {
    if share.high <= share.low {
        return percent(share.value);
    }
    with_interval(share)
}
