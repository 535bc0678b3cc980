//! Comparison of the charged tokens of prompts with the estimated ones: [`TokenCheck`].

use crate::ask::ImageTokenCheck;
use crate::engine::costs::budget::{Budget, text_tokens};
use crate::engine::costs::measured_tokens::MeasuredTokens;
use crate::engine::images::trials::{Item, Trial};
use crate::engine::models::ModelUnderTest;
use crate::types::{ImageFacts, Usage};

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
