//! Cost of a run and its limit: [`Budget`].
//!
//! Upper bounds of the tokens of prompts: [`PromptBounds`].
//!
//! Before the first reply, a bound is computed from the length of the text and the rule of the model's family for
//! images. Afterwards it is computed from the charged tokens of an earlier prompt with images of the same sizes, plus
//! the bytes of the differing text: no tokenizer makes more tokens than bytes.
//!
//! Cost of the stored records of a run: [`StoredCosts`].

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use crate::costs::money::MoneySettings;
use crate::images::frames::Source;
use crate::images::trials::{Item, Prompt, Trial};
use crate::models::ModelUnderTest;
use darkqa_ask::{
    ChargeRatios, Price, PricedRequest, ReplyExcess, Reservation, Spending, TokenBound, Unpriced, stated_charge,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{ImageFacts, Unstated, Usage, Via};
use darkqa_pictures::Scaling;
use darkqa_report::joined;
use darkqa_store::StoredTrial;

/// Characters of English text per token, by the rule of thumb of every provider.
const CHARACTERS_PER_TOKEN: f64 = 4.0;

/// Tokens of a message besides its text and images.
const MESSAGE_TOKENS: f64 = 10.0;

/// Tokens reserved for the first reply of a model without a token limit; chosen.
const UNLIMITED_REPLY: u64 = 4096;

/// The models that have replies in a run: those of all its phases, and those of earlier commands in its manifest.
#[derive(Debug, Clone, Copy)]
pub struct RunModels<'a> {
    pub models: &'a [&'a ModelUnderTest],
    /// `None` if there are no other models.
    pub manifest: Option<&'a RunManifest>,
}

impl RunModels<'_> {
    /// Price of the replies of the model that has this name in records; `None` if unknown.
    fn price(self, money: &MoneySettings, name: &str) -> Option<Price> {
        let model = self.models.iter().find(|model| *model.name == *name);
        match (model, self.manifest) {
            (Some(model), _) => model.price(&money.prices),
            (None, Some(manifest)) => joined::price(&money.prices, manifest, name),
            (None, None) => money.prices.find(name),
        }
    }
}

/// Cost of a run so far and the upper bounds of its requests, which `--max-cost` limits.
#[derive(Debug)]
pub struct Budget {
    models: Vec<ModelBudget>,
    spending: Arc<Spending>,
    /// Number of stored requests without stated tokens, and the upper bound of their cost in US dollars.
    unstated: (u32, f64),
    /// Number of stored replies by model that were charged more than the price table says.
    dearer: BTreeMap<String, usize>,
}

/// Price and bounds of the requests to one model.
#[derive(Debug)]
struct ModelBudget {
    /// `None` if the model is free, or its price is unknown.
    price: Option<Price>,
    prompts: PromptBounds,
    /// Replies beyond the token limit.
    excess: Arc<ReplyExcess>,
    /// Charges that the server states.
    charges: Arc<ChargeRatios>,
}

/// Permission to ask a question now.
#[derive(Debug)]
pub enum Permit {
    /// Permitted: the model has no known price.
    Free,
    /// Permitted, with the cost reserved.
    Reserved(Box<Reservation>),
    /// Not permitted before other questions have ended.
    Refused,
}

