//! Estimate of the tokens, cost, bytes and time of a run, without sending anything: [`estimate`].

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ask::{ImageLimit, Price, Server};
use crate::engine::costs::budget::{Budget, shown_tokens, text_tokens};
use crate::engine::costs::measured_tokens::MeasuredTokens;
use crate::engine::costs::planned_images::{PlannedImages, SampledImages};
use crate::engine::experiment::{ExpectedRequest, Experiment};
use crate::engine::images::frames::Source;
use crate::engine::images::image_pipeline::ImagePipeline;
use crate::engine::images::trials::{Item as _, Plan};
use crate::engine::models::ModelUnderTest;
use crate::engine::open_run::image_limit;
use crate::error::Result;
use crate::runs::forecast::{CostLine, FewSources, Forecast, ProfileCost, StoreForecast};
use crate::store::StoredTrial;
use crate::types::{Degradation, ImageFacts, ProfileName, View};
use darkqa_score::cluster::MIN_CLUSTERS;

/// Assumed latency of a reply in seconds, if no reply is stored.
const REPLY_SECONDS: f64 = 2.0;

/// Estimates the remaining requests with their tokens, cost, bytes and time. A few images are made to measure their
/// size.
pub(crate) fn estimate<E: Experiment>(
    experiment: &E,
    plans: &[Plan<E::Item>],
    measured: &[MeasuredTokens],
    stored: &[StoredTrial],
    pipeline: &mut ImagePipeline<'_>,
) -> Result<Forecast> {
    let settings = experiment.settings();
    let (money, sources) = (&settings.money, experiment.sources());
    let expected = plans.first().map_or_else(Vec::new, |plan| experiment.expected_requests(&plan.sources));
    let (mut lines, mut all_models) = (Vec::new(), Vec::new());
    let mut built_in = Vec::new();
    let mut loads = Vec::new();
    for phase in 0..plans.len() {
        all_models.extend(experiment.models(phase).iter().cloned());
    }
    let budget = Budget::new(money, &all_models, stored)?;
    let mut models_before = 0;
    for (phase, plan) in plans.iter().enumerate() {
        let expected = if phase == 0 { &[] } else { &expected[..] };
        let measured = &measured[phase];
        for (model, line) in cost_lines(experiment, phase, plan, measured, expected) {
            add_load(&mut loads, &experiment.models(phase)[model], &line);
            let ratio = budget.charges(models_before + model).mean();
            lines.push(line.at_ratio(ratio));
        }
        built_in.extend(built_in_models(experiment, phase, plan));
        models_before += experiment.models(phase).len();
    }
    let sample = match plans.first() {
        Some(plan) => SampledImages::make(experiment, plan, pipeline)?,
        None => SampledImages::default(),
    };
    let images = PlannedImages::new(experiment, plans, &sample);
    let latencies: Vec<u64> = stored.iter().filter_map(StoredTrial::latency_ms).collect();
    // Endpoints are asked in parallel, so the slowest determines the time.
    let (asking_seconds, pace) = loads
        .iter()
        .map(|load| asking_time(load, &latencies))
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .unwrap_or_else(|| (0.0, "built-in models alone".to_owned()));
    let largest = sample.images.iter().max_by_key(|image| image.bytes);
    let limit = image_limit(settings);
    let planned: usize = plans.iter().map(|plan| plan.keys.len()).sum();
    let remaining: usize = plans.iter().map(Plan::remaining).sum();
    let is_few = experiment.part().is_none() && sources.len() < MIN_CLUSTERS;
    let few_sources = FewSources { number: sources.len(), needed: MIN_CLUSTERS, of: E::SOURCE };
    Ok(Forecast {
        lines,
        built_in,
        trials: planned + expected.len(),
        answered: planned - remaining,
        spent: budget.spent(),
        images: images.made,
        images_sent: images.sent,
        bytes: images.bytes,
        largest_image: largest.map_or(0, |image| image.bytes),
        sampled: sample.images.len(),
        too_large: limit.zip(largest).and_then(|(limit, image)| too_large(limit, image, sources)),
        making_seconds: images.seconds,
        asking_seconds,
        pace,
        prices: format!("prices of {}", money.prices.as_of),
        batch: money.prices.batch,
        image_store: images.set.map(|set| StoreForecast::new(set.description(), set.bytes(), set.room())),
        reply: E::REPLY,
        few_sources: is_few.then_some(few_sources),
        power: experiment.power().filter(|_| experiment.part().is_none()),
        largest_request: sources.iter().any(|source| source.order.len() > 1).then_some(images.largest_request),
    })
}

