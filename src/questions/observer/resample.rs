//! Resampling of an image to the size of its masks: [`area_mean`].

use std::borrow::Cow;

use darkqa_base::types::Rgb;

/// Resamples an image to a width and height. Each pixel is the mean of the area that it covers, rounded half up.
#[must_use]
pub fn area_mean(image: &Rgb, [width, height]: [usize; 2]) -> Cow<'_, Rgb> {
    if [image.width(), image.height()] == [width, height] {
        return Cow::Borrowed(image);
    }
    let (columns, rows) = (spans(image.width(), width), spans(image.height(), height));
    let whole = (image.width() * image.height()) as u64;
    let mut samples = Vec::with_capacity(width * height * 3);
    for row in &rows {
        for column in &columns {
            let mut sums = [0_u64; 3];
            for (y, weight_y) in row {
                for (x, weight_x) in column {
                    let pixel = &image.samples()[(y * image.width() + x) * 3..][..3];
                    for (sum, code) in sums.iter_mut().zip(pixel) {
                        *sum += weight_x * weight_y * u64::from(*code);
                    }
                }
            }
            samples.extend(sums.map(|sum| ((sum + whole / 2) / whole) as u8));
        }
    }
    Rgb::new(height, width, samples).map_or_else(|_| Cow::Owned(Rgb::black(height, width)), Cow::Owned)
}

/// For each of `to` equal parts of `from` pixels, returns the covered pixels with their overlaps, in units of 1 / `to`
/// pixel.
fn spans(from: usize, to: usize) -> Vec<Vec<(usize, u64)>> {
    (0..to)
        .map(|part: usize| {
            let (start, end) = (part * from, (part + 1) * from);
            let pixels = start / to..end.div_ceil(to);
            pixels
                .map(|pixel| {
                    let overlap = end.min((pixel + 1) * to) - start.max(pixel * to);
                    (pixel, overlap as u64)
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_is_the_mean_of_its_area() {
        for (codes, width, size, expected) in [
            (vec![0, 30, 60], 3, [2, 1], vec![10, 50]),
            (vec![0, 30, 60], 3, [6, 1], vec![0, 0, 30, 30, 60, 60]),
            (vec![0, 10, 20, 31], 2, [1, 1], vec![15]),
            (vec![0, 10, 20, 30], 2, [2, 3], vec![0, 10, 10, 20, 20, 30]),
        ] {
            let samples = codes.iter().flat_map(|code| [*code; 3]).collect();
            let image = Rgb::new(codes.len() / width, width, samples).unwrap();
            let resized = area_mean(&image, size);
            let codes: Vec<u8> = resized.samples().iter().step_by(3).copied().collect();
            assert_eq!(codes, expected);
        }
    }
}