impl Budget {
    /// A budget for models, which includes the cost of their stored records.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub fn new(money: &MoneySettings, models: &[ModelUnderTest], stored: &[StoredTrial]) -> Result<Self> {
        let all: Vec<&ModelUnderTest> = models.iter().collect();
        let run_models = RunModels { models: &all, manifest: None };
        Self::for_run(money, models, run_models, stored)
    }

    /// A budget for the `models` that are asked now. It includes the cost of the stored records of all models of the
    /// run.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub fn for_run(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        run_models: RunModels<'_>,
        stored: &[StoredTrial],
    ) -> Result<Self> {
        if money.max_cost.is_some() {
            for model in models {
                if let Err(reason) = model.priced(&money.prices) {
                    let problem = reason.words(model.model.name(), &money.prices.as_of);
                    return Err(Error::usage("--max-cost", problem));
                }
            }
        }
        let mut costs = StoredCosts::default();
        for record in stored {
            costs.add(run_models.price(money, &record.model), money, record);
        }
        Ok(Self {
            models: models
                .iter()
                .map(|model| ModelBudget {
                    price: model.price(&money.prices),
                    prompts: PromptBounds::new(),
                    excess: Arc::default(),
                    charges: costs.charges(&model.name),
                })
                .collect(),
            unstated: costs.unstated(),
            dearer: costs.dearer(),
            spending: Arc::new(Spending::new(money.max_cost, costs.sum())),
        })
    }

    /// Adds an upper bound in US dollars of the cost of requests without a record: those of batches that have not
    /// ended, and those of killed processes.
    pub fn with_unrecorded(self, dollars: f64) -> Self {
        let max_cost = self.spending.limit();
        let spending = Spending::new(max_cost, self.spending.spent()).with_pending_batches(dollars);
        Self { spending: Arc::new(spending), ..self }
    }

    /// Asks for permission to ask a question now, and reserves the upper bound of the cost of its first request.
    pub fn permit<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
    ) -> Permit {
        let Some(request) = self.request(model, trial, images) else {
            return Permit::Free;
        };
        let reservation = self.spending.reserve(request);
        reservation.map_or(Permit::Refused, |held| Permit::Reserved(Box::new(held)))
    }

    /// The request of a trial with the upper bound of its tokens; `None` if the model has no known price.
    pub fn request<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
    ) -> Option<PricedRequest> {
        let budget = &self.models[trial.model];
        let price = budget.price?;
        let sizes = sizes(images.clone());
        let image_tokens = self.expected_image_tokens(trial.model, model, images);
        let facts = facts(model, trial, &sizes, image_tokens);
        Some(PricedRequest {
            price,
            bound: TokenBound {
                prompt: budget.prompts.bound(facts),
                reply: model.model.reply_limit().unwrap_or(UNLIMITED_REPLY),
            },
            excess: Arc::clone(&budget.excess),
            charges: Arc::clone(&budget.charges),
        })
    }

    /// Corrects the bounds of later prompts by the charged tokens of a trial's prompt. Adds the stated charge of a
    /// model without a price, for which nothing is reserved.
    pub fn observe<'a, I: Item>(
        &mut self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
        usage: Usage,
    ) {
        let sizes = sizes(images.clone());
        let image_tokens = self.expected_image_tokens(trial.model, model, images);
        let facts = facts(model, trial, &sizes, image_tokens);
        let charged = usage.prompt_tokens.unwrap_or(0);
        let budget = &mut self.models[trial.model];
        budget.prompts.observe(facts, charged);
        if budget.price.is_none()
            && let Some(cost) = stated_charge(usage, 0.0)
        {
            self.spending.add(cost);
        }
    }

    /// Expected tokens of a trial's prompt: of its text by length, of its images by the rule of the model's family.
    pub fn expected_tokens<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts>,
    ) -> f64 {
        let price = self.models[trial.model].price;
        let images = images.map(|image| image_tokens(model, price, image.width, image.height));
        text_tokens(&trial.prompt) + images.map(|tokens| tokens.unwrap_or(0.0)).sum::<f64>()
    }

    /// Expected tokens of images for a model and its index; `None` if the rule of its family is unknown.
    pub fn expected_image_tokens<'a>(
        &self,
        index: usize,
        model: &ModelUnderTest,
        mut images: impl Iterator<Item = &'a ImageFacts>,
    ) -> Option<f64> {
        let price = self.models[index].price;
        images.try_fold(0.0, |sum, image| Some(sum + image_tokens(model, price, image.width, image.height)?))
    }

    /// US dollars spent so far; `None` if no model has a price and no server states a charge.
    pub fn spent(&self) -> Option<f64> {
        let spent = self.spending.spent();
        let is_known = spent > 0.0 || self.models.iter().any(|model| model.price.is_some());
        is_known.then_some(spent)
    }

    /// US dollars spent so far by all models with a price; zero if no model has one.
    pub fn charged(&self) -> f64 {
        self.spending.spent()
    }

    /// Number of stored requests without stated tokens, and the upper bound of their cost in US dollars.
    pub fn unstated(&self) -> (u32, f64) {
        self.unstated
    }

    /// The spending that all requests share.
    pub fn spending(&self) -> &Arc<Spending> {
        &self.spending
    }

    /// Replies of a model beyond the token limit.
    pub fn excess(&self, model: usize) -> &ReplyExcess {
        &self.models[model].excess
    }

    /// Charges that the server of a model states.
    pub fn charges(&self, model: usize) -> &ChargeRatios {
        &self.models[model].charges
    }

    /// Number of stored replies by model that were charged more than the price table says.
    pub fn dearer(&self) -> &BTreeMap<String, usize> {
        &self.dearer
    }

    /// Expected cost of a request to a model, in US dollars, by the price table and the charges so far; `None` if it
    /// has no known price.
    pub fn expected_cost(&self, model: usize, prompt: f64, reply: f64) -> Option<f64> {
        let ModelBudget { price, charges, .. } = &self.models[model];
        Some(charges.mean().unwrap_or(1.0) * (*price)?.cost(prompt, reply))
    }

    /// The reason why the price of a model is unknown, if it is another one than that the table does not have the
    /// model.
    pub fn unpriced(money: &MoneySettings, model: &ModelUnderTest) -> Option<String> {
        let reason = model.priced(&money.prices).err()?;
        let is_told = reason != Unpriced::Model;
        is_told.then(|| reason.words(model.model.name(), &money.prices.as_of))
    }
}

