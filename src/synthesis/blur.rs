//! Motion blur in linear light: [`blur`], and [`blurred_codes`] for a picture that is otherwise as it was.
//!
//! Each sample is the mean of the light along the [path](Streak). Beyond an edge of the picture stands the edge's own pixel.
//! Rows do not depend on each other. Along a row all inner weights are equal; their sum is made of sums of 1, 2, 4 … pixels,
//! which takes few additions at any length. Along other paths the weighted pixels are added in the order of their offsets.

use rayon::prelude::*;

use super::clean::Clean;
use super::codes::{encode, shown_light};
use super::curve;
use super::lanes::{Isa, Kernel, LANES, Lanes};
use super::streak::{Streak, Tap};
use crate::types::{Light, Rgb};

/// Version of motion blur, raised whenever a pixel changes.
pub(crate) const VERSION: u32 = 1;

/// The light of a picture, blurred along a path.
#[must_use]
pub fn blur(clean: Clean<'_>, streak: Streak) -> Light {
    let blur = Blur::new(clean, streak, Isa::best());
    let mut blurred = Light::black(clean.height(), clean.width());
    let rows = blurred.samples_mut().par_chunks_mut(3 * clean.width());
    rows.enumerate()
        .for_each_init(Scratch::default, |scratch, (row, light)| {
            blur.row(row, scratch, light);
        });
    blurred
}

/// A picture blurred along a path, in 8-bit codes. Of codes that stand still, they are unchanged.
#[must_use]
pub fn blurred_codes<'a>(clean: impl Into<Clean<'a>>, streak: Streak) -> Rgb {
    let clean = clean.into();
    if let (Clean::Codes(codes), true) = (clean, streak.is_still()) {
        return codes.clone();
    }
    let mut blurred = Rgb::black(clean.height(), clean.width());
    let isa = Isa::best();
    let blur = Blur::new(clean, streak, isa);
    let width = 3 * clean.width();
    let rows = blurred.samples_mut().par_chunks_mut(width).enumerate();
    rows.for_each_init(
        || (Scratch::default(), vec![0.0; width]),
        |(scratch, light), (row, codes)| {
            blur.row(row, scratch, light);
            encode(light, codes, isa);
        },
    );
    blurred
}

/// The light of a picture and the weights of a path, ready for any row.
struct Blur {
    /// Light in rows of `stride` samples: the picture with the edge pixels repeated in a margin on both sides.
    light: Vec<f32>,
    height: usize,
    stride: usize,
    /// Pixels of a margin.
    margin: usize,
    weights: Weights,
    isa: Isa,
}

/// How the weighted pixels of a path are summed.
#[derive(Debug)]
enum Weights {
    /// One by one.
    Each(Vec<Tap>),
    /// Along a row.
    Row(RowWeights),
}

/// The weights of a path along a row.
#[derive(Debug)]
struct RowWeights {
    /// Number of pixels in the middle that have one weight; odd.
    equal: usize,
    /// This weight.
    weight: f32,
    /// The weights of the other pixels by their distance from the middle, on both sides.
    pairs: Vec<(usize, f32)>,
}

/// Smallest number of equal weights for which sums of sums take less time; chosen.
const FEWEST_EQUAL: usize = 5;

impl Weights {
    fn of(streak: Streak) -> Self {
        let taps = streak.taps();
        match RowWeights::of(&taps) {
            Some(row) if row.equal >= FEWEST_EQUAL => Self::Row(row),
            _ => Self::Each(taps),
        }
    }
}

impl RowWeights {
    /// The weights of a path along a row; `None` for another path.
    fn of(taps: &[Tap]) -> Option<Self> {
        if taps.iter().any(|tap| tap.offset[1] != 0) {
            return None;
        }
        // The right half of the symmetric weights, from the middle.
        let half: Vec<f64> = taps[taps.len() / 2..]
            .iter()
            .map(|tap| tap.weight)
            .collect();
        let inner = half
            .iter()
            .take_while(|weight| (*weight - half[0]).abs() < 1e-12);
        let inner = inner.count();
        let pairs = (inner..half.len()).map(|at| (at, half[at] as f32));
        Some(Self {
            equal: 2 * inner - 1,
            weight: half[0] as f32,
            pairs: pairs.collect(),
        })
    }
}

