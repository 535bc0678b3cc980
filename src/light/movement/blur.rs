//! Motion blur in linear light: [`blur`] returns light, [`blurred_codes`] 8-bit codes.
//!
//! Each sample is the weighted mean of the light along the [path](Streak); edge pixels are repeated beyond the edges.
//! Rows are independent of each other. For a path along a row, all inner weights are equal, and their sum is combined
//! from sums of 1, 2, 4 … pixels, which takes few additions at any length. For other paths, the weighted pixels are
//! added in the order of their offsets.

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::motion::{Streak, Tap};
use crate::clean::{self, Clean, display_light, encode};
use crate::draws::{LANES, Lanes};
use darkqa_base::types::images::{Isa, Kernel};
use darkqa_base::types::{Light, Rgb};

/// Version of motion blur, raised whenever a pixel changes.
pub const VERSION: u32 = 1;

/// Blurs an image along a path; returns linear light.
#[must_use]
pub fn blur(clean: Clean<'_>, streak: Streak) -> Light {
    let blur = Blur::new(clean, streak, Isa::best());
    let mut blurred = Light::black(clean.height(), clean.width());
    let rows = blurred.samples_mut().par_chunks_mut(3 * clean.width());
    rows.enumerate().for_each_init(Scratch::default, |scratch, (row, light)| {
        blur.row(row, scratch, light);
    });
    blurred
}

/// Blurs an image along a path; returns 8-bit codes. Codes without motion are unchanged.
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
    blurred.samples_mut().par_chunks_mut(width).enumerate().for_each_init(
        || (Scratch::default(), vec![0.0; width]),
        |(scratch, light), (row, codes)| {
            blur.row(row, scratch, light);
            encode(light, codes, isa);
        },
    );
    blurred
}

/// The light of an image and the weights of a path, prepared for blurring any row.
struct Blur {
    /// Light in rows of `stride` samples: the image with its edge pixels repeated in a margin on both sides.
    light: Vec<f32>,
    height: usize,
    stride: usize,
    /// Width of a margin, in pixels.
    margin: usize,
    weights: Weights,
    isa: Isa,
}

/// Weights of a path, by the method of summation.
#[derive(Debug)]
enum Weights {
    /// Any path: taps are added one by one.
    Each(Vec<Tap>),
    /// A path along a row: equal weights are added by partial sums.
    Row(RowWeights),
}

/// The weights of a path along a row.
#[derive(Debug)]
struct RowWeights {
    /// Number of pixels in the middle with equal weight; odd.
    equal: usize,
    /// The weight of each of these pixels.
    weight: f32,
    /// The other pixels: distance from the middle, and the weight on both sides.
    pairs: Vec<(usize, f32)>,
}

/// Smallest number of equal weights for which partial sums are faster; chosen.
const MIN_EQUAL: usize = 5;

impl Weights {
    fn from_streak(streak: Streak) -> Self {
        let taps = streak.taps();
        match RowWeights::from_taps(&taps) {
            Some(row) if row.equal >= MIN_EQUAL => Self::Row(row),
            _ => Self::Each(taps),
        }
    }
}

impl RowWeights {
    /// The weights of a path along a row; `None` for another path.
    fn from_taps(taps: &[Tap]) -> Option<Self> {
        if taps.iter().any(|tap| tap.offset[1] != 0) {
            return None;
        }
        // The right half of the symmetric weights, from the middle.
        let half: Vec<f64> = taps[taps.len() / 2..].iter().map(|tap| tap.weight).collect();
        let inner = half.iter().take_while(|weight| (*weight - half[0]).abs() < 1e-12).count();
        Some(Self {
            equal: 2 * inner - 1,
            weight: half[0] as f32,
            pairs: (inner..half.len()).map(|distance| (distance, half[distance] as f32)).collect(),
        })
    }
}

/// Buffers of one thread.
#[derive(Debug, Default)]
struct Scratch {
    /// Index in the light of each tap for the first pixel of a row, and its weight.
    starts: Vec<(usize, f32)>,
    /// Partial sums of 1, 2, 4 … pixels.
    sums: Vec<f32>,
}