fn facts<'a, I: Item>(
    model: &ModelUnderTest,
    trial: &'a Trial<I>,
    sizes: &'a [(usize, usize)],
    image_tokens: Option<f64>,
) -> PromptFacts<'a> {
    PromptFacts { prompt: &trial.prompt, sizes, system_bytes: model.model.system_bytes(), image_tokens }
}

/// Expected tokens of a prompt's text.
pub fn text_tokens(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS_PER_TOKEN + MESSAGE_TOKENS
}

/// Tokens of the images in a request about a source: `charged` tokens each if that is known, else by size. `None` if
/// the tokens of an image are unknown.
pub(super) fn shown_tokens(
    model: &ModelUnderTest,
    price: Option<Price>,
    charged: Option<f64>,
    source: &Source,
    scaling: Scaling,
) -> Option<f64> {
    source.order.iter().try_fold(0.0, |sum, place| {
        let (width, height) = source.frames[*place].size;
        let (width, height) = scaling.size(width, height);
        Some(sum + charged.or_else(|| image_tokens(model, price, width, height))?)
    })
}

/// Tokens of an image for a model: from the table of prices, else by the model's family; `None` if unknown.
fn image_tokens(model: &ModelUnderTest, price: Option<Price>, width: usize, height: usize) -> Option<f64> {
    price
        .and_then(|price| price.image_tokens)
        .or_else(|| model.model.image_tokens(width as u64, height as u64))
        .map(|tokens| tokens as f64)
}

/// Tokens that a chat template adds to a message; chosen: more than those of known models.
const TEMPLATE_TOKENS: u64 = 64;

/// Pixels per token of an image, if the model's rule is not known: patches of 14 × 14, the smallest in use.
const PIXELS_PER_TOKEN: u64 = 14 * 14;

/// Minimum number of tokens of an image, if the model's rule is not known: five tiles of 576 tokens, as in LLaVA-NeXT.
const MIN_IMAGE_TOKENS: u64 = 5 * 576;

/// Number of tokens by which a text may exceed the sum of its parts, because of their joins; chosen.
const JOINS: u64 = 4;

/// Number of earlier prompts that are kept for comparison; chosen.
const MAX_REFERENCES: usize = 16;

