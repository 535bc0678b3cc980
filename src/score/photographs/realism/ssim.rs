//! Structural similarity of two images: [`ssim`], and [`sampled_ssim`] from a part of the windows.

#![expect(clippy::inline_always, reason = "only inlined code is compiled for a kernel's instruction set, see isa")]

use rayon::prelude::*;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::Rgb;
use darkqa_base::types::images::{Isa, Kernel};

/// Half-width of the window in pixels: 3.5 standard deviations of 1.5 pixels, rounded.
const RADIUS: usize = 5;
/// Number of weights along a side of the window.
const TAPS: usize = 2 * RADIUS + 1;

/// Weights along one side of the window.
type WindowWeights = [f32; TAPS];

/// Number of local means: of x, y, x² + y² and xy.
const MOMENTS: usize = 4;

/// Windows in a row of a tile, a multiple of [`LANES`]. The last [`TAPS`] rows of all moments fit in the L1 cache.
/// Tiles of 64 to 192 are equally fast on an AMD EPYC.
const TILE: usize = 96;

/// Number of partial sums that are added in parallel.
const LANES: usize = 8;

/// Samples of an image row that the windows of a tile cover; the three channels are interleaved.
const COVERED: usize = TILE + 3 * (TAPS - 1);

/// Rows of windows per band. Threads compute bands in parallel.
const BAND: usize = 64;

/// Longest distance of the rows of windows that [`sampled_ssim`] takes.
const MAX_STEP: usize = 8;

/// Smallest number of rows of windows that [`sampled_ssim`] takes, if the image has as many.
const MIN_SAMPLED_ROWS: usize = 128;

/// Windows in a row of a tile of a sampled row, a multiple of [`LANES`]. A tile shares no work with the next one, so it
/// is wider than [`TILE`].
const WIDE_TILE: usize = 240;

/// Samples of an image row that the windows of a wide tile cover, rounded up to whole vectors.
const WIDE_COVERED: usize = (WIDE_TILE + 3 * (TAPS - 1)).next_multiple_of(16);

/// Code that is subtracted from every sample. Squares of the difference are more precise in `f32`.
const MIDDLE: u8 = 128;

/// Checks that two images have the same size; the error names both sizes.
pub fn same_size(a: &Rgb, b: &Rgb) -> Result<()> {
    let [a, b] = [a, b].map(|image| (image.width(), image.height()));
    if a == b {
        return Ok(());
    }
    let problem = format_args!(
        "{} × {} pixels against {} × {}; both images of a pair must have the same size",
        a.0, a.1, b.0, b.1
    );
    Err(Error::data("pair", problem))
}

/// Structural similarity (Wang et al. 2004): Gaussian window of standard deviation 1.5 (11 × 11), K1 0.01, K2 0.03,
/// population covariance, data range 255. The result is the mean over the three channels and over all windows inside
/// the image.
///
/// It equals scikit-image's `structural_similarity` with `gaussian_weights=True, sigma=1.5,
/// use_sample_covariance=False, data_range=255, channel_axis=-1` to 10⁻⁶, and to 10⁻⁵ for dark images. Local means are
/// `f32`, relative to code 128: this takes a third of the time of `f64`.
///
/// # Errors
/// If the sizes differ, or if a side is shorter than the window.
pub fn ssim(a: &Rgb, b: &Rgb) -> Result<f64> {
    check_sizes(a, b)?;
    Ok(mean_similarity(a, b, Isa::best()))
}

/// [`ssim`] from every eighth row of windows. Of images with less than 1,034 rows it takes at least 128 rows of windows,
/// and all if they have less than 266.
///
/// Measured on 37 photographs and 9 drawn rooms at ten levels each, it differs from [`ssim`] by at most 6·10⁻⁴ at
/// 640 × 480 and at 2560 × 1440, where it takes a seventh of the time.
///
/// # Errors
/// See [`ssim`].
pub fn sampled_ssim(a: &Rgb, b: &Rgb) -> Result<f64> {
    check_sizes(a, b)?;
    let rows = a.height() - (TAPS - 1);
    Ok(match (rows / MIN_SAMPLED_ROWS).min(MAX_STEP) {
        0 | 1 => mean_similarity(a, b, Isa::best()),
        step => mean_sampled_similarity(a, b, step, Isa::best()),
    })
}

