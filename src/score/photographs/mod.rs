//! Dark photographs, and the fidelity of images.
//!
//! Relation between the fidelity of images and right answers: [`FidelityFindings`].
//!
//! Exposure drop of dark photographs relative to their frames: [`PairDarkness`].
//!
//! Light in which the photographs of a data set were taken, for reports: [`PhotographedSet`].

pub mod realism;

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::choice::ParsingMode;
use super::grid::Grid;
use super::model_in_condition::{ModelInCondition, pooled_models};
use crate::significance::holm;
use crate::statistics::auc::{Auc, PairCounts, RankedReply};
use darkqa_base::types::{
    AxisLevel, Digest, EnhancerName, Family, FrameId, ImageFidelity, PairFacts, PhotoName, SetLight, Variant, View,
};
use realism::smooth::quantile;

/// Scalar product.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Relation between the similarity of images to their clean frames and the answers.
///
/// Within a condition, only replies of the same model and family are compared: pairs across conditions would only show
/// that darkness costs accuracy. Models are pooled; built-in reference models are left out if there are others, and
/// never pooled with each other.
#[derive(Debug, Clone, PartialEq)]
pub struct FidelityFindings {
    /// Models whose replies are counted.
    pub models: Vec<String>,
    /// One row for each condition with measured images.
    pub conditions: Vec<ConditionFidelity>,
    /// AUC of PSNR and of SSIM for right against wrong answers within conditions, over all conditions.
    pub within: [Option<Auc>; 2],
    /// p-value of the AUC of PSNR after the correction over all tests behind sentences.
    pub p_report: Option<f64>,
    /// Spearman's rank correlation of mean accuracy with mean PSNR and with mean SSIM, over the conditions;
    /// descriptive, without a test. `None` with fewer than three conditions.
    pub between: [Option<f64>; 2],
}

/// Fidelity and accuracy in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct ConditionFidelity {
    pub level: AxisLevel,
    pub variant: Variant,
    /// Enhancer; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Number of different images.
    pub images: usize,
    /// Mean PSNR in dB and mean SSIM over the images; `None` if no image has a finite value.
    pub means: [Option<f64>; 2],
    /// Share of right replies.
    pub accuracy: f64,
    /// Number of replies.
    pub replies: usize,
    /// AUC of PSNR and of SSIM for right against wrong answers; `None` with too few replies.
    pub predicts: [Option<Prediction>; 2],
}

/// An AUC with its p-value after Holm's correction over the conditions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    pub auc: Auc,
    /// p-value after Holm's correction over all conditions.
    pub holm: f64,
}

/// PSNR and SSIM of images.
type MeasuredImages<'a> = HashMap<ImageKey<'a>, [Option<f64>; 2]>;

/// A frame and the digest of an image of it. Both are needed, because two frames may have the same image, for example a
/// black one, but different clean frames.
type ImageKey<'a> = (&'a FrameId, Digest);

/// A condition of the trials with its subjects, one for each model.
type ConditionKey<'a> = (AxisLevel, &'a Variant, Option<&'a EnhancerName>);

