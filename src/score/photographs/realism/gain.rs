//! System gain K estimated from the noise of a real pair, [`GainFit`], and of several pairs, [`ProfileFit`].
//!
//! The gain is estimated by indirect inference (Gourieroux, Monfort and Renault 1993, J. Appl. Econometrics 8:S85): the
//! statistic of the real image, its [`SpreadCurve`], is compared with that of synthetic images over a ladder of K.

use std::fmt;

use serde::Serialize;

use super::CameraOrigin;
use super::smooth::{BINS, MIN_VALUES, Mean, SpreadCurve, quantile};
use darkqa_base::types::ProfileName;

/// Number of gains for which synthetic images are made (chosen).
pub const LADDER_STEPS: usize = 15;

/// Minimum and maximum gain, in ADU per electron (chosen; the built-in cameras are between 0.09 and 29).
pub const GAINS: [f64; 2] = [0.02, 30.0];

/// Number of gains, evenly spaced in ln K, at which the curves are compared (chosen).
const FINE: usize = 601;

/// Maximum misfit of a fit, in ln spread (chosen: pairs simulated by this program have up to 0.1, a pair whose
/// low-light image was made without a sensor at least 0.9).
const MAX_MISFIT: f64 = 0.3;

/// Minimum number of bins for a fit (chosen); fewer do not determine the shape of a curve.
const MIN_BINS: usize = 4;

/// Gains of the synthetic images, in ascending order.
#[must_use]
pub fn ladder() -> [f64; LADDER_STEPS] {
    std::array::from_fn(|step| libm::exp(log_gain(step, LADDER_STEPS)))
}

/// ln K of one of `n` gains, evenly spaced over the ladder.
fn log_gain(index: usize, n: usize) -> f64 {
    let [low, high] = GAINS.map(libm::log);
    low + (high - low) * index as f64 / (n - 1) as f64
}

/// Fit of the gain to one pair under one noise profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GainFit {
    /// Gain with the nearest spread, in ADU per electron; `None` without enough smooth blocks.
    pub gain: Option<f64>,
    /// Root mean square over the bins of ln(synthetic spread / real spread) at that gain.
    pub misfit: Option<f64>,
    /// Outcome of the fit.
    pub outcome: FitOutcome,
}

/// Outcome of a gain fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitOutcome {
    /// The spreads agree.
    Fitted,
    /// The spreads do not agree at any gain.
    Misfit,
    /// The nearest gain is an end of the ladder.
    EndOfLadder,
    /// Too few blocks are smooth.
    FewBlocks,
}

impl GainFit {
    /// Finds the gain at which the synthetic spread is nearest to the real one; `synthetic` has one curve for each gain
    /// of [`ladder`].
    #[must_use]
    pub fn fit(real: &SpreadCurve, synthetic: &[SpreadCurve; LADDER_STEPS]) -> Self {
        let bins: Vec<(f64, [f64; LADDER_STEPS])> = (0..BINS)
            .filter_map(|bin| {
                let mut curve = [0.0; LADDER_STEPS];
                for (value, spread) in curve.iter_mut().zip(synthetic) {
                    *value = spread.bins[bin]?;
                }
                Some((real.bins[bin]?, curve))
            })
            .collect();
        if bins.len() < MIN_BINS {
            return Self { gain: None, misfit: None, outcome: FitOutcome::FewBlocks };
        }
        let (index, misfit) = (0..FINE)
            .map(|index| {
                let squares = bins.iter().map(|(real, curve)| {
                    let difference = interpolate(curve, index) - real;
                    difference * difference
                });
                (squares.sum::<f64>() / bins.len() as f64).sqrt()
            })
            .enumerate()
            .fold((0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best });
        Self {
            gain: Some(libm::exp(log_gain(index, FINE))),
            misfit: Some(misfit),
            outcome: if index == 0 || index == FINE - 1 {
                FitOutcome::EndOfLadder
            } else if misfit > MAX_MISFIT {
                FitOutcome::Misfit
            } else {
                FitOutcome::Fitted
            },
        }
    }

    /// Gain, if the fit succeeded.
    #[must_use]
    pub fn fitted(&self) -> Option<f64> {
        self.gain.filter(|_| self.outcome == FitOutcome::Fitted)
    }
}