/// Checks that both images have the same size, and at least that of the window.
fn check_sizes(a: &Rgb, b: &Rgb) -> Result<()> {
    same_size(a, b)?;
    let (height, width) = (a.height(), a.width());
    if height < TAPS || width < TAPS {
        let problem = format_args!("{width} × {height} pixels are fewer than the window's {TAPS} × {TAPS}");
        return Err(Error::data("pair", problem));
    }
    Ok(())
}

/// Mean similarity over all windows. Row sums are added in row order, so that the result does not depend on the number
/// of threads.
fn mean_similarity(a: &Rgb, b: &Rgb, isa: Isa) -> f64 {
    let [height, width] = [a.height(), a.width()].map(|side| side - (TAPS - 1));
    let window = window();
    let mut sums = vec![0.0; height];
    sums.par_chunks_mut(BAND).enumerate().for_each(|(band, sums)| {
        isa.run(Band { images: [a, b], first: band * BAND, window: &window, sums });
    });
    sums.iter().sum::<f64>() / (3 * height * width) as f64
}

/// Mean similarity over every `step`th row of windows; equally many rows are left out at both ends. Row sums are added
/// in row order.
fn mean_sampled_similarity(a: &Rgb, b: &Rgb, step: usize, isa: Isa) -> f64 {
    let [height, width] = [a.height(), a.width()].map(|side| side - (TAPS - 1));
    let first = (height - 1) % step / 2;
    let window = window();
    let mut sums = vec![0.0; (height - first).div_ceil(step)];
    sums.par_iter_mut().enumerate().for_each(|(row, sum)| {
        isa.run(SampledRow { images: [a, b], row: first + row * step, window: &window, sum });
    });
    sums.iter().sum::<f64>() / (3 * sums.len() * width) as f64
}

/// Gaussian weights of standard deviation 1.5 pixels; their sum is 1.
fn window() -> WindowWeights {
    let weights: [f64; TAPS] = std::array::from_fn(|tap| {
        let distance = tap as f64 - RADIUS as f64;
        libm::exp(-0.5 * distance * distance / (1.5 * 1.5))
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| (weight / sum) as f32)
}

/// Row of numbers, aligned to a cache line: loading a vector that crosses two lines takes two accesses.
#[repr(align(64))]
#[derive(Clone, Copy)]
struct AlignedRow<const N: usize>([f32; N]);

/// Codes of both images in one image row, as far as the windows of a tile cover it.
type Codes = [[u8; COVERED]; 2];

/// Adjacent rows of windows of an image pair, computed by one thread.
struct Band<'a> {
    images: [&'a Rgb; 2],
    /// Index of the first row of windows.
    first: usize,
    window: &'a WindowWeights,
    /// Output: the sum of similarities of each row of windows.
    sums: &'a mut [f64],
}

impl Band<'_> {
    /// Number of image rows that the windows of the band cover.
    fn lines(&self) -> usize {
        self.sums.len() + TAPS - 1
    }

    /// Copies the covered codes tile by tile. Reading a tile directly from an image would miss the cache at each row.
    fn tiled(&self) -> Vec<Codes> {
        let stride = 3 * self.images[0].width();
        let lines = self.lines();
        let tiles = (stride - 3 * (TAPS - 1)).div_ceil(TILE);
        let mut tiled = vec![[[MIDDLE; COVERED]; 2]; tiles * lines];
        for line in 0..lines {
            for (index, image) in self.images.iter().enumerate() {
                let row = &image.samples()[(self.first + line) * stride..][..stride];
                for (tile, begin) in (0..tiles).zip((0..).step_by(TILE)) {
                    let covered = &row[begin..stride.min(begin + COVERED)];
                    tiled[tile * lines + line][index][..covered.len()].copy_from_slice(covered);
                }
            }
        }
        tiled
    }
}

