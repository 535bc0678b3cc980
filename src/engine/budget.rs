//! Cost of a run and its limit: [`Budget`].

use crate::ask::Price;
use crate::engine::models::ModelUnderTest;
use crate::engine::money::MoneySettings;
use crate::error::{Error, Result};
use crate::images::trial::{Item, Prompt, Trial};
use crate::run_reports;
use crate::store::StoredTrial;
use crate::types::manifest::RunManifest;
use crate::types::{ImageFacts, LostAttempts, Usage, Via};

/// Characters of English text per token, by the rule of thumb of every provider.
const CHARACTERS_PER_TOKEN: f64 = 4.0;

/// Tokens of a message besides its text and images.
const MESSAGE_TOKENS: f64 = 10.0;

/// Whose replies a run has: the models of all its phases, and those that its manifest knows from earlier commands.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answering<'a> {
    pub(crate) models: &'a [&'a ModelUnderTest],
    /// `None` if the models are all.
    pub(crate) manifest: Option<&'a RunManifest>,
}

impl Answering<'_> {
    /// The price of the replies under a name in records; `None` if it is not known.
    fn price(self, money: &MoneySettings, name: &str) -> Option<Price> {
        let model = self.models.iter().find(|model| *model.name == *name);
        match (model, self.manifest) {
            (Some(model), _) => model.price(&money.prices),
            (None, Some(manifest)) => run_reports::price(&money.prices, manifest, name),
            (None, None) => money.prices.of(name),
        }
    }
}

/// The sum of what replies cost, and the decision whether one more question is within `--max-cost`.
#[derive(Debug)]
pub(crate) struct Budget {
    /// Price of each model; `None` if it is free or unknown.
    prices: Vec<Option<Price>>,
    /// Limit in US dollars; `None` for no limit.
    max_cost: Option<f64>,
    /// US dollars spent so far.
    spent: f64,
    /// Cost of the most expensive reply so far, in US dollars; `None` before the first reply.
    highest_cost: Option<f64>,
}