/// Value of a curve over the ladder at one of the fine gains, by linear interpolation in ln K.
fn interpolate(curve: &[f64; LADDER_STEPS], index: usize) -> f64 {
    let position = index as f64 * (LADDER_STEPS - 1) as f64 / (FINE - 1) as f64;
    let below = (position as usize).min(LADDER_STEPS - 2);
    let [low, high] = [curve[below], curve[below + 1]];
    low + (position - below as f64) * (high - low)
}

impl FitOutcome {
    /// Word in CSV and JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Fitted => "fitted",
            Self::Misfit => "misfit",
            Self::EndOfLadder => "end-of-ladder",
            Self::FewBlocks => "few-blocks",
        }
    }
}

impl fmt::Display for FitOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Fitted => "fitted",
            Self::Misfit => "no fit: the low image's noise is not a sensor's under this noise profile",
            Self::EndOfLadder => {
                "no fit, as the ladder of K ends here: the low image's noise is not a sensor's under this noise profile"
            }
            Self::FewBlocks => "no fit: too few blocks of 8 × 8 pixels are smooth, and neither black nor white",
        })
    }
}

/// Summary of the gains of several pairs under one noise profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PooledGain {
    /// Geometric mean with its 95 % interval by Student's t distribution of ln K; `None` for fewer than 3 pairs.
    pub mean: Option<Mean>,
    /// 10 % and 90 % quantiles of K, computed in ln K, in ADU per electron.
    pub range: [f64; 2],
    /// Number of pairs.
    pub n: usize,
}

impl PooledGain {
    /// Summarizes the fitted gains of pairs; `None` without gains.
    #[must_use]
    pub fn new(gains: &[f64]) -> Option<Self> {
        let mut logs: Vec<f64> = gains.iter().map(|gain| libm::log(*gain)).collect();
        logs.sort_by(f64::total_cmp);
        let range = [quantile(&logs, 0.1)?, quantile(&logs, 0.9)?].map(libm::exp);
        let mean = Mean::from_values(&logs).filter(|mean| mean.interval.is_some());
        Some(Self {
            mean: mean.map(|mean| Mean {
                value: libm::exp(mean.value),
                interval: mean.interval.map(|ends| ends.map(libm::exp)),
                n: mean.n,
            }),
            range,
            n: gains.len(),
        })
    }
}

/// Fits of the gain to all pairs under one noise profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProfileFit {
    /// Name of the noise profile.
    #[serde(rename = "reading")]
    pub profile: ProfileName,
    /// Ratio r assumed by the fit, if images determine only the product r · K; `None` if r is 2^ΔEV.
    pub ratio: Option<f64>,
    /// Summary of the gains of the fitted pairs; `None` if no pair was fitted.
    pub pooled: Option<PooledGain>,
    /// Fit to each pair.
    pub pairs: Vec<PairFit>,
}

/// Fit of the gain to a named pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairFit {
    pub pair: String,
    #[serde(flatten)]
    pub fit: GainFit,
}

impl ProfileFit {
    /// Combines the fits to all pairs.
    #[must_use]
    pub fn new(profile: ProfileName, ratio: Option<f64>, pairs: Vec<PairFit>) -> Self {
        let gains: Vec<f64> = pairs.iter().filter_map(|pair| pair.fit.fitted()).collect();
        Self { profile, ratio, pooled: PooledGain::new(&gains), pairs }
    }