/// Number of later prompts that must agree with an earlier one before it replaces the bound by length. Chosen: the
/// first reply of a server may come from another replica, or from a cache.
const MIN_AGREEING: usize = 2;

/// Ratio of a bound to the charged tokens up to which the bound is close, so that the prompt need not be kept for
/// comparison; chosen.
const MAX_CLOSE_RATIO: f64 = 1.05;

/// Facts that determine the tokens of a prompt.
#[derive(Debug, Clone, Copy)]
pub(super) struct PromptFacts<'a> {
    pub prompt: &'a Prompt,
    /// Width and height of each image, in pixels.
    pub sizes: &'a [(usize, usize)],
    /// Bytes of the system message.
    pub system_bytes: usize,
    /// Tokens of all images by the rule of the model's family; `None` if it is not known.
    pub image_tokens: Option<f64>,
}

/// The width and the height of images.
pub(super) fn sizes<'a>(images: impl Iterator<Item = &'a ImageFacts>) -> Vec<(usize, usize)> {
    images.map(|image| (image.width, image.height)).collect()
}

/// An earlier prompt with the tokens that it was charged.
#[derive(Debug)]
struct Reference {
    prompt: Prompt,
    sizes: Vec<(usize, usize)>,
    charged: u64,
    /// Number of later prompts that were charged no more than the bound from this one.
    agreeing: usize,
}

impl Reference {
    /// Upper bound of the tokens of another prompt with images of the same sizes.
    fn most_tokens(&self, facts: PromptFacts<'_>) -> f64 {
        (self.charged + differing_bytes(&self.prompt, facts.prompt) as u64 + JOINS) as f64
    }
}

/// Upper bounds of the tokens of a model's prompts.
#[derive(Debug)]
pub(super) struct PromptBounds {
    references: VecDeque<Reference>,
    /// Largest ratio of charged tokens to the bound by length; at least 1.
    excess_by_length: f64,
    /// Largest ratio of charged tokens to the bound by comparison; at least 1.
    excess_by_comparison: f64,
}

impl PromptBounds {
    pub(super) fn new() -> Self {
        Self { references: VecDeque::new(), excess_by_length: 1.0, excess_by_comparison: 1.0 }
    }

    /// Upper bound of the tokens of a prompt.
    pub(super) fn bound(&self, facts: PromptFacts<'_>) -> u64 {
        let by_length = by_length(facts) * self.excess_by_length;
        let by_comparison = self.by_comparison(facts);
        let by_comparison = by_comparison.map(|tokens| tokens * self.excess_by_comparison);
        by_comparison.map_or(by_length, |tokens| tokens.min(by_length)).ceil() as u64
    }

    /// Corrects the bounds of later prompts by the charged tokens of a prompt.
    pub(super) fn observe(&mut self, facts: PromptFacts<'_>, charged: u64) {
        if charged == 0 {
            return;
        }
        let tokens = charged as f64;
        self.excess_by_length = self.excess_by_length.max(tokens / by_length(facts));
        let by_comparison = self.by_comparison(facts);
        let mut is_close = false;
        for one in self.references.iter_mut().filter(|one| one.sizes == facts.sizes) {
            let most = one.most_tokens(facts);
            one.agreeing += usize::from(tokens <= most);
            is_close |= (tokens..=MAX_CLOSE_RATIO * tokens).contains(&most);
        }
        if let Some(expected) = by_comparison {
            self.excess_by_comparison = self.excess_by_comparison.max(tokens / expected);
        }
        if !is_close {
            if self.references.len() == MAX_REFERENCES {
                self.references.pop_front();
            }
            self.references.push_back(Reference {
                prompt: facts.prompt.clone(),
                sizes: facts.sizes.to_vec(),
                charged,
                agreeing: 0,
            });
        }
    }

