//! What a run of open questions would take, found out without sending anything: [`estimate`].

use std::collections::BTreeMap;

use super::item::{Judged, Open};
use super::marks::{Kept, Marks, predictions};
use super::plan::{Plan, WalkPlan};
use super::stage::Stage;
use super::theatre::{Sample, Theatre};
use crate::ask::openeqa::judged;
use crate::ask::{ImageLimit, Price, bilinear};
use crate::config::{OpenEqa, Show};
use crate::error::Result;
use crate::report::forecast::{Forecast, Line, json, render};
use crate::run::askers::Asker;
use crate::run::forecast::{AROUND, line, waiting};
use crate::run::ledger::{Ledger, image_of, words};
use crate::run::trial::{Item, Prompt};
use crate::run::{Verdict, limit, open_enhancers};
use crate::store;
use crate::types::manifest::Status;
use crate::types::{Condition, OpenDetail, Record, View};

/// An answer as it may be: as long as one with so many tokens.
const ANSWER: &str =
    "There is a small round table with two chairs next to the window of the living room.";

/// Says what is left to ask and what it would take; sends nothing and leaves no file.
pub(super) fn estimate(config: &OpenEqa, mut stage: Stage<'_>) -> Result<Verdict> {
    let records: Vec<Record<OpenDetail>> = store::read_records(&stage.folder)?;
    let answered = records.iter().filter(|record| !record.failed());
    let there = answered.map(|record| record.key).collect();
    let plan = Plan::new(&stage, &there)?;
    let given = super::all_given(config, &stage)?;
    let everyone: Vec<Asker> = stage.askers.iter().chain(&stage.judge).cloned().collect();
    let ledger = Ledger::new(&config.money, &everyone, &records)?;
    let kept = records.iter().cloned();
    let kept: Kept = kept.map(|record| (record.key, record)).collect();
    let predicted = predictions(&stage, &plan.due, &given, &kept, config.protocol);
    let marks = Marks::new(&stage, &predicted, &there);
    let files = std::mem::take(&mut stage.files);
    let (_, enhancers) = open_enhancers(files, &config.enhancement)?;
    let samples = Theatre::new(config, &stage, enhancers).sample(&plan.walks)?;
    let sizes = Sizes::new(&stage, &samples);
    let mut lines: Vec<Line> = (0..stage.askers.len())
        .filter(|index| stage.askers[*index].model.is_remote())
        .map(|index| answers(config, &stage, &plan, &sizes, index))
        .collect();
    // Each answer that is still to come may be one of its own.
    let judge = stage.judge.iter().filter(|judge| judge.model.is_remote());
    lines.extend(judge.map(|judge| {
        let price = config.money.prices.of(judge.model.name());
        let known: f64 = marks.left.iter().map(|trial| words(&trial.prompt)).sum();
        let coming = trials(&plan).map(|trial| {
            let question = &trial.item.0;
            let extra = question.extra.as_deref();
            let prompt = judged(&question.text, &question.answer, extra, ANSWER);
            words(&Prompt::of(prompt.into()))
        });
        let requests = marks.left.len() + plan.left();
        let text = known + coming.sum::<f64>();
        let judged = line(judge, price, requests, [text, Judged::REPLY], Some(0.0));
        Line {
            model: format!("{} (judge)", judge.model.name()),
            ..judged
        }
    }));
    lines.retain(|line| line.requests > 0);
    let forecast = forecast(
        config,
        &plan,
        &samples,
        &sizes,
        lines,
        &records,
        ledger.spent(),
    );
    let forecast = Forecast {
        trials: plan.due.len()
            + marks.due.len()
            + if stage.judge.is_some() {
                plan.left()
            } else {
                0
            },
        answered: plan.due.len() - plan.left() + marks.due.len() - marks.left.len(),
        ..forecast
    };
    Ok(Verdict {
        status: Status::Complete,
        output: match config.output.show {
            Show::Json => json(&forecast)?,
            Show::Table => render(&forecast),
        },
    })
}

/// The answers that are left.
fn trials(plan: &Plan) -> impl Iterator<Item = &crate::run::trial::Trial<Open>> {
    let shots = plan.walks.iter().flat_map(|walk| &walk.shots);
    shots.flat_map(|shot| &shot.trials)
}

/// How large walks are, as sent.
struct Sizes {
    /// The mean size of an image file by condition, in bytes.
    bytes: BTreeMap<Condition, f64>,
    /// The width and height of an image of each walk, and how many there are.
    walks: Vec<Option<(usize, usize, usize)>>,
}

