//! Estimate of the tokens, cost, bytes and time of a run, without sending anything: [`estimate`].
//!
//! Estimates of the images that remain to be made and sent, from a sample: [`PlannedImages`], [`SampledImages`].
//!
//! The estimated cost of each source of a plan: [`costs`].

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::token_check::MeasuredTokens;
use crate::costs::budget::{Budget, shown_tokens, text_tokens};
use crate::experiment::{ExpectedRequest, Experiment};
use crate::image_cache::ImageSet;
use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::image_pipeline::ImagePipeline;
use crate::images::stored::Needed;
use crate::images::trials::{Item as _, Plan, SourcePlan, TrialGroup};
use crate::models::ModelUnderTest;
use crate::open_run::image_limit;
use darkqa_ask::{ImageLimit, Price, Server};
use darkqa_base::error::Result;
use darkqa_base::types::{Condition, Degradation, ImageFacts, ProfileName, View};
use darkqa_runs::forecast::{CostLine, FewSources, Forecast, ProfileCost, StoreForecast};
use darkqa_runs::run_plan::FrameCost;
use darkqa_score::cluster::MIN_CLUSTERS;
use darkqa_store::StoredTrial;

/// Assumed latency of a reply in seconds, if no reply is stored.
const REPLY_SECONDS: f64 = 2.0;

