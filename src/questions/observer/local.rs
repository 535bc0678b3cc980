//! Fit with light and noise that vary across the image: [`fit`].
//!
//! A single curve for all pixels fails if only a part of the image was changed. A covered corner would raise the noise
//! everywhere, and uneven light would look like noise in every tile. This fit therefore estimates the curve together
//! with a smooth light field, by iteratively reweighted least squares: the weight of a tile is the inverse of its mean
//! squared residual, so tiles that contradict the curve count little (Huber and Ronchetti, *Robust Statistics*, 2009,
//! chapter 7).
//!
//! The tiles with contrast then vote. A tile agrees if its received contrast is between half and twice the predicted
//! contrast. If fewer than half of them agree, the image shows something else, and the fit to all pixels is used. An
//! image of another room therefore cannot be confirmed by a few tiles that look alike by chance.
//!
//! [`ChannelFit`]: effect of a degradation on the codes of one colour channel, estimated from one image.
//!
//! The tone curve is the increasing function of the untouched code that is nearest to the received codes (isotonic
//! regression by pool adjacent violators: Ayer et al., Ann. Math. Stat. 26:641, 1955). The residual counts as noise. A
//! global tone curve or gain therefore changes nothing, and content that an enhancer invents is noise, because it is
//! not a function of the untouched code.

use super::tiles::{CODES, SameCode, TileSums, Tiles};

/// Number of rounds before the light field is fitted (chosen). Covered tiles lose their weight first, so the field does
/// not fit them.
const ROUNDS_WITHOUT_FIELD: usize = 3;

/// Total number of rounds of reweighting (chosen).
const ROUNDS: usize = 12;

/// Number of coefficients of the light field, a quadratic polynomial in the tile's position.
const TERMS: usize = 6;

/// Minimum gain of the light (chosen).
pub(super) const MIN_GAIN: f64 = 0.02;

/// Ratio of received to predicted contrast at which a tile agrees: from half-way between no contrast and the predicted
/// contrast, to the inverse.
const AGREEING: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Minimum signal-to-noise ratio of a tile's predicted contrast for the tile to contradict the prediction (chosen, as
/// for an element of an outline).
const MIN_SNR: f64 = 6.8;

/// Maximum ratio of a tile's mean squared residual to the median over all tiles (chosen). A tile is disturbed if it
/// exceeds this ratio and [`MAX_UNEXPLAINED`].
const MAX_RESIDUAL: f64 = 9.0;

/// Maximum ratio of a tile's sum of squared residuals to its squared predicted contrasts (chosen).
const MAX_UNEXPLAINED: f64 = 0.25;

/// Number of pixels with the expected noise that are added to each tile, to shrink its noise towards that of all tiles
/// (chosen).
const SHARED_PIXELS: f64 = 64.0;

/// Fits the channels of a received image: tile by tile if enough tiles agree with one curve, else with one fit for all
/// pixels.
pub(super) fn fit(tiles: &Tiles, sums: &TileSums) -> ImageFit {
    let whole = ImageFit::whole(tiles, sums);
    by_tile(tiles, sums, &whole).unwrap_or(whole)
}

