//! Several images beside each other as one picture: [`montage`].

use crate::error::Result;
use crate::types::Rgb;

/// Width of the gap between two images, in pixels; chosen.
const GAP: usize = 2;

/// The grey of the gaps and behind smaller images; chosen, so that dark and bright images stand out.
const GREY: u8 = 128;

/// The number of columns for a number of images: the least with which there are no more rows than columns.
pub(crate) fn columns(images: usize) -> usize {
    (1..=images)
        .find(|columns| columns * columns >= images)
        .unwrap_or(1)
}

/// The images in rows, in order, each in its own size. All places have the size of the widest and of the highest image.
///
/// # Errors
/// None in practice: the picture has as many samples as its sides say.
pub(crate) fn montage(images: &[Rgb]) -> Result<Rgb> {
    let most = |of: fn(&Rgb) -> usize| images.iter().map(of).max().unwrap_or(1);
    let (height, width) = (most(Rgb::height), most(Rgb::width));
    let columns = columns(images.len());
    let rows = images.len().div_ceil(columns).max(1);
    let side = |count: usize, each: usize| count * (each + GAP) - GAP;
    let (picture_height, picture_width) = (side(rows, height), side(columns, width));
    let mut samples = vec![GREY; picture_height * picture_width * 3];
    for (place, image) in images.iter().enumerate() {
        let top = place / columns * (height + GAP);
        let left = place % columns * (width + GAP);
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
    fn images_stand_in_rows() {
        let images = [filled(2, 3, 1), filled(4, 2, 2), filled(1, 1, 3)];
        let picture = montage(&images).unwrap();
        assert_eq!(
            (picture.height(), picture.width()),
            (4 + GAP + 4, 3 + GAP + 3)
        );
        let at =
            |row: usize, column: usize| picture.samples()[(row * picture.width() + column) * 3];
        assert_eq!([at(1, 2), at(3, 3 + GAP + 1), at(4 + GAP, 0)], [1, 2, 3]);
        assert_eq!([at(2, 0), at(0, 3), at(4, 0), at(9, 7)], [GREY; 4]);
    }

    #[test]
    fn there_are_at_least_as_many_columns_as_rows() {
        let found = [0, 1, 2, 3, 4, 5, 9, 10].map(columns);
        assert_eq!(found, [1, 1, 2, 2, 2, 3, 3, 4]);
    }
}