impl Budget {
    /// A budget that includes the cost of the stored records, which are of these models.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub(crate) fn new(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        stored: &[StoredTrial],
    ) -> Result<Self> {
        let all: Vec<&ModelUnderTest> = models.iter().collect();
        let answering = Answering {
            models: &all,
            manifest: None,
        };
        Self::of_run(money, models, answering, stored)
    }

    /// A budget of the models that are asked now. It includes the cost of the stored records of all models of the run.
    ///
    /// # Errors
    /// If `--max-cost` is set and a model has no price, because the limit could not be enforced.
    pub(crate) fn of_run(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        answering: Answering<'_>,
        stored: &[StoredTrial],
    ) -> Result<Self> {
        let price = |model: &ModelUnderTest| model.price(&money.prices);
        let prices: Vec<Option<Price>> = models.iter().map(price).collect();
        let unknown = models
            .iter()
            .zip(&prices)
            .find(|(model, price)| model.model.is_remote() && price.is_none());
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
        let mut budget = Self {
            prices,
            max_cost: money.max_cost,
            spent: 0.0,
            highest_cost: None,
        };
        for record in stored {
            let Some(price) = answering.price(money, &record.model) else {
                continue;
            };
            if let Some(lost) = record.lost() {
                let share = match record.via {
                    Via::Direct | Via::File => 1.0,
                    Via::Batch => money.prices.batch,
                };
                budget.spent += share * price.charged(lost);
            }
            let Some(usage) = record.usage() else {
                continue;
            };
            let dollars = price.charged(usage);
            match record.via {
                Via::Direct | Via::File => budget.add(dollars),
                // A batch price does not tell what a direct request costs, so it does not enter `highest_cost`.
                Via::Batch => budget.spent += money.prices.batch * dollars,
            }
        }
        Ok(budget)
    }

    /// Adds the cost of a reply. If the server reports no usage, the cost follows from the expected tokens of prompt and reply.
    pub(crate) fn record(&mut self, model: usize, usage: Option<Usage>, prompt: f64, reply: f64) {
        match (usage, self.prices[model]) {
            (Some(usage), _) => self.charge(model, usage),
            (None, Some(price)) => self.add(price.of(prompt, reply)),
            (None, None) => {}
        }
    }

    /// Adds the cost of attempts without a reply.
    pub(crate) fn record_lost(&mut self, model: usize, lost: LostAttempts) {
        if let Some(price) = self.prices[model].filter(|_| !lost.is_none()) {
            self.spent += price.charged(lost.usage);
            let each = price.charged(lost.usage) / f64::from(lost.attempts);
            self.highest_cost = Some(self.highest_cost.map_or(each, |highest| highest.max(each)));
        }
    }

    fn charge(&mut self, model: usize, usage: Usage) {
        if let Some(price) = self.prices[model] {
            self.add(price.charged(usage));
        }
    }

    fn add(&mut self, dollars: f64) {
        self.spent += dollars;
        self.highest_cost = Some(
            self.highest_cost
                .map_or(dollars, |highest_cost| highest_cost.max(dollars)),
        );
    }

    /// Expected tokens of a trial's prompt: its text by length, its images by the model's family.
    pub(crate) fn expected_tokens<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts>,
    ) -> f64 {
        let price = self.prices[trial.model];
        let images = images.map(|image| image_tokens(model, price, image.width, image.height));
        text_tokens(&trial.prompt) + images.map(|tokens| tokens.unwrap_or(0.0)).sum::<f64>()
    }

    /// Expected tokens of images for a model, which has this index; `None` if it is not known how the model counts them.
    pub(crate) fn expected_image_tokens<'a>(
        &self,
        (index, model): (usize, &ModelUnderTest),
        mut images: impl Iterator<Item = &'a ImageFacts>,
    ) -> Option<f64> {
        let price = self.prices[index];
        images.try_fold(0.0, |sum, image| {
            Some(sum + image_tokens(model, price, image.width, image.height)?)
        })
    }

    /// US dollars spent so far; `None` if no model has a price.
    pub(crate) fn spent(&self) -> Option<f64> {
        self.prices
            .iter()
            .any(Option::is_some)
            .then_some(self.spent)
    }

    /// Whether a model has a price.
    pub(crate) fn is_paid(&self, model: usize) -> bool {
        self.prices[model].is_some()
    }

    /// US dollars spent so far, by all models with a price.
    pub(crate) fn charged(&self) -> f64 {
        self.spent
    }

    /// Expected cost of a request to a model, in US dollars; `None` if it has no known price.
    pub(crate) fn expected_cost(&self, model: usize, prompt: f64, reply: f64) -> Option<f64> {
        Some(self.prices[model]?.of(prompt, reply))
    }

    /// Whether one more question is within `--max-cost`, if each request in flight costs as much as the most expensive reply so
    /// far. Until the first reply, one question is asked at a time, because the length of the model's reasoning is unknown.
    pub(crate) fn can_afford(
        &self,
        in_flight: usize,
        model: usize,
        prompt: f64,
        reply: f64,
    ) -> bool {
        let (Some(max_cost), Some(price)) = (self.max_cost, self.prices[model]) else {
            return true;
        };
        let expected = price.of(prompt, reply);
        match self.highest_cost {
            None => in_flight == 0 && expected <= max_cost,
            Some(highest_cost) => {
                self.spent + highest_cost.max(expected) * (in_flight + 1) as f64 <= max_cost
            }
        }
    }
}

/// Expected tokens of a prompt's text.
pub(crate) fn text_tokens(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS_PER_TOKEN + MESSAGE_TOKENS
}

/// Tokens of an image for a model: from the table of prices, else by the model's family; `None` if unknown.
pub(crate) fn image_tokens(
    model: &ModelUnderTest,
    price: Option<Price>,
    width: usize,
    height: usize,
) -> Option<f64> {
    let stated = price.and_then(|price| price.image_tokens);
    let counted = || model.model.image_tokens(width as u64, height as u64);
    stated.or_else(counted).map(|tokens| tokens as f64)
}
