//! Several images in one picture, arranged in rows: [`montage`].

use crate::error::Result;
use crate::types::Rgb;

/// Width of the gap between two images, in pixels; chosen.
const GAP: usize = 2;

/// Grey code of the background; chosen so that dark and bright images stand out.
const GREY: u8 = 128;

/// The smallest number of columns for which there are at most as many rows as columns.
pub(crate) fn columns(images: usize) -> usize {
    (1..=images).find(|columns| columns * columns >= images).unwrap_or(1)
}

/// Arranges images in rows, unscaled. Each cell has the width of the widest image and the height of the highest.
///
/// # Errors
/// None in practice: the number of samples follows from the sides.
pub(crate) fn montage(images: &[Rgb]) -> Result<Rgb> {
    let height = images.iter().map(Rgb::height).max().unwrap_or(1);
    let width = images.iter().map(Rgb::width).max().unwrap_or(1);
    let columns = columns(images.len());
    let rows = images.len().div_ceil(columns).max(1);
    let picture_height = rows * (height + GAP) - GAP;
    let picture_width = columns * (width + GAP) - GAP;
    let mut samples = vec![GREY; picture_height * picture_width * 3];
    for (index, image) in images.iter().enumerate() {
        let top = index / columns * (height + GAP);
        let left = index % columns * (width + GAP);
        let lines = image.samples().chunks_exact(image.width() * 3);
        for (row, line) in lines.enumerate() {
            let start = ((top + row) * picture_width + left) * 3;
            samples[start..start + line.len()].copy_from_slice(line);
        }
    }
    Rgb::new(picture_height, picture_width, samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(height: usize, width: usize, code: u8) -> Rgb {
        Rgb::new(height, width, vec![code; height * width * 3]).unwrap()
    }

    #[test]
    fn images_are_arranged_in_rows() {
        let images = [filled(2, 3, 1), filled(4, 2, 2), filled(1, 1, 3)];
        let picture = montage(&images).unwrap();
        assert_eq!((picture.height(), picture.width()), (4 + GAP + 4, 3 + GAP + 3));
        let code = |[row, column]: [usize; 2]| picture.samples()[(row * picture.width() + column) * 3];
        assert_eq!([[1, 2], [3, 3 + GAP + 1], [4 + GAP, 0]].map(code), [1, 2, 3]);
        assert_eq!([[2, 0], [0, 3], [4, 0], [9, 7]].map(code), [GREY; 4]);
    }

    #[test]
    fn columns_are_the_smallest_number_not_below_rows() {
        let found = [0, 1, 2, 3, 4, 5, 9, 10].map(columns);
        assert_eq!(found, [1, 1, 2, 2, 2, 3, 3, 4]);
    }
}
