//! A run on one sheet of the width of the text: [`overview_sheet`].

use super::lines::lines;
use super::look::Look;
use super::rows::{column, in_rows};
use super::samples::{Pixels, samples};
use super::sheet::Sheet;
use crate::drawing::chart::Chart;
use crate::drawing::figures::OverviewPanels;
use crate::error::Result;
use crate::types::Thumbnail;

/// Panels in a row.
const COLUMNS: usize = 2;

/// The sheet, its caption, and the panels that it lacks.
#[derive(Debug)]
pub(crate) struct OverviewSheet {
    pub sheet: Sheet,
    /// A caption for each panel, after its letter.
    pub caption: String,
    /// The panels that are left out, each with the reason.
    pub left_out: Vec<(&'static str, String)>,
    /// The charts of the sheet, for other forms.
    pub charts: Vec<Chart>,
}

/// Up to four panels on one sheet, two in a row: the charts, and samples of the images. Panels are lettered as far as there are data.
///
/// # Errors
/// If a small copy that a run stored cannot be read.
pub(crate) fn overview_sheet(
    panels: &OverviewPanels,
    thumbnails: &[Thumbnail],
    look: &Look,
    pixels: Pixels,
) -> Result<OverviewSheet> {
    let half = column(COLUMNS, look);
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
    let captions: Vec<String> = parts
        .iter()
        .enumerate()
        .map(|(place, (_, caption))| format!("({}) {caption}", letter(place)))
        .collect();
    Ok(OverviewSheet {
        caption: format!("{} ({}.)", captions.join(" "), panels.note),
        sheet: in_rows(parts.into_iter().map(|(sheet, _)| sheet), COLUMNS, look),
        left_out,
        charts,
    })
}

fn letter(place: usize) -> char {
    ('a'..='z').nth(place).unwrap_or('z')
}
