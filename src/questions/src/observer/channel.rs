//! What a degradation did to the codes of one colour channel, estimated from one image: [`ChannelFit`].
//!
//! The tone curve is the increasing function of the untouched code that is nearest to the received codes (isotonic regression
//! by pool adjacent violators: Ayer et al., Ann. Math. Stat. 26:641, 1955). What is left counts as noise. A global tone curve
//! or gain therefore changes nothing, and what an enhancer invents is no function of the untouched code, so that it is noise.

use darkqa_ground::types::Rgb;

/// Number of codes of a channel.
const CODES: usize = 256;

/// The variance of a code is pooled over this many codes on either side, so that rare codes have one too (chosen).
const POOLED: usize = 8;

/// Sums over the pixels whose untouched code is the same, in one channel.
#[derive(Debug, Clone, Copy, Default)]
struct CodeSums {
    /// Sum of the received codes.
    received: u64,
    /// Sum of their squares.
    squares: u64,
}

/// Number of pixels of each code, for each channel.
pub(super) type Histogram = [[u64; CODES]; 3];

/// The histogram of an image.
pub(super) fn histogram(image: &Rgb) -> Histogram {
    let mut counts = [[0; CODES]; 3];
    let (pixels, _) = image.samples().as_chunks::<3>();
    for pixel in pixels {
        for (counts, code) in counts.iter_mut().zip(pixel) {
            counts[usize::from(*code)] += 1;
        }
    }
    counts
}

/// Tone curve and noise of one channel.
#[derive(Debug, Clone)]
pub(super) struct ChannelFit {
    /// Expected received code for each untouched code; never decreases.
    pub(super) curve: [f64; CODES],
    /// Mean squared residual of each untouched code, pooled over 17 codes, in codes squared.
    pub(super) variance: [f64; CODES],
}

/// The channels of an image, and the share of its variance that they explain.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) channels: [ChannelFit; 3],
    /// R² = 1 − Σ(R − P)² / Σ(R − mean)² over all pixels and channels, from 0 to 1; 0 for a constant image.
    pub(super) explained: f64,
}

impl Fit {
    /// Fits the channels of a received image. `untouched` has the same size and this histogram.
    pub(super) fn of(untouched: &[u8], counts: &Histogram, received: &Rgb) -> Self {
        let sums = sums(untouched, received.samples());
        let (mut residual, mut total) = (0.0, 0.0);
        let channels = [0, 1, 2].map(|channel| {
            let (counts, sums) = (&counts[channel], &sums[channel]);
            let curve = curve(counts, sums);
            let residuals = residuals(counts, sums, &curve);
            residual += residuals.iter().sum::<f64>();
            total += spread(counts, sums);
            ChannelFit {
                variance: pooled(counts, &residuals),
                curve,
            }
        });
        let explained = if total > 0.0 {
            (1.0 - residual / total).clamp(0.0, 1.0)
        } else {
            0.0
        };
        Self {
            channels,
            explained,
        }
    }
}

/// The sums of each untouched code, for each channel.
fn sums(untouched: &[u8], received: &[u8]) -> [[CodeSums; CODES]; 3] {
    let mut sums = [[CodeSums::default(); CODES]; 3];
    let (untouched, _) = untouched.as_chunks::<3>();
    let (received, _) = received.as_chunks::<3>();
    for (untouched, received) in untouched.iter().zip(received) {
        for ((sums, code), received) in sums.iter_mut().zip(untouched).zip(received) {
            let received = u64::from(*received);
            let sum = &mut sums[usize::from(*code)];
            sum.received += received;
            sum.squares += received * received;
        }
    }
    sums
}

