//! What subjects and numbers are called in words: [`light`], [`family`], [`percent`] and others.

use crate::score::subject::Subject;
use crate::types::{EnhancerName, Family, KindReading};

/// A variant in words, with what mended it.
#[must_use]
pub fn light(variant: &KindReading, enhancer: Option<&EnhancerName>) -> String {
    let variant = variant.title();
    match enhancer {
        None => variant,
        Some(name) => format!("{variant} + {name}"),
    }
}

/// A family in words: the paper's five by their names, others as they are.
#[must_use]
pub fn family(family: Option<&Family>) -> &str {
    match family {
        None => "all families",
        Some(Family::RoomType) => "room type",
        Some(Family::Affordance) => "room affordance",
        Some(Family::Presence) => "object recognition",
        Some(Family::Color) => "object colour",
        Some(Family::Closest) => "closest object",
        Some(Family::Other(name)) => name,
    }
}

/// A subject in words: its model and what it was shown.
#[must_use]
pub fn name(subject: &Subject) -> String {
    format!("{} {}", subject.model, subject.condition())
}

/// A share in percent, with one digit.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

/// A difference of shares in percentage points, with its sign.
#[must_use]
pub fn points(difference: f64) -> String {
    let text = format!("{:+.1}", 100.0 * difference);
    match &*text {
        "+0.0" | "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// A p-value: three digits, or that it is below them.
#[must_use]
pub fn p(value: f64) -> String {
    if value < 0.001 {
        "< 0.001".to_owned()
    } else {
        format!("{value:.3}")
    }
}

/// An interval of exposure drops in EV; one that lies beyond the darkest level as a whole is none.
#[must_use]
pub fn reach(low: f64, high: f64, darkest: f64) -> String {
    if low.is_infinite() {
        "–".to_owned()
    } else {
        format!("{} to {}", stops(low, darkest), stops(high, darkest))
    }
}

/// An exposure drop in EV; beyond the darkest level that was asked it is more than that.
#[must_use]
pub fn stops(value: f64, darkest: f64) -> String {
    if value.is_infinite() {
        format!("> {darkest}")
    } else {
        format!("{value:.1}")
    }
}
