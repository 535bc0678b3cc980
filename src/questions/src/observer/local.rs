//! Light and noise that differ from place to place: [`fit`].
//!
//! One curve for all pixels is wrong if only a part of an image was changed: what covers one corner would count as noise
//! everywhere, and uneven light as noise in every tile. So the curve is estimated together with a smooth field of light, from the
//! tiles that agree with it: iteratively reweighted least squares, in which the weight of a tile is the inverse of its mean squared
//! residual (Huber and Ronchetti, *Robust Statistics*, 2009, chapter 7).
//!
//! The tiles vote on the result. A tile with contrast agrees if the received contrast is between half and twice the predicted one.
//! Unless at least half of them agree, the image is another one, and there is no local fit. So an image of another room is judged by
//! all of its pixels, and cannot be confirmed by the few tiles that happen to look alike.

use super::channel::{ChannelFit, CodeTotals, Fit, ROUNDING, TileFit};
use super::tiles::{CODES, TileSums, Tiles};

/// Rounds of reweighting without a field of light, so that a covered part is not mistaken for a bright one (chosen).
const ROUNDS_WITHOUT_FIELD: usize = 3;

/// Rounds of reweighting (chosen).
const ROUNDS: usize = 12;

/// Coefficients of the field of light: a polynomial of the second degree in the place.
const TERMS: usize = 6;

/// Least gain of the light (chosen).
pub(super) const MIN_GAIN: f64 = 0.02;

/// Contrast of a tile that agrees, relative to the predicted one: nearer to "as predicted" than to "nothing", and the inverse.
const AGREEING: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Least signal-to-noise ratio of a tile's contrast at which the tile can deny it (chosen, that of an outline's element).
const CERTAIN: f64 = 6.8;

/// A tile is disturbed if its mean squared residual is above this many times the median of all tiles (chosen), and above
/// [`MAX_UNEXPLAINED`] of its own contrast.
const MAX_RESIDUAL: f64 = 9.0;

/// See [`MAX_RESIDUAL`] (chosen).
const MAX_UNEXPLAINED: f64 = 0.25;

/// Number of pixels by which the noise of a tile is drawn to that of all tiles (chosen).
const SHARED_PIXELS: f64 = 64.0;

/// Fits the channels of a received image: tile by tile if most tiles agree with one curve, else all pixels alike.
pub(super) fn fit(tiles: &Tiles, sums: &TileSums) -> Fit {
    let whole = Fit::whole(tiles, sums);
    by_tile(tiles, sums, &whole).unwrap_or(whole)
}

/// The fit with light and noise of each tile; `None` unless at least half of the tiles with contrast agree. `whole` is the fit to
/// all pixels.
fn by_tile(tiles: &Tiles, sums: &TileSums, whole: &Fit) -> Option<Fit> {
    let curves = curves(tiles, sums, whole);
    let moments = moments(tiles, sums, &curves);
    let found: Vec<Contrast> = moments.iter().map(Contrast::from_moments).collect();
    let [yes, all] = (0..tiles.len())
        .filter(|tile| tiles.has_contrast(*tile))
        .fold([0, 0], |[yes, all], tile| {
            let agrees = AGREEING.contains(&found[tile].amplitude);
            [yes + usize::from(agrees), all + 1]
        });
    if yes == 0 || 2 * yes < all {
        return None;
    }
    let usual = median(found.iter().map(|contrast| contrast.residual)).max(ROUNDING);
    let disturbed = |tile: usize| {
        let contrast = &found[tile];
        contrast.is_disturbed(usual) || tiles.has_contrast(tile) && contrast.is_denied()
    };
    let disturbed: Vec<bool> = (0..tiles.len()).map(disturbed).collect();
    let channels = [0, 1, 2].map(|channel| {
        let mut codes = CodeTotals::default();
        for tile in (0..tiles.len()).filter(|tile| !disturbed[*tile]) {
            let gain = moments[tile][channel].gain();
            codes.add(tiles.by_code(sums, tile, channel), gain, 1.0);
        }
        let curve = curves[channel];
        ChannelFit {
            variance: codes.noise(&curve),
            curve,
        }
    });
    let tiles = (0..tiles.len()).map(|tile| TileFit {
        gain: moments[tile].map(|moments| moments.gain()),
        noise: [0, 1, 2].map(|channel| {
            let variance = &channels[channel].variance;
            let pixels = tiles.by_code(sums, tile, channel);
            let expected = pixels.map(|same| same.count * variance[same.code].max(ROUNDING));
            moments[tile][channel].noise(expected.sum())
        }),
        is_disturbed: disturbed[tile],
    });
    Some(Fit {
        tiles: tiles.collect(),
        channels,
        is_local: true,
        explained: whole.explained,
    })
}