/// The increasing curve nearest to the mean received codes. Codes without a pixel lie on straight lines between the others.
fn curve(counts: &[u64; CODES], sums: &[CodeSums; CODES]) -> [f64; CODES] {
    // Value, weight and last code of each block of codes with the same value.
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for code in (0..CODES).filter(|code| counts[*code] > 0) {
        let weight = counts[code] as f64;
        let mut block = (sums[code].received as f64 / weight, weight, code);
        while let Some(&(value, weight, _)) = blocks.last()
            && value >= block.0
        {
            blocks.pop();
            let sum = weight + block.1;
            block = ((value * weight + block.0 * block.1) / sum, sum, code);
        }
        blocks.push(block);
    }
    let mut curve = [0.0; CODES];
    let mut known: Option<usize> = None;
    let mut blocks = blocks.into_iter().peekable();
    for code in (0..CODES).filter(|code| counts[*code] > 0) {
        let Some(&(value, _, last)) = blocks.peek() else {
            break;
        };
        match known {
            None => curve[..=code].fill(value),
            Some(before) => {
                let step = (value - curve[before]) / (code - before) as f64;
                for between in before + 1..code {
                    curve[between] = curve[before] + step * (between - before) as f64;
                }
                curve[code] = value;
            }
        }
        known = Some(code);
        if code == last {
            blocks.next();
        }
    }
    if let Some(last) = known {
        let value = curve[last];
        curve[last..].fill(value);
    }
    curve
}

/// The sum of squared residuals of each code.
fn residuals(
    counts: &[u64; CODES],
    sums: &[CodeSums; CODES],
    curve: &[f64; CODES],
) -> [f64; CODES] {
    std::array::from_fn(|code| {
        let CodeSums { received, squares } = sums[code];
        let fitted = curve[code];
        let sum =
            squares as f64 - 2.0 * fitted * received as f64 + fitted * fitted * counts[code] as f64;
        sum.max(0.0)
    })
}

/// The sum of squared differences of the received codes from their mean.
fn spread(counts: &[u64; CODES], sums: &[CodeSums; CODES]) -> f64 {
    let pixels: u64 = counts.iter().sum();
    let received: u64 = sums.iter().map(|sum| sum.received).sum();
    let squares: u64 = sums.iter().map(|sum| sum.squares).sum();
    let received = received as f64;
    squares as f64 - received * received / pixels.max(1) as f64
}

/// The mean squared residual of each code and its neighbours.
fn pooled(counts: &[u64; CODES], residuals: &[f64; CODES]) -> [f64; CODES] {
    std::array::from_fn(|code| {
        let near = code.saturating_sub(POOLED)..(code + POOLED + 1).min(CODES);
        let pixels: u64 = counts[near.clone()].iter().sum();
        residuals[near].iter().sum::<f64>() / pixels.max(1) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fit of a row of grey pixels.
    fn fit(untouched: &[u8], received: &[u8]) -> Fit {
        let grey = |codes: &[u8]| -> Vec<u8> { codes.iter().flat_map(|code| [*code; 3]).collect() };
        let image = |codes: &[u8]| Rgb::new(1, codes.len(), grey(codes)).unwrap();
        let untouched = image(untouched);
        Fit::of(
            untouched.samples(),
            &histogram(&untouched),
            &image(received),
        )
    }

    #[test]
    fn the_curve_increases_and_passes_through_what_does() {
        let found = fit(&[10, 10, 20, 30, 40], &[4, 6, 8, 7, 90]);
        let curve = &found.channels[0].curve;
        for (code, value) in [
            (0, 5.0),
            (10, 5.0),
            (15, 6.25),
            (20, 7.5),
            (25, 7.5),
            (30, 7.5),
            (35, 48.75),
            (40, 90.0),
            (255, 90.0),
        ] {
            assert!(
                (curve[code] - value).abs() < 1e-9,
                "{code}: {}",
                curve[code]
            );
        }
        // Residuals 1 and 1 at code 10, 0.5 at 20 and 30: pooled over the codes from 2 to 18.
        assert!((found.channels[0].variance[10] - 1.0).abs() < 1e-9);
        assert!((found.channels[0].variance[30] - 0.25).abs() < 1e-9);
        assert!(found.explained > 0.99, "{}", found.explained);
    }

    #[test]
    fn a_falling_or_constant_channel_explains_nothing() {
        for received in [[90, 60, 30, 0], [7; 4]] {
            let found = fit(&[10, 20, 30, 40], &received);
            let curve = &found.channels[0].curve;
            assert!((curve[0] - curve[255]).abs() < 1e-9);
            assert!(found.explained.abs() < 1e-9, "{}", found.explained);
        }
        // One code only, and no pixel at all.
        assert!(fit(&[9, 9], &[1, 3]).explained.abs() < 1e-9);
        let empty = Fit::of(&[], &[[0; 256]; 3], &Rgb::black(1, 1));
        assert!(empty.explained.abs() < 1e-9);
    }
}
