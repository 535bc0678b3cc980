//! Relation between the fidelity of images and right answers: [`FidelityFindings`].

use crate::photographs::dot;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::choice::ParsingMode;
use crate::grid::Grid;
use crate::model_in_condition::{ModelInCondition, pooled_models};
use crate::significance::holm;
use crate::statistics::auc::{Auc, PairCounts, RankedReply};
use darkqa_base::types::{AxisLevel, Digest, EnhancerName, Family, FrameId, ImageFidelity, Variant, View};

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
type Measured<'a> = HashMap<ImageKey<'a>, [Option<f64>; 2]>;

/// A frame and the digest of an image of it. Both are needed, because two frames may have the same image, for example a
/// black one, but different clean frames.
type ImageKey<'a> = (&'a FrameId, Digest);

/// A condition of the trials with its subjects, one for each model.
type ConditionKey<'a> = (AxisLevel, &'a Variant, Option<&'a EnhancerName>);

impl FidelityFindings {
    /// Computes the findings for the measured images; `None` if no reply is about a measured image.
    #[must_use]
    pub fn new<'a>(grid: &Grid<'a>, measured: &'a [ImageFidelity]) -> Option<Self> {
        let measured: Measured<'_> = measured
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
    images: Measured<'a>,
    right: usize,
    replies: usize,
    /// Pairs by PSNR and by SSIM.
    pairs: [PairCounts; 2],
}

impl<'a> ConditionSums<'a> {
    fn new(grid: &Grid<'a>, subjects: &[usize], measured: &Measured<'a>) -> Self {
        let mut sums = Self {
            images: HashMap::new(),
            right: 0,
            replies: 0,
            pairs: [(); 2].map(|()| PairCounts::new(grid.clusters)),
        };
        for &subject in subjects {
            let mut strata = BTreeMap::<&Family, [Vec<RankedReply>; 2]>::new();
            for (index, item) in grid.items.iter().enumerate() {
                let reading = grid.result(subject, index).reading(ParsingMode::Strict);
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
