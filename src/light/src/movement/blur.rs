//! Motion blur in linear light: [`blur`], and [`blurred_codes`] for a picture that is otherwise as it was.
//!
//! Each sample is the mean of the light along the [path](Streak). Beyond an edge of the picture stands the edge's own pixel.
//! Rows do not depend on each other. Along a row all inner weights are equal; their sum is made of sums of 1, 2, 4 … pixels,
//! which takes few additions at any length. Along other paths the weighted pixels are added in the order of their offsets.

use rayon::prelude::*;

use super::streak::{Streak, Tap};
use crate::clean::Clean;
use crate::codes::{encode, shown_light};
use crate::curve;
use crate::draws::{LANES, Lanes};
use darkqa_ground::types::images::{Isa, Kernel};
use darkqa_ground::types::{Light, Rgb};

/// Version of motion blur, raised whenever a pixel changes.
pub const VERSION: u32 = 1;

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
    blurred
        .samples_mut()
        .par_chunks_mut(width)
        .enumerate()
        .for_each_init(
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
    fn from_streak(streak: Streak) -> Self {
        let taps = streak.taps();
        match RowWeights::from_taps(&taps) {
            Some(row) if row.equal >= FEWEST_EQUAL => Self::Row(row),
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
        let half: Vec<f64> = taps[taps.len() / 2..]
            .iter()
            .map(|tap| tap.weight)
            .collect();
        let inner = half
            .iter()
            .take_while(|weight| (*weight - half[0]).abs() < 1e-12)
            .count();
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
        // Whole lanes are read; the last of them extend beyond the row.
        let mut light = vec![0.0; height * stride + 2 * LANES];
        light[..height * stride]
            .par_chunks_mut(stride)
            .enumerate()
            .for_each(|(row, padded)| {
                let samples = row * 3 * width..(row + 1) * 3 * width;
                let inside = &mut padded[3 * margin..3 * (margin + width)];
                match clean {
                    Clean::Codes(codes) => {
                        let shown = shown_light();
                        for (light, code) in inside.iter_mut().zip(&codes.samples()[samples]) {
                            *light = shown[usize::from(*code)];
                        }
                    }
                    Clean::Rgb16Image(codes) => {
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
            weights: Weights::from_streak(streak),
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
mod tests;
