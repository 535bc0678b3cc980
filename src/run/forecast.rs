//! What a run would take, found out without sending anything: [`forecast`].

use std::collections::BTreeMap;
use std::time::Instant;

use super::darkroom::{Darkroom, Desk};
use super::ledger::{Ledger, image_of, words};
use super::plan::{Choice, FramePlan, Plan};
use super::trial::{Item as _, Prompt};
use crate::ask::{ImageLimit, Payload, Price};
use crate::config::{Config, Server};
use crate::error::Result;
use crate::report::forecast::{Forecast, Line};
use crate::run::askers::Asker;
use crate::types::{Condition, ImageFacts, Record, View};

/// How many frames are made into images, to know their size; of those with an enhancer one.
const SAMPLED: usize = 3;

/// How long a reply takes where nothing is known of the endpoint.
const REPLY_SECONDS: f64 = 2.0;

/// Bytes of a request besides its image and its words.
pub(super) const AROUND: f64 = 300.0;

/// What a forecast is made of.
pub(super) struct Means<'a> {
    pub(super) config: &'a Config,
    pub(super) askers: &'a [Asker],
    pub(super) plan: &'a Plan,
    pub(super) ledger: &'a Ledger,
    pub(super) kept: &'a [Record],
    pub(super) limit: Option<ImageLimit>,
}

/// Lays out what is left to ask, with the sizes of a few images that are made for it.
pub(super) fn forecast(means: &Means<'_>, darkroom: &mut Darkroom<'_>) -> Result<Forecast> {
    let Means { config, plan, .. } = *means;
    let sample = sample(plan, darkroom)?;
    let lines = lines(means, darkroom);
    let mean = sample.bytes_by_condition();
    let mut bytes = 0.0;
    let mut images = 0;
    for shot in plan.frames.iter().flat_map(|frame| &frame.shots) {
        let image = shot
            .condition
            .as_ref()
            .and_then(|c| mean.get(&c.to_string()));
        images += usize::from(shot.condition.is_some());
        for trial in &shot.trials {
            if means.askers[trial.asker].model.is_remote() {
                let image = image.map_or(0.0, |bytes| bytes * 4.0 / 3.0);
                let words = trial.prompt.parts().concat().len();
                bytes += image + words as f64 + AROUND;
            }
        }
    }
    let requests: usize = lines.iter().map(|line| line.requests).sum();
    let tokens = lines
        .iter()
        .map(|line| line.text_tokens + line.image_tokens.unwrap_or(0.0) + line.reply_tokens)
        .sum();
    let server = config.ask.server.as_ref();
    let latencies = means.kept.iter().filter_map(|record| record.latency_ms);
    let (asking_seconds, pace) = waiting(server, latencies, requests as f64, tokens);
    let largest = sample.images.iter().max_by_key(|image| image.bytes);
    let prices = &config.money.prices;
    Ok(Forecast {
        lines,
        trials: plan.trials(),
        answered: plan.trials() - plan.left(),
        spent: means.ledger.spent(),
        images,
        bytes,
        largest_image: largest.map_or(0, |image| image.bytes),
        sampled: sample.images.len(),
        too_large: means
            .limit
            .zip(largest)
            .and_then(|(limit, image)| limit.check(image).err().map(|problem| problem.to_string())),
        making_seconds: sample.seconds_by_condition(plan),
        asking_seconds,
        pace,
        prices: format!("prices of {}", prices.as_of),
        batch: prices.batch,
        reply: "a letter",
        largest_request: None,
    })
}

/// What is left of each model.
fn lines(means: &Means<'_>, darkroom: &Darkroom<'_>) -> Vec<Line> {
    let remote = means.askers.iter().enumerate();
    let remote = remote.filter(|(_, asker)| asker.model.is_remote());
    let lines = remote.map(|(index, asker)| {
        let price = means.config.money.prices.of(asker.model.name());
        let (mut requests, mut text, mut image) = (0, 0.0, Some(0.0));
        for frame in &means.plan.frames {
            let size = darkroom
                .pictures
                .get(&frame.frame)
                .map(|pictured| pictured.size);
            for shot in &frame.shots {
                let trials = shot.trials.iter().filter(|trial| trial.asker == index);
                let prompts: Vec<&Prompt> = trials.map(|trial| &trial.prompt).collect();
                requests += prompts.len();
                text += prompts.iter().map(|prompt| words(prompt)).sum::<f64>();
                if let (Some(_), Some((width, height))) = (&shot.condition, size) {
                    let most = means.config.images.max_side;
                    let (width, height) = Payload::fitted(width, height, most);
                    let each = image_of(asker, price, width as usize, height as usize);
                    let all = each.map(|tokens| tokens * prompts.len() as f64);
                    image = image.zip(all).map(|(sofar, all)| sofar + all);
                }
            }
        }
        line(asker, price, requests, [text, Choice::REPLY], image)
    });
    lines.filter(|line| line.requests > 0).collect()
}