impl Blur {
    fn new(clean: Clean<'_>, streak: Streak, isa: Isa) -> Self {
        let taps = streak.taps();
        let margin = taps.iter().map(|tap| tap.offset[0].unsigned_abs()).max().unwrap_or_default();
        let (height, width) = (clean.height(), clean.width());
        let stride = 3 * (width + 2 * margin);
        // Kernels read whole lanes, which may extend beyond the last row.
        let mut light = vec![0.0; height * stride + 2 * LANES];
        light[..height * stride].par_chunks_mut(stride).enumerate().for_each(|(row, padded)| {
            let samples = row * 3 * width..(row + 1) * 3 * width;
            let inside = &mut padded[3 * margin..3 * (margin + width)];
            match clean {
                Clean::Codes(codes) => {
                    let shown = display_light();
                    for (light, code) in inside.iter_mut().zip(&codes.samples()[samples]) {
                        *light = shown[usize::from(*code)];
                    }
                }
                Clean::Rgb16Image(codes) => {
                    for (light, code) in inside.iter_mut().zip(&codes.samples()[samples]) {
                        *light = clean::gamma_expand(f64::from(*code) / 65_535.0) as f32;
                    }
                }
                Clean::Light(light) | Clean::Scene(light) => {
                    inside.copy_from_slice(&light.samples()[samples]);
                }
            }
            repeat_edges(padded, margin);
        });
        Self { light, height, stride, margin, weights: Weights::from_streak(streak), isa }
    }

    /// Writes a row of blurred light.
    fn row(&self, row: usize, scratch: &mut Scratch, blurred: &mut [f32]) {
        match &self.weights {
            Weights::Each(taps) => {
                scratch.starts.clear();
                scratch.starts.extend(taps.iter().map(|tap| {
                    let [right, down] = tap.offset;
                    let row = row.saturating_add_signed(down).min(self.height - 1);
                    let column = self.margin.saturating_add_signed(right);
                    (row * self.stride + 3 * column, tap.weight as f32)
                }));
                self.isa.run(EachTap { light: &self.light, starts: &scratch.starts, blurred });
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

/// Fills both margins of a row with its first and last pixel.
fn repeat_edges(padded: &mut [f32], margin: usize) {
    let pixels = padded.as_chunks_mut::<3>().0;
    let (first, last) = (pixels[margin], pixels[pixels.len() - margin - 1]);
    let end = pixels.len() - margin;
    pixels[..margin].fill(first);
    pixels[end..].fill(last);
}

/// Copies one batch of lanes from an index on.
#[inline(always)]
fn lanes(light: &[f32], from: usize) -> Lanes<f32> {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&light[from..from + LANES]);
    lanes
}

/// Kernel that blurs one row tap by tap.
struct EachTap<'a> {
    light: &'a [f32],
    /// Index in `light` of each tap for the first pixel of the row, and its weight.
    starts: &'a [(usize, f32)],
    blurred: &'a mut [f32],
}

impl Kernel for EachTap<'_> {
    #[inline(always)]
    fn run(self) {
        for (index, blurred) in self.blurred.chunks_mut(LANES).enumerate() {
            let mut sum = [0.0; LANES];
            for (start, weight) in self.starts {
                let light = lanes(self.light, start + index * LANES);
                for i in 0..LANES {
                    sum[i] += weight * light[i];
                }
            }
            blurred.copy_from_slice(&sum[..blurred.len()]);
        }
    }
}

/// Kernel that blurs one row along itself.
struct AlongRow<'a> {
    /// The row with its margins, and two more batches of lanes.
    light: &'a [f32],
    margin: usize,
    weights: &'a RowWeights,
    sums: &'a mut [f32],
    blurred: &'a mut [f32],
}

impl Kernel for AlongRow<'_> {
    #[inline(always)]
    fn run(self) {
        let RowWeights { equal, weight, pairs } = self.weights;
        // The sums start at the leftmost of the equal pixels. A sum of `size` pixels is stored at the position of its
        // first pixel.
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

/// Doubles the length of the first `needed` sums: adds to each the sum `distance` samples to its right.
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
