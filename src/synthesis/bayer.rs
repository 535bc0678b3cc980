//! The sensor's picture: one sample a site under a mosaic of red, green and blue filters ([`Bayer`]).

use rayon::prelude::*;

/// The four colour planes of an RGGB mosaic, each of half the height and half the width.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// Red: even rows, even columns.
    R,
    /// Green in the rows of red: even rows, odd columns.
    Gr,
    /// Green in the rows of blue: odd rows, even columns.
    Gb,
    /// Blue: odd rows, odd columns.
    B,
}

impl Plane {
    /// All four, in the order in which per-plane numbers are listed.
    pub const ALL: [Self; 4] = [Self::R, Self::Gr, Self::Gb, Self::B];

    /// The plane of a sensor site.
    #[must_use]
    pub fn at(row: usize, column: usize) -> Self {
        Self::ALL[2 * (row & 1) + (column & 1)]
    }
}

/// A RAW image: even height × even width, row by row in the sensor's own order, black 0 and white 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Bayer {
    height: usize,
    width: usize,
    samples: Vec<f32>,
}

impl Bayer {
    /// A black image that covers `height` × `width` pixels: odd sizes, and zero, go up to the next even one.
    #[must_use]
    pub fn covering(height: usize, width: usize) -> Self {
        let [height, width] = [height, width].map(|size| size.max(1).next_multiple_of(2));
        Self {
            height,
            width,
            samples: vec![0.0; height * width],
        }
    }

    /// The height in sensor rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The width in sensor columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The samples of a sensor row.
    ///
    /// # Panics
    /// Where there is no such row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.samples[row * self.width..][..self.width]
    }

    /// All rows, to be changed in parallel.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        self.samples.par_chunks_mut(self.width)
    }

    /// Interpolates one row of pixels bilinearly, each plane replicated beyond its edges. `pixels` may be shorter than
    /// the row.
    ///
    /// A plane's replicated neighbour lies two sites back, so that beyond an edge the mosaic is mirrored at its last
    /// site: −1 reads 1.
    pub fn demosaic_row(&self, row: usize, pixels: &mut [[f32; 3]]) {
        let above = self.row(if row == 0 { 1 } else { row - 1 });
        let here = self.row(row);
        let below = self.row(if row + 1 == self.height {
            row - 1
        } else {
            row + 1
        });
        let fill = if row.is_multiple_of(2) {
            red_pair
        } else {
            blue_pair
        };
        for (i, pair) in pixels.chunks_mut(2).enumerate() {
            let even = 2 * i;
            let odd = even + 1;
            let left = if even == 0 { odd } else { even - 1 };
            let right = if odd + 1 == self.width { even } else { odd + 1 };
            let columns = [left, even, odd, right];
            let both = fill([above, here, below].map(|line| columns.map(|column| line[column])));
            pair.copy_from_slice(&both[..pair.len()]);
        }
    }
}

/// Three rows of four neighbouring sites, of which the middle two are interpolated.
type Window = [[f32; 4]; 3];

/// The two pixels of a red and a green site.
fn red_pair([u, m, d]: Window) -> [[f32; 3]; 2] {
    [
        [
            m[1],
            (m[0] + m[2] + u[1] + d[1]) * 0.25,
            (u[0] + u[2] + d[0] + d[2]) * 0.25,
        ],
        [(m[1] + m[3]) * 0.5, m[2], (u[2] + d[2]) * 0.5],
    ]
}

/// The two pixels of a green and a blue site.
fn blue_pair([u, m, d]: Window) -> [[f32; 3]; 2] {
    [
        [(u[1] + d[1]) * 0.5, m[1], (m[0] + m[2]) * 0.5],
        [
            (u[1] + u[3] + d[1] + d[3]) * 0.25,
            (m[1] + m[3] + u[2] + d[2]) * 0.25,
            m[2],
        ],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(height: usize, width: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Bayer {
        let mut bayer = Bayer::covering(height, width);
        bayer.rows_mut().enumerate().for_each(|(row, line)| {
            for (column, sample) in line.iter_mut().enumerate() {
                *sample = value(row, column);
            }
        });
        bayer
    }

    fn demosaic(bayer: &Bayer) -> Vec<Vec<[f32; 3]>> {
        let mut rows = vec![vec![[0.0; 3]; bayer.width()]; bayer.height()];
        for (row, pixels) in rows.iter_mut().enumerate() {
            bayer.demosaic_row(row, pixels);
        }
        rows
    }

    #[test]
    fn odd_sizes_are_covered() {
        for (size, covered) in [((1, 1), (2, 2)), ((1, 6), (2, 6)), ((5, 2), (6, 2))] {
            let bayer = Bayer::covering(size.0, size.1);
            assert_eq!((bayer.height(), bayer.width()), covered);
        }
    }

    #[test]
    fn constant_planes_stay_constant_to_the_border() {
        for (height, width) in [(2, 2), (2, 8), (6, 2), (6, 8)] {
            let colours = filled(height, width, |row, column| match Plane::at(row, column) {
                Plane::R => 0.25,
                Plane::Gr | Plane::Gb => 0.5,
                Plane::B => 0.75,
            });
            for pixel in demosaic(&colours).iter().flatten() {
                assert_eq!(
                    pixel.map(f32::to_bits),
                    [0.25f32, 0.5, 0.75].map(f32::to_bits)
                );
            }
        }
    }

    /// Written from the definition: each pixel's channel is the mean of the nearest sites of that colour, sites beyond
    /// an edge being the plane's last one.
    #[test]
    fn pixels_are_means_of_their_neighbours() {
        let (height, width) = (6, 8);
        let value = |row: usize, column: usize| ((row * 31 + column * 17) % 64) as f32;
        let found = demosaic(&filled(height, width, value));
        let clamp = |at: isize, size: usize| {
            let parity = at.rem_euclid(2);
            (at.clamp(parity, size.cast_signed() - 2 + parity)) as usize
        };
        let channel = |row: isize, column: isize| match Plane::at(row as usize, column as usize) {
            Plane::R => 0,
            Plane::Gr | Plane::Gb => 1,
            Plane::B => 2,
        };
        for (row, pixels) in found.iter().enumerate() {
            for (column, pixel) in pixels.iter().enumerate() {
                let mut sums = [[0.0f32; 2]; 3];
                // The site itself where it has the colour; else those at the smallest distance.
                for (colour, sum) in sums.iter_mut().enumerate() {
                    for distance in 0..=2isize {
                        for (down, right) in (-1..=1).flat_map(|d| (-1..=1).map(move |r| (d, r))) {
                            let [y, x] = [row.cast_signed() + down, column.cast_signed() + right];
                            let parity = [y.rem_euclid(2), x.rem_euclid(2)];
                            if down * down + right * right == distance
                                && channel(parity[0], parity[1]) == colour
                            {
                                sum[0] += value(clamp(y, height), clamp(x, width));
                                sum[1] += 1.0;
                            }
                        }
                        if sum[1] > 0.0 {
                            break;
                        }
                    }
                }
                let due = sums.map(|[sum, n]| (sum / n).to_bits());
                assert_eq!(pixel.map(f32::to_bits), due, "{row}, {column}");
            }
        }
    }
}
