//! Estimated tokens, costs and time of a run before it starts: [`Forecast`].

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::report::power::PowerForecast;
use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal;
use crate::types::ProfileName;
use crate::types::text::counted;

/// Estimate for the remaining requests of one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CostLine {
    /// Name of the model, with a remark if it is asked without images.
    pub model: String,
    /// Addresses of its endpoints, without secrets.
    pub endpoints: Vec<String>,
    /// Number of requests left.
    pub requests: usize,
    /// Text tokens of all prompts.
    pub text_tokens: f64,
    /// Tokens of all images; `None` if the model's image tokens are unknown.
    pub image_tokens: Option<f64>,
    /// Tokens of all replies if each is short, such as a letter, a mark or a sentence.
    pub reply_tokens: f64,
    /// Tokens of all replies if each is as long as `--max-tokens` allows; `None` without a limit.
    pub longest_reply_tokens: Option<f64>,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
    /// Cost in dollars if each reply is as long as `--max-tokens` allows.
    pub most_dollars: Option<f64>,
    /// Tokens of one image as charged for the replies so far; `None` if there are too few replies.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charged_image_tokens: Option<f64>,
    /// Ratio of the charges that the server has stated so far to the price table, by which the costs are multiplied; `None` without such
    /// charges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charge_ratio: Option<f64>,
    /// The same requests by the noise profile of their images.
    pub readings: Vec<ProfileCost>,
}

impl CostLine {
    /// The same line, with costs at this ratio to the price table.
    pub(crate) fn at_ratio(self, ratio: Option<f64>) -> Self {
        let times = |dollars: Option<f64>| dollars.map(|dollars| ratio.unwrap_or(1.0) * dollars);
        Self {
            dollars: times(self.dollars),
            most_dollars: times(self.most_dollars),
            charge_ratio: ratio,
            readings: self
                .readings
                .into_iter()
                .map(|profile| ProfileCost {
                    dollars: times(profile.dollars),
                    ..profile
                })
                .collect(),
            ..self
        }
    }
}

/// Remaining requests with images of one noise profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ProfileCost {
    /// Noise profile; `None` for requests that all profiles share: L0, images without noise, and no image at all.
    pub reading: Option<ProfileName>,
    /// Number of requests left.
    pub requests: usize,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
}

/// Relative difference of charges from the price table from which it is printed; chosen.
const TOLD_FROM: f64 = 0.05;

/// Estimate of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Forecast {
    /// Requests left, by model.
    pub lines: Vec<CostLine>,
    /// Built-in models, which need no endpoint, and the observer's controls; each with its number of remaining trials.
    pub built_in: Vec<(String, usize)>,
    /// Number of all trials.
    pub trials: usize,
    /// Number of trials with a reply.
    pub answered: usize,
    /// Cost of the replies so far in dollars; `None` if no price is known.
    pub spent: Option<f64>,
    /// Number of images to make.
    pub images: usize,
    /// Number of images in all requests; an image counts once for each of its requests.
    pub images_sent: usize,
    /// Number of bytes to send, with images as base64.
    pub bytes: f64,
    /// Size of the largest sampled image file in bytes.
    pub largest_image: usize,
    /// Number of images that were made as a sample.
    pub sampled: usize,
    /// Reason why the endpoint would refuse the largest image; `None` if it accepts it.
    pub too_large: Option<String>,
    /// Time to make all images on this machine, in seconds.
    pub making_seconds: f64,
    /// Time of waiting for all replies, in seconds.
    pub asking_seconds: f64,
    /// Text for the assumptions behind the waiting time.
    pub pace: String,
    /// Date and source of the prices.
    pub prices: String,
    /// Charge of the Batch API as a share of the price.
    pub batch: f64,
    /// Text for the length of the shortest assumed reply.
    pub reply: &'static str,
    /// Number of frames or walks, if intervals and tests need more.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub few_sources: Option<FewSources>,
    /// Smallest effect that the whole run can detect; `None` for a shard, and for questions without choices or answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power: Option<PowerForecast>,
    /// Size of the largest request in bytes, estimated from sampled images; only if requests have many images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_request: Option<f64>,
    /// Share of images that the image store can reuse; `None` without an image store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_store: Option<StoreForecast>,
}

/// Number of frames or walks that is too small for reliable intervals and tests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FewSources {
    /// Number in the run.
    pub number: usize,
    /// Number that intervals and tests need.
    pub needed: usize,
    /// Name of the sources in the singular, such as "frame".
    pub of: &'static str,
}

/// Reuse of stored images by another model that is asked about the same images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct StoreForecast {
    /// Text for the kind of images that are stored.
    pub kept: &'static str,
    /// Size of all images in bytes.
    pub bytes: f64,
    /// Capacity of the store in bytes.
    pub room: f64,
    /// Share of the images that the store can return, from 0 to 1.
    pub hits: f64,
}

impl StoreForecast {
    /// Forecast for images of a total size and a store of a capacity, both in bytes.
    pub(crate) fn new(kept: &'static str, bytes: f64, room: f64) -> Self {
        let hits = if bytes > room { room / bytes } else { 1.0 };
        Self {
            kept,
            bytes,
            room,
            hits,
        }
    }

