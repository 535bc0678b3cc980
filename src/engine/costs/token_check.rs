//! Comparison of the charged tokens of prompts with the estimated ones: [`TokenCheck`].
//!
//! The cost of requests in flight, as a file in the run folder: [`InFlightCost`]. If the process is killed, the file
//! remains, and the next process counts the requests that may have been charged without a record.
//!
//! Tokens of images as the server charges them: [`MeasuredTokens`].
//!
//! Before the first reply, the tokens of an image are estimated by the rule of the model's family, from which the
//! server may deviate. Afterwards they are measured: the charged tokens of a prompt minus the estimated tokens of its
//! text.
//!
//! Warnings about requests whose cost may exceed `--max-cost`: [`BudgetNotes`].

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::money::MoneySettings;
use crate::costs::budget::{Budget, text_tokens};
use crate::images::frames::Source;
use crate::images::trials::{Item, Plan, Trial};
use crate::models::ModelUnderTest;
use darkqa_ask::{ImageTokenCheck, Spending};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::money;
use darkqa_base::types::{ImageFacts, TrialKey, Usage};
use darkqa_store::{StoredTrial, set_file_aside};

/// Charged tokens of the prompts of a run, for each of its models. Warns once for each if they differ from the
/// estimate, and if they show that the server shrinks the images.
#[derive(Debug)]
pub(crate) struct TokenCheck {
    measured: MeasuredTokens,
    /// True for models whose estimated tokens have been compared with the charged ones.
    is_compared: Vec<bool>,
    images: Vec<ImageTokenCheck>,
    /// True for models whose server was said to shrink the images.
    has_told_shrunk: Vec<bool>,
}

impl TokenCheck {
    /// A check without replies, for a number of models.
    pub(crate) fn new(models: usize) -> Self {
        Self {
            measured: MeasuredTokens::new(models),
            is_compared: vec![false; models],
            images: vec![ImageTokenCheck::default(); models],
            has_told_shrunk: vec![false; models],
        }
    }

    /// Adds the reply to a trial about these images.
    pub(crate) fn add<'a, I: Item>(
        &mut self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
        usage: Usage,
        budget: &Budget,
    ) {
        let Some(charged) = usage.prompt_tokens else {
            return;
        };
        if images.clone().next().is_none() {
            return;
        }
        self.compare(model, trial, images.clone(), charged, budget);
        self.check_images(model, trial, images, charged);
    }

    /// Compares the charged tokens of images with the estimate, once for each model, and warns if they differ.
    fn compare<'a, I: Item>(
        &mut self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
        charged: u64,
        budget: &Budget,
    ) {
        let index = trial.model;
        if self.is_compared[index] {
            return;
        }
        let (text, shown) = (text_tokens(&trial.prompt), images.clone().count());
        self.measured.add(index, charged, text, shown);
        if self.measured.image(index).is_none() {
            return;
        }
        self.is_compared[index] = true;
        let difference = budget
            .expected_image_tokens(index, model, images)
            .and_then(|tokens| self.measured.difference(index, text, shown, tokens));
        if let Some(difference) = difference {
            tracing::warn!(
                "{}: a prompt is charged {:.0} tokens, where {:.0} were estimated (median of the first 10 with images); --dry-run \
                 estimates the rest of this run by what is charged",
                model.name,
                difference.charged,
                difference.estimated
            );
        }
    }

    /// Warns once for each model if the charged tokens show that the server shrinks the images.
    fn check_images<'a, I: Item>(
        &mut self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts>,
        charged: u64,
    ) {
        let index = trial.model;
        if self.has_told_shrunk[index] {
            return;
        }
        let sizes = images.map(|image| (image.width as u64, image.height as u64));
        let expected: Option<Vec<u64>> =
            sizes.map(|(width, height)| model.model.scaling_image_tokens(width, height)).collect();
        let Some(expected) = expected else {
            return;
        };
        let parts = trial.prompt.parts();
        let text: usize = parts.iter().map(|part| part.chars().count()).sum();
        let characters = text + model.model.system_bytes();
        self.images[index].add(charged, characters, &expected);
        if let Some(shrunk) = self.images[index].shrunk() {
            self.has_told_shrunk[index] = true;
            tracing::warn!("{}", shrunk.words(&model.name));
        }
    }
}

/// Name of the file in a run folder. It exists while requests are in flight, and after a process was killed.
const NOTE: &str = "in_flight.json";

/// Factor by which the written cost exceeds the reserved one, so that the file is seldom written; chosen.
const MARGIN: f64 = 1.25;

/// Cost of requests without a record, in US dollars.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub struct InFlightCost {
    /// Upper bound of the requests in flight when earlier processes were killed.
    killed: f64,
    /// Upper bound of the requests in flight now.
    in_flight: f64,
}

