//! A contact sheet, images in rows and columns with a label above each column: [`contact`].

use super::{GAP, LINE, SheetCanvas, fitted, lines, mean};
use crate::types::Rgb;

/// Minimum width of a column in pixels, so that its label can be read.
const COLUMN: usize = 280;

/// One column: its label and its images from top to bottom.
#[derive(Debug)]
pub(crate) struct ContactColumn<'a> {
    pub(crate) label: String,
    pub(crate) images: Vec<&'a Rgb>,
}

/// The sheet. Images wider than a cell are scaled down by means of pixels.
#[must_use]
pub(crate) fn contact(columns: &[ContactColumn<'_>]) -> Rgb {
    let size = |image: &Rgb| fitted(image.height(), image.width());
    let images = columns.iter().flat_map(|column| &column.images);
    let sizes: Vec<[usize; 2]> = images.map(|image| size(image)).collect();
    let largest = |side: usize| sizes.iter().map(|size| size[side]).max().unwrap_or(0);
    let (height, width) = (largest(0), largest(1).max(COLUMN));
    let rows = columns.iter().map(|column| column.images.len()).max();
    let labels: Vec<Vec<String>> = columns
        .iter()
        .map(|column| lines(&column.label, width))
        .collect();
    let label_lines = labels.iter().map(Vec::len).max().unwrap_or(0);
    let head = 2 * GAP + label_lines * LINE;
    let mut sheet = SheetCanvas::new(
        head + rows.unwrap_or(0) * (height + GAP),
        GAP + columns.len() * (width + GAP),
    );
    for (place, column) in columns.iter().enumerate() {
        let left = GAP + place * (width + GAP);
        for (line, text) in labels[place].iter().enumerate() {
            sheet.write([GAP + line * LINE, left], width, text, [0; 3]);
        }
        for (row, image) in column.images.iter().enumerate() {
            let (top, size) = (head + row * (height + GAP), size(image));
            sheet.fill([top, left], size, |row, column| {
                mean(image, size, row, column)
            });
        }
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_stand_in_their_rows_and_columns() {
        let image = |code: u8| Rgb::new(10, 20, vec![code; 600]).unwrap();
        let (one, two, three) = (image(50), image(100), image(150));
        let column = |label: &str, images| ContactColumn {
            label: label.to_owned(),
            images,
        };
        let sheet = contact(&[column("a", vec![&one, &two]), column("b", vec![&three])]);
        let at = |row: usize, column: usize| sheet.samples()[(row * sheet.width() + column) * 3];
        let top = 2 * GAP + LINE;
        assert_eq!(at(top, GAP), 50);
        assert_eq!(at(top + 10 + GAP, GAP), 100);
        assert_eq!(at(top, 2 * GAP + COLUMN), 150);
        assert_eq!(at(top + 10 + GAP, 2 * GAP + COLUMN), 255);
        // A long label takes a second line.
        let label = "a label of many words that one line of a column cannot hold";
        let taller = contact(&[column(label, vec![&one])]);
        assert_eq!(
            taller.samples()[((top + LINE) * taller.width() + GAP) * 3],
            50
        );
    }
}
