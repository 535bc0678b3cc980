//! The estimated tokens, costs and time of a run before it starts: [`Forecast`].

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::report::power::PowerForecast;
use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal;
use crate::text::words::counted;
use crate::types::ReadingName;

/// Estimate of the requests that are left for one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CostLine {
    /// The model, with a remark if it is asked without images.
    pub model: String,
    /// The addresses at which it would be asked, without secrets.
    pub endpoints: Vec<String>,
    /// Number of requests left.
    pub requests: usize,
    /// Text tokens of all prompts.
    pub text_tokens: f64,
    /// Tokens of all images; `None` if it is not known how the model counts them.
    pub image_tokens: Option<f64>,
    /// Tokens of all replies if each is short: a letter, a mark, a sentence.
    pub reply_tokens: f64,
    /// Tokens of all replies if each is as long as `--max-tokens` allows; `None` without a limit.
    pub longest_reply_tokens: Option<f64>,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
    /// Cost in dollars if each reply is as long as `--max-tokens` allows.
    pub most_dollars: Option<f64>,
    /// Tokens of one image, as the replies so far were charged; `None` if there are too few of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub charged_image_tokens: Option<f64>,
    /// The same requests by the noise profile of what is shown.
    pub readings: Vec<ReadingCost>,
}

/// Requests of one noise profile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ReadingCost {
    /// The noise profile; `None` for what all readings share: L0, images without noise, and no image at all.
    pub reading: Option<ReadingName>,
    /// Number of requests left.
    pub requests: usize,
    /// Cost in dollars if each reply is short; `None` if no price is known.
    pub dollars: Option<f64>,
}

/// Estimate of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Forecast {
    /// Requests left, by model.
    pub lines: Vec<CostLine>,
    /// The built-in models, which are asked at no endpoint, with the trials left of each; controls are among them.
    pub built_in: Vec<(String, usize)>,
    /// Number of all trials.
    pub trials: usize,
    /// Number of trials with a reply.
    pub answered: usize,
    /// Cost of the replies so far in dollars; `None` if no price is known.
    pub spent: Option<f64>,
    /// Number of images to be made.
    pub images: usize,
    /// Number of images in all requests: an image counts once for each request about it.
    pub images_sent: usize,
    /// Number of bytes to be sent, with images as base64.
    pub bytes: f64,
    /// Size of the largest sampled image file in bytes.
    pub largest_image: usize,
    /// Number of images that were made as a sample.
    pub sampled: usize,
    /// Why the endpoint does not accept the largest image; `None` if it does.
    pub too_large: Option<String>,
    /// Time to make all images on this machine, in seconds.
    pub making_seconds: f64,
    /// Time of waiting for all replies, in seconds.
    pub asking_seconds: f64,
    /// Basis of the waiting time, in words.
    pub pace: String,
    /// Date and source of the prices.
    pub prices: String,
    /// Charge of the Batch API as a share of the price.
    pub batch: f64,
    /// Length of the shortest reply that is assumed, in words.
    pub reply: &'static str,
    /// The frames or walks, if intervals and tests need more of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub few_sources: Option<FewSources>,
    /// The effect that the whole run can detect; `None` for a shard, and for questions without choices or answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub power: Option<PowerForecast>,
    /// Size of the largest request in bytes, as sampled images suggest, if requests hold many images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_request: Option<f64>,
    /// The images that an image store saves the next model; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_store: Option<StoreForecast>,
}

/// Frames or walks that are too few.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FewSources {
    /// How many there are.
    pub number: usize,
    /// How many intervals and tests need.
    pub needed: usize,
    /// The counted thing, in the singular.
    pub of: &'static str,
}

/// The images that an image store saves another model that is asked about the same images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct StoreForecast {
    /// Which images it keeps, in words.
    pub kept: &'static str,
    /// Number of bytes of all of them.
    pub bytes: f64,
    /// Number of bytes that it has room for.
    pub room: f64,
    /// Share of them that it can give, from 0 to 1.
    pub hits: f64,
}

