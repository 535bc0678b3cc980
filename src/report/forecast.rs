//! What a run would take, before it is begun: [`Forecast`].

use std::fmt::Write;

use serde::Serialize;

use super::table::ColumnKind::{Count, Text};
use super::table::TableBuilder;
use super::terminal;
use crate::error::{Error, Result};

/// What is left to ask of one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CostLine {
    /// The model, with how it is asked where that is without images.
    pub model: String,
    /// Requests left.
    pub requests: usize,
    /// Tokens of the words of all prompts.
    pub text_tokens: f64,
    /// Tokens of all images; `None` where nobody knows how the model counts them.
    pub image_tokens: Option<f64>,
    /// Tokens of all replies if each is short: a letter, a mark, a sentence.
    pub reply_tokens: f64,
    /// Tokens of all replies if each is as long as `--max-tokens` allows; `None` without a limit.
    pub longest_reply_tokens: Option<f64>,
    /// Dollars if each reply is short; `None` where no price is known.
    pub dollars: Option<f64>,
    /// Dollars if each reply is as long as `--max-tokens` allows.
    pub most_dollars: Option<f64>,
}

/// What a run would take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Forecast {
    /// What is left by model.
    pub lines: Vec<CostLine>,
    /// Trials in all.
    pub trials: usize,
    /// Trials with a reply.
    pub answered: usize,
    /// What the replies so far were charged, in dollars; `None` where no price is known.
    pub spent: Option<f64>,
    /// Images to be made.
    pub images: usize,
    /// Bytes to be sent, images as base64.
    pub bytes: f64,
    /// Bytes of the largest image file among those made to find out.
    pub largest_image: usize,
    /// How many images were made to find out.
    pub sampled: usize,
    /// What is wrong with the largest image, where the endpoint does not take it.
    pub too_large: Option<String>,
    /// Seconds of this machine to make all images.
    pub making_seconds: f64,
    /// Seconds of waiting for all replies.
    pub asking_seconds: f64,
    /// What the waiting rests on.
    pub pace: String,
    /// The day of the prices, and where they come from.
    pub prices: String,
    /// What the Batch API charges, as a share of the price.
    pub batch: f64,
    /// What the shortest reply is taken to be, in words.
    pub reply: &'static str,
    /// The size of the largest request in bytes, where requests hold many images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_request: Option<f64>,
}

/// The forecast as JSON.
pub(crate) fn json(forecast: &Forecast) -> Result<String> {
    let text = serde_json::to_string_pretty(forecast);
    text.map(|text| text + "\n")
        .map_err(|e| Error::data("the estimate", e))
}

/// The forecast for people.
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
        .made();
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
    if forecast.lines.is_empty() {
        return text + ".\n";
    }
    let _ = write!(text, ".\n{table}");
    let _ = writeln!(
        text,
        "dollars: from {} a reply to every reply as long as --max-tokens allows; {prices}; by the Batch API {:.0} % of it",
        forecast.reply,
        100.0 * forecast.batch
    );
    if forecast.lines.iter().any(|line| line.dollars.is_none()) {
        text.push_str("unknown: a table of --prices FILE can state the price of a model and its image-tokens\n");
    }
    let _ = writeln!(
        text,
        "to send: {} in {images} images, the largest {:.2} MB ({sampled} made to find out)",
        bytes(forecast.bytes),
        forecast.largest_image as f64 / 1e6
    );
    if let Some(request) = forecast.largest_request {
        let _ = writeln!(text, "a request has up to {}", bytes(request));
    }
    let _ = writeln!(
        text,
        "time: {} of waiting ({pace}), {} of making images beside it",
        hours(forecast.asking_seconds),
        hours(forecast.making_seconds)
    );
    if let Some(problem) = &forecast.too_large {
        let _ = writeln!(text, "the run would not begin: {problem}");
    }
    text
}

/// A whole number in groups of three.
fn count(number: f64) -> String {
    let digits = format!("{number:.0}");
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i) % 3 == 0 {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

fn between(low: Option<f64>, high: Option<f64>, show: &dyn Fn(f64) -> String) -> String {
    match (low, high) {
        (None, _) => "unknown".to_owned(),
        (Some(low), Some(high)) if show(low) != show(high) => {
            format!("{} – {}", show(low), show(high))
        }
        (Some(low), _) => show(low),
    }
}

/// Dollars, with as many digits as say something.
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

fn hours(seconds: f64) -> String {
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
    fn numbers_read_well() {
        assert_eq!(count(1_234_567.4), "1,234,567");
        assert_eq!(count(999.0), "999");
        assert_eq!(between(Some(0.5), Some(12.0), &money), "$0.5000 – $12.00");
        assert_eq!(between(Some(3.0), None, &money), "$3.00");
        assert_eq!(hours(7200.0), "2.0 h");
    }
}