impl FidelityFindings {
    /// Computes the findings for the measured images; `None` if no reply is about a measured image.
    #[must_use]
    pub fn new<'a>(grid: &Grid<'a>, measured: &'a [ImageFidelity]) -> Option<Self> {
        let measured: MeasuredImages<'_> = measured
            .iter()
            .map(|image| ((&*image.frame, image.image), [Some(image.psnr.unwrap_or(f64::INFINITY)), image.ssim]))
            .collect();
        if measured.is_empty() {
            return None;
        }
        let pool = pooled_models(grid.listing.without_people(
            grid.subjects.iter().filter(|subject| subject.view == Some(View::Image)).map(|subject| &*subject.model),
        ));
        let mut conditions = BTreeMap::<ConditionKey<'_>, Vec<usize>>::new();
        let mut models = BTreeSet::new();
        for (index, subject) in grid.subjects.iter().enumerate() {
            let is_counted = subject.view == Some(View::Image) && pool.contains(&*subject.model);
            if let (true, Some(level)) = (is_counted, subject.level) {
                let key = (level, &subject.variant, subject.enhancer.as_ref());
                conditions.entry(key).or_default().push(index);
                models.insert(subject.model.clone());
            }
        }
        let mut all = [(); 2].map(|()| PairCounts::new(grid.clusters));
        let mut rows: Vec<ConditionFidelity> = conditions
            .into_iter()
            .filter_map(|(key, subjects)| {
                let sums = ConditionSums::new(grid, &subjects, &measured);
                let (row, pairs) = (sums.row(key)?, &sums.pairs);
                all.iter_mut().zip(pairs).for_each(|(all, pairs)| all.extend(pairs));
                Some(row)
            })
            .collect();
        if rows.is_empty() {
            return None;
        }
        correct(&mut rows);
        Some(Self {
            p_report: None,
            models: models.into_iter().collect(),
            within: all.map(|pairs| pairs.auc()),
            between: [0, 1].map(|index| rank_correlation(&rows, index)),
            conditions: rows,
        })
    }

    /// Row of a condition.
    #[must_use]
    pub fn condition(&self, subject: &ModelInCondition) -> Option<&ConditionFidelity> {
        self.conditions.iter().find(|row| {
            Some(row.level) == subject.level && row.variant == subject.variant && row.enhancer == subject.enhancer
        })
    }
}

/// Sums over the replies in one condition.
struct ConditionSums<'a> {
    images: MeasuredImages<'a>,
    right: usize,
    replies: usize,
    /// Pairs by PSNR and by SSIM.
    pairs: [PairCounts; 2],
}

impl<'a> ConditionSums<'a> {
    fn new(grid: &Grid<'a>, subjects: &[usize], measured: &MeasuredImages<'a>) -> Self {
        let mut sums = Self {
            images: HashMap::new(),
            right: 0,
            replies: 0,
            pairs: [(); 2].map(|()| PairCounts::new(grid.clusters)),
        };
        for &subject in subjects {
            let mut strata = BTreeMap::<&Family, [Vec<RankedReply>; 2]>::new();
            for (index, item) in grid.items.iter().enumerate() {
                let reading = grid.result(subject, index).parsed(ParsingMode::Strict);
                let image = grid.trial(subject, index).and_then(|trial| {
                    let image = trial.images()?;
                    Some((trial.frame(), image.first))
                });
                let (Some(reading), Some(image)) = (reading, image) else {
                    continue;
                };
                let Some(&numbers) = measured.get(&image) else {
                    continue;
                };
                let right = item.is_right(reading);
                sums.images.insert(image, numbers);
                sums.right += usize::from(right);
                sums.replies += 1;
                let stratum = strata.entry(&*item.asked.family).or_default();
                for (replies, number) in stratum.iter_mut().zip(numbers) {
                    replies.extend(number.map(|number| RankedReply { cluster: item.cluster, number, right }));
                }
            }
            for stratum in strata.values_mut() {
                for (pairs, replies) in sums.pairs.iter_mut().zip(stratum) {
                    pairs.add(replies);
                }
            }
        }
        sums
    }

    /// Computes the row of the condition, before correction; `None` without replies.
    fn row(&self, (level, variant, enhancer): ConditionKey<'_>) -> Option<ConditionFidelity> {
        if self.replies == 0 {
            return None;
        }
        Some(ConditionFidelity {
            level,
            variant: variant.clone(),
            enhancer: enhancer.cloned(),
            images: self.images.len(),
            means: [0, 1].map(|index| mean(self.images.values().filter_map(|numbers| numbers[index]))),
            accuracy: self.right as f64 / self.replies as f64,
            replies: self.replies,
            predicts: [0, 1].map(|index| {
                let auc = self.pairs[index].auc()?;
                Some(Prediction { auc, holm: auc.p })
            }),
        })
    }
}