/// Buffers of one thread.
#[derive(Debug, Default)]
struct Scratch {
    /// Where the light of each tap begins, and its weight.
    places: Vec<(usize, f32)>,
    /// Sums of 1, 2, 4 … pixels.
    sums: Vec<f32>,
}

impl Blur {
    fn new(clean: Clean<'_>, streak: Streak, isa: Isa) -> Self {
        let taps = streak.taps();
        let reach = taps.iter().map(|tap| tap.offset[0].unsigned_abs()).max();
        let margin = reach.unwrap_or_default();
        let (height, width) = (clean.height(), clean.width());
        let stride = 3 * (width + 2 * margin);
        // Whole lanes are read, of which the last ones are beyond the row.
        let mut light = vec![0.0; height * stride + 2 * LANES];
        let rows = light[..height * stride].par_chunks_mut(stride).enumerate();
        rows.for_each(|(row, padded)| {
            let samples = row * 3 * width..(row + 1) * 3 * width;
            let inside = &mut padded[3 * margin..3 * (margin + width)];
            match clean {
                Clean::Codes(codes) => {
                    let shown = shown_light();
                    for (light, code) in inside.iter_mut().zip(&codes.samples()[samples]) {
                        *light = shown[usize::from(*code)];
                    }
                }
                Clean::Codes16(codes) => {
                    for (light, code) in inside.iter_mut().zip(&codes.samples()[samples]) {
                        *light = curve::gamma_expand(f64::from(*code) / 65_535.0) as f32;
                    }
                }
                Clean::Light(light) | Clean::Scene(light) => {
                    inside.copy_from_slice(&light.samples()[samples]);
                }
            }
            repeat_edges(padded, margin);
        });
        Self {
            light,
            height,
            stride,
            margin,
            weights: Weights::of(streak),
            isa,
        }
    }

    /// Writes a row of blurred light.
    fn row(&self, row: usize, scratch: &mut Scratch, blurred: &mut [f32]) {
        match &self.weights {
            Weights::Each(taps) => {
                scratch.places.clear();
                scratch.places.extend(taps.iter().map(|tap| {
                    let [right, down] = tap.offset;
                    let row = row.saturating_add_signed(down).min(self.height - 1);
                    let column = self.margin.saturating_add_signed(right);
                    (row * self.stride + 3 * column, tap.weight as f32)
                }));
                self.isa.run(EachTap {
                    light: &self.light,
                    places: &scratch.places,
                    blurred,
                });
            }
            Weights::Row(weights) => {
                scratch.sums.resize(self.stride + 2 * LANES, 0.0);
                self.isa.run(AlongRow {
                    light: &self.light[row * self.stride..][..self.stride + 2 * LANES],
                    margin: self.margin,
                    weights,
                    sums: &mut scratch.sums,
                    blurred,
                });
            }
        }
    }
}

/// Fills both margins of a row with the picture's first and last pixel.
fn repeat_edges(padded: &mut [f32], margin: usize) {
    let pixels = padded.as_chunks_mut::<3>().0;
    let (first, last) = (pixels[margin], pixels[pixels.len() - margin - 1]);
    let end = pixels.len() - margin;
    pixels[..margin].fill(first);
    pixels[end..].fill(last);
}

/// The lanes of `light` from a place on.
#[inline(always)]
fn lanes(light: &[f32], from: usize) -> Lanes<f32> {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&light[from..from + LANES]);
    lanes
}

/// A row of sums of weighted pixels.
struct EachTap<'a> {
    light: &'a [f32],
    /// Where the light of each tap begins for the first pixel of the row, and its weight.
    places: &'a [(usize, f32)],
    blurred: &'a mut [f32],
}

