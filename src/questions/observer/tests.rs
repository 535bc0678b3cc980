//! The observer on a disc in noise: its numbers are those of the textbook.

use super::cells::{Cells, Outline, TILE, outlines, patch_sums};
use super::local;
use super::tiles::Tiles;
use crate::rule_context::Picker;
use darkqa_base::types::{FrameId, Rgb};

const SIZE: [usize; 2] = [240, 180];

/// Approximately normal draws: sums of twelve uniform ones.
fn normal(seed: u64) -> impl FnMut() -> f64 {
    let frame = FrameId("noise".to_owned());
    let picker = Picker { seed, dataset: "", frame: &frame };
    let mut state = picker.bits("", "") | 1;
    let mut uniform = move || {
        // Marsaglia's xorshift64 (2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Discs in a grid, masks 2 and up, on a background, mask 1.
fn discs(columns: usize, radius: f64) -> Vec<u32> {
    let [width, height] = SIZE;
    let side = (width / columns).min(height);
    (0..width * height)
        .map(|i: usize| {
            let (x, y) = (i % width, i / width);
            let (column, row) = (x / side, y / side);
            let [dx, dy] = [(x, column), (y, row)].map(|(at, cell)| {
                let middle = (cell * side) as f64 + side as f64 / 2.0 - 0.5;
                at as f64 - middle
            });
            let is_inside = dx * dx + dy * dy < radius * radius;
            let is_inside = is_inside && column < columns && (row + 1) * side <= height;
            if is_inside { 2 + (row * columns + column) as u32 } else { 1 }
        })
        .collect()
}

/// An image with the same code in all channels, by pixel.
fn image(code: impl Fn(usize) -> f64) -> Rgb {
    let [width, height] = SIZE;
    let samples = (0..width * height).flat_map(|i| [code(i).round().clamp(0.0, 255.0) as u8; 3]);
    Rgb::new(height, width, samples.collect()).unwrap()
}

/// The untouched frame behind an image.
struct Untouched<'a> {
    image: &'a Rgb,
    cells: Cells,
    tiles: Tiles,
}

impl<'a> Untouched<'a> {
    fn new(masks: &[u32], image: &'a Rgb) -> Self {
        let cells = Cells::from_masks(masks, SIZE);
        let tiles = Tiles::new(image, TILE * cells.side);
        Self { image, cells, tiles }
    }

    fn observe(&self, received: &Rgb) -> Vec<Outline> {
        let untouched = self.image.samples();
        let sums = self.tiles.sums(untouched, received.samples());
        let fit = local::fit(&self.tiles, &sums);
        let sums = patch_sums(&self.cells, untouched, &fit, received);
        outlines(&self.cells, &sums, &fit.tiles)
    }
}

fn observe(masks: &[u32], untouched: &Rgb, received: &Rgb) -> Vec<Outline> {
    Untouched::new(masks, untouched).observe(received)
}

/// Codes of a disc on a background, and the same in noise of a standard deviation, independent in every sample.
fn in_noise(untouched: &Rgb, deviation: f64, seed: u64) -> Rgb {
    let mut draw = normal(seed);
    let mut noisy = untouched.clone();
    for code in noisy.samples_mut() {
        *code = (f64::from(*code) + deviation * draw()).round().clamp(0.0, 255.0) as u8;
    }
    noisy
}

#[test]
fn z_is_contrast_over_noise_times_the_root_of_the_pixels() {
    let masks = discs(4, 22.0);
    let (contrast, deviation) = (24.0, 12.0);
    let untouched = image(|i| if masks[i] > 1 { 120.0 + contrast } else { 120.0 });
    let cells = Cells::from_masks(&masks, SIZE);
    // An element of n inside and m outside has as much as 1 / (1/n + 1/m) pixels, in each of three channels.
    let pixels = cells
        .scales
        .iter()
        .map(|scale| -> f64 {
            scale
                .elements
                .iter()
                .filter(|element| element.mask == 2)
                .map(|element| 3.0 / (1.0 / element.inside + 1.0 / element.outside))
                .sum()
        })
        .fold(0.0, f64::max);
    let expected = contrast / (deviation * deviation + 1.0 / 12.0_f64).sqrt() * pixels.sqrt();
    let found: Vec<f64> = (0..8)
        .flat_map(|seed| {
            let noisy = in_noise(&untouched, deviation, seed);
            observe(&masks, &untouched, &noisy).split_off(2)
        })
        .map(|outline| outline.z)
        .collect();
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    // The factors of the noise are never below 1, so that with thirteen outlines z is some 6 % below, and never above.
    assert!((0.92..1.02).contains(&(mean / expected)), "{mean} {expected}");
}

#[test]
fn contrast_is_seen_if_it_is_the_predicted_one() {
    let masks = discs(1, 60.0);
    let untouched = image(|i| if masks[i] == 2 { 150.0 } else { 100.0 });
    let seen = |received: &Rgb| observe(&masks, &untouched, received)[2].confirmed >= 0.5;
    let step = |inside: f64, outside: f64, seed: u64| {
        let flat = image(|i| if masks[i] == 2 { inside } else { outside });
        in_noise(&flat, 3.0, seed)
    };
    for (inside, outside, expected) in [
        (150.0, 100.0, true),
        (60.0, 40.0, true),
        (12.0, 8.0, true),
        // The wrong sign, nothing at all.
        (100.0, 150.0, false),
        (100.0, 100.0, false),
    ] {
        assert_eq!(seen(&step(inside, outside, 3)), expected, "{inside} {outside}");
    }
}

/// Three discs of different untouched codes: a curve through two of them predicts the third, which has less contrast
/// than that.
#[test]
fn less_than_half_of_the_predicted_contrast_is_not_confirmed() {
    let masks = discs(4, 22.0);
    let codes: Vec<f64> =
        masks.iter().map(|mask| if *mask > 1 && mask.is_multiple_of(2) { 180.0 } else { 100.0 }).collect();
    let untouched = image(|i| codes[i]);
    for (share, expected) in [(1.0, true), (0.8, true), (0.3, false), (0.0, false)] {
        let received = image(|i| {
            let own = if masks[i] == 2 { share } else { 1.0 };
            100.0 + own * (codes[i] - 100.0)
        });
        let found = observe(&masks, &untouched, &in_noise(&received, 4.0, 1))[2];
        assert_eq!(found.confirmed >= 0.5, expected, "{share}: {found:?}");
    }
}

/// Noise alone, of pixels, of rows, and shared by neighbours as after demosaicing: 12 discs in 280 images of each kind.
#[test]
fn noise_alone_shows_nothing() {
    let [width, height] = SIZE;
    let masks = discs(4, 22.0);
    let untouched = image(|i| if masks[i] == 1 { 100.0 } else { 140.0 });
    let known = Untouched::new(&masks, &untouched);
    let (mut things, mut detected, mut seen) = (0_u32, [0_u32; 3], [0_u32; 3]);
    for seed in 0..280 {
        for kind in 0..3 {
            let mut draw = normal(1000 * kind as u64 + seed);
            let rows: Vec<f64> = (0..height).map(|_| draw()).collect();
            let white: Vec<f64> = (0..width * height).map(|_| draw()).collect();
            let received = image(|i| {
                let noise = match kind {
                    0 => white[i],
                    1 => 0.6 * white[i] + rows[i / width],
                    _ => {
                        let right = white[(i + 1) % white.len()];
                        let below = white[(i + width) % white.len()];
                        (white[i] + right + below) / 2.0
                    }
                };
                100.0 + 8.0 * noise
            });
            for outline in &known.observe(&received)[2..] {
                things += 1;
                detected[kind] += u32::from(outline.is_detected());
                seen[kind] += u32::from(outline.confirmed >= 0.5);
            }
        }
    }
    assert!(things >= 10_000, "{things}");
    // Twice the rate of false alarms that the tests allow. The noise that an outline shares is measured from the twelve
    // outlines of the image, so that the z of a whole outline has the tails of Student's distribution; it decides no
    // answer.
    for (found, rate) in [(seen, 0.002), (detected, 0.005)] {
        let max = (rate * f64::from(things)) as u32;
        assert!(found.iter().sum::<u32>() <= max, "{found:?} of {things}");
    }
}

#[test]
fn frames_without_contrast_show_nothing() {
    let [width, height] = SIZE;
    let masks = discs(4, 22.0);
    let untouched = image(|i| f64::from(40 * masks[i].min(5)));
    let flat = image(|_| 90.0);
    for (masks, untouched, received) in [
        (&masks, &flat, &untouched),
        (&masks, &untouched, &flat),
        (&vec![1; width * height], &untouched, &untouched),
        (&vec![0; width * height], &untouched, &untouched),
    ] {
        let found = observe(masks, untouched, received);
        assert!(found.iter().all(|outline| outline.confirmed <= 0.0), "{found:?}");
    }
}
