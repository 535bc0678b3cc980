//! RAW images with a Bayer mosaic of colour filters, one sample per sensor site ([`Bayer`]), and their demosaicing.

use rayon::prelude::*;

use crate::draws::{LANES, Lanes};

/// Colour plane of an RGGB mosaic: every second row and every second column of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Plane {
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
    /// All four planes, in the order in which per-plane numbers are listed.
    pub(crate) const ALL: [Self; 4] = [Self::R, Self::Gr, Self::Gb, Self::B];

    /// Plane of the site at a sensor row and column.
    #[must_use]
    pub(crate) fn at(row: usize, column: usize) -> Self {
        Self::ALL[2 * (row & 1) + (column & 1)]
    }
}

/// RAW image of even height and even width; black is 0, white is 1.
///
/// Each row is stored plane by plane, the even columns before the odd ones. A plane is padded to whole batches of
/// lanes, plus one sample for the neighbour beyond the edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Bayer {
    height: usize,
    width: usize,
    samples: Vec<f32>,
}

impl Bayer {
    /// A black image that covers `height` × `width` pixels; odd sizes and zero are rounded up to the next even size.
    #[must_use]
    pub fn covering(height: usize, width: usize) -> Self {
        let [height, width] = [height, width].map(|size| size.max(1).next_multiple_of(2));
        Self { height, width, samples: vec![0.0; height * 2 * stride(width)] }
    }

    /// Height in sensor rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width in sensor columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The sample at a site, black 0 and white 1.
    ///
    /// # Panics
    /// If the site is outside the image.
    #[must_use]
    pub fn sample(&self, row: usize, column: usize) -> f32 {
        assert!(column < self.width, "column {column} of {}", self.width);
        self.sites(row).planes[column % 2][column / 2 + column % 2]
    }

    /// Read access to the sites of a row.
    ///
    /// # Panics
    /// If the row is outside the image.
    #[must_use]
    pub(super) fn sites(&self, row: usize) -> Sites<'_> {
        let stride = stride(self.width);
        let (even, odd) = self.samples[row * 2 * stride..][..2 * stride].split_at(stride);
        Sites { planes: [even, odd] }
    }

    /// Write access to all rows, as a parallel iterator.
    pub fn lines_mut(&mut self) -> impl IndexedParallelIterator<Item = RawRow<'_>> {
        let width = self.width;
        let lines = self.samples.par_chunks_mut(2 * stride(width));
        lines.map(move |samples| RawRow { width, samples })
    }

    /// Write access to one row.
    pub(super) fn line_mut(&mut self, row: usize) -> RawRow<'_> {
        let (width, size) = (self.width, 2 * stride(self.width));
        RawRow { width, samples: &mut self.samples[row * size..][..size] }
    }
}

/// Number of samples of one plane in a row: whole batches of lanes, and one sample for the neighbour beyond the edge.
fn stride(width: usize) -> usize {
    (width / 2).next_multiple_of(LANES) + 1
}

/// Sites of one row. Beyond the edge, a plane repeats its last site: the even columns at the end of the plane, the odd
/// columns at its beginning.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sites<'a> {
    /// Even and odd columns: column 2i is at `[0][i]`, column 2i + 1 at `[1][i + 1]`.
    pub(super) planes: [&'a [f32]; 2],
}

/// Write access to one row of a RAW image.
#[derive(Debug)]
pub struct RawRow<'a> {
    width: usize,
    samples: &'a mut [f32],
}

impl RawRow<'_> {
    /// The planes of the even and the odd columns, in whole batches of lanes; samples beyond the width are never used.
    pub fn planes(&mut self) -> [&mut [Lanes<f32>]; 2] {
        let (even, odd) = self.samples.split_at_mut(stride(self.width));
        [even.as_chunks_mut().0, odd.split_at_mut(1).1.as_chunks_mut().0]
    }

    /// Repeats the last site of each plane beyond the edge. Must be called after the last change of the row.
    pub fn repeat_edges(&mut self) {
        let (n, stride) = (self.width / 2, stride(self.width));
        self.samples[n] = self.samples[n - 1];
        self.samples[stride] = self.samples[stride + 1];
    }
}

/// Colours of the even and the odd columns of a batch, channel by channel.
pub(super) type Colours = [[Lanes<f32>; 3]; 2];

