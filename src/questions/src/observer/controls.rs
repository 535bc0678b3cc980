//! The images of the observer's controls, in which there is nothing to see of a frame, so that the observer must guess:
//! [`control_image`].
//!
//! An observer that answers more than chance on one of them answers from the labels and not from the pixels.

use super::ObservedFrame;
use darkqa_ground::types::{Control, Digest, Rgb};

/// Side of the squares that are shuffled, in pixels; smaller in images with fewer than three in a row or column.
const TILE: usize = 80;

/// Width of the three box means that stand for a Gaussian of σ = 20 pixels: σ² = 3 (41² − 1) / 12.
const BOX: usize = 41;

/// An image as a control shows it. Random numbers are drawn from `key` and the name of the control.
#[must_use]
pub fn control_image(control: Control, image: &Rgb, frame: &ObservedFrame, key: &Digest) -> Rgb {
    let mut rng = SplitMix64::new(key, control);
    let [width, height] = [image.width(), image.height()];
    let at = |from: &dyn Fn(usize, usize) -> [usize; 2]| remap(image, from);
    match control {
        Control::OtherRoom => image.clone(),
        Control::Mosaic12 => mosaic(image, 12),
        Control::Mosaic40 => mosaic(image, 40),
        Control::Mirrored => at(&|x, y| [width - 1 - x, y]),
        Control::UpsideDown => at(&|x, y| [x, height - 1 - y]),
        Control::Tiles => shuffle_tiles(image, &mut rng),
        Control::Black => Rgb::black(height, width),
        Control::Flat => mosaic(image, width.max(height)),
        Control::WhiteNoise => {
            let mut noise = image.clone();
            for code in noise.samples_mut() {
                *code = (rng.next() >> 56) as u8;
            }
            noise
        }
        Control::PinkNoise => pink_noise(image, &mut rng),
        Control::Negative => {
            let mut negative = image.clone();
            for code in negative.samples_mut() {
                *code = 255 - *code;
            }
            negative
        }
        Control::Blur => blur(image),
        Control::Shift32 => at(&|x, y| shifted([x, y], [width, height], 32)),
        Control::Shift4 => at(&|x, y| shifted([x, y], [width, height], 4)),
        Control::RandomMasks => random_masks(frame, &mut rng),
        Control::Outlines => draw_outlines(frame),
    }
}

/// Random numbers: `SplitMix64` (Steele, Lea and Flood, OOPSLA 2014).
struct SplitMix64(u64);

impl SplitMix64 {
    fn new(key: &Digest, control: Control) -> Self {
        let seed = Digest::from_parts([&key.as_bytes()[..], control.name().as_bytes()]);
        let (words, _) = seed.as_bytes().as_chunks::<8>();
        Self(u64::from_le_bytes(words[0]))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut value = self.0;
        value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        value ^ (value >> 31)
    }