/// Fit with the light and noise of each tile; `None` unless at least half of the tiles with contrast agree. `whole` is
/// the fit to all pixels, from which the iteration starts.
fn by_tile(tiles: &Tiles, sums: &TileSums, whole: &ImageFit) -> Option<ImageFit> {
    let curves = curves(tiles, sums, whole);
    let moments = moments(tiles, sums, &curves);
    let contrasts: Vec<TileContrast> = moments.iter().map(TileContrast::from_moments).collect();
    let [agreeing, voting] =
        (0..tiles.len()).filter(|tile| tiles.has_contrast(*tile)).fold([0, 0], |[agreeing, voting], tile| {
            let agrees = AGREEING.contains(&contrasts[tile].amplitude);
            [agreeing + usize::from(agrees), voting + 1]
        });
    if agreeing == 0 || 2 * agreeing < voting {
        return None;
    }
    let median_residual = median(contrasts.iter().map(|contrast| contrast.residual)).max(ROUNDING);
    let disturbed: Vec<bool> = contrasts
        .iter()
        .enumerate()
        .map(|(tile, contrast)| {
            contrast.is_disturbed(median_residual) || tiles.has_contrast(tile) && contrast.contradicts_prediction()
        })
        .collect();
    let channels = [0, 1, 2].map(|channel| {
        let mut codes = CodeTotals::default();
        for tile in (0..tiles.len()).filter(|tile| !disturbed[*tile]) {
            let gain = moments[tile][channel].gain();
            codes.add(tiles.by_code(sums, tile, channel), gain, 1.0);
        }
        let curve = curves[channel];
        ChannelFit { variance: codes.noise(&curve), curve }
    });
    let tile_fits = (0..tiles.len())
        .map(|tile| TileFit {
            gain: moments[tile].map(|moments| moments.gain()),
            noise: [0, 1, 2].map(|channel| {
                let variance = &channels[channel].variance;
                let expected: f64 =
                    tiles.by_code(sums, tile, channel).map(|same| same.count * variance[same.code].max(ROUNDING)).sum();
                moments[tile][channel].noise(expected)
            }),
            is_disturbed: disturbed[tile],
        })
        .collect();
    Some(ImageFit { tiles: tile_fits, channels, is_local: true, explained: whole.explained })
}

/// Estimates the curve of each channel by iteratively reweighted least squares over the tiles, starting from `whole`.
fn curves(tiles: &Tiles, sums: &TileSums, whole: &ImageFit) -> [[f64; CODES]; 3] {
    let mut curves = [0, 1, 2].map(|channel| whole.channels[channel].curve);
    let mut weights = vec![1.0; tiles.len()];
    let mut gains = vec![[1.0; 3]; tiles.len()];
    for round in 0..ROUNDS {
        let moments = moments(tiles, sums, &curves);
        if round >= ROUNDS_WITHOUT_FIELD {
            gains = light_field(tiles, &moments, &weights);
        }
        let residuals: Vec<f64> = moments
            .iter()
            .zip(&gains)
            .map(|(moments, gains)| {
                let residual: f64 = moments.iter().zip(gains).map(|(moments, gain)| moments.residual(*gain)).sum();
                residual / moments.iter().map(|moments| moments.pixels).sum::<f64>().max(1.0)
            })
            .collect();
        let floor = f64::max(0.1 * median(residuals.iter().copied()), ROUNDING);
        weights = residuals.iter().map(|residual| 1.0 / (residual + floor)).collect();
        curves = [0, 1, 2].map(|channel| {
            let mut codes = CodeTotals::default();
            for tile in 0..tiles.len() {
                let pixels = tiles.by_code(sums, tile, channel);
                codes.add(pixels, gains[tile][channel], weights[tile]);
            }
            codes.curve()
        });
    }
    curves
}

/// Sums over the pixels of one tile in one channel, with P the predicted and R the received code.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    /// Number of pixels.
    pixels: f64,
    /// Σ P.
    predicted: f64,
    /// Σ P².
    power: f64,
    /// Σ R.
    received: f64,
    /// Σ R².
    squares: f64,
    /// Σ P R.
    product: f64,
}

impl Moments {
    /// Least-squares gain of the light; 1 if nothing is predicted.
    fn gain(&self) -> f64 {
        if self.power > 0.0 { self.product / self.power } else { 1.0 }
    }

    /// Sum of squared residuals at a given gain of the light.
    fn residual(&self, gain: f64) -> f64 {
        (self.squares - 2.0 * gain * self.product + gain * gain * self.power).max(0.0)
    }

    /// Ratio of the noise variance to the expected variance. `expected` is the sum of the expected variances of the
    /// pixels.
    fn noise(&self, expected: f64) -> f64 {
        let shared = SHARED_PIXELS * expected / self.pixels.max(1.0);
        (self.residual(self.gain()) + shared) / (expected + shared).max(ROUNDING)
    }
}