impl StoreForecast {
    /// The forecast for images of this many bytes and a store with this room.
    pub(crate) fn new(kept: &'static str, bytes: f64, room: f64) -> Self {
        let hits = if bytes > room { room / bytes } else { 1.0 };
        Self {
            kept,
            bytes,
            room,
            hits,
        }
    }

    /// One line of text.
    fn line(&self) -> String {
        let (kept, set, room) = (self.kept, bytes(self.bytes), bytes(self.room));
        let percent = 100.0 * self.hits;
        format!(
            "image store: {kept} {set}, room {room}: the next model finds about {percent:.0} % of them\n"
        )
    }
}

/// The forecast as JSON.
pub(crate) fn json(forecast: &Forecast) -> Result<String> {
    let text = serde_json::to_string_pretty(forecast);
    text.map(|text| text + "\n")
        .map_err(|e| Error::data("the estimate", e))
}

/// The forecast as text for the terminal.
#[must_use]
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
            between(Some(line.reply_tokens), line.longest_reply_tokens, &count)
        })
        .column(Count, "terminal dollars", |line| {
            between(line.dollars, line.most_dollars, &money)
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
    let store = forecast.image_store.as_ref();
    let mut last = store.map(StoreForecast::line).unwrap_or_default();
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

/// The built-in models with their trials; empty without any.
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

/// Where the models would be asked: a line for each address, with its models if there are several addresses.
fn by_endpoint(lines: &[CostLine]) -> String {
    let mut at: Vec<(String, Vec<&str>)> = Vec::new();
    for line in lines {
        let endpoints = line.endpoints.join(", ");
        match at.iter_mut().find(|(other, _)| *other == endpoints) {
            Some((_, models)) => models.push(&line.model),
            None => at.push((endpoints, vec![&line.model])),
        }
    }
    let several = at.len() > 1;
    at.into_iter()
        .map(|(endpoints, models)| {
            if several {
                format!("asked at {endpoints}: {}\n", models.join(", "))
            } else {
                format!("asked at {endpoints}\n")
            }
        })
        .collect()
}

/// The requests of all models by noise profile; empty with fewer than two readings.
fn by_reading(lines: &[CostLine]) -> String {
    let mut sums = BTreeMap::<Option<&ReadingName>, (usize, Option<f64>)>::new();
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
                ReadingName::as_str,
            );
            let price = dollars.map_or("price unknown".to_owned(), money);
            format!("{name} {} ({price})", count(requests as f64))
        })
        .collect();
    format!("requests by reading: {}\n", parts.join(", "))
}

/// A number rounded to an integer, with digits in groups of three.
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

/// A range of values as text; one value if both are shown alike.
fn between(low: Option<f64>, high: Option<f64>, show: &dyn Fn(f64) -> String) -> String {
    match (low, high) {
        (None, _) => "unknown".to_owned(),
        (Some(low), Some(high)) if show(low) != show(high) => {
            format!("{} – {}", show(low), show(high))
        }
        (Some(low), _) => show(low),
    }
}

/// An amount in dollars: two digits, or four below one dollar.
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

/// A time as `2.0 h`, `6 min` or `40 s`.
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
    fn a_store_gives_the_images_that_find_room() {
        let of = |bytes| StoreForecast::new("enhanced images", bytes, 20e9);
        assert!((of(80e9).hits - 0.25).abs() < 1e-12);
        assert!((of(20e9).hits - 1.0).abs() < 1e-12);
        assert_eq!(
            of(80e9).line(),
            "image store: enhanced images 80.0 GB, room 20.0 GB: the next model finds about 25 % of them\n"
        );
    }

    #[test]
    fn several_readings_are_counted_apart() {
        let cost = |reading: Option<&str>, requests, dollars| ReadingCost {
            reading: reading.map(|name| ReadingName::new(name).unwrap()),
            requests,
            dollars,
        };
        let line = |readings| CostLine {
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
            readings,
        };
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
        assert_eq!(between(Some(0.5), Some(12.0), &money), "$0.5000 – $12.00");
        assert_eq!(between(Some(3.0), None, &money), "$3.00");
        assert_eq!(hours(7200.0), "2.0 h");
    }
}