impl Kernel for EachTap<'_> {
    #[inline(always)]
    fn run(self) {
        for (index, blurred) in self.blurred.chunks_mut(LANES).enumerate() {
            let mut sum = [0.0; LANES];
            for (place, weight) in self.places {
                let light = lanes(self.light, place + index * LANES);
                for i in 0..LANES {
                    sum[i] += weight * light[i];
                }
            }
            blurred.copy_from_slice(&sum[..blurred.len()]);
        }
    }
}

/// A row blurred along itself.
struct AlongRow<'a> {
    /// The row with its margins, and two lanes more.
    light: &'a [f32],
    margin: usize,
    weights: &'a RowWeights,
    sums: &'a mut [f32],
    blurred: &'a mut [f32],
}

impl Kernel for AlongRow<'_> {
    #[inline(always)]
    fn run(self) {
        let RowWeights {
            equal,
            weight,
            pairs,
        } = self.weights;
        // The sums begin at the leftmost of the equal pixels. A sum of `size` pixels stands where its first pixel is.
        let first = 3 * (self.margin - equal / 2);
        let mut needed = self.blurred.len() + 3 * (equal - 1);
        self.sums[..needed].copy_from_slice(&self.light[first..first + needed]);
        self.sums[needed..].fill(0.0);
        self.blurred.fill(0.0);
        let (mut size, mut begin) = (1, 0);
        loop {
            if equal & size != 0 {
                for (sum, part) in self.blurred.iter_mut().zip(&self.sums[3 * begin..]) {
                    *sum += part;
                }
                begin += size;
            }
            if 2 * size > *equal {
                break;
            }
            needed -= 3 * size;
            double(self.sums, 3 * size, needed);
            size *= 2;
        }
        let middle = 3 * self.margin;
        for (index, blurred) in self.blurred.chunks_mut(LANES).enumerate() {
            let at = index * LANES;
            let mut sum = [0.0; LANES];
            for (sum, equal) in sum.iter_mut().zip(&*blurred) {
                *sum = weight * equal;
            }
            for (distance, weight) in pairs {
                let left = lanes(self.light, middle + at - 3 * distance);
                let right = lanes(self.light, middle + at + 3 * distance);
                for i in 0..LANES {
                    sum[i] += weight * (left[i] + right[i]);
                }
            }
            blurred.copy_from_slice(&sum[..blurred.len()]);
        }
    }
}

