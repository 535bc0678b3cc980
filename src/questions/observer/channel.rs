//! [`ChannelFit`]: effect of a degradation on the codes of one colour channel, estimated from one image.
//!
//! The tone curve is the increasing function of the untouched code that is nearest to the received codes (isotonic
//! regression by pool adjacent violators: Ayer et al., Ann. Math. Stat. 26:641, 1955). The residual counts as noise. A
//! global tone curve or gain therefore changes nothing, and content that an enhancer invents is noise, because it is
//! not a function of the untouched code.

use super::tiles::{CODES, SameCode, TileSums, Tiles};

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
pub(super) struct Fit {
    pub(super) channels: [ChannelFit; 3],
    /// Light and noise of each tile.
    pub(super) tiles: Vec<TileFit>,
    /// True if light and noise are fitted for each tile.
    pub(super) is_local: bool,
    /// R² = 1 − Σ(R − P)² / Σ(R − mean)² over all pixels and channels, with one curve for the whole image; from 0 to 1,
    /// and 0 for a constant image.
    pub(super) explained: f64,
}

impl Fit {
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
    use darkqa_base::types::Rgb;

    use super::*;

    /// The fit of a row of grey pixels.
    fn fit(untouched: &[u8], received: &[u8]) -> Fit {
        let [untouched, received] = [untouched, received].map(|codes| {
            let samples = codes.iter().flat_map(|code| [*code; 3]).collect();
            Rgb::new(1, codes.len(), samples).unwrap()
        });
        let tiles = Tiles::new(&untouched, 16);
        let sums = tiles.sums(untouched.samples(), received.samples());
        Fit::whole(&tiles, &sums)
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
