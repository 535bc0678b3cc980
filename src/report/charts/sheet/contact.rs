//! Contact sheet: images in rows and columns, with a label above each column ([`contact`]).

use super::{GAP, LINE, SheetCanvas, fitted_size, lines, mean_colour};
use crate::types::Rgb;

/// Minimum width of a column in pixels, so that its label can be read.
const COLUMN: usize = 280;

/// Column of a contact sheet: label, and images from top to bottom.
#[derive(Debug)]
pub(crate) struct ContactColumn<'a> {
    pub(crate) label: String,
    pub(crate) images: Vec<&'a Rgb>,
}

/// Draws a contact sheet. Images wider than a cell are scaled down by averaging pixels.
#[must_use]
pub(crate) fn contact(columns: &[ContactColumn<'_>]) -> Rgb {
    let [height, width] = columns
        .iter()
        .flat_map(|column| &column.images)
        .map(|image| fitted_size(image))
        .fold([0, COLUMN], |[height, width], size| [height.max(size[0]), width.max(size[1])]);
    let rows = columns.iter().map(|column| column.images.len()).max();
    let labels: Vec<Vec<String>> = columns.iter().map(|column| lines(&column.label, width)).collect();
    let label_lines = labels.iter().map(Vec::len).max().unwrap_or(0);
    let head = 2 * GAP + label_lines * LINE;
    let mut sheet = SheetCanvas::new(head + rows.unwrap_or(0) * (height + GAP), GAP + columns.len() * (width + GAP));
    for (index, (column, label)) in columns.iter().zip(&labels).enumerate() {
        let left = GAP + index * (width + GAP);
        for (line, text) in label.iter().enumerate() {
            sheet.write([GAP + line * LINE, left], width, text, [0; 3]);
        }
        for (row, image) in column.images.iter().enumerate() {
            let (top, size) = (head + row * (height + GAP), fitted_size(image));
            sheet.fill([top, left], size, |y, x| mean_colour(image, size, y, x));
        }
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column<'a>(label: &str, images: Vec<&'a Rgb>) -> ContactColumn<'a> {
        ContactColumn { label: label.to_owned(), images }
    }

    /// Red code of a pixel.
    fn red(sheet: &Rgb, row: usize, column: usize) -> u8 {
        sheet.samples()[(row * sheet.width() + column) * 3]
    }

    #[test]
    fn images_are_in_their_rows_and_columns() {
        let [one, two, three] = [50, 100, 150].map(|code| Rgb::new(10, 20, vec![code; 600]).unwrap());
        let sheet = contact(&[column("a", vec![&one, &two]), column("b", vec![&three])]);
        let top = 2 * GAP + LINE;
        assert_eq!(red(&sheet, top, GAP), 50);
        assert_eq!(red(&sheet, top + 10 + GAP, GAP), 100);
        assert_eq!(red(&sheet, top, 2 * GAP + COLUMN), 150);
        assert_eq!(red(&sheet, top + 10 + GAP, 2 * GAP + COLUMN), 255);
        // A long label takes a second line.
        let label = "a label of many words that one line of a column cannot hold";
        let taller = contact(&[column(label, vec![&one])]);
        assert_eq!(red(&taller, top + LINE, GAP), 50);
    }
}