/// The curve of each channel, with which most tiles agree.
fn curves(tiles: &Tiles, sums: &TileSums, whole: &Fit) -> [[f64; CODES]; 3] {
    let mut curves = [0, 1, 2].map(|channel| whole.channels[channel].curve);
    let mut weights = vec![1.0; tiles.len()];
    let mut gains = vec![[1.0; 3]; tiles.len()];
    for round in 0..ROUNDS {
        let moments = moments(tiles, sums, &curves);
        if round >= ROUNDS_WITHOUT_FIELD {
            gains = field(tiles, &moments, &weights);
        }
        let residuals: Vec<f64> = moments
            .iter()
            .zip(&gains)
            .map(|(moments, gains)| {
                let residual: f64 = moments
                    .iter()
                    .zip(gains)
                    .map(|(moments, gain)| moments.residual(*gain))
                    .sum();
                residual
                    / moments
                        .iter()
                        .map(|moments| moments.pixels)
                        .sum::<f64>()
                        .max(1.0)
            })
            .collect();
        let floor = f64::max(0.1 * median(residuals.iter().copied()), ROUNDING);
        weights = residuals
            .iter()
            .map(|residual| 1.0 / (residual + floor))
            .collect();
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

/// Sums over the pixels of a tile, in one channel, with P the predicted and R the received code.
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
    /// The gain of the light that explains the received codes best; 1 if nothing is predicted.
    fn gain(&self) -> f64 {
        if self.power > 0.0 {
            self.product / self.power
        } else {
            1.0
        }
    }

    /// The sum of squared residuals in light of a given gain.
    fn residual(&self, gain: f64) -> f64 {
        (self.squares - 2.0 * gain * self.product + gain * gain * self.power).max(0.0)
    }

    /// The variance of the noise relative to the expected one, a sum over the pixels.
    fn noise(&self, expected: f64) -> f64 {
        let shared = SHARED_PIXELS * expected / self.pixels.max(1.0);
        (self.residual(self.gain()) + shared) / (expected + shared).max(ROUNDING)
    }
}

/// The moments of each tile and channel.
fn moments(tiles: &Tiles, sums: &TileSums, curves: &[[f64; CODES]; 3]) -> Vec<[Moments; 3]> {
    let of_channel = |tile: usize, channel: usize| {
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
    };
    let tiles = 0..tiles.len();
    tiles
        .map(|tile| [0, 1, 2].map(|channel| of_channel(tile, channel)))
        .collect()
}

/// The received contrast of a tile against the predicted one, over all channels.
#[derive(Debug, Clone, Copy)]
struct Contrast {
    /// Slope of the received codes over those predicted in the tile's own light; 0 if no contrast is predicted.
    amplitude: f64,
    /// Sum of the squared predicted contrasts.
    power: f64,
    /// Mean squared residual of a sample in the tile's own light.
    residual: f64,
    /// Number of samples.
    samples: f64,
}

impl Contrast {
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

    /// Whether more is left than noise, with the usual mean squared residual of a sample.
    fn is_disturbed(&self, usual: f64) -> bool {
        self.residual > MAX_RESIDUAL * usual
            && self.residual * self.samples > MAX_UNEXPLAINED * self.power
    }

    /// Whether the contrast is certainly not the predicted one.
    fn is_denied(&self) -> bool {
        let certainty = self.power / self.residual.max(ROUNDING);
        certainty >= CERTAIN * CERTAIN && !AGREEING.contains(&self.amplitude)
    }
}

/// The gains of a smooth field of light at each tile: the polynomial that explains the received codes best.
fn field(tiles: &Tiles, moments: &[[Moments; 3]], weights: &[f64]) -> Vec<[f64; 3]> {
    let rows = tiles.len().div_ceil(tiles.columns.max(1));
    let terms: Vec<[f64; TERMS]> = (0..tiles.len())
        .map(|tile| {
            let [column, row] = tiles.place(tile);
            // From −1 to 1.
            let x = (2.0 * column + 1.0) / tiles.columns as f64 - 1.0;
            let y = (2.0 * row + 1.0) / rows as f64 - 1.0;
            [1.0, x, y, x * x, x * y, y * y]
        })
        .collect();
    let fields = [0, 1, 2].map(|channel| {
        let mut equations = Equations::<TERMS>::default();
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

/// Normal equations of a weighted linear regression on `N` terms; the first is constant.
#[derive(Debug, Clone)]
pub(super) struct Equations<const N: usize> {
    matrix: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> Default for Equations<N> {
    fn default() -> Self {
        Self {
            matrix: [[0.0; N]; N],
            right: [0.0; N],
        }
    }
}

impl<const N: usize> Equations<N> {
    /// Adds observations at a place with these terms: the sum of their squared predictors, and of predictor × response.
    pub(super) fn add(&mut self, terms: &[f64; N], power: f64, product: f64) {
        for (i, row) in self.matrix.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value += power * terms[i] * terms[j];
            }
            self.right[i] += product * terms[i];
        }
    }

    /// The coefficients; the constant 1 if there is no observation. Terms that the observations do not determine are near 0.
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
        // Gaussian elimination; the matrix is positive definite, so no pivot is needed.
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

/// The median, the upper of the middle two; 0 without values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
