//! What a run costs: [`Budget`].

use super::models::ModelUnderTest;
use super::money::MoneySettings;
use super::trial::{Item, Prompt, Trial};
use crate::ask::Price;
use crate::error::{Error, Result};
use crate::types::{ImageFacts, Record, Usage, Via};

/// How many characters of English a token is, by the rule of thumb of every provider.
const CHARACTERS: f64 = 4.0;

/// How many tokens a message has besides its words.
const AROUND: f64 = 10.0;

/// Books what replies were charged, and says whether another question is within the means.
#[derive(Debug)]
pub(crate) struct Budget {
    /// What each model charges; `None` for those that are free or unknown.
    prices: Vec<Option<Price>>,
    most: Option<f64>,
    spent: f64,
    /// What the most expensive reply so far has cost.
    highest_cost: Option<f64>,
}

impl Budget {
    /// A budget that goes on from the kept records of a run.
    ///
    /// # Errors
    /// Where `--max-cost` is said and a model has no price: it could not be kept to.
    pub(crate) fn new<D>(
        money: &MoneySettings,
        models: &[ModelUnderTest],
        stored: &[Record<D>],
    ) -> Result<Self> {
        let price = |model: &ModelUnderTest| {
            let remote = model.model.is_remote();
            remote
                .then(|| money.prices.of(model.model.name()))
                .flatten()
        };
        let prices: Vec<Option<Price>> = models.iter().map(price).collect();
        let unknown = models
            .iter()
            .zip(&prices)
            .find(|(model, price)| model.model.is_remote() && price.is_none());
        if let (Some(_), Some((model, _))) = (money.most, unknown) {
            return Err(Error::usage(
                "--max-cost",
                format_args!(
                    "no price of {} is known as of {}; state it in a table by --prices FILE",
                    model.model.name(),
                    money.prices.as_of
                ),
            ));
        }
        let mut budget = Self {
            prices,
            most: money.most,
            spent: 0.0,
            highest_cost: None,
        };
        for record in stored {
            let price = money.prices.of(&record.model);
            let Some((price, usage)) = price.zip(record.usage) else {
                continue;
            };
            let dollars = price.charged(usage);
            match record.via {
                Via::Direct | Via::File => budget.add(dollars),
                // It says nothing about what a request of its own costs.
                Via::Batch => budget.spent += money.prices.batch * dollars,
            }
        }
        Ok(budget)
    }

    /// Books a reply; where the server does not say what it charges, what is likely for a prompt and a reply of so many tokens.
    pub(crate) fn book(&mut self, model: usize, usage: Option<Usage>, likely: f64, reply: f64) {
        match (usage, self.prices[model]) {
            (Some(usage), _) => self.charge(model, usage),
            (None, Some(price)) => self.add(price.of(likely, reply)),
            (None, None) => {}
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

    /// How many tokens the prompt of a trial is likely to have: its words by their length, its images by the model's family.
    pub(crate) fn expected_tokens<'a, I: Item>(
        &self,
        model: &ModelUnderTest,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts>,
    ) -> f64 {
        let price = self.prices[trial.model];
        let images = images.map(|image| image_of(model, price, image.width, image.height));
        words(&trial.prompt) + images.map(|tokens| tokens.unwrap_or(0.0)).sum::<f64>()
    }

    /// The dollars booked so far; `None` where no model has a price.
    pub(crate) fn spent(&self) -> Option<f64> {
        self.prices
            .iter()
            .any(Option::is_some)
            .then_some(self.spent)
    }

    /// Whether one more question is within `--max-cost`, with so many on the way that may each turn out as expensive as
    /// the most expensive so far. Until the first reply is booked one at a time is asked: nobody knows how much a model thinks.
    pub(crate) fn can_afford(
        &self,
        on_the_way: usize,
        model: usize,
        likely: f64,
        reply: f64,
    ) -> bool {
        let (Some(most), Some(price)) = (self.most, self.prices[model]) else {
            return true;
        };
        let likely = price.of(likely, reply);
        match self.highest_cost {
            None => on_the_way == 0 && likely <= most,
            Some(highest_cost) => {
                self.spent + highest_cost.max(likely) * (on_the_way + 1) as f64 <= most
            }
        }
    }
}

/// How many tokens the words of a prompt are likely to have.
pub(crate) fn words(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS + AROUND
}

/// How many tokens an image is to a model: by the table of prices, else by its family; `None` where nobody knows.
pub(crate) fn image_of(
    model: &ModelUnderTest,
    price: Option<Price>,
    width: usize,
    height: usize,
) -> Option<f64> {
    let stated = price.and_then(|price| price.image_tokens);
    let counted = || model.model.image_tokens(width as u64, height as u64);
    stated.or_else(counted).map(|tokens| tokens as f64)
}