/// Mean of the finite numbers, summed in increasing order, so that it does not depend on their order; `None` without
/// finite numbers.
fn mean(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut finite: Vec<f64> = numbers.filter(|number| number.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    (!finite.is_empty()).then(|| finite.iter().sum::<f64>() / finite.len() as f64)
}

/// Applies Holm's correction over the conditions, for PSNR and for SSIM.
fn correct(rows: &mut [ConditionFidelity]) {
    for index in 0..2 {
        let mut predictions: Vec<&mut Prediction> =
            rows.iter_mut().filter_map(|row| row.predicts[index].as_mut()).collect();
        let values: Vec<f64> = predictions.iter().map(|prediction| prediction.auc.p).collect();
        for (prediction, holm) in predictions.iter_mut().zip(holm(&values)) {
            prediction.holm = holm;
        }
    }
}

/// Spearman's rank correlation of mean accuracy and mean fidelity over the conditions; `None` with fewer than three
/// conditions, or if one of the two is constant.
fn rank_correlation(rows: &[ConditionFidelity], index: usize) -> Option<f64> {
    let (fidelity, accuracy): (Vec<f64>, Vec<f64>) =
        rows.iter().filter_map(|row| Some((row.means[index]?, row.accuracy))).unzip();
    if fidelity.len() < 3 {
        return None;
    }
    let middle = f64::midpoint(fidelity.len() as f64, 1.0);
    let [a, b] = [fidelity, accuracy].map(|values| {
        let mut ranks = ranks(&values);
        for rank in &mut ranks {
            *rank -= middle;
        }
        ranks
    });
    let scale = (dot(&a, &a) * dot(&b, &b)).sqrt();
    (scale > 0.0).then(|| dot(&a, &b) / scale)
}

/// Ranks from 1; equal numbers share the mean of their ranks.
fn ranks(numbers: &[f64]) -> Vec<f64> {
    numbers
        .iter()
        .map(|number: &f64| {
            let below = numbers.iter().filter(|other| *other < number).count();
            let equal = numbers.iter().filter(|other| other.total_cmp(number).is_eq()).count();
            below as f64 + f64::midpoint(equal as f64, 1.0)
        })
        .collect()
}

/// Maximum difference in EV between the drops by mean and by median for a pair that differs in exposure only (chosen).
const MAX_MEAN_MEDIAN_GAP: f64 = 0.5;

/// Darkness of the photographs that a subject was shown, or that its synthetic images were matched to, by frame.
#[must_use]
pub fn pair_facts<'g>(grid: &Grid<'g>, subject: usize) -> BTreeMap<&'g FrameId, PairFacts> {
    (0..grid.items.len())
        .filter_map(|item| grid.trial(subject, item))
        .filter_map(|trial| {
            let image = trial.images()?;
            Some((trial.sent_frame(), *image.pair.as_deref()?))
        })
        .collect()
}

/// Darkness of all photographs of a grid, by name.
#[must_use]
pub fn from_grid(grid: &Grid<'_>) -> Vec<PairDarkness> {
    let named: Vec<(&PhotoName, usize)> = grid
        .subjects
        .iter()
        .enumerate()
        .filter_map(|(index, subject)| Some((subject.variant.photograph()?, index)))
        .collect();
    let names: BTreeSet<&PhotoName> = named.iter().map(|(name, _)| *name).collect();
    names
        .into_iter()
        .filter_map(|name| {
            let facts: BTreeMap<_, _> = named
                .iter()
                .filter(|(other, _)| *other == name)
                .flat_map(|(_, subject)| pair_facts(grid, *subject))
                .collect();
            PairDarkness::new(name, &facts.into_values().collect::<Vec<_>>())
        })
        .collect()
}

/// Exposure drop of the photographs of one name relative to their frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDarkness {
    /// Name of the photographs.
    pub name: PhotoName,
    /// Number of frames with a known drop.
    pub frames: usize,
    /// Number of frames with an unknown drop, because the frame or its photograph is black.
    pub unknown: usize,
    /// Lower quartile, median and upper quartile of the drop in EV.
    pub ev: [f64; 3],
    /// Median of the drops that make synthetic images equally dark, in EV; comparable with levels.
    pub synthesis: f64,
    /// Number of frames whose drop is stated by the data set.
    pub stated: usize,
    /// True if the median is measured beyond the measurable range, so that the true drop may be larger.
    pub is_lower_bound: bool,
    /// Number of frames that are not brighter than their photograph.
    pub brighter: usize,
    /// Medians over the frames of the drop by the mean and of the drop by the median of pixels; `None` if they cannot
    /// be measured.
    pub mean_and_median: Option<[f64; 2]>,
}