/// Moments of each tile and channel.
fn moments(tiles: &Tiles, sums: &TileSums, curves: &[[f64; CODES]; 3]) -> Vec<[Moments; 3]> {
    (0..tiles.len())
        .map(|tile| {
            [0, 1, 2].map(|channel| {
                let mut moments = Moments::default();
                for same in tiles.by_code(sums, tile, channel) {
                    let predicted = curves[channel][same.code];
                    moments.pixels += same.count;
                    moments.predicted += predicted * same.count;
                    moments.power += predicted * predicted * same.count;
                    moments.received += same.received;
                    moments.squares += same.squares;
                    moments.product += predicted * same.received;
                }
                moments
            })
        })
        .collect()
}

/// Received contrast of a tile compared with the predicted contrast, over all channels.
#[derive(Debug, Clone, Copy)]
struct TileContrast {
    /// Slope of received over predicted codes, after the tile's own gain; 0 if no contrast is predicted.
    amplitude: f64,
    /// Sum of the squared predicted contrasts.
    power: f64,
    /// Mean squared residual of a sample at the tile's own gain.
    residual: f64,
    /// Number of samples.
    samples: f64,
}

impl TileContrast {
    fn from_moments(channels: &[Moments; 3]) -> Self {
        let (mut product, mut power, mut residual, mut samples) = (0.0, 0.0, 0.0, 0.0);
        for moments in channels {
            let (gain, pixels) = (moments.gain(), moments.pixels.max(1.0));
            let mean = moments.predicted / pixels;
            product += gain * (moments.product - mean * moments.received);
            power += gain * gain * (moments.power - mean * moments.predicted).max(0.0);
            residual += moments.residual(gain);
            samples += moments.pixels;
        }
        Self {
            amplitude: if power > 0.0 { product / power } else { 0.0 },
            power,
            residual: residual / f64::max(samples, 1.0),
            samples,
        }
    }

    /// True if the residual exceeds the noise. `median_residual` is the median over all tiles of the mean squared
    /// residual.
    fn is_disturbed(&self, median_residual: f64) -> bool {
        self.residual > MAX_RESIDUAL * median_residual && self.residual * self.samples > MAX_UNEXPLAINED * self.power
    }

    /// True if the predicted contrast is strong enough to detect and the received contrast does not agree with it.
    fn contradicts_prediction(&self) -> bool {
        let squared_snr = self.power / self.residual.max(ROUNDING);
        squared_snr >= MIN_SNR * MIN_SNR && !AGREEING.contains(&self.amplitude)
    }
}

/// Gains of the smooth light field at each tile and channel, from a weighted least-squares fit of the polynomial.
fn light_field(tiles: &Tiles, moments: &[[Moments; 3]], weights: &[f64]) -> Vec<[f64; 3]> {
    let rows = tiles.len().div_ceil(tiles.columns.max(1));
    let terms: Vec<[f64; TERMS]> = (0..tiles.len())
        .map(|tile| {
            let [column, row] = tiles.column_and_row(tile);
            // Centre of the tile, from −1 to 1.
            let x = (2.0 * column + 1.0) / tiles.columns as f64 - 1.0;
            let y = (2.0 * row + 1.0) / rows as f64 - 1.0;
            [1.0, x, y, x * x, x * y, y * y]
        })
        .collect();
    let fields = [0, 1, 2].map(|channel| {
        let mut equations = NormalEquations::<TERMS>::default();
        for ((moments, terms), weight) in moments.iter().zip(&terms).zip(weights) {
            let moments = &moments[channel];
            equations.add(terms, weight * moments.power, weight * moments.product);
        }
        equations.solve()
    });
    terms
        .iter()
        .map(|terms| {
            fields.map(|field| {
                let gain: f64 = field.iter().zip(terms).map(|(c, term)| c * term).sum();
                gain.max(MIN_GAIN)
            })
        })
        .collect()
}

/// Normal equations of a weighted linear regression on `N` terms; the first term is constant.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations<const N: usize> {
    matrix: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> Default for NormalEquations<N> {
    fn default() -> Self {
        Self { matrix: [[0.0; N]; N], right: [0.0; N] }
    }
}