/// Adds to each of the first `needed` sums the one that is `distance` samples to the right.
#[inline(always)]
fn double(sums: &mut [f32], distance: usize, needed: usize) {
    for at in (0..needed).step_by(LANES) {
        let mut sum = lanes(sums, at);
        let right = lanes(sums, at + distance);
        for i in 0..LANES {
            sum[i] += right[i];
        }
        sums[at..at + LANES].copy_from_slice(&sum);
    }
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;

    /// Textured pixels, a bright lamp and a dark corner.
    fn picture(height: usize, width: usize) -> Rgb {
        let sample = |i: usize| match (i / 3 / width, i / 3 % width) {
            (row, column) if row < 4 && column < 4 => 0,
            (row, column) if row % 9 == 5 && column % 11 == 6 => 255,
            _ => (i.wrapping_mul(2_654_435_761) >> 24) as u8,
        };
        Rgb::new(height, width, (0..3 * height * width).map(sample).collect()).unwrap()
    }

    fn streak(length: f64, angle: f64) -> Streak {
        Streak::new(length, angle).unwrap()
    }

    /// The definition in double precision: each pixel is the weighted mean of its neighbours, the edge repeated.
    fn defined(clean: &Rgb, streak: Streak) -> Vec<f64> {
        let (height, width) = (clean.height(), clean.width());
        let light = |row: usize, column: usize, channel: usize| {
            let code = clean.samples()[3 * (row * width + column) + channel];
            libm::pow(f64::from(code) / 255.0, 2.2)
        };
        let taps = streak.taps();
        let mut blurred = Vec::new();
        for i in 0..3 * height * width {
            let (row, column, channel) = (i / 3 / width, i / 3 % width, i % 3);
            let weighted = taps.iter().map(|tap| {
                let [right, down] = tap.offset;
                let row = row.saturating_add_signed(down).min(height - 1);
                let column = column.saturating_add_signed(right).min(width - 1);
                tap.weight * light(row, column, channel)
            });
            blurred.push(weighted.sum());
        }
        blurred
    }

    const PATHS: [(f64, f64); 14] = [
        (0.3, 0.0),
        (1.0, 0.0),
        (2.5, 0.0),
        (5.9, 0.0),
        (6.0, 180.0),
        (6.78, 0.0),
        (13.3, 0.0),
        (16.0, 0.0),
        (31.99, 0.0),
        (64.0, 0.0),
        (16.0, 90.0),
        (5.5, 30.0),
        (16.0, 137.0),
        (64.0, 45.0),
    ];

    #[test]
    fn light_is_the_weighted_mean_of_the_path() {
        for (height, width) in [(23, 61), (3, 5), (1, 1), (40, 150)] {
            let clean = picture(height, width);
            for (length, angle) in PATHS {
                let expected = defined(&clean, streak(length, angle));
                let found = blur((&clean).into(), streak(length, angle));
                for (found, expected) in found.samples().iter().zip(&expected) {
                    let off = (f64::from(*found) - expected).abs();
                    let bound = 2e-7 + 1e-6 * expected;
                    assert!(off < bound, "{length} at {angle}: {found} {expected}");
                }
                let codes = blurred_codes(&clean, streak(length, angle));
                for (code, light) in codes.samples().iter().zip(&expected) {
                    let exact = 255.0 * libm::pow(*light, 1.0 / 2.2);
                    assert!(
                        (f64::from(*code) - exact).abs() < 0.501,
                        "{length} at {angle}"
                    );
                }
            }
        }
    }

    /// A white edge blurred over four pixels: 99, 163, 206 and 240. Blurred in codes it would be 32, 96, 159 and 223.
    #[test]
    fn an_edge_is_blurred_in_light_and_not_in_codes() {
        let edge = (0..36).map(|i| if i < 18 { 0 } else { 255 }).collect();
        let edge = Rgb::new(1, 12, edge).unwrap();
        let blurred = blurred_codes(&edge, streak(4.0, 0.0));
        let red: Vec<u8> = blurred.samples().iter().step_by(3).copied().collect();
        assert_eq!(red, [0, 0, 0, 0, 99, 163, 206, 240, 255, 255, 255, 255]);
    }

    #[test]
    fn still_and_even_pictures_are_unchanged() {
        let clean = picture(9, 17);
        assert_eq!(blurred_codes(&clean, streak(0.0, 33.0)), clean);
        assert_ne!(blurred_codes(&clean, streak(0.4, 33.0)), clean);
        for code in [0, 1, 2, 128, 254, 255] {
            let even = Rgb::new(8, 9, vec![code; 3 * 72]).unwrap();
            for (length, angle) in PATHS {
                let blurred = blurred_codes(&even, streak(length, angle));
                assert_eq!(blurred, even, "{code}, {length} at {angle}");
            }
        }
    }

    /// Neither threads nor the instruction set change a bit, and light goes in as the codes that it is of.
    #[test]
    fn threads_and_instructions_change_nothing() {
        let clean = picture(40, 150);
        let light = clean.samples().iter();
        let light = light.map(|code| shown_light()[usize::from(*code)]);
        let light = Light::new(40, 150, light.collect()).unwrap();
        for (length, angle) in PATHS {
            let path = streak(length, angle);
            let expected = blur((&clean).into(), path);
            assert_eq!(blur((&light).into(), path), expected);
            for threads in [1, 3] {
                let pool = ThreadPoolBuilder::new().num_threads(threads).build();
                let found = pool.unwrap().install(|| blur((&clean).into(), path));
                assert_eq!(found, expected, "{threads} threads, {length} at {angle}");
            }
            for isa in Isa::available() {
                let blur = Blur::new((&clean).into(), path, isa);
                let mut scratch = Scratch::default();
                for row in [0, 20, 39] {
                    let mut found = vec![7.0; 450];
                    blur.row(row, &mut scratch, &mut found);
                    assert_eq!(found, expected.samples()[450 * row..][..450], "{isa:?}");
                }
            }
        }
    }
}
