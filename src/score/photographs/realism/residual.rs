//! Residuals of noisy images relative to their clean image ([`Residuals`]), and the divergence of synthetic residuals
//! from real ones ([`divergence`]).

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::ssim::same_size;
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

/// Number of possible differences of two 8-bit codes: −255 to 255.
const STEPS: usize = 511;

/// Histogram of the differences of codes over all channels, and their moments by clean code.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Residuals {
    /// Number of samples with each difference, from −255 to 255.
    counts: Vec<u64>,
    /// For each clean code: number of samples, sum and sum of squares of the differences.
    codes: Vec<[i64; 3]>,
}

impl Default for Residuals {
    fn default() -> Self {
        Self { counts: vec![0; STEPS], codes: vec![[0; 3]; 256] }
    }
}

impl Residuals {
    /// Computes the residuals of `image` relative to `clean`.
    ///
    /// # Errors
    /// If the sizes differ.
    pub fn new(image: &Rgb, clean: &Rgb) -> Result<Self> {
        same_size(image, clean)?;
        let mut residuals = Self::default();
        for (code, clean) in image.samples().iter().zip(clean.samples()) {
            let difference = i64::from(*code) - i64::from(*clean);
            residuals.counts[(difference + 255) as usize] += 1;
            let [n, sum, squares] = &mut residuals.codes[usize::from(*clean)];
            *n += 1;
            *sum += difference;
            *squares += difference * difference;
        }
        Ok(residuals)
    }

    /// Adds the residuals of another image.
    pub fn add(&mut self, other: &Self) {
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a += b;
        }
        for (a, b) in self.codes.iter_mut().zip(&other.codes) {
            for (a, b) in a.iter_mut().zip(b) {
                *a += b;
            }
        }
    }

    /// Differences of codes, from −255 to 255, each with its share of all samples.
    pub fn shares(&self) -> impl Iterator<Item = (i32, f64)> {
        let n = self.counts.iter().sum::<u64>().max(1) as f64;
        (-255..).zip(self.counts.iter().map(move |count| *count as f64 / n))
    }

    /// For each clean code that occurs: code, number of samples, and mean and standard deviation of its residuals.
    pub fn by_code(&self) -> impl Iterator<Item = (usize, i64, [f64; 2])> {
        self.codes.iter().enumerate().filter(|(_, [n, ..])| *n > 0).map(|(code, [n, sum, squares])| {
            let [count, sum, squares] = [*n, *sum, *squares].map(|x| x as f64);
            let mean = sum / count;
            (code, *n, [mean, (squares / count - mean * mean).max(0.0).sqrt()])
        })
    }

    /// Number of samples in each bin.
    fn binned(&self, bins: Bins) -> Vec<u64> {
        let mut binned = vec![0; bins.count()];
        for (difference, count) in (-255..).zip(&self.counts) {
            binned[bins.index(difference)] += count;
        }
        binned
    }
}

/// The bins of a residual histogram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Bins {
    /// Residuals in [0, 1] units, 64 bins from −0.1 to 0.1 and one beyond either end, as in the code of Fu et al. 2023.
    #[default]
    Fu,
    /// Residuals in codes, edges −260, −256 … 260, and one count added to each bin (Kousha et al. 2022).
    Kousha,
}

/// Rule for empty bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum EmptyBins {
    /// 10⁻⁸ is added to the share of each bin, and the shares are normalized to sum to 1 again.
    #[default]
    Eps,
    /// Only bins that are filled on both sides are used, and the shares are not normalized: a synthesis without noise
    /// then has a divergence of 0 or less.
    Drop,
}

impl EmptyBins {
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Eps => Self::Drop,
            Self::Drop => Self::Eps,
        }
    }
}

impl Bins {
    fn count(self) -> usize {
        match self {
            Self::Fu => 66,
            Self::Kousha => 130,
        }
    }

    /// Bin of a difference of codes.
    fn index(self, difference: i32) -> usize {
        match self {
            // A value on an edge belongs to the bin above, as in numpy.
            Self::Fu => {
                let residual = f64::from(difference) / 255.0;
                (0..65).take_while(|edge| inner_edge(*edge) <= residual).count()
            }
            Self::Kousha => ((difference + 260) / 4) as usize,
        }
    }
}

/// Inner edge of [`Bins::Fu`]. The edges are those of numpy's `arange(-0.1, 0.1 + 1e-9, 0.2 / 64)`: s + i · d with d =
/// (s + 0.2/64) − s. The middle edge is 8·10⁻¹⁷, not 0, so that a residual of 0 is counted in the bin below it.
fn inner_edge(index: usize) -> f64 {
    const FIRST: f64 = -0.1;
    let step = (FIRST + 0.2 / 64.0) - FIRST;
    FIRST + index as f64 * step
}

/// Divergence of synthetic residuals from real ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Divergence {
    /// D_KL(real ‖ synthetic) in nats.
    pub nats: f64,
    /// Number of bins that are empty on the synthetic side only.
    pub empty: usize,
}

/// Computes D_KL(real ‖ synthetic) of two sets of residuals. The rule is ignored for [`Bins::Kousha`], which has no
/// empty bins.
#[must_use]
pub fn divergence(real: &Residuals, synthetic: &Residuals, bins: Bins, rule: EmptyBins) -> Divergence {
    let [real, synthetic] = [real, synthetic].map(|residuals| residuals.binned(bins));
    let empty = real.iter().zip(&synthetic).filter(|(p, q)| **p > 0 && **q == 0).count();
    let added = match (bins, rule) {
        (Bins::Kousha, _) => AddedCount::Count,
        (Bins::Fu, EmptyBins::Eps) => AddedCount::Share,
        (Bins::Fu, EmptyBins::Drop) => AddedCount::Nothing,
    };
    let [real, synthetic] = [real, synthetic].map(|counts| shares(&counts, added));
    let nats =
        real.iter().zip(&synthetic).filter(|(p, q)| **p > 0.0 && **q > 0.0).map(|(p, q)| p * libm::log(p / q)).sum();
    Divergence { nats, empty }
}

