//! What a run costs: [`Ledger`].

use super::askers::Asker;
use super::trial::{Item, Prompt, Trial};
use crate::ask::Price;
use crate::config::Money;
use crate::error::{Error, Result};
use crate::types::{ImageFacts, Kept, Usage, Via};

/// How many characters of English a token is, by the rule of thumb of every provider.
const CHARACTERS: f64 = 4.0;

/// How many tokens a message has besides its words.
const AROUND: f64 = 10.0;

/// Books what replies were charged, and says whether another question is within the means.
#[derive(Debug)]
pub(super) struct Ledger {
    /// What each model charges; `None` for those that are free or unknown.
    prices: Vec<Option<Price>>,
    most: Option<f64>,
    spent: f64,
    /// The dearest reply so far.
    dearest: Option<f64>,
}

impl Ledger {
    /// A ledger that goes on from the kept records of a run.
    ///
    /// # Errors
    /// Where `--max-cost` is said and a model has no price: it could not be kept to.
    pub(super) fn new<'a, R: Kept + 'a>(
        money: &Money,
        askers: &[Asker],
        kept: impl IntoIterator<Item = &'a R>,
    ) -> Result<Self> {
        let price = |asker: &Asker| {
            let remote = asker.model.is_remote();
            remote
                .then(|| money.prices.of(asker.model.name()))
                .flatten()
        };
        let prices: Vec<Option<Price>> = askers.iter().map(price).collect();
        let unknown = askers
            .iter()
            .zip(&prices)
            .find(|(asker, price)| asker.model.is_remote() && price.is_none());
        if let (Some(_), Some((asker, _))) = (money.most, unknown) {
            return Err(Error::usage(
                "--max-cost",
                format_args!(
                    "no price of {} is known as of {}; state it in a table by --prices FILE",
                    asker.model.name(),
                    money.prices.as_of
                ),
            ));
        }
        let mut ledger = Self {
            prices,
            most: money.most,
            spent: 0.0,
            dearest: None,
        };
        for record in kept {
            let Some((price, usage)) = record
                .charged()
                .and_then(|(model, usage)| Some((money.prices.of(model)?, usage)))
            else {
                continue;
            };
            let dollars = price.charged(usage);
            match record.via() {
                Via::Direct | Via::File => ledger.add(dollars),
                // It says nothing about what a request of its own costs.
                Via::Batch => ledger.spent += money.prices.batch * dollars,
            }
        }
        Ok(ledger)
    }

    /// Books a reply; where the server does not say what it charges, what is likely for a prompt and a reply of so many tokens.
    pub(super) fn book(&mut self, asker: usize, usage: Option<Usage>, likely: f64, reply: f64) {
        match (usage, self.prices[asker]) {
            (Some(usage), _) => self.charge(asker, usage),
            (None, Some(price)) => self.add(price.of(likely, reply)),
            (None, None) => {}
        }
    }

    fn charge(&mut self, asker: usize, usage: Usage) {
        if let Some(price) = self.prices[asker] {
            self.add(price.charged(usage));
        }
    }

    fn add(&mut self, dollars: f64) {
        self.spent += dollars;
        self.dearest = Some(self.dearest.map_or(dollars, |dearest| dearest.max(dollars)));
    }

    /// How many tokens the prompt of a trial is likely to have: its words by their length, its images by the model's family.
    pub(super) fn likely<'a, I: Item>(
        &self,
        asker: &Asker,
        trial: &Trial<I>,
        images: impl Iterator<Item = &'a ImageFacts>,
    ) -> f64 {
        let price = self.prices[trial.asker];
        let images = images.map(|image| image_of(asker, price, image.width, image.height));
        words(&trial.prompt) + images.map(|tokens| tokens.unwrap_or(0.0)).sum::<f64>()
    }

    /// The dollars booked so far; `None` where no model has a price.
    pub(super) fn spent(&self) -> Option<f64> {
        self.prices
            .iter()
            .any(Option::is_some)
            .then_some(self.spent)
    }

    /// Whether one more question is within `--max-cost`, with so many on the way that may each turn out as dear as the
    /// dearest so far. Until the first reply is booked one at a time is asked: nobody knows how much a model thinks.
    pub(super) fn affords(&self, on_the_way: usize, asker: usize, likely: f64, reply: f64) -> bool {
        let (Some(most), Some(price)) = (self.most, self.prices[asker]) else {
            return true;
        };
        let likely = price.of(likely, reply);
        match self.dearest {
            None => on_the_way == 0 && likely <= most,
            Some(dearest) => self.spent + dearest.max(likely) * (on_the_way + 1) as f64 <= most,
        }
    }
}

/// How many tokens the words of a prompt are likely to have.
pub(super) fn words(prompt: &Prompt) -> f64 {
    let characters = prompt.parts().map(|part| part.chars().count());
    characters.iter().sum::<usize>() as f64 / CHARACTERS + AROUND
}

/// How many tokens an image is to a model: by the table of prices, else by its family; `None` where nobody knows.
pub(super) fn image_of(
    asker: &Asker,
    price: Option<Price>,
    width: usize,
    height: usize,
) -> Option<f64> {
    let stated = price.and_then(|price| price.image_tokens);
    let counted = || asker.model.image_tokens(width as u64, height as u64);
    stated.or_else(counted).map(|tokens| tokens as f64)
}