/// Known values of some facts, in ascending order.
fn sorted(facts: &[PairFacts], of: fn(&PairFacts) -> Option<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = facts.iter().filter_map(of).collect();
    values.sort_by(f64::total_cmp);
    values
}

impl PairDarkness {
    /// Summarizes the photographs of one name, one for each frame; `None` if no drop is known.
    #[must_use]
    pub fn new(name: &PhotoName, facts: &[PairFacts]) -> Option<Self> {
        let all = sorted(facts, PairFacts::ev);
        let ev = [quantile(&all, 0.25)?, quantile(&all, 0.5)?, quantile(&all, 0.75)?];
        let mean = quantile(&sorted(facts, |facts| facts.median.and(facts.mean)), 0.5);
        let median = quantile(&sorted(facts, |facts| facts.mean.and(facts.median)), 0.5);
        let matching = quantile(&sorted(facts, PairFacts::matching), 0.5);
        let stated = facts.iter().filter(|facts| facts.stated.is_some()).count();
        Some(Self {
            name: name.clone(),
            frames: all.len(),
            unknown: facts.len() - all.len(),
            synthesis: matching.unwrap_or(ev[1]),
            ev,
            stated,
            is_lower_bound: stated < facts.len() && ev[1] > PairFacts::MEASURABLE,
            brighter: all.iter().filter(|ev| **ev <= 0.0).count(),
            mean_and_median: mean.zip(median).map(|(mean, median)| [mean, median]),
        })
    }

    /// Median drop, such as `3.6 EV` or `≥ 6.8 EV`.
    #[must_use]
    pub fn short(&self) -> String {
        let least = if self.is_lower_bound { "≥ " } else { "" };
        format!("{least}{:.1} EV", self.ev[1])
    }

    /// Drop with its quartiles, such as `3.6 EV (quartiles 3.5–3.7), as measured`.
    #[must_use]
    pub fn long(&self) -> String {
        let source = match self.stated {
            0 => "as measured".to_owned(),
            all if all == self.frames => "as the data state".to_owned(),
            some => format!("as the data state for {some} frames, the others as measured"),
        };
        let [low, _, high] = self.ev;
        format!("{} (quartiles {low:.2}–{high:.2}), {source}", self.short())
    }

    /// Warnings about unusual pairs, as full sentences.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let name = &self.name;
        let mut all = Vec::new();
        if self.ev[1] < 0.0 {
            all.push(format!(
                "The photographs {name} are brighter than their frames ({}): were normal and low light swapped?",
                self.short()
            ));
        } else if self.brighter > 0 {
            all.push(format!(
                "{} of {} photographs {name} are not darker than their frames.",
                self.brighter, self.frames
            ));
        }
        if let Some([mean, median]) = self.mean_and_median
            && (mean - median).abs() > MAX_MEAN_MEDIAN_GAP
        {
            all.push(format!(
                "The photographs {name} are {mean:.2} EV darker than their frames by the mean and {median:.2} EV by the median of \
                 pixels: they are not one exposure apart, as with another light, a tone curve or synthesis of another kind."
            ));
        }
        if self.is_lower_bound {
            all.push(format!(
                "Above {} EV, noise that is clipped at black hides a part of the drop, so that {} is a lower bound; \"ev\" in \
                 frames.jsonl states it.",
                PairFacts::MEASURABLE,
                self.short()
            ));
        }
        if self.unknown > 0 {
            all.push(format!(
                "Photographs {name} whose drop is not known, because they or their frames are black: {}.",
                self.unknown
            ));
        }
        all
    }
}

/// Minimum mean linear brightness of photographs of well-lit scenes (chosen: a well-lit room has about 0.15, and 0.04
/// when two stops darker).
const BRIGHT: f64 = 0.08;

