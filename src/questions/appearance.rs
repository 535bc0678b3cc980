//! Image statistics of a frame for comparing sets of frames: [`FrameAppearance`]. No rule uses them.

use ndarray::Array2;

use super::colors::{BINS, Palette};
use super::statistics::ppm;
use darkqa_base::types::{Frame, Rgb};

/// Maximum number of rows for detecting edges (chosen). Higher images are reduced, because the luma of a large image
/// changes less from pixel to pixel.
const MAX_ROWS: usize = 480;

/// Minimum gradient of an edge, in codes of luma per pixel (chosen).
pub const MIN_EDGE_GRADIENT: f32 = 2.5;

/// Minimum area of a segment that is counted, in millionths of the frame; the same as in the rulebook.
const MIN_SEGMENT_PPM: u64 = 500;

/// Weights of red, green and blue in luminance and luma (ITU-R BT.709).
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Image statistics of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameAppearance {
    /// Mean linear light in EV relative to white.
    pub light_ev: f64,
    /// Share of pixels at edges, from 0 to 1.
    pub edges: f64,
    /// Share of pixels of each colour, from 0 to 1: the eleven names in order, then pixels without a name.
    pub colors: [f64; BINS],
    /// Number of segments that are not tiny; `None` without a segment map.
    pub segments: Option<usize>,
    /// 10 %, 50 % and 90 % quantiles of depth in metres; `None` without a depth map.
    pub depth: Option<[f64; 3]>,
}

impl FrameAppearance {
    /// Measures a frame, with colours named by a palette. Depth values are used as stored in the map.
    #[must_use]
    pub fn new(frame: &Frame, palette: &Palette) -> Self {
        let pixels = (frame.rgb.height() * frame.rgb.width()).max(1) as f64;
        let mut colors = [0_u64; BINS];
        let (codes, _) = frame.rgb.samples().as_chunks::<3>();
        for code in codes {
            colors[palette.bin(*code)] += 1;
        }
        Self {
            light_ev: mean_light(codes).log2(),
            edges: edges(&frame.rgb),
            colors: colors.map(|count| count as f64 / pixels),
            segments: frame.segments.as_ref().map(segments),
            depth: frame.depth.as_ref().and_then(depth),
        }
    }
}

/// Mean luminance of 8-bit sRGB codes, 1 for white; at least half of that of code 1 (IEC 61966-2-1).
fn mean_light(codes: &[[u8; 3]]) -> f64 {
    let light: [f64; 256] = std::array::from_fn(|code| {
        let value = code as f64 / 255.0;
        if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
    });
    let sum: f64 = codes
        .iter()
        .map(|code: &[u8; 3]| -> f64 {
            code.iter().zip(WEIGHTS).map(|(code, weight)| light[usize::from(*code)] * f64::from(weight)).sum()
        })
        .sum();
    (sum / codes.len().max(1) as f64).max(light[1] / 2.0)
}

/// Share of pixels whose luma changes by at least [`MIN_EDGE_GRADIENT`] codes per pixel, by the magnitude of the Sobel
/// gradient (I. Sobel and G. Feldman 1968): an eighth of the response of its kernels. Images of more than [`MAX_ROWS`]
/// rows are reduced first.
fn edges(image: &Rgb) -> f64 {
    let luma = reduce(&luma(image));
    let (height, width) = luma.dim();
    let at = |y: usize, x: usize, down: usize, right: usize| {
        let near = |index: usize, step: usize, end: usize| (index + step).saturating_sub(1).min(end - 1);
        luma[(near(y, down, height), near(x, right, width))]
    };
    let mut steep = 0_usize;
    for y in 0..height {
        for x in 0..width {
            let [left, right] = [0, 2].map(|dx| at(y, x, 0, dx) + 2.0 * at(y, x, 1, dx) + at(y, x, 2, dx));
            let [above, below] = [0, 2].map(|dy| at(y, x, dy, 0) + 2.0 * at(y, x, dy, 1) + at(y, x, dy, 2));
            let (across, along) = (right - left, below - above);
            steep += usize::from((across * across + along * along).sqrt() / 8.0 >= MIN_EDGE_GRADIENT);
        }
    }
    steep as f64 / (height * width).max(1) as f64
}