    /// Lowest upper bound by comparison with earlier prompts. Only prompts with images of the same sizes count, if
    /// enough later ones agree with them; `None` without any.
    fn by_comparison(&self, facts: PromptFacts<'_>) -> Option<f64> {
        self.references
            .iter()
            .filter(|one| one.sizes == facts.sizes && one.agreeing >= MIN_AGREEING)
            .map(|one| one.most_tokens(facts))
            .min_by(f64::total_cmp)
    }
}

/// Upper bound of the tokens of a prompt by its bytes and the sizes of its images.
fn by_length(facts: PromptFacts<'_>) -> f64 {
    let text: usize = facts.prompt.parts().iter().map(|part| part.len()).sum();
    let text = (text + facts.system_bytes) as u64 + TEMPLATE_TOKENS;
    let images = facts.image_tokens.unwrap_or_else(|| {
        facts
            .sizes
            .iter()
            .map(|(width, height)| (width * height) as u64)
            .map(|area| area.div_ceil(PIXELS_PER_TOKEN).max(MIN_IMAGE_TOKENS))
            .sum::<u64>() as f64
    });
    text as f64 + images
}

/// Number of bytes of a prompt's text without the beginnings and ends that its parts share with those of another
/// prompt.
fn differing_bytes(other: &Prompt, prompt: &Prompt) -> usize {
    other.parts().into_iter().zip(prompt.parts()).map(|(other, text)| unshared(other.as_bytes(), text.as_bytes())).sum()
}

/// Number of bytes of a text without the beginning and end that it shares with another one.
fn unshared(other: &[u8], text: &[u8]) -> usize {
    let start = other.iter().zip(text).take_while(|(a, b)| a == b).count();
    let (other, text) = (&other[start..], &text[start..]);
    let ends = other.iter().rev().zip(text.iter().rev());
    text.len() - ends.take_while(|(a, b)| a == b).count()
}

/// Cost of stored records in US dollars, and the charges that servers state in them.
#[derive(Debug, Default)]
pub(super) struct StoredCosts {
    by_model: BTreeMap<String, ModelCosts>,
}

#[derive(Debug, Default)]
struct ModelCosts {
    charges: Arc<ChargeRatios>,
    /// Cost of the requests with stated tokens or a stated charge, in US dollars.
    known: f64,
    /// Number of requests without stated tokens, and the upper bound of their cost at the price table.
    unstated: (u32, f64),
    /// Number of replies that were charged more than the price table says.
    dearer: usize,
}

impl StoredCosts {
    /// Adds a record of a model with this price; without one, only stated charges count.
    pub(super) fn add(&mut self, price: Option<Price>, money: &MoneySettings, record: &StoredTrial) {
        let lost = record.lost();
        let usages = [record.usage(), lost.map(|lost| lost.usage)];
        if price.is_none() && usages.iter().flatten().all(|usage| usage.cost.is_none()) {
            return;
        }
        let share = match record.via {
            Via::Direct | Via::File => 1.0,
            Via::Batch => money.prices.batch,
        };
        let model = self.by_model.entry(record.model.to_string()).or_default();
        for usage in usages.into_iter().flatten() {
            model.add(price, share, usage);
        }
        if let Some((price, lost)) = price.zip(lost) {
            let unstated = lost.unstated;
            let dollars = share * price.max_cost(bound(unstated));
            model.unstated.0 = model.unstated.0.saturating_add(unstated.requests);
            model.unstated.1 += dollars;
        }
    }

    /// Sum of all costs in US dollars.
    pub(super) fn sum(&self) -> f64 {
        let known: f64 = self.by_model.values().map(|model| model.known).sum();
        known + self.unstated().1
    }

    /// Number of requests without stated tokens, and the upper bound of their cost in US dollars: as dear as the other
    /// requests.
    pub(super) fn unstated(&self) -> (u32, f64) {
        self.by_model.values().fold((0, 0.0), |(count, sum), model| {
            let (requests, dollars) = model.unstated;
            let dollars = model.charges.factor() * dollars;
            (u32::saturating_add(count, requests), sum + dollars)
        })
    }