/// Light in which the photographs of a data set were taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhotographedSet {
    /// Whether the photographs were taken in the dark.
    pub light: SetLight,
    /// Mean linear luminance of a sample of the photographs, from 0 to 1, and size of the sample; `None` if it was not
    /// measured.
    pub brightness: Option<(f64, usize)>,
    /// Light where the photographs were taken, in lux; `None` if it is not known.
    pub lux: Option<f64>,
    /// Number of images from whose exposure `lux` is estimated ([`lux_of_exposure_value`]); `None` if it was measured.
    pub exposed: Option<usize>,
}

/// Light in lux in which a camera's meter chooses an exposure value at ISO 100: C · 2^EV / 100, with C = 250 lx·s for a
/// flat receptor (ISO 2720:1974, the constant of most incident-light meters).
#[must_use]
pub fn lux_of_exposure_value(exposure_value: f64) -> f64 {
    2.5 * exposure_value.exp2()
}

impl PhotographedSet {
    /// Notice to readers about a data set taken in the dark; `None` for other data sets.
    pub fn notice(self) -> Option<String> {
        if self.light == SetLight::Lit {
            return None;
        }
        let brightness = self.brightness.map(|(mean, frames)| {
            format!(
                " Their mean linear brightness is {mean:.4} of 1 (measured on {frames}); a mid-grey, code 128, is 0.22."
            )
        });
        let is_bright = self.brightness.is_some_and(|(mean, _)| mean >= BRIGHT);
        let doubt = if is_bright {
            " That is as bright as photographs in the light: if these are not from the dark, leave out --light dark."
        } else {
            ""
        };
        Some(format!(
            "These photographs were taken in the dark (--light dark): L0 is each as photographed, there is no image in the light to \
             compare with, and no darkness threshold.{}{doubt}",
            brightness.unwrap_or_default()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(facts: &[(Option<f64>, f64, f64)]) -> PairDarkness {
        let facts: Vec<PairFacts> = facts
            .iter()
            .map(|(stated, mean, median)| PairFacts {
                stated: *stated,
                mean: Some(*mean),
                median: Some(*median),
                synthesis: Some(*mean),
            })
            .collect();
        PairDarkness::new(&PhotoName::numbered(0), &facts).unwrap()
    }

    #[test]
    fn one_exposure_is_its_median_with_quartiles_and_nothing_odd() {
        let pairs = pair(&[(None, 3.5, 3.6), (None, 3.6, 3.6), (None, 3.7, 3.7)]);
        assert_eq!(pairs.short(), "3.6 EV");
        assert_eq!(pairs.long(), "3.6 EV (quartiles 3.55–3.65), as measured");
        assert!(pairs.warnings().is_empty(), "{:?}", pairs.warnings());
    }

    #[test]
    fn what_the_data_state_goes_first_and_is_no_lower_bound() {
        let pairs = pair(&[(Some(8.0), 6.9, 6.9)]);
        assert_eq!(pairs.long(), "8.0 EV (quartiles 8.00–8.00), as the data state");
        assert!(pairs.warnings().is_empty());
        let measured = pair(&[(None, 6.9, 6.9)]);
        assert_eq!(measured.short(), "≥ 6.9 EV");
        assert!(measured.warnings()[0].contains("lower bound"));
    }

    #[test]
    fn swapped_pairs_and_other_tones_are_told() {
        let swapped = pair(&[(None, -3.0, -3.1)]);
        assert!(swapped.warnings()[0].contains("swapped"), "{:?}", swapped.warnings());
        let some = pair(&[(None, 3.0, 3.0), (None, 3.0, 3.1), (None, 0.0, 0.0)]);
        assert!(some.warnings()[0].starts_with("1 of 3 photographs dark are not darker"));
        let tone = pair(&[(None, 2.17, 3.33)]);
        assert!(tone.warnings()[0].contains("not one exposure apart"));
    }

    #[test]
    fn black_images_are_counted() {
        let facts = [PairFacts::default(), PairFacts { mean: Some(2.0), ..PairFacts::default() }];
        let pairs = PairDarkness::new(&PhotoName::numbered(0), &facts).unwrap();
        assert_eq!((pairs.frames, pairs.unknown), (1, 1));
        assert!(pairs.warnings()[0].contains("are black"));
        assert_eq!(PairDarkness::new(&PhotoName::numbered(0), &facts[..1]), None);
    }
}
