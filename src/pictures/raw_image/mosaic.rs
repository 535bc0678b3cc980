//! Demosaicing of integer codes, for all four Bayer patterns: [`demosaic`].
//!
//! The crate `light` has another implementation, for linear light in floats, for patterns that begin with red.

use darkqa_base::types::Sample;

/// A sample of a raw image.
pub(super) trait RawSample: Sample + Into<u32> + TryFrom<u32> {}

impl RawSample for u8 {}
impl RawSample for u16 {}

/// Appends the RGB samples of a Bayer mosaic. A missing colour of a site is the rounded mean of the two or four nearest
/// sites with that colour; beyond an edge, rows and columns are mirrored. `red` is the row and column (0 or 1) of the
/// first red site.
pub(super) fn demosaic<T: RawSample>(sites: &[T], width: usize, red: [usize; 2], samples: &mut Vec<T>) {
    let height = sites.len() / width;
    for y in 0..height {
        let [above, below] = neighbours(y, height).map(|row| &sites[row * width..][..width]);
        let here = &sites[y * width..][..width];
        for x in 0..width {
            let [left, right] = neighbours(x, width);
            let site = here[x];
            let cross = [above[x], below[x], here[left], here[right]];
            let corners = [above[left], above[right], below[left], below[right]];
            // Two neighbours are repeated, so that every mean is of four samples.
            let horizontal = [here[left], here[left], here[right], here[right]];
            let vertical = [above[x], above[x], below[x], below[x]];
            samples.extend_from_slice(&match (y % 2 == red[0], x % 2 == red[1]) {
                (true, true) => [site, mean(cross), mean(corners)],
                (false, false) => [mean(corners), mean(cross), site],
                (true, false) => [mean(horizontal), site, mean(vertical)],
                (false, true) => [mean(vertical), site, mean(horizontal)],
            });
        }
    }
}

/// The mean of four samples, rounded half up.
fn mean<T: RawSample>(sites: [T; 4]) -> T {
    let sum: u32 = sites.into_iter().map(Into::into).sum();
    T::try_from((sum + 2) / 4).unwrap_or_default()
}

/// The indices before and after `i` below `count`, mirrored at the edges so that they keep their parity.
fn neighbours(i: usize, count: usize) -> [usize; 2] {
    let last = count - 1;
    let before = if i == 0 { 1.min(last) } else { i - 1 };
    let after = if i == last { last.saturating_sub(1) } else { i + 1 };
    [before, after]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERNS: [[usize; 2]; 4] = [[0, 0], [0, 1], [1, 0], [1, 1]];

    /// The colour channel of a site: 0 red, 1 green, 2 blue.
    fn channel(y: usize, x: usize, red: [usize; 2]) -> usize {
        match (y % 2 == red[0], x % 2 == red[1]) {
            (true, true) => 0,
            (false, false) => 2,
            _ => 1,
        }
    }

    /// A mosaic with the values `value(row, column, channel)`.
    fn mosaic(width: usize, height: usize, red: [usize; 2], value: impl Fn(usize, usize, usize) -> u16) -> Vec<u16> {
        (0..height)
            .flat_map(|y| (0..width).map(move |x| (y, x)))
            .map(|(y, x)| value(y, x, channel(y, x, red)))
            .collect()
    }

    #[test]
    fn constant_colours_stay_constant_to_the_border() {
        for red in PATTERNS {
            for (width, height) in [(2, 2), (3, 5), (8, 6)] {
                let sites = mosaic(width, height, red, |_, _, channel| [10, 500, 65535][channel]);
                let mut samples = Vec::new();
                demosaic(&sites, width, red, &mut samples);
                assert_eq!(samples, [10, 500, 65535].repeat(width * height), "{red:?}");
            }
        }
    }

    /// Away from the edges, each channel of a pixel is the mean of the nearest sites with that colour.
    #[test]
    fn pixels_are_means_of_their_neighbours() {
        let (width, height) = (9, 7);
        for red in PATTERNS {
            let sites = mosaic(width, height, red, |y, x, _| ((y * 31 + x * 17) % 64) as u16);
            let mut samples = Vec::new();
            demosaic(&sites, width, red, &mut samples);
            for (y, x) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (y, x))) {
                for colour in 0..3 {
                    let of_colour: Vec<(usize, u32)> = (y - 1..=y + 1)
                        .flat_map(|j| (x - 1..=x + 1).map(move |i| (j, i)))
                        .filter(|&(j, i)| channel(j, i, red) == colour)
                        .map(|(j, i)| {
                            let distance = j.abs_diff(y) + i.abs_diff(x);
                            (distance, u32::from(sites[j * width + i]))
                        })
                        .collect();
                    let least = of_colour.iter().map(|(distance, _)| *distance).min();
                    let nearest: Vec<u32> = of_colour
                        .into_iter()
                        .filter(|(distance, _)| Some(*distance) == least)
                        .map(|(_, value)| value)
                        .collect();
                    let count = nearest.len() as u32;
                    let expected = (nearest.iter().sum::<u32>() + count / 2) / count;
                    let found = samples[(y * width + x) * 3 + colour];
                    assert_eq!(u32::from(found), expected, "{red:?} {y} {x} {colour}");
                }
            }
        }
    }

    #[test]
    fn a_single_row_or_column_does_not_panic() {
        for red in PATTERNS {
            for width in [1, 4] {
                let mut samples = Vec::new();
                demosaic(&[1_u8, 2, 3, 4], width, red, &mut samples);
                assert_eq!(samples.len(), 12);
            }
        }
    }
}