impl Kernel for Band<'_> {
    #[inline(always)]
    fn run(self) {
        let windows = 3 * (self.images[0].width() - (TAPS - 1));
        let mut moments = [AlignedRow([0.0; COVERED]); MOMENTS];
        // Ring buffer of the weighted means along the last `TAPS` image rows.
        let mut recent = vec![[AlignedRow([0.0; TILE]); MOMENTS]; TAPS];
        let mut means = [AlignedRow([0.0; TILE]); MOMENTS];
        for (tile, begin) in self.tiled().chunks_exact(self.lines()).zip((0..).step_by(TILE)) {
            for (line, codes) in tile.iter().enumerate() {
                set_moments(&mut moments, codes);
                for (row, moment) in recent[line % TAPS].iter_mut().zip(&moments) {
                    filter_along_row(row, self.window, moment);
                }
                if let Some(first) = (line + 1).checked_sub(TAPS) {
                    for (moment, means) in means.iter_mut().enumerate() {
                        let rows = std::array::from_fn(|tap| &recent[(first + tap) % TAPS][moment]);
                        filter_over_rows(means, self.window, rows);
                    }
                    let mut similarities = similarities(&means);
                    similarities[TILE.min(windows - begin)..].fill(0.0);
                    self.sums[first] += sum(&similarities);
                }
            }
        }
    }
}

/// Computes x, y, x² + y² and xy of samples minus [`MIDDLE`].
#[inline(always)]
fn set_moments(moments: &mut [AlignedRow<COVERED>; MOMENTS], codes: &Codes) {
    let [xs, ys, squares, products] = moments;
    let [x_codes, y_codes] = codes;
    for i in 0..COVERED {
        let [x, y] = [x_codes[i], y_codes[i]].map(|code| f32::from(code) - f32::from(MIDDLE));
        xs.0[i] = x;
        ys.0[i] = y;
        squares.0[i] = x * x + y * y;
        products.0[i] = x * y;
    }
}

/// One row of windows of an image pair.
struct SampledRow<'a> {
    images: [&'a Rgb; 2],
    /// Index of the row of windows, which is that of its first image row.
    row: usize,
    window: &'a WindowWeights,
    /// Output: the sum of similarities.
    sum: &'a mut f64,
}

impl Kernel for SampledRow<'_> {
    #[inline(always)]
    fn run(self) {
        let stride = 3 * self.images[0].width();
        let windows = stride - 3 * (TAPS - 1);
        let rows = self.images.map(|image| &image.samples()[self.row * stride..][..TAPS * stride]);
        let mut padded = [[[MIDDLE; WIDE_COVERED]; TAPS]; 2];
        let mut moments = [AlignedRow([0.0; WIDE_COVERED]); MOMENTS];
        let mut means = [AlignedRow([0.0; WIDE_TILE]); MOMENTS];
        for begin in (0..windows).step_by(WIDE_TILE) {
            let covered = WIDE_COVERED.min(stride - begin);
            if covered < WIDE_COVERED {
                for (padded, rows) in padded.iter_mut().zip(rows) {
                    for (tap, padded) in padded.iter_mut().enumerate() {
                        padded[..covered].copy_from_slice(&rows[tap * stride + begin..][..covered]);
                    }
                }
            }
            let codes = |image: usize| {
                std::array::from_fn(|tap| {
                    let row = rows[image][tap * stride + begin..].first_chunk();
                    row.filter(|_| covered == WIDE_COVERED).unwrap_or(&padded[image][tap])
                })
            };
            set_moment_means(&mut moments, self.window, [codes(0), codes(1)]);
            for (means, moment) in means.iter_mut().zip(&moments) {
                filter_along_row(means, self.window, moment);
            }
            let mut similarities = similarities(&means);
            similarities[WIDE_TILE.min(windows - begin)..].fill(0.0);
            *self.sum += sum(&similarities);
        }
    }
}

/// Rows of codes that a tile covers, one for each weight of the window.
type CodeRows<'a> = [&'a [u8; WIDE_COVERED]; TAPS];

