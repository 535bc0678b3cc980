//! The content of a report's figure: [`Drawn`].

use super::Chart;
use super::bars::BarChart;
use super::data::ChartData;
use super::reliability::ReliabilityChart;
use super::thresholds::ThresholdChart;
use crate::error::Result;

/// The content of a figure.
#[derive(Debug, Clone)]
pub(crate) enum Drawn {
    Lines(Chart),
    Bars(BarChart),
    Thresholds(ThresholdChart),
    Reliability(ReliabilityChart),
}

impl Drawn {
    /// Further text of the caption: numbers of items, and the meaning of bands and bars.
    pub(crate) fn note(&self) -> String {
        match self {
            Self::Lines(chart) => chart.note.clone(),
            Self::Bars(chart) => chart.note.clone(),
            Self::Reliability(chart) => chart.note.clone(),
            Self::Thresholds(chart) => format!("lines are 95 % intervals by {}", chart.unit),
        }
    }

    /// The data of the figure for the script of the page; `None` for a figure that the page shows as it is.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn data(&self) -> Result<Option<String>> {
        match self {
            Self::Lines(chart) => ChartData::json(chart).map(Some),
            Self::Bars(_) | Self::Thresholds(_) | Self::Reliability(_) => Ok(None),
        }
    }
}
