//! Drawing of the overview figure, which summarizes a run on one sheet: [`overview_sheet`].

use super::lines::lines;
use super::look::Look;
use super::rows::{arrange_in_rows, column_look};
use super::samples::{Pixels, samples};
use super::sheet::Sheet;
use crate::error::Result;
use crate::report::charts::chart::Chart;
use crate::report::charts::figures::OverviewPanels;
use crate::types::Thumbnail;

/// Number of panels in a row.
const COLUMNS: usize = 2;

/// The drawn overview, its caption, and the panels that are missing.
#[derive(Debug)]
pub(crate) struct OverviewSheet {
    pub sheet: Sheet,
    /// Letter and caption of each panel.
    pub caption: String,
    /// Name of each missing panel, and the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// The charts of the sheet, for output in other formats.
    pub charts: Vec<Chart>,
}

/// Draws up to four panels on one sheet, two in a row: the charts, then sample images. The panels that have data are
/// lettered in order.
///
/// # Errors
/// If a thumbnail that a run stored cannot be decoded.
pub(crate) fn overview_sheet(
    panels: &OverviewPanels,
    thumbnails: &[Thumbnail],
    look: &Look,
    pixels: Pixels,
) -> Result<OverviewSheet> {
    let half = column_look(COLUMNS, look);
    let mut parts: Vec<(Sheet, String)> = Vec::new();
    let (mut left_out, mut charts) = (Vec::new(), Vec::new());
    for (name, chart) in &panels.charts {
        match chart {
            Err(why) => left_out.push((*name, (*why).to_owned())),
            Ok((caption, chart)) => {
                let mut chart = chart.clone();
                for panel in &mut chart.panels {
                    panel.title = format!("({}) {}", letter(parts.len()), panel.title);
                }
                parts.push((lines(&chart, &half), caption.clone()));
                charts.push(chart);
            }
        }
    }
    match samples(panels, thumbnails, &half, letter(parts.len()), pixels)? {
        Ok(part) => parts.push(part),
        Err(why) => left_out.push(("samples", why.to_owned())),
    }
    let captions: Vec<String> =
        parts.iter().enumerate().map(|(index, (_, caption))| format!("({}) {caption}", letter(index))).collect();
    Ok(OverviewSheet {
        caption: format!("{} ({}.)", captions.join(" "), panels.note),
        sheet: arrange_in_rows(parts.into_iter().map(|(sheet, _)| sheet), COLUMNS, look),
        left_out,
        charts,
    })
}

fn letter(index: usize) -> char {
    ('a'..='z').nth(index).unwrap_or('z')
}