/// Built-in models that a plan asks, with the number of trials of each.
fn built_in_models<E: Experiment>(experiment: &E, phase: usize, plan: &Plan<E::Item>) -> Vec<(String, usize)> {
    let models = experiment.models(phase);
    let mut trials = vec![0; models.len()];
    for trial in plan.groups().flat_map(|(_, group)| &group.trials) {
        trials[trial.model] += 1;
    }
    models
        .iter()
        .zip(trials)
        .filter(|(model, trials)| !model.model.is_remote() && *trials > 0)
        .map(|(model, trials)| (label(model, E::PHASES[phase]), trials))
        .collect()
}

/// The name of a model, marked if it is a judge or asked without images.
fn label(model: &ModelUnderTest, phase: &str) -> String {
    let role = match (phase, model.view) {
        ("marks", _) => " (judge)",
        (_, View::Blind) => " (blind)",
        (_, View::Image) => "",
    };
    format!("{}{role}", model.name)
}

/// The reason why a request is too large for an endpoint, judged by the largest image and the largest number of images
/// in a request; `None` if all fit.
fn too_large(limit: ImageLimit, image: &ImageFacts, sources: &[Source]) -> Option<String> {
    let max_images = sources.iter().map(|source| source.order.len()).max().unwrap_or(0);
    limit
        .check(image)
        .and_then(|()| limit.check_request(max_images, Some(image)))
        .err()
        .map(|problem| problem.to_string())
        .or_else(|| limit.may_exceed(max_images, image))
}

/// The cost line of each model at an endpoint that a phase asks, with the index of the model.
fn cost_lines<E: Experiment>(
    experiment: &E,
    phase: usize,
    plan: &Plan<E::Item>,
    measured: &MeasuredTokens,
    expected: &[ExpectedRequest],
) -> Vec<(usize, CostLine)> {
    let sources = experiment.sources();
    experiment
        .models(phase)
        .iter()
        .enumerate()
        .filter(|(_, model)| model.model.is_remote())
        .map(|(index, model)| {
            let price = model.price(&experiment.settings().money.prices);
            let mut by_profile = BTreeMap::<Option<ProfileName>, Tokens>::new();
            for (place, group) in plan.groups() {
                let degradation = group.condition.as_ref().and_then(|c| c.degradation());
                let profile = degradation.and_then(Degradation::reading).cloned();
                let tokens = by_profile.entry(profile).or_default();
                let before = tokens.requests;
                for trial in group.trials.iter().filter(|trial| trial.model == index) {
                    tokens.add(text_tokens(&trial.prompt), trial.item.reply_tokens());
                }
                let source = &sources[place];
                if group.condition.is_some() && tokens.requests > before {
                    let scaling = experiment.recipe().scaling;
                    let charged = measured.image(index);
                    let requests = (tokens.requests - before) as f64;
                    tokens.image = tokens
                        .image
                        .zip(shown_tokens(model, price, charged, source, scaling))
                        .map(|(sum, each)| sum + each * requests);
                }
            }
            for request in expected.iter().filter(|request| request.model == index) {
                let tokens = by_profile.entry(None).or_default();
                tokens.add(request.text_tokens, request.reply_tokens);
            }
            let line = CostLine {
                charged_image_tokens: measured.image(index),
                ..cost_line(model, price, &by_profile, E::PHASES[phase])
            };
            (index, line)
        })
        .filter(|(_, line)| line.requests > 0)
        .collect()
}

/// Numbers of requests to one endpoint and of their tokens.
struct Load {
    server: Arc<Server>,
    requests: f64,
    tokens: f64,
}

