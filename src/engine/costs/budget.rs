//! Cost of a run and its limit: [`Budget`].

use std::sync::Arc;

use crate::ask::{Price, PricedRequest, ReplyExcess, Reservation, Spending, TokenBound};
use crate::engine::costs::money::MoneySettings;
use crate::engine::costs::prompt_bounds::{self, PromptBounds, PromptFacts};
use crate::engine::models::ModelUnderTest;
use crate::error::{Error, Result};
use crate::images::frames::Source;
use crate::images::trials::{Item, Prompt, Trial};
use crate::picture::Scaling;
use crate::run_reports;
use crate::store::StoredTrial;
use crate::types::manifests::RunManifest;
use crate::types::{ImageFacts, Unstated, Usage, Via};

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
            (None, Some(manifest)) => run_reports::price(&money.prices, manifest, name),
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
}

/// Price and bounds of the requests to one model.
#[derive(Debug)]
struct ModelBudget {
    /// `None` if the model is free, or its price is unknown.
    price: Option<Price>,
    prompts: PromptBounds,
    /// Replies beyond the token limit.
    excess: Arc<ReplyExcess>,
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
    pub(crate) fn new(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        stored: &[StoredTrial],
    ) -> Result<Self> {
        let all: Vec<&ModelUnderTest> = models.iter().collect();
        let run_models = RunModels {
            models: &all,
            manifest: None,
        };
        Self::for_run(money, models, run_models, stored)
    }

    /// A budget for the `models` that are asked now. It includes the cost of the stored records of all models of the run.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub(crate) fn for_run(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        run_models: RunModels<'_>,
        stored: &[StoredTrial],
    ) -> Result<Self> {
        let budgets: Vec<ModelBudget> = models
            .iter()
            .map(|model| ModelBudget {
                price: model.price(&money.prices),
                prompts: PromptBounds::new(),
                excess: Arc::default(),
            })
            .collect();
        let unknown = models
            .iter()
            .zip(&budgets)
            .find(|(model, budget)| model.model.is_remote() && budget.price.is_none());
        if let (Some(_), Some((model, _))) = (money.max_cost, unknown) {
            return Err(Error::usage(
                "--max-cost",
                format_args!(
                    "the price of {} is not in the table of {}; add it to your own table and name that with --prices FILE, or set price \
                     in a file of models",
                    model.name, money.prices.as_of
                ),
            ));
        }
        let costs = stored.iter().filter_map(|record| {
            let price = run_models.price(money, &record.model)?;
            Some(price_factor(money, record.via) * charged(price, record))
        });
        let unstated = stored.iter().filter_map(|record| {
            let price = run_models.price(money, &record.model)?;
            let unstated = record.lost()?.unstated;
            let dollars = price_factor(money, record.via) * price.max_cost(bound(unstated));
            Some((unstated.requests, dollars))
        });
        Ok(Self {
            unstated: unstated.fold((0, 0.0), |(count, sum), (requests, dollars)| {
                (u32::saturating_add(count, requests), sum + dollars)
            }),
            models: budgets,
            spending: Arc::new(Spending::new(money.max_cost, costs.sum())),
        })
    }

    /// Adds an upper bound in US dollars of the cost of requests without a record: those of batches that have not ended, and those of
    /// killed processes.
    pub(crate) fn with_unrecorded(self, dollars: f64) -> Self {
        let max_cost = self.spending.limit();
        let spending = Spending::new(max_cost, self.spending.spent()).with_pending_batches(dollars);
        Self {
            spending: Arc::new(spending),
            ..self
        }
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
        })
    }

    /// Corrects the bounds of later prompts by the charged tokens of a trial's prompt.
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
        self.models[trial.model].prompts.observe(facts, charged);
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
        images.try_fold(0.0, |sum, image| {
            Some(sum + image_tokens(model, price, image.width, image.height)?)
        })
    }

    /// US dollars spent so far; `None` if no model has a price.
    pub(crate) fn spent(&self) -> Option<f64> {
        self.models
            .iter()
            .any(|model| model.price.is_some())
            .then(|| self.spending.spent())
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

    /// Expected cost of a request to a model, in US dollars; `None` if it has no known price.
    pub(crate) fn expected_cost(&self, model: usize, prompt: f64, reply: f64) -> Option<f64> {
        Some(self.models[model].price?.cost(prompt, reply))
    }
}

/// Factor of the price for requests that were sent in this way.
fn price_factor(money: &MoneySettings, via: Via) -> f64 {
    match via {
        Via::Direct | Via::File => 1.0,
        Via::Batch => money.prices.batch,
    }
}

/// Cost of all requests of a stored trial in US dollars; the upper bound for requests without stated tokens.
fn charged(price: Price, record: &StoredTrial) -> f64 {
    let reply = record.usage().map_or(0.0, |usage| price.charged(usage));
    let others = record.lost();
    reply
        + others.map_or(0.0, |lost| {
            price.charged(lost.usage) + price.max_cost(bound(lost.unstated))
        })
}

fn bound(unstated: Unstated) -> TokenBound {
    TokenBound {
        prompt: unstated.prompt_tokens,
        reply: unstated.completion_tokens,
    }
}

fn facts<'a, I: Item>(
    model: &ModelUnderTest,
    trial: &'a Trial<I>,
    sizes: &'a [(usize, usize)],
    image_tokens: Option<f64>,
) -> PromptFacts<'a> {
    PromptFacts {
        prompt: &trial.prompt,
        sizes,
        system_bytes: model.model.system_bytes(),
        image_tokens,
    }
}

/// Expected tokens of a prompt's text.
pub(crate) fn text_tokens(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS_PER_TOKEN + MESSAGE_TOKENS
}

/// Tokens of the images in a request about a source: `charged` tokens each if that is known, else by size. `None` if the tokens of an
/// image are unknown.
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
fn image_tokens(
    model: &ModelUnderTest,
    price: Option<Price>,
    width: usize,
    height: usize,
) -> Option<f64> {
    price
        .and_then(|price| price.image_tokens)
        .or_else(|| model.model.image_tokens(width as u64, height as u64))
        .map(|tokens| tokens as f64)
}