impl<const N: usize> NormalEquations<N> {
    /// Adds observations that share these terms: `power` is the sum of their squared predictors, `product` the sum of
    /// predictor × response.
    pub(super) fn add(&mut self, terms: &[f64; N], power: f64, product: f64) {
        for (i, row) in self.matrix.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value += power * terms[i] * terms[j];
            }
            self.right[i] += product * terms[i];
        }
    }

    /// Returns the coefficients; without observations, the constant term is 1 and the others are 0. A small ridge keeps
    /// terms near 0 that the observations do not determine.
    pub(super) fn solve(mut self) -> [f64; N] {
        let total = self.matrix[0][0];
        let mut solution = [0.0; N];
        solution[0] = 1.0;
        if total <= 0.0 {
            return solution;
        }
        for i in 1..N {
            self.matrix[i][i] += 1e-6 * total;
        }
        // Gaussian elimination; the matrix is positive definite, so it needs no pivoting.
        for i in 0..N {
            for row in i + 1..N {
                let factor = self.matrix[row][i] / self.matrix[i][i];
                for column in i..N {
                    self.matrix[row][column] -= factor * self.matrix[i][column];
                }
                self.right[row] -= factor * self.right[i];
            }
        }
        for i in (0..N).rev() {
            let known: f64 = (i + 1..N).map(|j| self.matrix[i][j] * solution[j]).sum();
            solution[i] = (self.right[i] - known) / self.matrix[i][i];
        }
        solution
    }
}

/// Median of the values, the upper one of two middle values; 0 without values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Number of codes on either side over which the variance of a code is pooled, so that rare codes also have a variance
/// (chosen).
const POOLED: usize = 8;

/// Variance of rounding to whole codes, in codes squared.
pub(super) const ROUNDING: f64 = 1.0 / 12.0;

/// Tone curve and noise of one channel.
#[derive(Debug, Clone)]
pub(super) struct ChannelFit {
    /// Expected received code for each untouched code in light of gain 1; never decreases.
    pub(super) curve: [f64; CODES],
    /// Mean squared residual of each untouched code, pooled over 17 codes, in codes squared.
    pub(super) variance: [f64; CODES],
}

/// Light and noise of a tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct TileFit {
    /// Gain of the light in each channel, relative to the curve.
    pub(super) gain: [f64; 3],
    /// Variance of the noise in each channel, relative to that of the codes.
    pub(super) noise: [f64; 3],
    /// True if something other than light and noise disturbs the tile, such as a box that covers a part of it.
    pub(super) is_disturbed: bool,
}

impl Default for TileFit {
    fn default() -> Self {
        Self { gain: [1.0; 3], noise: [1.0; 3], is_disturbed: false }
    }
}

/// Fitted channels of an image, and the share of its variance that they explain.
#[derive(Debug, Clone)]
pub(super) struct ImageFit {
    pub(super) channels: [ChannelFit; 3],
    /// Light and noise of each tile.
    pub(super) tiles: Vec<TileFit>,
    /// True if light and noise are fitted for each tile.
    pub(super) is_local: bool,
    /// R² = 1 − Σ(R − P)² / Σ(R − mean)² over all pixels and channels, with one curve for the whole image; from 0 to 1,
    /// and 0 for a constant image.
    pub(super) explained: f64,
}

impl ImageFit {
    /// Fits one curve for each channel to all pixels.
    pub(super) fn whole(tiles: &Tiles, sums: &TileSums) -> Self {
        let (mut residual, mut total) = (0.0, 0.0);
        let channels = [0, 1, 2].map(|channel| {
            let mut codes = CodeTotals::default();
            for tile in 0..tiles.len() {
                codes.add(tiles.by_code(sums, tile, channel), 1.0, 1.0);
            }
            let fit = codes.fit();
            residual += codes.residuals(&fit.curve).iter().sum::<f64>();
            total += codes.total_squares();
            fit
        });
        Self {
            channels,
            tiles: vec![TileFit::default(); tiles.len()],
            is_local: false,
            explained: if total > 0.0 { (1.0 - residual / total).clamp(0.0, 1.0) } else { 0.0 },
        }
    }
}

