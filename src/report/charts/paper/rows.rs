//! Arrangement of several sheets in rows and columns on one sheet: [`arrange_in_rows`].

use super::look::Look;
use super::sheet::Sheet;

/// Space between two sheets in em.
const GAP: f64 = 2.0;

/// Style of a sheet that fills one of several columns.
pub(super) fn column_look(columns: usize, look: &Look) -> Look {
    let between = GAP * look.font_size * (columns - 1) as f64;
    let width = (look.width - between) / columns as f64;
    Look { width, ..*look }
}

/// Arranges sheets of the width of a column (see [`column_look`]) in rows.
pub(super) fn arrange_in_rows(parts: impl IntoIterator<Item = Sheet>, columns: usize, look: &Look) -> Sheet {
    let gap = GAP * look.font_size;
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
            sheet.insert(part, [step * column as f64, top]);
        }
        top += tallest;
    }
    sheet.size = [look.width, top];
    sheet
}