/// Amount added to each bin.
#[derive(Clone, Copy)]
enum AddedCount {
    Nothing,
    /// 1 to the count.
    Count,
    /// 10⁻⁸ to the share.
    Share,
}

/// Share of each bin, after adding an amount to each.
fn shares(counts: &[u64], added: AddedCount) -> Vec<f64> {
    let n = counts.iter().sum::<u64>() as f64;
    let raised: Vec<f64> = counts
        .iter()
        .map(|count| match added {
            AddedCount::Nothing => *count as f64 / n,
            AddedCount::Count => *count as f64 + 1.0,
            AddedCount::Share => *count as f64 / n + 1e-8,
        })
        .collect();
    let sum = match added {
        AddedCount::Nothing => 1.0,
        AddedCount::Count | AddedCount::Share => raised.iter().sum(),
    };
    raised.iter().map(|share| share / sum).collect()
}

impl fmt::Display for Bins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Fu => "Fu et al. 2023: 64 bins of 1/320 and two beyond",
            Self::Kousha => "Kousha et al. 2022: bins of 4 codes, one count added to each",
        })
    }
}

impl fmt::Display for EmptyBins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Eps => "eps: 1e-8 added to each bin's share",
            Self::Drop => "drop: bins filled on both sides alone",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residuals(counts: &[(i32, u64)]) -> Residuals {
        let mut residuals = Residuals::default();
        for (difference, count) in counts {
            residuals.counts[(difference + 255) as usize] = *count;
        }
        residuals
    }

    #[test]
    fn equal_residuals_have_no_divergence() {
        let same = residuals(&[(-3, 10), (0, 80), (7, 10)]);
        for (bins, rule) in [(Bins::Fu, EmptyBins::Eps), (Bins::Fu, EmptyBins::Drop), (Bins::Kousha, EmptyBins::Eps)] {
            let found = divergence(&same, &same, bins, rule);
            assert!(found.nats.abs() < 1e-12 && found.empty == 0);
        }
    }

    /// Computed by hand: real (½, ½) against synthetic (1, 0) and against (¼, ¾).
    #[test]
    fn divergence_matches_values_computed_by_hand() {
        let real = residuals(&[(0, 50), (20, 50)]);
        let noiseless = residuals(&[(0, 100)]);
        let dropped = divergence(&real, &noiseless, Bins::Fu, EmptyBins::Drop);
        assert!((dropped.nats - 0.5 * f64::ln(0.5)).abs() < 1e-12);
        assert_eq!(dropped.empty, 1);
        let eps = divergence(&real, &noiseless, Bins::Fu, EmptyBins::Eps);
        let expected = 0.5 * f64::ln(0.5) + 0.5 * f64::ln(0.5 / 1e-8);
        assert!((eps.nats - expected).abs() < 1e-4, "{}", eps.nats);
        let other = residuals(&[(0, 25), (20, 75)]);
        let found = divergence(&real, &other, Bins::Fu, EmptyBins::Drop).nats;
        assert!((found - 0.5 * f64::ln(2.0) - 0.5 * f64::ln(2.0 / 3.0)).abs() < 1e-12);
        let kousha = divergence(&real, &noiseless, Bins::Kousha, EmptyBins::Eps).nats;
        let p = 51.0 / 230.0;
        let expected = p * f64::ln(51.0 / 101.0) + p * f64::ln(51.0);
        assert!((kousha - expected).abs() < 1e-12);
    }

    const NUMPY: [usize; 53] = [
        0, 1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20, 21, 22, 24, 25, 26, 27, 29, 30, 31, 32, 34, 35, 36,
        38, 39, 40, 41, 43, 44, 45, 46, 48, 49, 50, 51, 53, 54, 55, 56, 58, 59, 60, 61, 63, 64, 65,
    ];

    /// The bins of numpy for the residuals k/255, k from −26 to 26: `np.histogram` with the edges above.
    #[test]
    fn bins_match_numpy() {
        let found: Vec<usize> = (-26..=26).map(|k| Bins::Fu.index(k)).collect();
        assert_eq!(found, NUMPY);
        assert_eq!((Bins::Fu.index(-255), Bins::Fu.index(255)), (0, 65));
        assert_eq!([-255, -1, 0, 3, 4, 255].map(|k| Bins::Kousha.index(k)), [1, 64, 65, 65, 66, 128]);
    }

    #[test]
    fn spread_is_reported_by_clean_code() {
        let clean = Rgb::new(1, 2, vec![10, 10, 10, 10, 20, 20]).unwrap();
        let noisy = Rgb::new(1, 2, vec![8, 12, 8, 12, 21, 21]).unwrap();
        let found: Vec<_> = Residuals::new(&noisy, &clean).unwrap().by_code().collect();
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].0, found[0].1), (10, 4));
        assert!(found[0].2[0].abs() < 1e-12 && (found[0].2[1] - 2.0).abs() < 1e-12);
        assert!((found[1].2[0] - 1.0).abs() < 1e-12 && found[1].2[1].abs() < 1e-12);
    }
}