    /// Formats the forecast as one line.
    fn line(&self) -> String {
        let (kept, set, room) = (self.kept, bytes(self.bytes), bytes(self.room));
        let percent = 100.0 * self.hits;
        format!(
            "image store: {kept} {set}, room {room}: the next model finds about {percent:.0} % of them\n"
        )
    }
}

/// Serializes the forecast as JSON.
pub(crate) fn json(forecast: &Forecast) -> Result<String> {
    serde_json::to_string_pretty(forecast)
        .map(|text| text + "\n")
        .map_err(|e| Error::data("the estimate", e))
}

/// Formats the forecast for the terminal.
#[must_use]
#[expect(clippy::too_many_lines, reason = "one column after another")]
pub(crate) fn render(forecast: &Forecast) -> String {
    let table = TableBuilder::new("estimate", &forecast.lines)
        .column(Text, "terminal model", |line| line.model.clone())
        .column(Count, "terminal requests", |line| {
            count(line.requests as f64)
        })
        .column(Count, "terminal text tokens", |line| {
            count(line.text_tokens)
        })
        .column(Count, "terminal image tokens", |line| {
            line.image_tokens.map_or("unknown".to_owned(), count)
        })
        .column(Count, "terminal reply tokens", |line| {
            range_text(Some(line.reply_tokens), line.longest_reply_tokens, count)
        })
        .column(Count, "terminal dollars", |line| {
            range_text(line.dollars, line.most_dollars, money)
        })
        .build();
    let table = terminal::table(&[table]);
    let Forecast {
        trials,
        answered,
        images,
        sampled,
        pace,
        prices,
        ..
    } = forecast;
    let mut text = format!(
        "Nothing was sent. {} of {trials} trials are left to ask",
        trials - answered
    );
    if let (Some(spent), true) = (forecast.spent, *answered > 0) {
        let _ = write!(text, "; the {answered} answered ones cost {}", money(spent));
    }
    let mut last = forecast
        .image_store
        .as_ref()
        .map(StoreForecast::line)
        .unwrap_or_default();
    if let Some(power) = &forecast.power {
        let _ = writeln!(last, "{}", power.line());
    }
    if let Some(few) = &forecast.few_sources {
        let _ = writeln!(
            last,
            "only {} ({} are needed): intervals and tests would be rough",
            counted(few.number, few.of),
            few.needed
        );
    }
    let built_in = built_in_line(&forecast.built_in);
    if forecast.lines.is_empty() {
        return text + ".\n" + &built_in + &last;
    }
    let _ = write!(text, ".\n{table}{built_in}");
    for line in &forecast.lines {
        if let Some(tokens) = line.charged_image_tokens {
            let _ = writeln!(
                text,
                "{}: {} tokens an image, as its first replies were charged",
                line.model,
                count(tokens)
            );
        }
    }
    for line in &forecast.lines {
        if let Some(ratio) = line
            .charge_ratio
            .filter(|ratio| (ratio - 1.0).abs() > TOLD_FROM)
        {
            let _ = writeln!(
                text,
                "{}: dollars at {ratio:.2} times the price table, as its replies were charged",
                line.model
            );
        }
    }
    text += &by_endpoint(&forecast.lines);
    text += &by_reading(&forecast.lines);
    let _ = writeln!(
        text,
        "dollars: from {} a reply to every reply as long as --max-tokens allows; {prices}; by a Batch API, if there is one, {:.0} % of it",
        forecast.reply,
        100.0 * forecast.batch
    );
    if forecast.lines.iter().any(|line| line.dollars.is_none()) {
        text.push_str("unknown: state the price of a model and its image-tokens in a table of --prices FILE\n");
    }
    let _ = writeln!(
        text,
        "to send: {} with {} (made once: {images}), the largest {:.2} MB (of {sampled} in a sample)",
        bytes(forecast.bytes),
        counted(forecast.images_sent, "image"),
        forecast.largest_image as f64 / 1e6
    );
    if let Some(request) = forecast.largest_request {
        let _ = writeln!(text, "the largest request has about {}", bytes(request));
    }
    let _ = writeln!(
        text,
        "time: {} of waiting ({pace}), {} of making images in parallel",
        hours(forecast.asking_seconds),
        hours(forecast.making_seconds)
    );
    text += &last;
    if let Some(problem) = &forecast.too_large {
        let _ = writeln!(text, "the run would not start: {problem}");
    }
    text
}

/// Line with the built-in models and their trials; empty without any.
fn built_in_line(models: &[(String, usize)]) -> String {
    let models: Vec<String> = models
        .iter()
        .map(|(model, trials)| format!("{model} {}", count(*trials as f64)))
        .collect();
    match &*models {
        [] => String::new(),
        models => format!("at no endpoint, built in: {}\n", models.join(", ")),
    }
}