/// Luma of each pixel, in codes.
fn luma(image: &Rgb) -> Array2<f32> {
    let (codes, _) = image.samples().as_chunks::<3>();
    let width = image.width();
    Array2::from_shape_fn((image.height(), width), |(y, x)| {
        codes[y * width + x].iter().zip(WEIGHTS).map(|(code, weight)| f32::from(*code) * weight).sum()
    })
}

/// Reduces a map to at most [`MAX_ROWS`] rows; each new pixel is the mean of the pixels that it covers.
fn reduce(map: &Array2<f32>) -> Array2<f32> {
    let (height, width) = map.dim();
    if height <= MAX_ROWS {
        return map.clone();
    }
    let columns = (width * MAX_ROWS / height).max(1);
    let rows = resize_rows(map, MAX_ROWS);
    resize_rows(&rows.reversed_axes(), columns).reversed_axes()
}

/// Reduces a map to a number of rows, each the mean of the rows that it covers.
fn resize_rows(map: &Array2<f32>, rows: usize) -> Array2<f32> {
    let (height, width) = map.dim();
    let step = height as f32 / rows as f32;
    let mut shrunk = Array2::zeros((rows, width));
    for row in 0..rows {
        let (from, to) = (row as f32 * step, (row + 1) as f32 * step);
        for y in from as usize..(to.ceil() as usize).min(height) {
            let covered = to.min(y as f32 + 1.0) - from.max(y as f32);
            shrunk.row_mut(row).scaled_add(covered.max(0.0) / step, &map.row(y));
        }
    }
    shrunk
}

/// Number of segments that are not tiny.
fn segments(map: &Array2<u32>) -> usize {
    let mut counts = std::collections::BTreeMap::<u32, u64>::new();
    for number in map.iter().filter(|number| **number != 0) {
        *counts.entry(*number).or_insert(0) += 1;
    }
    let whole = map.len() as u64;
    counts.values().filter(|count| ppm(**count, whole) >= MIN_SEGMENT_PPM).count()
}

/// 10 %, 50 % and 90 % quantiles of depth in metres; `None` if no pixel has depth.
fn depth(map: &Array2<u32>) -> Option<[f64; 3]> {
    let mut known: Vec<u32> = map.iter().copied().filter(|depth| *depth > 0).collect();
    known.sort_unstable();
    let last = known.len().checked_sub(1)?;
    Some([10, 50, 90].map(|percent| f64::from(known[last * percent / 100]) / 1000.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(height: usize, width: usize, code: impl Fn(usize, usize) -> u8) -> Rgb {
        let codes = (0..height * width).flat_map(|i| [code(i / width, i % width); 3]);
        Rgb::new(height, width, codes.collect()).unwrap()
    }

    #[test]
    fn light_is_measured_in_ev_below_white() {
        let [white, half, black] = [255, 188, 0].map(|code: u8| mean_light(&[[code; 3]; 5]).log2());
        assert!(white.abs() < 1e-6);
        assert!((half + 1.0).abs() < 0.01, "{half}");
        assert!(black.is_finite());
    }

    #[test]
    fn edges_are_where_luma_changes() {
        assert!(edges(&image(40, 50, |_, _| 90)) == 0.0);
        // A step of 100 codes: the columns on both sides of it.
        let step = image(40, 50, |_, x| if x < 25 { 60 } else { 160 });
        assert!((edges(&step) - 2.0 / 50.0).abs() < 1e-9);
        // A slope below the threshold has no edges; one above it has edges everywhere but at the border.
        assert!(edges(&image(40, 50, |_, x| 2 * x as u8)) == 0.0);
        assert!(edges(&image(40, 50, |_, x| 3 * x as u8)) > 0.9);
    }

    #[test]
    fn a_large_picture_has_the_edges_of_the_small_one() {
        let [small, large] = [1, 2].map(|scale| {
            let bars = image(480 * scale, 640 * scale, |_, x| [40, 200][x / (16 * scale) % 2]);
            edges(&bars)
        });
        assert!((small - large).abs() < 1e-9 && small > 0.1, "{small} {large}");
        let odd = reduce(&luma(&image(720, 960, |_, _| 77)));
        assert_eq!(odd.dim(), (480, 640));
        assert!(odd.iter().all(|luma| (luma - 77.0).abs() < 1e-3));
    }
}
