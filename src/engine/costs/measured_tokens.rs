//! Tokens of images as the server charges them: [`MeasuredTokens`].
//!
//! Before the first reply, the tokens of an image are estimated by the rule of the model's family, from which the
//! server may deviate. Afterwards they are measured: the charged tokens of a prompt minus the estimated tokens of its
//! text.

use std::collections::HashMap;

use crate::engine::costs::budget::text_tokens;
use crate::engine::images::frames::Source;
use crate::engine::images::trials::{Item, Plan};
use crate::store::StoredTrial;
use crate::types::TrialKey;

/// Number of replies whose median is used; chosen.
const REPLIES: usize = 10;

/// Relative deviation of an estimate from the charge up to which no warning is printed; chosen.
const TOLERANCE: f64 = 0.1;

/// Tokens charged for images, by model of a phase.
#[derive(Debug, Clone)]
pub(crate) struct MeasuredTokens {
    /// For each model, the charged tokens per image of each of the first replies, at most [`REPLIES`].
    images: Vec<Vec<f64>>,
}

/// The tokens of a prompt as estimated, and as charged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Difference {
    pub(crate) estimated: f64,
    pub(crate) charged: f64,
}

impl MeasuredTokens {
    /// No measurements yet, for a number of models.
    pub(crate) fn new(models: usize) -> Self {
        Self { images: vec![Vec::new(); models] }
    }

    /// Measures the stored replies to the trials of a plan about these sources.
    pub(crate) fn from_stored<I: Item>(
        models: usize,
        plan: &Plan<I>,
        sources: &[Source],
        stored: &[StoredTrial],
    ) -> Self {
        let charged: HashMap<TrialKey, u64> =
            stored.iter().filter_map(|record| Some((record.key, record.usage()?.prompt_tokens?))).collect();
        let mut measured = Self::new(models);
        for (place, group) in plan.groups().filter(|(_, group)| group.condition.is_some()) {
            let images = sources[place].order.len();
            for trial in &group.trials {
                if let Some(charged) = charged.get(&trial.key) {
                    measured.add(trial.model, *charged, text_tokens(&trial.prompt), images);
                }
            }
        }
        measured
    }

    /// Adds a reply about a number of images: the charged tokens of its prompt, and the estimated tokens of the text.
    pub(crate) fn add(&mut self, model: usize, charged: u64, text: f64, images: usize) {
        let measured = &mut self.images[model];
        if measured.len() < REPLIES && images > 0 {
            measured.push((charged as f64 - text).max(0.0) / images as f64);
        }
    }

    /// Median of the tokens charged for one image; `None` before [`REPLIES`] replies.
    pub(crate) fn image(&self, model: usize) -> Option<f64> {
        let mut images = self.images[model].clone();
        images.sort_by(f64::total_cmp);
        let middle = REPLIES / 2;
        (images.len() == REPLIES).then(|| f64::midpoint(images[middle - 1], images[middle]))
    }

    /// Compares the estimated tokens of a prompt with the charged ones: `text` and `image_tokens` are the estimates for
    /// the text and for all `images` together. `None` if they differ by at most [`TOLERANCE`], or before [`REPLIES`]
    /// replies.
    pub(crate) fn difference(&self, model: usize, text: f64, images: usize, image_tokens: f64) -> Option<Difference> {
        let charged = text + self.image(model)? * images as f64;
        let estimated = text + image_tokens;
        let differs = (charged - estimated).abs() > TOLERANCE * estimated;
        differs.then_some(Difference { estimated, charged })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_ten_replies_corrects_the_estimate() {
        let mut measured = MeasuredTokens::new(2);
        for i in 0..10 {
            assert_eq!(measured.image(1), None, "{i}");
            // One reply that was charged far more does not count.
            let charged = if i == 3 { 90_000 } else { 100 + 1000 + i };
            // The charge for several images is divided equally among them.
            let images = if i < 5 { 1 } else { 2 };
            measured.add(1, 100 + (charged - 100) * images as u64, 100.0, images);
        }
        let image = measured.image(1).unwrap();
        assert!((image - 1005.5).abs() < 1.0, "{image}");
        assert_eq!(measured.image(0), None);
        let difference = measured.difference(1, 100.0, 1, 765.0).unwrap();
        assert!((difference.charged - 1105.5).abs() < 1.0);
        assert!((difference.estimated - 865.0).abs() < 1e-9);
        // Within 10 %.
        assert_eq!(measured.difference(1, 100.0, 1, 1000.0), None);
        assert_eq!(measured.difference(1, 100.0, 2, 2000.0), None);
        assert!(measured.difference(1, 100.0, 2, 1000.0).is_some());
    }
}