/// What is left of one model: requests, the tokens of all their words and of each likely reply, and those of all images.
pub(super) fn line(
    asker: &Asker,
    price: Option<Price>,
    requests: usize,
    [text_tokens, reply]: [f64; 2],
    image_tokens: Option<f64>,
) -> Line {
    let limit = asker.model.max_tokens();
    let reply_tokens = requests as f64 * reply;
    let longest = limit.map(|limit| requests as f64 * f64::from(limit));
    let blind = if asker.view == View::Blind {
        " (blind)"
    } else {
        ""
    };
    let dollars = |reply: f64| Some(price?.of(text_tokens + image_tokens?, reply));
    Line {
        model: format!("{}{blind}", asker.model.name()),
        requests,
        text_tokens,
        image_tokens,
        reply_tokens,
        longest_reply_tokens: longest,
        dollars: dollars(reply_tokens),
        most_dollars: longest.and_then(dollars),
    }
}

/// How long all replies take, and what that rests on: the user's limits, and replies as slow as those kept.
pub(super) fn waiting(
    server: Option<&Server>,
    latencies_ms: impl Iterator<Item = u64>,
    requests: f64,
    tokens: f64,
) -> (f64, String) {
    let Some(server) = server else {
        return (0.0, "built-in models alone".to_owned());
    };
    let kept: Vec<f64> = latencies_ms
        .filter(|ms| *ms > 0)
        .map(|ms| ms as f64 / 1e3)
        .collect();
    let (each, known) = if kept.is_empty() {
        (REPLY_SECONDS, "assumed")
    } else {
        (kept.iter().sum::<f64>() / kept.len() as f64, "as so far")
    };
    let sending = &server.sending;
    let wide = sending.concurrency.most();
    let mut slowest = (
        requests * each / wide as f64,
        format!("{each:.1} s a reply {known}, {wide} at once"),
    );
    let minutes = |number: f64, quota: Option<std::num::NonZeroU32>| {
        quota.map(|quota| 60.0 * number / f64::from(quota.get()))
    };
    let quotas = [
        ("--rpm", minutes(requests, sending.quota.requests)),
        ("--tpm", minutes(tokens, sending.quota.tokens)),
    ];
    for (flag, seconds) in quotas {
        if let Some(seconds) = seconds.filter(|seconds| *seconds > slowest.0) {
            slowest = (seconds, format!("by {flag}"));
        }
    }
    slowest
}

/// Images that were made to know their size and time.
struct Sample {
    images: Vec<ImageFacts>,
    /// Sum of bytes, of seconds, and how many, by condition.
    sums: BTreeMap<String, (f64, f64, usize)>,
}

/// Makes the images of a few frames spread over the plan.
fn sample(plan: &Plan, darkroom: &mut Darkroom<'_>) -> Result<Sample> {
    let mut sample = Sample {
        images: Vec::new(),
        sums: BTreeMap::new(),
    };
    let frames = &plan.frames;
    let step = frames.len().div_ceil(SAMPLED).max(1);
    for (i, FramePlan { frame, shots }) in frames.iter().step_by(step).enumerate() {
        let mut desk = Desk::new(frame.clone());
        let conditions = shots.iter().filter_map(|shot| shot.condition.as_ref());
        for condition in conditions.filter(|c: &&Condition| i == 0 || c.enhancer.is_none()) {
            let started = Instant::now();
            let image = darkroom.image(&mut desk, condition)?;
            let facts = image.facts();
            let (bytes, seconds, n) = sample.sums.entry(condition.to_string()).or_default();
            *bytes += facts.bytes as f64;
            *seconds += started.elapsed().as_secs_f64();
            *n += 1;
            sample.images.push(facts.clone());
        }
    }
    Ok(sample)
}

impl Sample {
    fn bytes_by_condition(&self) -> BTreeMap<String, f64> {
        let mean = |(bytes, _, n): &(f64, f64, usize)| bytes / *n as f64;
        let sums = self.sums.iter();
        sums.map(|(condition, sum)| (condition.clone(), mean(sum)))
            .collect()
    }

    /// The time to make all images of a plan.
    fn seconds_by_condition(&self, plan: &Plan) -> f64 {
        let shots = plan.frames.iter().flat_map(|frame| &frame.shots);
        let conditions = shots.filter_map(|shot| shot.condition.as_ref());
        let seconds = conditions.filter_map(|condition| {
            let (_, seconds, n) = self.sums.get(&condition.to_string())?;
            Some(seconds / *n as f64)
        });
        seconds.sum()
    }
}
