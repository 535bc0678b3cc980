//! Cost of a run and its limit: [`Budget`].

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ask::{
    ChargeRatios, Price, PricedRequest, ReplyExcess, Reservation, Spending, TokenBound, Unpriced, stated_charge,
};
use crate::engine::costs::money::MoneySettings;
use crate::engine::costs::prompt_bounds::{self, PromptBounds, PromptFacts};
use crate::engine::costs::stored_costs::StoredCosts;
use crate::engine::images::frames::Source;
use crate::engine::images::trials::{Item, Prompt, Trial};
use crate::engine::models::ModelUnderTest;
use crate::error::{Error, Result};
use crate::pictures::Scaling;
use crate::report::joined;
use crate::store::StoredTrial;
use crate::types::manifests::RunManifest;
use crate::types::{ImageFacts, Usage};

/// Characters of English text per token, by the rule of thumb of every provider.
const CHARACTERS_PER_TOKEN: f64 = 4.0;

/// Tokens of a message besides its text and images.
const MESSAGE_TOKENS: f64 = 10.0;

/// Tokens reserved for the first reply of a model without a token limit; chosen.
const UNLIMITED_REPLY: u64 = 4096;

/// The models that have replies in a run: those of all its phases, and those of earlier commands in its manifest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RunModels<'a> {
    pub(crate) models: &'a [&'a ModelUnderTest],
    /// `None` if there are no other models.
    pub(crate) manifest: Option<&'a RunManifest>,
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
pub(crate) struct Budget {
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
pub(crate) enum Permit {
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
    pub(crate) fn new(money: &MoneySettings, models: &[ModelUnderTest], stored: &[StoredTrial]) -> Result<Self> {
        let all: Vec<&ModelUnderTest> = models.iter().collect();
        let run_models = RunModels { models: &all, manifest: None };
        Self::for_run(money, models, run_models, stored)
    }

    /// A budget for the `models` that are asked now. It includes the cost of the stored records of all models of the
    /// run.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub(crate) fn for_run(
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
    pub(crate) fn with_unrecorded(self, dollars: f64) -> Self {
        let max_cost = self.spending.limit();
        let spending = Spending::new(max_cost, self.spending.spent()).with_pending_batches(dollars);
        Self { spending: Arc::new(spending), ..self }
    }

    /// Asks for permission to ask a question now, and reserves the upper bound of the cost of its first request.
    pub(crate) fn permit<'a, I: Item>(
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
    pub(crate) fn request<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
    ) -> Option<PricedRequest> {
        let budget = &self.models[trial.model];
        let price = budget.price?;
        let sizes = prompt_bounds::sizes(images.clone());
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
    pub(crate) fn observe<'a, I: Item>(
        &mut self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts> + Clone,
        usage: Usage,
    ) {
        let sizes = prompt_bounds::sizes(images.clone());
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
    pub(crate) fn expected_tokens<'a, I: Item>(
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
    pub(crate) fn expected_image_tokens<'a>(
        &self,
        index: usize,
        model: &ModelUnderTest,
        mut images: impl Iterator<Item = &'a ImageFacts>,
    ) -> Option<f64> {
        let price = self.models[index].price;
        images.try_fold(0.0, |sum, image| Some(sum + image_tokens(model, price, image.width, image.height)?))
    }

    /// US dollars spent so far; `None` if no model has a price and no server states a charge.
    pub(crate) fn spent(&self) -> Option<f64> {
        let spent = self.spending.spent();
        let is_known = spent > 0.0 || self.models.iter().any(|model| model.price.is_some());
        is_known.then_some(spent)
    }

    /// US dollars spent so far by all models with a price; zero if no model has one.
    pub(crate) fn charged(&self) -> f64 {
        self.spending.spent()
    }

    /// Number of stored requests without stated tokens, and the upper bound of their cost in US dollars.
    pub(crate) fn unstated(&self) -> (u32, f64) {
        self.unstated
    }

    /// The spending that all requests share.
    pub(crate) fn spending(&self) -> &Arc<Spending> {
        &self.spending
    }

    /// Replies of a model beyond the token limit.
    pub(crate) fn excess(&self, model: usize) -> &ReplyExcess {
        &self.models[model].excess
    }

    /// Charges that the server of a model states.
    pub(crate) fn charges(&self, model: usize) -> &ChargeRatios {
        &self.models[model].charges
    }

    /// Number of stored replies by model that were charged more than the price table says.
    pub(crate) fn dearer(&self) -> &BTreeMap<String, usize> {
        &self.dearer
    }

    /// Expected cost of a request to a model, in US dollars, by the price table and the charges so far; `None` if it
    /// has no known price.
    pub(crate) fn expected_cost(&self, model: usize, prompt: f64, reply: f64) -> Option<f64> {
        let ModelBudget { price, charges, .. } = &self.models[model];
        Some(charges.mean().unwrap_or(1.0) * (*price)?.cost(prompt, reply))
    }

    /// The reason why the price of a model is unknown, if it is another one than that the table does not have the
    /// model.
    pub(crate) fn unpriced(money: &MoneySettings, model: &ModelUnderTest) -> Option<String> {
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
pub(crate) fn text_tokens(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS_PER_TOKEN + MESSAGE_TOKENS
}

/// Tokens of the images in a request about a source: `charged` tokens each if that is known, else by size. `None` if
/// the tokens of an image are unknown.
pub(crate) fn shown_tokens(
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