    /// Gains for evaluating a pair, with their source: those of the other pairs if at least 3 are fitted, so that no
    /// pair is evaluated with its own gain; otherwise those of all pairs. `None` if no pair is fitted.
    #[must_use]
    pub fn for_pair(&self, name: &str) -> Option<(PooledGain, CameraOrigin)> {
        let all = self.pooled.clone()?;
        if all.n < MIN_VALUES {
            return Some((all, CameraOrigin::SamePairs));
        }
        let gains: Vec<f64> =
            self.pairs.iter().filter(|pair| pair.pair != name).filter_map(|pair| pair.fit.fitted()).collect();
        PooledGain::new(&gains).map(|gains| (gains, CameraOrigin::OtherPairs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spread ∝ √K in all bins, a bin higher than the one before, times `factor(bin)`.
    fn curve(gain: f64, factor: impl Fn(usize) -> f64) -> SpreadCurve {
        SpreadCurve {
            bins: std::array::from_fn(|bin| Some(0.5 * libm::log(gain * (1.0 + bin as f64)) + libm::log(factor(bin)))),
        }
    }

    fn synthetic() -> [SpreadCurve; LADDER_STEPS] {
        ladder().map(|gain| curve(gain, |_| 1.0))
    }

    #[test]
    fn the_gain_of_a_synthetic_curve_is_found() {
        for gain in [0.03, 0.7746, 11.0] {
            let fit = GainFit::fit(&curve(gain, |_| 1.0), &synthetic());
            assert!((fit.fitted().unwrap() / gain).ln().abs() < 0.01, "{fit:?}");
            assert!(fit.misfit.unwrap() < 0.01);
        }
    }

    #[test]
    fn a_curve_of_another_shape_or_beyond_the_ladder_is_not_fitted() {
        let uneven = curve(1.0, |bin| if bin.is_multiple_of(2) { 1.0 } else { 2.0 });
        let fit = GainFit::fit(&uneven, &synthetic());
        assert_eq!((fit.outcome, fit.fitted()), (FitOutcome::Misfit, None));
        assert!((fit.misfit.unwrap() - f64::ln(2.0) / 2.0).abs() < 0.01);
        for gain in [0.001, 900.0] {
            let fit = GainFit::fit(&curve(gain, |_| 1.0), &synthetic());
            assert_eq!((fit.outcome, fit.fitted()), (FitOutcome::EndOfLadder, None));
        }
        let mut few = curve(1.0, |_| 1.0);
        few.bins[..5].fill(None);
        let fit = GainFit::fit(&few, &synthetic());
        assert_eq!((fit.outcome, fit.gain), (FitOutcome::FewBlocks, None));
        few.bins[4] = Some(0.5 * f64::ln(5.0));
        assert_eq!(GainFit::fit(&few, &synthetic()).outcome, FitOutcome::Fitted);
    }

    #[test]
    fn pairs_have_a_geometric_mean_from_three_on() {
        assert_eq!(PooledGain::new(&[]), None);
        let two = PooledGain::new(&[0.5, 2.0]).unwrap();
        assert_eq!((two.mean, two.n), (None, 2));
        assert!((two.range[0] * two.range[1] - 1.0).abs() < 1e-12);
        let three = PooledGain::new(&[4.0, 0.25, 1.0]).unwrap();
        let mean = three.mean.unwrap();
        // Deviation ln 4 of ln K, t of 2 degrees of freedom 4.302653.
        let half = 4.302_652_730 * f64::ln(4.0) / f64::sqrt(3.0);
        let [low, high] = mean.interval.unwrap();
        assert!((mean.value - 1.0).abs() < 1e-12);
        assert!((low.ln() + half).abs() < 1e-6 && (high.ln() - half).abs() < 1e-6);
        assert!((three.range[1] - f64::powf(4.0, 0.8)).abs() < 1e-9);
    }

    /// A pair is evaluated without its own gain; with fewer than three fitted pairs, the result is marked as using it.
    /// Fit of pairs with these gains.
    fn fit_of_pairs(gains: &[Option<f64>]) -> ProfileFit {
        let pairs = gains.iter().enumerate().map(|(index, gain)| PairFit {
            pair: index.to_string(),
            fit: GainFit {
                gain: *gain,
                misfit: Some(0.1),
                outcome: gain.map_or(FitOutcome::Misfit, |_| FitOutcome::Fitted),
            },
        });
        ProfileFit::new(ProfileName::PAPER, Some(200.0), pairs.collect())
    }

    #[test]
    fn no_pair_is_judged_by_its_own_gain() {
        let four = fit_of_pairs(&[Some(0.1), Some(0.2), None, Some(6.0)]);
        assert_eq!(four.pooled.as_ref().unwrap().n, 3);
        for (pair, n, most) in [("0", 2, 6.0), ("2", 3, 6.0), ("3", 2, 0.2)] {
            let (gains, origin) = four.for_pair(pair).unwrap();
            assert_eq!((gains.n, origin), (n, CameraOrigin::OtherPairs), "{pair}");
            assert!(gains.range[1] < most, "{pair}: {gains:?}");
            assert!((gains.range[1] > 1.0) == (pair != "3"), "{pair}: {gains:?}");
        }
        let (gains, origin) = fit_of_pairs(&[Some(0.1), Some(6.0)]).for_pair("0").unwrap();
        assert_eq!((gains.n, origin), (2, CameraOrigin::SamePairs));
        assert_eq!(fit_of_pairs(&[None, None]).for_pair("0"), None);
    }
}