impl InFlightCost {
    /// Reads the file in a run folder. Requests that it states as in flight are counted as those of a killed process.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(NOTE);
        let text = match files::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(e) => return Err(Error::file(path, "read", e)),
        };
        let note =
            serde_json::from_slice::<Self>(&text).ok().filter(|note| is_cost(note.killed) && is_cost(note.in_flight));
        let Some(note) = note else {
            let aside = set_file_aside(&path)?;
            tracing::warn!(
                "{}: not readable, set aside as {}: requests that were in flight when a process was killed are not in the costs",
                path.display(),
                aside.display()
            );
            return Ok(Self::default());
        };
        Ok(Self { killed: note.killed + note.in_flight, in_flight: 0.0 })
    }

    /// Upper bound of the cost of requests that killed processes left without a record, in US dollars.
    pub fn killed(self) -> f64 {
        self.killed
    }

    /// Writes the cost in flight, if it is higher than the written one.
    pub fn raise(&mut self, folder: &Path, dollars: f64) -> Result<()> {
        if dollars <= self.in_flight {
            return Ok(());
        }
        self.in_flight = dollars * MARGIN;
        self.write(folder)
    }

    /// Writes that nothing is in flight, once all requests have a record. Deletes the file if no process was killed
    /// either.
    pub fn end(&mut self, folder: &Path) -> Result<()> {
        if self.in_flight <= 0.0 {
            return Ok(());
        }
        self.in_flight = 0.0;
        if self.killed > 0.0 {
            return self.write(folder);
        }
        let path = folder.join(NOTE);
        fs::remove_file(&path).map_err(|e| Error::file(path, "delete", e))
    }

    fn write(self, folder: &Path) -> Result<()> {
        let path = folder.join(NOTE);
        let text = serde_json::to_vec(&self).map_err(|e| Error::file(&path, "write", e.into()))?;
        files::write(&path, &text)
    }
}

fn is_cost(dollars: f64) -> bool {
    dollars.is_finite() && dollars >= 0.0
}

/// Number of replies whose median is used; chosen.
const REPLIES: usize = 10;

/// Relative deviation of an estimate from the charge up to which no warning is printed; chosen.
const TOLERANCE: f64 = 0.1;

/// Tokens charged for images, by model of a phase.
#[derive(Debug, Clone)]
pub struct MeasuredTokens {
    /// For each model, the charged tokens per image of each of the first replies, at most [`REPLIES`].
    images: Vec<Vec<f64>>,
}

/// The tokens of a prompt as estimated, and as charged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    pub estimated: f64,
    pub charged: f64,
}

impl MeasuredTokens {
    /// No measurements yet, for a number of models.
    pub fn new(models: usize) -> Self {
        Self { images: vec![Vec::new(); models] }
    }

    /// Measures the stored replies to the trials of a plan about these sources.
    pub fn from_stored<I: Item>(models: usize, plan: &Plan<I>, sources: &[Source], stored: &[StoredTrial]) -> Self {
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
    pub fn add(&mut self, model: usize, charged: u64, text: f64, images: usize) {
        let measured = &mut self.images[model];
        if measured.len() < REPLIES && images > 0 {
            measured.push((charged as f64 - text).max(0.0) / images as f64);
        }
    }

    /// Median of the tokens charged for one image; `None` before [`REPLIES`] replies.
    pub fn image(&self, model: usize) -> Option<f64> {
        let mut images = self.images[model].clone();
        images.sort_by(f64::total_cmp);
        let middle = REPLIES / 2;
        (images.len() == REPLIES).then(|| f64::midpoint(images[middle - 1], images[middle]))
    }

    /// Compares the estimated tokens of a prompt with the charged ones: `text` and `image_tokens` are the estimates for
    /// the text and for all `images` together. `None` if they differ by at most [`TOLERANCE`], or before [`REPLIES`]
    /// replies.
    pub fn difference(&self, model: usize, text: f64, images: usize, image_tokens: f64) -> Option<Difference> {
        let charged = text + self.image(model)? * images as f64;
        let estimated = text + image_tokens;
        let differs = (charged - estimated).abs() > TOLERANCE * estimated;
        differs.then_some(Difference { estimated, charged })
    }
}

/// Warnings about `--max-cost`, at most one for each model.
#[derive(Debug)]
pub(crate) struct BudgetNotes<'a> {
    models: &'a [ModelUnderTest],
    /// True for models that the user was warned about.
    has_warned: Vec<bool>,
    /// True for models whose stated charges the user was told about, by kind of notice.
    has_told_charges: Vec<[bool; 3]>,
}

impl<'a> BudgetNotes<'a> {
    pub(crate) fn new(models: &'a [ModelUnderTest]) -> Self {
        Self { models, has_warned: vec![false; models.len()], has_told_charges: vec![[false; 3]; models.len()] }
    }