    /// Charges that the server of a model states.
    pub(super) fn charges(&self, model: &str) -> Arc<ChargeRatios> {
        let costs = self.by_model.get(model);
        costs.map_or_else(Arc::default, |costs| Arc::clone(&costs.charges))
    }

    /// Number of replies by model that were charged more than the price table says; models without such replies are
    /// left out.
    pub(super) fn dearer(&self) -> BTreeMap<String, usize> {
        let models = self.by_model.iter().filter(|(_, model)| model.dearer > 0);
        models.map(|(name, model)| (name.clone(), model.dearer)).collect()
    }
}

impl ModelCosts {
    /// Adds requests whose tokens cost a share of their price.
    fn add(&mut self, price: Option<Price>, share: f64, usage: Usage) {
        let Some(price) = price else {
            self.known += stated_charge(usage, 0.0).unwrap_or(0.0);
            return;
        };
        self.charges.record(price, usage, share);
        let charged = price.charged_in_part(usage, share);
        self.known += charged;
        self.dearer += usize::from(charged > DEARER * share * price.list_charge(usage));
    }
}

/// Ratio of a charge to the list price from which it counts as dearer; chosen: more than rounding.
const DEARER: f64 = 1.05;

fn bound(unstated: Unstated) -> TokenBound {
    TokenBound { prompt: unstated.prompt_tokens, reply: unstated.completion_tokens }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: &[(usize, usize)] = &[(640, 480)];

    fn facts(prompt: &Prompt, image_tokens: Option<f64>) -> PromptFacts<'_> {
        PromptFacts { prompt, sizes: SIZES, system_bytes: 0, image_tokens }
    }

    fn prompt(number: usize) -> Prompt {
        Prompt::from_text(format!("Which room is shown in image {number} of the set?").into())
    }

    #[test]
    fn a_first_prompt_is_bounded_by_its_length() {
        let bounds = PromptBounds::new();
        let text = prompt(7);
        let bytes = text.parts()[0].len() as u64;
        assert_eq!(bounds.bound(facts(&text, Some(80.0))), bytes + 64 + 80);
        assert_eq!(bounds.bound(facts(&text, None)), bytes + 64 + 2880);
    }

    #[test]
    fn later_prompts_are_bounded_by_earlier_ones() {
        let (mut bounds, seven) = (PromptBounds::new(), prompt(7));
        bounds.observe(facts(&seven, None), 300);
        // A single reply may be from a cache.
        assert!(bounds.bound(facts(&prompt(123), None)) > 2000);
        bounds.observe(facts(&prompt(8), None), 301);
        bounds.observe(facts(&prompt(9), None), 300);
        assert_eq!(bounds.bound(facts(&prompt(123), None)), 300 + 3 + 4);
        let other_size = PromptFacts { sizes: &[(320, 240)], ..facts(&seven, None) };
        assert!(bounds.bound(other_size) > 2000, "another image may have more tokens");
    }

    #[test]
    fn a_prompt_beyond_its_bound_raises_all_later_ones() {
        let (mut bounds, seven) = (PromptBounds::new(), prompt(7));
        bounds.observe(facts(&seven, Some(80.0)), 2000);
        assert!(bounds.bound(facts(&prompt(8), Some(80.0))) >= 2000);
        bounds.observe(facts(&prompt(8), Some(80.0)), 4000);
        assert!(bounds.bound(facts(&prompt(9), Some(80.0))) >= 3990);
        let other_size = PromptFacts { sizes: &[(320, 240)], ..facts(&seven, Some(80.0)) };
        assert!(bounds.bound(other_size) >= 4000);
    }

    #[test]
    fn shared_beginnings_and_ends_are_not_counted() {
        assert_eq!(unshared(b"is #17 here", b"is #2 here"), 1);
        assert_eq!(unshared(b"aaa", b"aaaa"), 1);
        assert_eq!(unshared(b"aaaa", b"aa"), 0);
        assert_eq!(unshared(b"", b"abc"), 3);
    }
}