/// Sums over the pixels of each untouched code, in one channel. Each pixel has a weight and a gain of the light.
#[derive(Debug, Clone)]
pub(super) struct CodeTotals {
    /// Σ weight.
    weight: [f64; CODES],
    /// Σ weight · gain².
    power: [f64; CODES],
    /// Σ weight · gain · received code.
    received: [f64; CODES],
    /// Σ weight · received code².
    squares: [f64; CODES],
}

impl Default for CodeTotals {
    fn default() -> Self {
        Self { weight: [0.0; CODES], power: [0.0; CODES], received: [0.0; CODES], squares: [0.0; CODES] }
    }
}

impl CodeTotals {
    /// Adds pixels with a common gain and weight.
    pub(super) fn add(&mut self, pixels: impl Iterator<Item = SameCode>, gain: f64, weight: f64) {
        for same in pixels {
            self.weight[same.code] += weight * same.count;
            self.power[same.code] += weight * gain * gain * same.count;
            self.received[same.code] += weight * gain * same.received;
            self.squares[same.code] += weight * same.squares;
        }
    }

    /// Fits the curve, and the noise around it.
    fn fit(&self) -> ChannelFit {
        let curve = self.curve();
        ChannelFit { variance: self.noise(&curve), curve }
    }

    /// Fits the increasing curve nearest to the received codes; codes without pixels are interpolated linearly.
    pub(super) fn curve(&self) -> [f64; CODES] {
        let occurs = |code: &usize| self.power[*code] > 0.0;
        // Value, weight and last code of each block of codes with the same value.
        let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
        for code in (0..CODES).filter(occurs) {
            let weight = self.power[code];
            let mut block = (self.received[code] / weight, weight, code);
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
        for code in (0..CODES).filter(occurs) {
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

    /// Mean squared residual of each code, pooled with its neighbours.
    pub(super) fn noise(&self, curve: &[f64; CODES]) -> [f64; CODES] {
        let residuals = self.residuals(curve);
        std::array::from_fn(|code| {
            let near = code.saturating_sub(POOLED)..(code + POOLED + 1).min(CODES);
            let weight: f64 = self.weight[near.clone()].iter().sum();
            let residual: f64 = residuals[near].iter().sum();
            if weight > 0.0 { residual / weight } else { 0.0 }
        })
    }

    /// Sum of squared residuals of each code.
    fn residuals(&self, curve: &[f64; CODES]) -> [f64; CODES] {
        std::array::from_fn(|code| {
            let fitted = curve[code];
            let sum = self.squares[code] - 2.0 * fitted * self.received[code] + fitted * fitted * self.power[code];
            sum.max(0.0)
        })
    }

    /// Sum of squared differences of the received codes from their mean, if all gains are 1.
    fn total_squares(&self) -> f64 {
        let [weight, received, squares] =
            [&self.weight, &self.received, &self.squares].map(|sums| sums.iter().sum::<f64>());
        if weight > 0.0 { squares - received * received / weight } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Rgb;

    /// The fit of a row of grey pixels.
    fn fit(untouched: &[u8], received: &[u8]) -> ImageFit {
        let [untouched, received] = [untouched, received].map(|codes| {
            let samples = codes.iter().flat_map(|code| [*code; 3]).collect();
            Rgb::new(1, codes.len(), samples).unwrap()
        });
        let tiles = Tiles::new(&untouched, 16);
        let sums = tiles.sums(untouched.samples(), received.samples());
        ImageFit::whole(&tiles, &sums)
    }

    #[test]
    fn curve_is_the_isotonic_fit() {
        let found = fit(&[10, 10, 20, 30, 40], &[4, 6, 8, 7, 90]);
        let curve = &found.channels[0].curve;
        for (code, value) in
            [(0, 5.0), (10, 5.0), (15, 6.25), (20, 7.5), (25, 7.5), (30, 7.5), (35, 48.75), (40, 90.0), (255, 90.0)]
        {
            assert!((curve[code] - value).abs() < 1e-9, "{code}: {}", curve[code]);
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
        // One code only.
        assert!(fit(&[9, 9], &[1, 3]).explained.abs() < 1e-9);
    }
}
