//! Any of the charts that a report's figure can have: [`FigureChart`].

use super::Chart;
use super::bars::BarChart;
use super::data::ChartData;
use super::reliability::ReliabilityChart;
use super::thresholds::ThresholdChart;
use crate::error::Result;

/// Chart of a figure, before it is drawn.
#[derive(Debug, Clone)]
pub(crate) enum FigureChart {
    Lines(Chart),
    Bars(BarChart),
    Thresholds(ThresholdChart),
    Reliability(ReliabilityChart),
}

impl FigureChart {
    /// Text for the end of the caption: number of items, and the meaning of bands and bars.
    pub(crate) fn note(&self) -> String {
        match self {
            Self::Lines(chart) => chart.note.clone(),
            Self::Bars(chart) => chart.note.clone(),
            Self::Reliability(chart) => chart.note.clone(),
            Self::Thresholds(chart) => format!("lines are 95 % intervals by {}", chart.unit),
        }
    }

    /// Data of the chart as JSON, for the page's script; `None` for a figure that the page shows as a static image.
    ///
    /// # Errors
    /// If the data cannot be serialized.
    pub(crate) fn script_data(&self) -> Result<Option<String>> {
        match self {
            Self::Lines(chart) => ChartData::json(chart).map(Some),
            Self::Bars(_) | Self::Thresholds(_) | Self::Reliability(_) => Ok(None),
        }
    }
}
