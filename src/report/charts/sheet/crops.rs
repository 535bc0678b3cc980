//! Sheet of crops from the middle of images, side by side: [`crops`].

use super::{CELL, GAP, LINE, SheetCanvas};
use crate::types::Rgb;

/// Row of crops. All its images have the same size.
#[derive(Debug, Clone)]
pub(crate) struct CropRow<'a> {
    /// Label of the row.
    pub name: String,
    /// One image for each column.
    pub images: Vec<&'a Rgb>,
    /// Factor by which the images are brightened in linear light.
    pub gain: f64,
}

/// Draws the middle of each image at full resolution, brightened by the gain of its row, below the column names.
#[must_use]
pub(crate) fn crops(columns: &[&str], rows: &[CropRow<'_>]) -> Rgb {
    let height = CELL * 2 / 3;
    let step = [LINE + height + GAP, CELL + GAP];
    let mut sheet = SheetCanvas::new(GAP + LINE + rows.len() * step[0], GAP + columns.len().max(1) * step[1]);
    for (index, name) in columns.iter().enumerate() {
        sheet.write([GAP, GAP + index * step[1]], CELL, name, [0; 3]);
    }
    for (index, row) in rows.iter().enumerate() {
        let top = GAP + LINE + index * step[0];
        let label = format!("{}, light × {:.1}", row.name, row.gain);
        sheet.write([top, GAP], sheet.width - GAP, &label, [90; 3]);
        // Codes are gamma-encoded.
        let scale = libm::pow(row.gain.max(0.0), 1.0 / 2.2);
        for (column, image) in row.images.iter().enumerate() {
            let size = [image.height().min(height), image.width().min(CELL)];
            let first = [(image.height() - size[0]) / 2, (image.width() - size[1]) / 2];
            let corner = [top + LINE, GAP + column * step[1]];
            sheet.fill(corner, size, |y, x| {
                let index = ((first[0] + y) * image.width() + first[1] + x) * 3;
                [0, 1, 2].map(|channel| {
                    let code = f64::from(image.samples()[index + channel]);
                    (code * scale).round().min(255.0) as u8
                })
            });
        }
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_are_brightened() {
        let image = Rgb::new(3, 500, vec![10; 4500]).unwrap();
        let rows = [CropRow { name: "a".to_owned(), images: vec![&image, &image], gain: 4.0 }];
        let sheet = crops(&["real", "made"], &rows);
        let brightened = sheet.samples().chunks(3).filter(|pixel| **pixel == [19; 3]).count();
        assert!(brightened >= 2 * 3 * CELL);
        assert!(crops(&[], &[]).width() > 0);
    }
}