/// Demosaics batch `index` of a row bilinearly, from the rows above, here and below. Planes repeat their last site
/// beyond the edges.
#[inline(always)]
pub(super) fn demosaic([above, here, below]: [Sites<'_>; 3], row: usize, index: usize, colours: &mut Colours) {
    let [even, odd] = colours;
    let [o_left, o] = here.odd(index);
    let [e, e_right] = here.even(index);
    let ([above_e, above_e_right], [below_e, below_e_right]) = (above.even(index), below.even(index));
    let ([above_o_left, above_o], [below_o_left, below_o]) = (above.odd(index), below.odd(index));
    if row.is_multiple_of(2) {
        even[0].copy_from_slice(e);
        mean_of_four(o_left, o, above_e, below_e, &mut even[1]);
        mean_of_four(above_o_left, above_o, below_o_left, below_o, &mut even[2]);
        mean_of_two(e, e_right, &mut odd[0]);
        odd[1].copy_from_slice(o);
        mean_of_two(above_o, below_o, &mut odd[2]);
    } else {
        mean_of_two(above_e, below_e, &mut even[0]);
        even[1].copy_from_slice(e);
        mean_of_two(o_left, o, &mut even[2]);
        mean_of_four(above_e, above_e_right, below_e, below_e_right, &mut odd[0]);
        mean_of_four(e, e_right, above_o, below_o, &mut odd[1]);
        odd[2].copy_from_slice(o);
    }
}

impl<'a> Sites<'a> {
    /// Lanes of the even columns, and lanes of their right neighbours in the plane.
    #[inline(always)]
    fn even(self, index: usize) -> [&'a Lanes<f32>; 2] {
        let plane = self.planes[0];
        [&plane.as_chunks().0[index], &plane[1..].as_chunks().0[index]]
    }

    /// Lanes of the left neighbours of the odd columns in the plane, and lanes of the odd columns.
    #[inline(always)]
    fn odd(self, index: usize) -> [&'a Lanes<f32>; 2] {
        let plane = self.planes[1];
        [&plane.as_chunks().0[index], &plane[1..].as_chunks().0[index]]
    }
}

#[inline(always)]
fn mean_of_two(a: &Lanes<f32>, b: &Lanes<f32>, mean: &mut Lanes<f32>) {
    for i in 0..LANES {
        mean[i] = (a[i] + b[i]) * 0.5;
    }
}

#[inline(always)]
fn mean_of_four(a: &Lanes<f32>, b: &Lanes<f32>, c: &Lanes<f32>, d: &Lanes<f32>, mean: &mut Lanes<f32>) {
    for i in 0..LANES {
        mean[i] = (a[i] + b[i] + c[i] + d[i]) * 0.25;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(height: usize, width: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Bayer {
        let mut bayer = Bayer::covering(height, width);
        bayer.lines_mut().enumerate().for_each(|(row, mut line)| {
            for (parity, plane) in line.planes().into_iter().enumerate() {
                for (i, sample) in plane.as_flattened_mut().iter_mut().enumerate() {
                    *sample = value(row, 2 * i + parity);
                }
            }
            line.repeat_edges();
        });
        bayer
    }

    fn demosaic_all(bayer: &Bayer) -> Vec<Vec<[f32; 3]>> {
        let last = bayer.height() - 1;
        (0..bayer.height())
            .map(|row: usize| {
                let around = [if row == 0 { 1 } else { row - 1 }, row, if row == last { row - 1 } else { row + 1 }];
                (0..bayer.width())
                    .map(|column: usize| {
                        let site = column / 2;
                        let mut colours = [[[0.0; LANES]; 3]; 2];
                        let rows = around.map(|row| bayer.sites(row));
                        demosaic(rows, row, site / LANES, &mut colours);
                        colours[column % 2].map(|channel| channel[site % LANES])
                    })
                    .collect()
            })
            .collect()
    }

    fn test_sample(row: usize, column: usize) -> f32 {
        ((row * 31 + column * 17) % 64) as f32
    }

    /// The nearest row or column below `size` of the same parity.
    fn clamp_in_plane(at: isize, size: usize) -> usize {
        let parity = at.rem_euclid(2);
        (at.clamp(parity, size.cast_signed() - 2 + parity)) as usize
    }

    fn channel(row: usize, column: usize) -> usize {
        match Plane::at(row, column) {
            Plane::R => 0,
            Plane::Gr | Plane::Gb => 1,
            Plane::B => 2,
        }
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
        for (height, width) in [(2, 2), (2, 8), (6, 2), (6, 8), (2, 126), (4, 130)] {
            let colours = filled(height, width, |row, column| match Plane::at(row, column) {
                Plane::R => 0.25,
                Plane::Gr | Plane::Gb => 0.5,
                Plane::B => 0.75,
            });
            for pixel in demosaic_all(&colours).iter().flatten() {
                assert_eq!(pixel.map(f32::to_bits), [0.25f32, 0.5, 0.75].map(f32::to_bits));
            }
        }
    }

    /// Reference: each channel of a pixel is the mean of the nearest sites of that colour. Beyond an edge, the last
    /// site of the plane is repeated.
    #[test]
    fn pixels_are_means_of_their_neighbours() {
        let (height, width) = (6, 132);
        let found = demosaic_all(&filled(height, width, test_sample));
        for (row, pixels) in found.iter().enumerate() {
            for (column, pixel) in pixels.iter().enumerate() {
                let mut sums = [[0.0f32; 2]; 3];
                // The site itself if it has the colour, else the sites at the smallest distance.
                for (colour, sum) in sums.iter_mut().enumerate() {
                    for distance in 0..=2isize {
                        for (down, right) in (-1..=1).flat_map(|d| (-1..=1).map(move |r| (d, r))) {
                            let [y, x] = [row.cast_signed() + down, column.cast_signed() + right];
                            let parity = [y.rem_euclid(2), x.rem_euclid(2)];
                            if down * down + right * right == distance
                                && channel(parity[0] as usize, parity[1] as usize) == colour
                            {
                                sum[0] += test_sample(clamp_in_plane(y, height), clamp_in_plane(x, width));
                                sum[1] += 1.0;
                            }
                        }
                        if sum[1] > 0.0 {
                            break;
                        }
                    }
                }
                let expected = sums.map(|[sum, n]| (sum / n).to_bits());
                assert_eq!(pixel.map(f32::to_bits), expected, "{row}, {column}");
            }
        }
    }
}
