//! The estimate of a run as text and JSON: [`render`], [`forecast_json`].

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::text::table::ColumnKind::{Count, Text};
use crate::text::table::TableBuilder;
use crate::text::terminal;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::ProfileName;
use darkqa_base::types::text::{bytes, counted, hours, money};
use darkqa_runs::forecast::{CostLine, Forecast, StoreForecast};

/// Relative difference of charges from the price table from which it is printed; chosen.
const TOLD_FROM: f64 = 0.05;

/// Serializes the forecast as JSON.
pub fn forecast_json(forecast: &Forecast) -> Result<String> {
    serde_json::to_string_pretty(forecast).map(|text| text + "\n").map_err(|e| Error::data("the estimate", e))
}

/// Formats the forecast for the terminal.
#[must_use]
pub fn render(forecast: &Forecast) -> String {
    let table = TableBuilder::new("estimate", &forecast.lines)
        .column(Text, "terminal model", |line| line.model.clone())
        .column(Count, "terminal requests", |line| count(line.requests as f64))
        .column(Count, "terminal text tokens", |line| count(line.text_tokens))
        .column(Count, "terminal image tokens", |line| line.image_tokens.map_or("unknown".to_owned(), count))
        .column(Count, "terminal reply tokens", |line| {
            range_text(Some(line.reply_tokens), line.longest_reply_tokens, count)
        })
        .column(Count, "terminal dollars", |line| range_text(line.dollars, line.most_dollars, money))
        .build();
    let table = terminal::table(&[table]);
    let Forecast { trials, answered, images, sampled, pace, prices, .. } = forecast;
    let mut text = format!("Nothing was sent. {} of {trials} trials are left to ask", trials - answered);
    if let (Some(spent), true) = (forecast.spent, *answered > 0) {
        let _ = write!(text, "; the {answered} answered ones cost {}", money(spent));
    }
    let mut last = forecast.image_store.as_ref().map(StoreForecast::line).unwrap_or_default();
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
            let _ =
                writeln!(text, "{}: {} tokens an image, as its first replies were charged", line.model, count(tokens));
        }
    }
    for line in &forecast.lines {
        if let Some(ratio) = line.charge_ratio.filter(|ratio| (ratio - 1.0).abs() > TOLD_FROM) {
            let _ = writeln!(
                text,
                "{}: dollars at {ratio:.2} times the price table, as its replies were charged",
                line.model
            );
        }
    }
    text += &by_endpoint(&forecast.lines);
    text += &by_profile(&forecast.lines);
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
    let models: Vec<String> =
        models.iter().map(|(model, trials)| format!("{model} {}", count(*trials as f64))).collect();
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
fn by_profile(lines: &[CostLine]) -> String {
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
            let name = reading.map_or("shared by all (L0, exposure drop, blind)", ProfileName::as_str);
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

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_runs::forecast::ProfileCost;

    fn cost(reading: Option<&str>, requests: usize, dollars: Option<f64>) -> ProfileCost {
        ProfileCost { reading: reading.map(|name| ProfileName::new(name).unwrap()), requests, dollars }
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
        assert_eq!(by_profile(std::slice::from_ref(&one)), "");
        let two = line(vec![shared, cost(Some("paper"), 5, Some(0.25)), cost(Some("physical"), 1005, None)]);
        assert_eq!(
            by_profile(&[one, two]),
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
