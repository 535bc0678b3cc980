//! Sheets beside and below each other: [`in_rows`].

use super::look::Look;
use super::sheet::Sheet;

/// Room between two sheets, in heights of letters.
const GAP: f64 = 2.0;

/// The look of a sheet in one of some columns.
pub(super) fn column(columns: usize, look: &Look) -> Look {
    let between = GAP * look.letters * (columns - 1) as f64;
    let width = (look.width - between) / columns as f64;
    Look { width, ..*look }
}

/// Sheets of the width of a [`column()`], in rows.
pub(super) fn in_rows(
    parts: impl IntoIterator<Item = Sheet>,
    columns: usize,
    look: &Look,
) -> Sheet {
    let gap = GAP * look.letters;
    let step = (look.width + gap) / columns as f64;
    let mut sheet = Sheet::default();
    let (mut top, mut parts) = (0.0, parts.into_iter());
    loop {
        let row: Vec<Sheet> = parts.by_ref().take(columns).collect();
        if row.is_empty() {
            break;
        }
        top += if top > 0.0 { gap / 2.0 } else { 0.0 };
        let tallest = row.iter().map(|part| part.size[1]).fold(0.0, f64::max);
        for (column, part) in row.into_iter().enumerate() {
            sheet.place(part, [step * column as f64, top]);
        }
        top += tallest;
    }
    sheet.size = [look.width, top];
    sheet
}
