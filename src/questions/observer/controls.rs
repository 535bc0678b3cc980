//! Control images, which contain no evidence about a frame, so that the observer must guess: [`control_image`].
//!
//! An observer that scores above chance on them answers from the labels and not from the pixels.

use super::ObservedFrame;
use darkqa_base::types::{Control, Digest, Rgb};

/// Side of the shuffled squares, in pixels; smaller if an image has fewer than three squares in a row or column.
const TILE: usize = 80;

/// Width of the three box filters that approximate a Gaussian of σ = 20 pixels: σ² = 3 (41² − 1) / 12.
const BOX: usize = 41;

/// Returns the image of a control. The random numbers are determined by `key` and the name of the control.
#[must_use]
pub fn control_image(control: Control, image: &Rgb, frame: &ObservedFrame, key: &Digest) -> Rgb {
    let mut rng = SplitMix64::new(key, control);
    let [width, height] = [image.width(), image.height()];
    match control {
        Control::OtherRoom => image.clone(),
        Control::Mosaic12 => mosaic(image, 12),
        Control::Mosaic40 => mosaic(image, 40),
        Control::Mirrored => remap(image, &|x, y| [width - 1 - x, y]),
        Control::UpsideDown => remap(image, &|x, y| [x, height - 1 - y]),
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
        Control::Shift32 => remap(image, &|x, y| shifted([x, y], [width, height], 32)),
        Control::Shift4 => remap(image, &|x, y| shifted([x, y], [width, height], 4)),
        Control::RandomMasks => random_masks(frame, &mut rng),
        Control::Outlines => draw_outlines(frame),
    }
}

/// Random number generator `SplitMix64` (Steele, Lea and Flood, OOPSLA 2014).
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

    /// Returns an integer below `count`. The bias is less than 2⁻⁴⁰ for the counts used here.
    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Moves pixels: the pixel at (x, y) is taken from `source(x, y)`.
fn remap(image: &Rgb, source: &dyn Fn(usize, usize) -> [usize; 2]) -> Rgb {
    let width = image.width();
    let mut remapped = image.clone();
    for (i, pixel) in remapped.samples_mut().chunks_exact_mut(3).enumerate() {
        let [x, y] = source(i % width, i / width);
        pixel.copy_from_slice(&image.samples()[(y * width + x) * 3..][..3]);
    }
    remapped
}

/// Position `by` pixels to the left and above, wrapping around the edges.
fn shifted(position: [usize; 2], size: [usize; 2], by: usize) -> [usize; 2] {
    [0, 1].map(|axis| (position[axis] + size[axis] - by % size[axis]) % size[axis])
}

/// Fills each square of `side` pixels with its mean.
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

/// Shuffles the tiles by a random cyclic permutation (Sattolo 1986), so that none stays in place. At the right and
/// lower edges, a tile is cut or its last pixels are repeated.
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
        let from = [tile % columns * side + x % side, tile / columns * side + y % side];
        [from[0].min(width - 1), from[1].min(height - 1)]
    })
}

/// Pink noise: a sum of noise fields, each twice as coarse as the one before, all with the same variance. It is scaled
/// to a mean of 128 and a standard deviation of 50 codes.
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
                let lower = knots[knot + columns] * (1.0 - right) + knots[knot + columns + 1] * right;
                *value += upper * (1.0 - below) + lower * below;
            }
            side *= 2;
        }
        let mean = field.iter().sum::<f64>() / field.len() as f64;
        let squares: f64 = field.iter().map(|value| (value - mean) * (value - mean)).sum();
        let scale = 50.0 / (squares / field.len() as f64).sqrt().max(1e-9);
        for (pixel, value) in noise.samples_mut().chunks_exact_mut(3).zip(field) {
            pixel[channel] = (128.5 + (value - mean) * scale).clamp(0.0, 255.0) as u8;
        }
    }
    noise
}

/// Blurs an image with three box filters along each axis.
fn blur(image: &Rgb) -> Rgb {
    let [width, height] = [image.width(), image.height()];
    let mut planes: Vec<f64> = image.samples().iter().map(|code| f64::from(*code)).collect();
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

/// Replaces `count` values, `step` apart, by their means over [`BOX`] values; the end values are repeated beyond the
/// ends.
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

/// Fills each mask of a frame with a random colour.
fn random_masks(frame: &ObservedFrame, rng: &mut SplitMix64) -> Rgb {
    let colours: Vec<[u8; 3]> = (0..=frame.cells.masks).map(|_| [0; 3].map(|_: u8| (rng.next() >> 56) as u8)).collect();
    let masks = frame.cells.mask_of_pixels();
    let mut image = frame.untouched.clone();
    for (pixel, mask) in image.samples_mut().chunks_exact_mut(3).zip(masks) {
        pixel.copy_from_slice(&colours[mask as usize]);
    }
    image
}

/// Draws a pixel black if the one to its right or below belongs to another mask, else grey.
fn draw_outlines(frame: &ObservedFrame) -> Rgb {
    let masks = frame.cells.mask_of_pixels();
    let width = frame.untouched.width();
    let mut image = frame.untouched.clone();
    for (i, pixel) in image.samples_mut().chunks_exact_mut(3).enumerate() {
        let right = (i % width + 1 < width).then_some(i + 1);
        let below = masks.get(i + width).map(|_| i + width);
        let is_outline = [right, below].into_iter().flatten().any(|other| masks[other] != masks[i]);
        pixel.fill(if is_outline { 0 } else { 128 });
    }
    image
}