/// Estimates the remaining requests with their tokens, cost, bytes and time. A few images are made to measure their
/// size.
pub fn estimate<E: Experiment>(
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
            let mut by_profile = BTreeMap::<Option<ProfileName>, TokenCounts>::new();
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
struct TokenCounts {
    requests: usize,
    text: f64,
    reply: f64,
    /// Tokens of all images; `None` if unknown.
    image: Option<f64>,
}

impl Default for TokenCounts {
    fn default() -> Self {
        Self { requests: 0, text: 0.0, reply: 0.0, image: Some(0.0) }
    }
}

impl TokenCounts {
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
    by_profile: &BTreeMap<Option<ProfileName>, TokenCounts>,
    phase: &str,
) -> CostLine {
    let tokens = TokenCounts::sum(by_profile.values());
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

/// Number of sources whose images are made to measure their size. Images with enhancers are made for the first of them
/// only.
const SAMPLED_SOURCES: usize = 3;

/// Bytes of a request besides its images and its text.
const REQUEST_BYTES: f64 = 300.0;

/// Bytes of base64 text for each byte of an image.
const BASE64: f64 = 4.0 / 3.0;

/// Numbers, bytes and times of the remaining images and requests, estimated from a sample of images.
pub struct PlannedImages {
    /// Number of images to be made.
    pub made: usize,
    /// Number of images in all requests.
    pub sent: usize,
    /// Bytes of all requests.
    pub bytes: f64,
    /// Bytes of the largest request.
    pub largest_request: f64,
    /// Time to make all images on this machine, in seconds.
    pub seconds: f64,
    /// The images that an image store would contain; `None` without a store.
    pub set: Option<ImageSet>,
}

impl PlannedImages {
    /// Estimates the images of the remaining trials in these plans, one plan for each phase.
    pub fn new<E: Experiment>(experiment: &E, plans: &[Plan<E::Item>], sample: &SampledImages) -> Self {
        let mut all = Self {
            made: 0,
            sent: 0,
            bytes: 0.0,
            largest_request: 0.0,
            seconds: 0.0,
            set: experiment.settings().images.image_set(),
        };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        for (phase, plan) in plans.iter().enumerate() {
            let models = experiment.models(phase);
            for (place, group) in plan.groups() {
                let source = &experiment.sources()[place];
                let condition = group.condition.as_ref();
                let mean = condition.and_then(|condition| sample.mean(condition));
                let shown = condition.map_or(0, |_| source.order.len());
                let shown_bytes = mean.map_or(0.0, |mean| mean.bytes * BASE64 * shown as f64);
                let trials = group.trials.iter();
                for trial in trials.filter(|trial| models[trial.model].model.is_remote()) {
                    let text = trial.prompt.parts().concat().len() as f64;
                    let request = shown_bytes + text + REQUEST_BYTES;
                    all.bytes += request;
                    all.sent += shown;
                    all.largest_request = all.largest_request.max(request);
                }
                if let Some(condition) = condition {
                    all.add_made(condition, source, mean, cores);
                }
            }
        }
        all
    }

    /// Adds the images of a source in a condition.
    fn add_made(&mut self, condition: &Condition, source: &Source, mean: Option<ImageMeans>, cores: usize) {
        let frames = source.frames.len();
        self.made += frames;
        if let Some(set) = &mut self.set {
            let bytes = mean.map_or(0.0, |mean| mean.bytes);
            set.add(condition.enhancer.is_some(), bytes * frames as f64);
        }
        // The frames of a walk are made in parallel, one per core. For a single frame, all cores work together.
        let in_parallel = if frames > 1 { cores } else { 1 };
        self.seconds += mean.map_or(0.0, |mean| mean.seconds * frames as f64 / in_parallel as f64);
    }
}

/// Mean size in bytes and mean time in seconds of an image.
#[derive(Debug, Clone, Copy)]
struct ImageMeans {
    bytes: f64,
    seconds: f64,
}

/// Images that were made to measure their size and time.
#[derive(Default)]
pub struct SampledImages {
    /// Sizes of all sampled images.
    pub images: Vec<ImageFacts>,
    /// Sum of bytes, sum of seconds and number of images, by condition.
    sums: BTreeMap<Condition, (f64, f64, usize)>,
}

impl SampledImages {
    /// Makes the images of the middle frame of a few sources spread over the plan.
    pub fn make<E: Experiment>(experiment: &E, plan: &Plan<E::Item>, pipeline: &mut ImagePipeline<'_>) -> Result<Self> {
        let mut sample = Self::default();
        let sources = experiment.sources();
        let shown: Vec<_> = plan
            .sources
            .iter()
            .filter_map(|part| {
                let source = &sources[part.source];
                Some((part, source, source.middle()?))
            })
            .collect();
        let step = shown.len().div_ceil(SAMPLED_SOURCES).max(1);
        for (i, (part, source, frame)) in shown.into_iter().step_by(step).enumerate() {
            let mut work = FrameWork::for_source(pipeline.steps.without_store(), source, frame);
            let conditions = part.conditions();
            for condition in conditions.filter(|condition| i == 0 || condition.enhancer.is_none()) {
                let started = Instant::now();
                let image = pipeline.image(&mut work, condition, Needed::Image)?;
                let facts = image.payload.facts();
                let (bytes, seconds, n) = sample.sums.entry(condition.clone()).or_default();
                *bytes += facts.bytes as f64;
                *seconds += started.elapsed().as_secs_f64();
                *n += 1;
                sample.images.push(facts.clone());
            }
        }
        Ok(sample)
    }

    fn mean(&self, condition: &Condition) -> Option<ImageMeans> {
        let (bytes, seconds, n) = self.sums.get(condition)?;
        Some(ImageMeans { bytes: bytes / *n as f64, seconds: seconds / *n as f64 })
    }
}

/// Processor seconds for each million pixels of an image that is degraded and encoded; measured on 1280 × 720, rounded.
const SECONDS_PER_MEGAPIXEL: f64 = 0.1;

/// Processor seconds for each million pixels of an enhanced image; chosen between 0.1 and 8, the range of the
/// enhancers.
const ENHANCED_SECONDS_PER_MEGAPIXEL: f64 = 1.0;

/// Processor seconds for each request; chosen.
const SECONDS_PER_REQUEST: f64 = 0.002;

/// The cost of the trials of the first phase of an experiment, for each of its sources in their order.
pub fn costs<E: Experiment>(experiment: &E, plan: &[SourcePlan<E::Item>]) -> Vec<FrameCost> {
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