    /// Names models whose price is unknown although the table has a similar one: another version or service tier.
    pub(crate) fn warn_unpriced(&self, settings: &MoneySettings) {
        for model in self.models {
            if let Some(reason) = Budget::unpriced(settings, model) {
                tracing::warn!("{}: its cost is not known: {reason}", model.name);
            }
        }
    }

    /// Says once for each model that its server states other charges than the price table, charges that are no
    /// plausible price, or a service tier without a price.
    pub(crate) fn warn_of_charges(&mut self, model: usize, budget: &Budget) {
        let charges = budget.charges(model);
        let name = &self.models[model].name;
        let [differing, implausible, tier] = &mut self.has_told_charges[model];
        if let Some(pair) = charges.differing().filter(|_| !*differing) {
            *differing = true;
            tracing::warn!(
                "{name}: a reply is charged {}, as its server states, where the price table gives {}: the stated charges count, and each \
                 request reserves as much more",
                dollars(pair.stated),
                dollars(pair.listed)
            );
        }
        if let Some(pair) = charges.implausible().filter(|_| !*implausible) {
            *implausible = true;
            tracing::warn!(
                "{name}: a reply states a charge of ${}, where the price table gives {}: more than 100 times off is no plausible price in \
                 US dollars, so the price table counts (--prices FILE has your own)",
                pair.stated,
                dollars(pair.listed)
            );
        }
        if charges.has_unknown_tier() && !*tier {
            *tier = true;
            tracing::warn!(
                "{name}: a reply is at a service tier without a price in the table, and counts at the price of the tier asked for; its \
                 factor belongs in [tiers.NAME] of your own table (--prices FILE)"
            );
        }
    }

    /// Warns of models whose replies have no upper bound, if `--max-cost` is set.
    pub(crate) fn warn_unlimited(&mut self, spending: &Spending) {
        if spending.limit().is_none() {
            return;
        }
        for (model, has_warned) in self.models.iter().zip(&mut self.has_warned) {
            if *has_warned || !is_unlimited(model) {
                continue;
            }
            *has_warned = true;
            tracing::warn!(
                "{}: no token limit holds for its replies and their thinking, so --max-cost is no upper bound: requests in flight may \
                 exceed it (remedies: --max-tokens with its field, --thinking off, or a thinking budget)",
                model.name
            );
        }
    }

    /// Warns if a reply was charged more tokens than its limit, or if models have no limit any more because their
    /// server refuses one.
    pub(crate) fn warn_exceeded(&mut self, model: usize, budget: &Budget) {
        let spending = budget.spending();
        self.warn_unlimited(spending);
        let excess = budget.excess(model);
        if self.has_warned[model] || spending.limit().is_none() || excess.replies() == 0 {
            return;
        }
        self.has_warned[model] = true;
        let model = &self.models[model];
        tracing::warn!(
            "{}: a reply was charged {} tokens, more than its limit of {}: the requests in flight may exceed --max-cost; from now on more \
             tokens are reserved for each reply",
            model.name,
            excess.longest(),
            model.model.reply_limit().unwrap_or_default()
        );
    }
}

/// True if the replies of a model at an endpoint have no token limit.
fn is_unlimited(model: &ModelUnderTest) -> bool {
    model.model.is_remote() && model.model.reply_limit().is_none()
}

/// A small sum of money, with three significant digits.
fn dollars(sum: f64) -> String {
    if sum <= 0.0 || sum >= 0.01 {
        return money(sum);
    }
    let decimals = 2 - sum.log10().floor() as i32;
    format!("${sum:.0$}", decimals.clamp(4, 12) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_killed_process_leaves_a_cost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let mut cost = InFlightCost::open(path).unwrap();
        cost.raise(path, 4.0).unwrap();
        cost.raise(path, 3.0).unwrap();
        cost.end(path).unwrap();
        assert_eq!(fs::read_dir(path).unwrap().count(), 0);
        cost.raise(path, 4.0).unwrap();
        let mut next = InFlightCost::open(path).unwrap();
        assert!((next.killed() - 5.0).abs() < 1e-9);
        next.raise(path, 1.0).unwrap();
        next.end(path).unwrap();
        let third = InFlightCost::open(path).unwrap();
        assert!((third.killed() - 5.0).abs() < 1e-9, "it counts once");
    }

    #[test]
    fn a_damaged_note_is_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        for damaged in ["", "{\"killed\":1", "{\"killed\":-1,\"in_flight\":0}"] {
            fs::write(path.join(NOTE), damaged).unwrap();
            assert!(InFlightCost::open(path).unwrap().killed() < 1e-9);
            assert!(path.join("in_flight.json.damaged").exists());
        }
    }

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