/// Adds the requests to a model to the load of its endpoint.
fn add_load(loads: &mut Vec<Load>, model: &ModelUnderTest, line: &CostLine) {
    let Some(server) = &model.server else {
        return;
    };
    let requests = line.requests as f64;
    let tokens = line.text_tokens + line.image_tokens.unwrap_or(0.0) + line.reply_tokens;
    match loads.iter_mut().find(|load| Arc::ptr_eq(&load.server, server)) {
        Some(load) => {
            load.requests += requests;
            load.tokens += tokens;
        }
        None => loads.push(Load { server: Arc::clone(server), requests, tokens }),
    }
}

/// Numbers of requests to one model and of their tokens.
#[derive(Debug)]
struct Tokens {
    requests: usize,
    text: f64,
    reply: f64,
    /// Tokens of all images; `None` if unknown.
    image: Option<f64>,
}

impl Default for Tokens {
    fn default() -> Self {
        Self { requests: 0, text: 0.0, reply: 0.0, image: Some(0.0) }
    }
}

impl Tokens {
    fn sum<'t>(terms: impl Iterator<Item = &'t Self>) -> Self {
        terms.fold(Self::default(), |sum, term| Self {
            requests: sum.requests + term.requests,
            text: sum.text + term.text,
            reply: sum.reply + term.reply,
            image: sum.image.zip(term.image).map(|(sum, term)| sum + term),
        })
    }

    /// The cost in US dollars if all replies together have `reply` tokens; `None` if the price or the tokens of images
    /// are unknown.
    fn dollars(&self, price: Option<Price>, reply: f64) -> Option<f64> {
        Some(price?.cost(self.text + self.image?, reply))
    }

    /// Adds a request with these tokens of its text and its reply.
    fn add(&mut self, text: f64, reply: f64) {
        self.requests += 1;
        self.text += text;
        self.reply += reply;
    }
}

/// The cost line of one model, from its tokens by the noise profile of the images.
fn cost_line(
    model: &ModelUnderTest,
    price: Option<Price>,
    by_profile: &BTreeMap<Option<ProfileName>, Tokens>,
    phase: &str,
) -> CostLine {
    let tokens = Tokens::sum(by_profile.values());
    let requests = tokens.requests as f64;
    let longest = model.model.max_tokens().map(|limit| requests * f64::from(limit));
    CostLine {
        model: label(model, phase),
        endpoints: model.server.as_deref().map_or_else(Vec::new, Server::addresses),
        requests: tokens.requests,
        text_tokens: tokens.text,
        image_tokens: tokens.image,
        reply_tokens: tokens.reply,
        longest_reply_tokens: longest,
        dollars: tokens.dollars(price, tokens.reply),
        most_dollars: longest.and_then(|longest| tokens.dollars(price, longest)),
        charged_image_tokens: None,
        charge_ratio: None,
        readings: by_profile
            .iter()
            .filter(|(_, tokens)| tokens.requests > 0)
            .map(|(profile, tokens)| ProfileCost {
                reading: profile.clone(),
                requests: tokens.requests,
                dollars: tokens.dollars(price, tokens.reply),
            })
            .collect(),
    }
}

/// Seconds until all replies of an endpoint have arrived, and a description of the limit that determines them: `--rpm`,
/// `--tpm`, or the mean latency of stored replies.
fn asking_time(load: &Load, latencies_ms: &[u64]) -> (f64, String) {
    let Load { server, requests, tokens } = load;
    let (requests, tokens) = (*requests, *tokens);
    let times: Vec<f64> = latencies_ms.iter().filter(|ms| **ms > 0).map(|ms| *ms as f64 / 1e3).collect();
    let (latency, origin) = if times.is_empty() {
        (REPLY_SECONDS, "assumed")
    } else {
        (times.iter().sum::<f64>() / times.len() as f64, "as so far")
    };
    let sending = &server.sending;
    let concurrency = server.max_in_flight();
    let mut slowest =
        (requests * latency / concurrency as f64, format!("{latency:.1} s a reply {origin}, {concurrency} at once"));
    let quotas = [("--rpm", requests, sending.quota.requests), ("--tpm", tokens, sending.quota.tokens)];
    for (flag, number, per_minute) in quotas {
        let Some(per_minute) = per_minute else {
            continue;
        };
        let seconds = 60.0 * number / f64::from(per_minute.get());
        if seconds > slowest.0 {
            slowest = (seconds, format!("by {flag}"));
        }
    }
    slowest
}
