//! The estimated cost of each source of a plan: [`costs`].

use crate::ask::Price;
use crate::engine::costs::budget::{shown_tokens, text_tokens};
use crate::engine::experiment::Experiment;
use crate::engine::images::frames::Source;
use crate::engine::images::trials::{Item as _, SourcePlan, TrialGroup};
use crate::runs::run_plan::FrameCost;

/// Processor seconds for each million pixels of an image that is degraded and encoded; measured on 1280 × 720, rounded.
const SECONDS_PER_MEGAPIXEL: f64 = 0.1;

/// Processor seconds for each million pixels of an enhanced image; chosen between 0.1 and 8, the range of the
/// enhancers.
const ENHANCED_SECONDS_PER_MEGAPIXEL: f64 = 1.0;

/// Processor seconds for each request; chosen.
const SECONDS_PER_REQUEST: f64 = 0.002;

/// The cost of the trials of the first phase of an experiment, for each of its sources in their order.
pub(crate) fn costs<E: Experiment>(experiment: &E, plan: &[SourcePlan<E::Item>]) -> Vec<FrameCost> {
    let sources = experiment.sources();
    let zero_cost = FrameCost { tokens: Some(0.0), dollars: Some(0.0), ..FrameCost::default() };
    let mut costs = vec![zero_cost; sources.len()];
    for part in plan {
        for group in &part.groups {
            add_group(experiment, &sources[part.source], group, &mut costs[part.source]);
        }
    }
    // Rounded to microseconds, because further digits may differ between machines.
    for cost in &mut costs {
        cost.seconds = (cost.seconds * 1e6).round() / 1e6;
    }
    costs
}

/// Adds the trials of a group about a source to its cost.
fn add_group<E: Experiment>(experiment: &E, source: &Source, group: &TrialGroup<E::Item>, cost: &mut FrameCost) {
    let models = experiment.models(0);
    if let Some(condition) = &group.condition {
        let seconds_per_megapixel = match condition.enhancer {
            None => SECONDS_PER_MEGAPIXEL,
            Some(_) => SECONDS_PER_MEGAPIXEL + ENHANCED_SECONDS_PER_MEGAPIXEL,
        };
        let pixels: f64 = source
            .frames
            .iter()
            .map(|frame| frame.size)
            .map(|(width, height)| f64::from(width) * f64::from(height))
            .sum();
        cost.seconds += seconds_per_megapixel * pixels / 1e6;
    }
    cost.requests += group.trials.len();
    cost.seconds += SECONDS_PER_REQUEST * group.trials.len() as f64;
    // Price and image tokens of each model, which are the same in all its requests.
    let by_model: Vec<(Option<Price>, Option<f64>)> = models
        .iter()
        .map(|model| {
            let price = model.price(&experiment.settings().money.prices);
            let tokens = match &group.condition {
                Some(_) => shown_tokens(model, price, None, source, experiment.recipe().scaling),
                None => Some(0.0),
            };
            (price, tokens)
        })
        .collect();
    for trial in &group.trials {
        if !models[trial.model].model.is_remote() {
            continue;
        }
        let (price, images) = by_model[trial.model];
        let (text, reply) = (text_tokens(&trial.prompt), trial.item.reply_tokens());
        let sent = images.map(|images| text + images);
        cost.tokens = cost.tokens.zip(sent).map(|(sum, sent)| sum + sent + reply);
        let dollars = price.zip(sent).map(|(price, sent)| price.cost(sent, reply));
        cost.dollars = cost.dollars.zip(dollars).map(|(sum, more)| sum + more);
    }
}