impl Sizes {
    fn new(stage: &Stage<'_>, samples: &[Sample]) -> Self {
        let bytes = samples.iter();
        let bytes = bytes.map(|sample| (sample.condition.clone(), sample.facts.bytes as f64));
        let walks = stage.episodes.iter().map(|episode| {
            let reel = episode.reel.as_ref().ok()?;
            let (width, height) = reel.stills.first()?.size;
            let (width, height) = (width as usize, height as usize);
            let side = stage.walk.side;
            let [height, width] =
                side.map_or([height, width], |side| bilinear::size(height, width, side));
            Some((width, height, reel.order.len()))
        });
        Self {
            bytes: bytes.collect(),
            walks: walks.collect(),
        }
    }

    /// The bytes of a request's images.
    fn images(&self, walk: &WalkPlan, condition: Option<&Condition>) -> f64 {
        let each = condition.and_then(|condition| self.bytes.get(condition));
        let images = self.walks[walk.episode].map_or(0, |(_, _, images)| images);
        each.map_or(0.0, |bytes| images as f64 * bytes * 4.0 / 3.0)
    }
}

/// What is left of one model.
fn answers(config: &OpenEqa, stage: &Stage<'_>, plan: &Plan, sizes: &Sizes, index: usize) -> Line {
    let asker = &stage.askers[index];
    let price: Option<Price> = config.money.prices.of(asker.model.name());
    let (mut requests, mut text, mut image) = (0, 0.0, Some(0.0));
    for walk in &plan.walks {
        for shot in &walk.shots {
            let own = shot.trials.iter().filter(|trial| trial.asker == index);
            let prompts: Vec<f64> = own.map(|trial| words(&trial.prompt)).collect();
            requests += prompts.len();
            text += prompts.iter().sum::<f64>();
            if let (View::Image, Some((width, height, images))) =
                (asker.view, sizes.walks[walk.episode])
            {
                let each = image_of(asker, price, width, height);
                let all = each.map(|tokens| tokens * (images * prompts.len()) as f64);
                image = image.zip(all).map(|(sofar, all)| sofar + all);
            }
        }
    }
    line(asker, price, requests, [text, Open::REPLY], image)
}

fn forecast(
    config: &OpenEqa,
    plan: &Plan,
    samples: &[Sample],
    sizes: &Sizes,
    lines: Vec<Line>,
    records: &[Record<OpenDetail>],
    spent: Option<f64>,
) -> Forecast {
    let (mut bytes, mut largest_request, mut images, mut seconds) = (0.0, 0.0_f64, 0, 0.0);
    for walk in &plan.walks {
        for shot in &walk.shots {
            let shown = sizes.images(walk, shot.condition.as_ref());
            for trial in &shot.trials {
                let request = shown + trial.prompt.parts().concat().len() as f64 + AROUND;
                bytes += request;
                largest_request = largest_request.max(request);
            }
            let sample = samples
                .iter()
                .find(|sample| Some(&sample.condition) == shot.condition.as_ref());
            if let (Some(sample), Some((_, _, frames))) = (sample, sizes.walks[walk.episode]) {
                images += frames;
                seconds += frames as f64 * sample.seconds;
            }
        }
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let requests: usize = lines.iter().map(|line| line.requests).sum();
    let tokens = lines
        .iter()
        .map(|line| line.text_tokens + line.image_tokens.unwrap_or(0.0) + line.reply_tokens)
        .sum();
    let latencies = records.iter().filter_map(|record| record.latency_ms);
    let server = config.ask.server.as_ref();
    let judge = config
        .judge
        .as_ref()
        .and_then(|judge| judge.server.as_ref());
    let (asking_seconds, pace) = waiting(server.or(judge), latencies, requests as f64, tokens);
    let largest = samples.iter().max_by_key(|sample| sample.facts.bytes);
    let limit: Option<ImageLimit> = limit(&config.ask, &config.images);
    let prices = &config.money.prices;
    Forecast {
        lines,
        trials: 0,
        answered: 0,
        spent,
        images,
        bytes,
        largest_image: largest.map_or(0, |sample| sample.facts.bytes),
        sampled: samples.len(),
        too_large: limit
            .zip(largest)
            .and_then(|(limit, sample)| limit.check(&sample.facts).err())
            .map(|problem| problem.to_string()),
        making_seconds: seconds / cores as f64,
        asking_seconds,
        pace,
        prices: format!("prices of {}", prices.as_of),
        batch: prices.batch,
        reply: "a sentence or a mark",
        largest_request: Some(largest_request),
    }
}