/// One line for each endpoint address, with its models if there are several addresses.
fn by_endpoint(lines: &[CostLine]) -> String {
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    for line in lines {
        let endpoints = line.endpoints.join(", ");
        match groups.iter_mut().find(|(other, _)| *other == endpoints) {
            Some((_, models)) => models.push(&line.model),
            None => groups.push((endpoints, vec![&line.model])),
        }
    }
    let several = groups.len() > 1;
    groups
        .into_iter()
        .map(|(endpoints, models)| {
            if several {
                format!("asked at {endpoints}: {}\n", models.join(", "))
            } else {
                format!("asked at {endpoints}\n")
            }
        })
        .collect()
}

/// Line with the requests of all models by noise profile; empty with fewer than two profiles.
fn by_reading(lines: &[CostLine]) -> String {
    let mut sums = BTreeMap::<Option<&ProfileName>, (usize, Option<f64>)>::new();
    for cost in lines.iter().flat_map(|line| &line.readings) {
        let (requests, dollars) = sums.entry(cost.reading.as_ref()).or_insert((0, Some(0.0)));
        *requests += cost.requests;
        *dollars = dollars.zip(cost.dollars).map(|(sum, cost)| sum + cost);
    }
    if sums.keys().flatten().count() < 2 {
        return String::new();
    }
    let parts: Vec<String> = sums
        .into_iter()
        .map(|(reading, (requests, dollars))| {
            let name = reading.map_or(
                "shared by all (L0, exposure drop, blind)",
                ProfileName::as_str,
            );
            let price = dollars.map_or("price unknown".to_owned(), money);
            format!("{name} {} ({price})", count(requests as f64))
        })
        .collect();
    format!("requests by reading: {}\n", parts.join(", "))
}

/// Formats a number rounded to an integer, with digits in groups of three.
fn count(number: f64) -> String {
    let digits = format!("{number:.0}");
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i) % 3 == 0 {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// Formats a range of values, or a single value if both look the same.
fn range_text(low: Option<f64>, high: Option<f64>, format: fn(f64) -> String) -> String {
    match (low, high) {
        (None, _) => "unknown".to_owned(),
        (Some(low), Some(high)) if format(low) != format(high) => {
            format!("{} – {}", format(low), format(high))
        }
        (Some(low), _) => format(low),
    }
}

/// Formats an amount in dollars with two decimals, or four below one dollar.
#[must_use]
pub(crate) fn money(dollars: f64) -> String {
    if dollars > 0.0 && dollars < 0.995 {
        format!("${dollars:.4}")
    } else {
        format!("${dollars:.2}")
    }
}

fn bytes(bytes: f64) -> String {
    match bytes {
        b if b >= 1e9 => format!("{:.1} GB", b / 1e9),
        b => format!("{:.1} MB", b / 1e6),
    }
}

/// Formats a time, as in `2.0 h`, `6 min` or `40 s`.
pub(crate) fn hours(seconds: f64) -> String {
    match seconds {
        s if s >= 3600.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 60.0 => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_limited_by_the_store_capacity() {
        let [too_large, fitting] =
            [80e9, 20e9].map(|bytes| StoreForecast::new("enhanced images", bytes, 20e9));
        assert!((too_large.hits - 0.25).abs() < 1e-12);
        assert!((fitting.hits - 1.0).abs() < 1e-12);
        assert_eq!(
            too_large.line(),
            "image store: enhanced images 80.0 GB, room 20.0 GB: the next model finds about 25 % of them\n"
        );
    }

    fn cost(reading: Option<&str>, requests: usize, dollars: Option<f64>) -> ProfileCost {
        ProfileCost {
            reading: reading.map(|name| ProfileName::new(name).unwrap()),
            requests,
            dollars,
        }
    }

    fn line(readings: Vec<ProfileCost>) -> CostLine {
        CostLine {
            model: "m".to_owned(),
            endpoints: Vec::new(),
            requests: 0,
            text_tokens: 0.0,
            image_tokens: None,
            reply_tokens: 0.0,
            longest_reply_tokens: None,
            dollars: None,
            most_dollars: None,
            charged_image_tokens: None,
            charge_ratio: None,
            readings,
        }
    }

    #[test]
    fn requests_are_counted_by_noise_profile() {
        let shared = cost(None, 6, Some(0.5));
        let one = line(vec![shared.clone(), cost(Some("paper"), 5, Some(0.25))]);
        assert_eq!(by_reading(std::slice::from_ref(&one)), "");
        let two = line(vec![
            shared,
            cost(Some("paper"), 5, Some(0.25)),
            cost(Some("physical"), 1005, None),
        ]);
        assert_eq!(
            by_reading(&[one, two]),
            "requests by reading: shared by all (L0, exposure drop, blind) 12 ($1.00), paper 10 ($0.5000), \
             physical 1,005 (price unknown)\n"
        );
    }

    #[test]
    fn numbers_are_easy_to_read() {
        assert_eq!(count(1_234_567.4), "1,234,567");
        assert_eq!(count(999.0), "999");
        assert_eq!(range_text(Some(0.5), Some(12.0), money), "$0.5000 – $12.00");
        assert_eq!(range_text(Some(3.0), None, money), "$3.00");
        assert_eq!(hours(7200.0), "2.0 h");
    }
}