/// Computes the weighted means over rows of x, y, x² + y² and xy of samples minus [`MIDDLE`].
#[inline(always)]
fn set_moment_means(
    means: &mut [AlignedRow<WIDE_COVERED>; MOMENTS],
    window: &WindowWeights,
    [x_codes, y_codes]: [CodeRows<'_>; 2],
) {
    let [xs, ys, squares, products] = means;
    for i in 0..WIDE_COVERED {
        let moments = |tap: usize| {
            let [x, y] = [x_codes[tap][i], y_codes[tap][i]].map(|code| f32::from(code) - f32::from(MIDDLE));
            [x, y, x * x + y * y, x * y]
        };
        let mut sums = moments(RADIUS).map(|moment| window[RADIUS] * moment);
        for (tap, weight) in window[..RADIUS].iter().enumerate() {
            let (one, other) = (moments(tap), moments(TAPS - 1 - tap));
            for moment in 0..MOMENTS {
                sums[moment] += weight * (one[moment] + other[moment]);
            }
        }
        [xs.0[i], ys.0[i], squares.0[i], products.0[i]] = sums;
    }
}

/// Computes the weighted mean along a row for each window. The window is symmetric: two samples share one
/// multiplication.
#[inline(always)]
fn filter_along_row<const WINDOWS: usize, const SAMPLES: usize>(
    means: &mut AlignedRow<WINDOWS>,
    window: &WindowWeights,
    samples: &AlignedRow<SAMPLES>,
) {
    for i in 0..WINDOWS {
        let mut mean = window[RADIUS] * samples.0[i + 3 * RADIUS];
        for (tap, weight) in window[..RADIUS].iter().enumerate() {
            mean += weight * (samples.0[i + 3 * tap] + samples.0[i + 3 * (TAPS - 1 - tap)]);
        }
        means.0[i] = mean;
    }
}

/// Computes the weighted mean over the rows of each window.
#[inline(always)]
fn filter_over_rows(means: &mut AlignedRow<TILE>, window: &WindowWeights, rows: [&AlignedRow<TILE>; TAPS]) {
    for i in 0..TILE {
        let mut mean = window[RADIUS] * rows[RADIUS].0[i];
        for (tap, weight) in window[..RADIUS].iter().enumerate() {
            mean += weight * (rows[tap].0[i] + rows[TAPS - 1 - tap].0[i]);
        }
        means.0[i] = mean;
    }
}

/// Similarity of each window, from the means of x, y, x² + y² and xy.
#[inline(always)]
fn similarities<const N: usize>([x, y, squares, product]: &[AlignedRow<N>; MOMENTS]) -> [f32; N] {
    std::array::from_fn(|i| similarity(x.0[i], y.0[i], squares.0[i], product.0[i]))
}

/// Sum in `f64`, added lane by lane: every instruction set can keep this order.
#[inline(always)]
fn sum<const N: usize>(numbers: &[f32; N]) -> f64 {
    let mut sums = [0.0; LANES];
    for numbers in numbers.as_chunks::<LANES>().0 {
        for lane in 0..LANES {
            sums[lane] += f64::from(numbers[lane]);
        }
    }
    sums.iter().sum()
}

/// Similarity of a window, from the means of x, y, x² + y² and xy of samples minus [`MIDDLE`].
#[inline(always)]
fn similarity(x: f32, y: f32, squares: f32, product: f32) -> f32 {
    const C1: f32 = (0.01 * 255.0) * (0.01 * 255.0);
    const C2: f32 = (0.03 * 255.0) * (0.03 * 255.0);
    let (variances, covariance) = (squares - x * x - y * y, product - x * y);
    let [x, y] = [x, y].map(|mean| mean + f32::from(MIDDLE));
    (2.0 * x * y + C1) * (2.0 * covariance + C2) / ((x * x + y * y + C1) * (variances + C2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Synthetic image that an integer formula generates, so that Python can generate the same image.
    fn image(height: usize, width: usize, salt: usize) -> Rgb {
        Rgb::new(
            height,
            width,
            (0..height * width * 3).map(|i: usize| ((i * i * 31 + i * salt * 17 + salt) % 251) as u8).collect(),
        )
        .unwrap()
    }

    /// Height, width and salt of an image, and its SSIM to the image of salt 1 by scikit-image 0.26.
    const SKIMAGE: [(usize, usize, usize, f64); 4] = [
        (11, 11, 2, 0.046_313_122_302_007_72),
        (24, 40, 3, 0.008_024_444_085_244_848),
        (37, 50, 5, 0.011_143_454_653_654_81),
        // Several bands and tiles; the last band and the last tile are partial.
        (150, 101, 5, 0.019_581_441_542_294_38),
    ];

    #[test]
    fn ssim_matches_scikit_image() {
        for (height, width, salt, expected) in SKIMAGE {
            let found = ssim(&image(height, width, 1), &image(height, width, salt)).unwrap();
            assert!((found - expected).abs() < 1e-6, "{height} × {width}: {found}");
        }
    }

    /// Dark images have small variances relative to [`MIDDLE`]², so that `f32` loses digits.
    #[test]
    fn dark_ssim_matches_scikit_image() {
        let [clean, other] = [1, 5].map(|salt| {
            let mut dark = image(150, 101, salt);
            dark.samples_mut().iter_mut().for_each(|code| *code %= 13);
            dark
        });
        let found = ssim(&clean, &other).unwrap();
        assert!((found - 0.723_017_844_581_759_7).abs() < 1e-5, "{found}");
    }

    #[test]
    fn identical_images_have_ssim_one() {
        let [clean, other] = [1, 5].map(|salt| image(150, 101, salt));
        assert!((ssim(&clean, &clean).unwrap() - 1.0).abs() < 1e-6);
        assert!(ssim(&clean, &other).unwrap() < 0.1);
    }

    #[test]
    fn instruction_sets_give_same_bits() {
        let images = [1, 5].map(|salt| image(150, 101, salt));
        let sampled = |a: &Rgb, b: &Rgb, isa| mean_sampled_similarity(a, b, 3, isa);
        for mean in [&mean_similarity as &dyn Fn(&Rgb, &Rgb, Isa) -> f64, &sampled] {
            let bits = |isa| mean(&images[0], &images[1], isa).to_bits();
            let [first, rest @ ..] = &Isa::available().into_iter().map(bits).collect::<Vec<_>>()[..] else {
                unreachable!("every machine has the baseline");
            };
            assert!(rest.iter().all(|bits| bits == first));
        }
    }

    /// A row of an image whose rows are all alike has the mean of all rows. Widths of one tile, several, and a partial
    /// one.
    #[test]
    fn sampled_rows_have_the_similarity_of_their_windows() {
        for width in [11, 90, 91, 170, 301] {
            let [clean, other] = [1, 5].map(|salt| {
                let row = image(1, width, salt).into_samples();
                Rgb::new(300, width, row.repeat(300)).unwrap()
            });
            let (all, sampled) = (ssim(&clean, &other).unwrap(), sampled_ssim(&clean, &other).unwrap());
            assert!((all - sampled).abs() < 1e-6, "{width}: {all} {sampled}");
        }
    }

    #[test]
    fn sampled_rows_represent_the_image() {
        // The lower half differs more than the upper one.
        let clean = image(640, 60, 1);
        let mut other = clean.clone();
        for (i, code) in other.samples_mut().iter_mut().enumerate() {
            let noise = (i * i % 17) as u8 * if i / 180 < 320 { 1 } else { 6 };
            *code = code.saturating_add(noise);
        }
        let (all, sampled) = (ssim(&clean, &other).unwrap(), sampled_ssim(&clean, &other).unwrap());
        assert!((all - sampled).abs() < 2e-3, "{all} {sampled}");
        assert_ne!(all.to_bits(), sampled.to_bits());
    }

    #[test]
    fn images_of_few_rows_are_not_sampled() {
        let [clean, other] = [1, 5].map(|salt| image(255 + TAPS - 1, 40, salt));
        let [all, sampled] = [ssim, sampled_ssim].map(|mean| mean(&clean, &other).unwrap().to_bits());
        assert_eq!(all, sampled);
    }

    #[test]
    fn small_images_are_rejected() {
        let error = ssim(&image(10, 30, 1), &image(10, 30, 1)).unwrap_err().to_string();
        assert!(error.contains("30 × 10"), "{error}");
    }
}