    /// A number from 0 up to `count`, exclusive. Its bias is below 2⁻⁴⁰ for the counts used here.
    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    /// A number from 0 to 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// An image whose pixel at (x, y) is the one of `image` that `from` names.
fn remap(image: &Rgb, from: &dyn Fn(usize, usize) -> [usize; 2]) -> Rgb {
    let width = image.width();
    let mut moved = image.clone();
    for (i, pixel) in moved.samples_mut().chunks_exact_mut(3).enumerate() {
        let [x, y] = from(i % width, i / width);
        pixel.copy_from_slice(&image.samples()[(y * width + x) * 3..][..3]);
    }
    moved
}

/// The place `by` pixels to the left and above, around the edges.
fn shifted(place: [usize; 2], size: [usize; 2], by: usize) -> [usize; 2] {
    [0, 1].map(|axis| (place[axis] + size[axis] - by % size[axis]) % size[axis])
}

/// Each square of `side` pixels filled with its mean.
fn mosaic(image: &Rgb, side: usize) -> Rgb {
    let (width, columns) = (image.width(), image.width().div_ceil(side));
    let square = |i: usize| i / width / side * columns + i % width / side;
    let mut sums = vec![[0_u64; 4]; columns * image.height().div_ceil(side)];
    let (pixels, _) = image.samples().as_chunks::<3>();
    for (i, pixel) in pixels.iter().enumerate() {
        let [count, codes @ ..] = &mut sums[square(i)];
        *count += 1;
        for (sum, code) in codes.iter_mut().zip(pixel) {
            *sum += u64::from(*code);
        }
    }
    let mut mosaic = image.clone();
    for (i, pixel) in mosaic.samples_mut().chunks_exact_mut(3).enumerate() {
        let [count, codes @ ..] = sums[square(i)];
        pixel.copy_from_slice(&codes.map(|sum| ((sum + count / 2) / count) as u8));
    }
    mosaic
}

/// The tiles in a cyclic order at random (Sattolo 1986), so that none stays in its place. At the right and lower edges a tile is
/// cut, or its last pixels are repeated.
fn shuffle_tiles(image: &Rgb, rng: &mut SplitMix64) -> Rgb {
    let [width, height] = [image.width(), image.height()];
    let side = TILE.min(width.min(height) / 3).max(1);
    let columns = width.div_ceil(side);
    let mut order: Vec<usize> = (0..columns * height.div_ceil(side)).collect();
    for last in (1..order.len()).rev() {
        order.swap(last, rng.below(last));
    }
    remap(image, &|x, y| {
        let tile = order[y / side * columns + x / side];
        let from = [
            tile % columns * side + x % side,
            tile / columns * side + y % side,
        ];
        [from[0].min(width - 1), from[1].min(height - 1)]
    })
}

/// A sum of noise fields, each twice as coarse as the one before, all with the same variance; scaled to mean 128 and a standard
/// deviation of 50 codes.
fn pink_noise(image: &Rgb, rng: &mut SplitMix64) -> Rgb {
    let [width, height] = [image.width(), image.height()];
    let mut noise = image.clone();
    for channel in 0..3 {
        let mut field = vec![0.0; width * height];
        let mut side = 1;
        while side < width.max(height) {
            let columns = width / side + 2;
            let count = columns * (height / side + 2);
            let knots: Vec<f64> = (0..count).map(|_| rng.unit() - 0.5).collect();
            for (i, value) in field.iter_mut().enumerate() {
                let (x, y) = (i % width, i / width);
                let [right, below] = [x % side, y % side].map(|rest| rest as f64 / side as f64);
                let knot = y / side * columns + x / side;
                let upper = knots[knot] * (1.0 - right) + knots[knot + 1] * right;
                let lower =
                    knots[knot + columns] * (1.0 - right) + knots[knot + columns + 1] * right;
                *value += upper * (1.0 - below) + lower * below;
            }
            side *= 2;
        }
        let mean = field.iter().sum::<f64>() / field.len() as f64;
        let squares: f64 = field
            .iter()
            .map(|value| (value - mean) * (value - mean))
            .sum();
        let scale = 50.0 / (squares / field.len() as f64).sqrt().max(1e-9);
        for (pixel, value) in noise.samples_mut().chunks_exact_mut(3).zip(field) {
            pixel[channel] = (128.5 + (value - mean) * scale).clamp(0.0, 255.0) as u8;
        }
    }
    noise
}

/// Three box means along each axis.
fn blur(image: &Rgb) -> Rgb {
    let [width, height] = [image.width(), image.height()];
    let mut planes: Vec<f64> = image
        .samples()
        .iter()
        .map(|code| f64::from(*code))
        .collect();
    for _ in 0..3 {
        for start in (0..height).map(|row| row * width * 3) {
            for channel in 0..3 {
                box_mean(&mut planes, start + channel, 3, width);
            }
        }
        for start in 0..width * 3 {
            box_mean(&mut planes, start, width * 3, height);
        }
    }
    let mut blurred = image.clone();
    for (code, value) in blurred.samples_mut().iter_mut().zip(planes) {
        *code = (value + 0.5).clamp(0.0, 255.0) as u8;
    }
    blurred
}

/// Replaces `count` values, `step` apart, by their means over [`BOX`] values; beyond the ends, the last ones are repeated.
fn box_mean(values: &mut [f64], start: usize, step: usize, count: usize) {
    let line: Vec<f64> = (0..count).map(|i| values[start + i * step]).collect();
    let half = BOX as isize / 2;
    let at = |i: isize| line[i.clamp(0, count as isize - 1) as usize];
    let mut sum: f64 = (-half..=half).map(at).sum();
    for i in 0..count {
        values[start + i * step] = sum / BOX as f64;
        let i = i as isize;
        sum += at(i + half + 1) - at(i - half);
    }
}

/// The masks of a frame, each in a colour at random.
fn random_masks(frame: &ObservedFrame, rng: &mut SplitMix64) -> Rgb {
    let colours: Vec<[u8; 3]> = (0..=frame.cells.masks)
        .map(|_| [0; 3].map(|_: u8| (rng.next() >> 56) as u8))
        .collect();
    let masks = frame.cells.mask_of_pixels();
    let mut image = frame.untouched.clone();
    for (pixel, mask) in image.samples_mut().chunks_exact_mut(3).zip(masks) {
        pixel.copy_from_slice(&colours[mask as usize]);
    }
    image
}

/// Black where the pixel to the right or below belongs to another mask, grey elsewhere.
fn draw_outlines(frame: &ObservedFrame) -> Rgb {
    let masks = frame.cells.mask_of_pixels();
    let width = frame.untouched.width();
    let mut image = frame.untouched.clone();
    for (i, pixel) in image.samples_mut().chunks_exact_mut(3).enumerate() {
        let right = (i % width + 1 < width).then_some(i + 1);
        let below = masks.get(i + width).map(|_| i + width);
        let is_outline = [right, below]
            .into_iter()
            .flatten()
            .any(|other| masks[other] != masks[i]);
        pixel.fill(if is_outline { 0 } else { 128 });
    }
    image
}
