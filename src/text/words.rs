//! Names and numbers as text: [`light`], [`family`], [`percent`] and others, and [`words`] for any cell.

use crate::text::table::{ColumnKind, TableCell};
use crate::types::{EnhancerName, Family, KindReading};
use darkqa_score::estimate::Estimate;
use darkqa_score::subject::Subject;

/// A variant in words, with its enhancer.
pub(crate) fn light(variant: &KindReading, enhancer: Option<&EnhancerName>) -> String {
    light_with(variant, enhancer.map(EnhancerName::as_str))
}

/// A variant in words, with a name for its enhancer.
pub(crate) fn light_with(variant: &KindReading, enhancer: Option<&str>) -> String {
    let (title, group) = (variant.title(), variant.group_suffix());
    match enhancer {
        None => title + &group,
        Some(name) => format!("{title} + {name}{group}"),
    }
}

/// A family in words: the paper's names for its five families, other families by their own names.
pub(crate) fn family(family: Option<&Family>) -> &str {
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

/// A subject in words: its model and condition.
pub(crate) fn name(subject: &Subject) -> String {
    format!("{} {}", subject.model, subject.condition())
}

/// A number of things: `1 pair`, `2 pairs`.
pub(crate) fn counted(number: usize, noun: &str) -> String {
    plural(number, noun, &format!("{noun}s"))
}

/// A number of things by its two words: `1 reply`, `2 replies`.
pub(crate) fn plural(number: usize, one: &str, several: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { several })
}

/// A name with its middle left out, if it is longer than `width`.
pub(crate) fn shortened(name: &str, width: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= width {
        return name.to_owned();
    }
    let (head, tail) = (width.div_ceil(2) - 1, width / 2);
    let middle = letters.len() - tail;
    letters[..head]
        .iter()
        .chain(&['…'])
        .chain(&letters[middle..])
        .collect()
}

/// A share in percent, with one decimal.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share).replace('-', "−")
}

/// Whether a condition or a light in words, as `L3-noise+lift` or `with noise + lift`, is enhanced by an enhancer.
pub(crate) fn names_enhancer(text: &str, enhancer: &str) -> bool {
    text.split([' ', '+']).any(|word| word == enhancer)
}

/// A difference of shares in percentage points, with its sign and one decimal.
pub(crate) fn points(difference: f64) -> String {
    let text = format!("{:+.1}", 100.0 * difference);
    match &*text {
        "+0.0" | "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// Both ends of the interval of a difference in percentage points, as `−1.2, +5.0`.
pub(crate) fn ends_in_points(difference: Estimate) -> String {
    format!("{}, {}", points(difference.low), points(difference.high))
}

/// A p-value with three decimals, or "< 0.001".
pub(crate) fn p(value: f64) -> String {
    if value < 0.001 {
        "< 0.001".to_owned()
    } else {
        format!("{value:.3}")
    }
}

/// An interval of exposure drops in EV; "–" if all of it lies beyond the darkest level.
pub(crate) fn reach(low: f64, high: f64, darkest: f64) -> String {
    if low.is_infinite() {
        "–".to_owned()
    } else {
        format!("{} to {}", stops(low, darkest), stops(high, darkest))
    }
}

/// An exposure drop in EV; "> " and the darkest level asked if it lies beyond that.
pub(crate) fn stops(value: f64, darkest: f64) -> String {
    if value.is_infinite() {
        format!("> {darkest}")
    } else {
        format!("{value:.1}")
    }
}

/// A share in percent with its interval, as `96.4 [93.0, 98.2]`.
pub(crate) fn with_interval(share: Estimate) -> String {
    let [value, low, high] = [share.value, share.low, share.high].map(percent);
    format!("{value} [{low}, {high}]")
}

/// The estimate of a cell whose interval does not stand in the same text: accuracies and scores.
pub(crate) fn interval(kind: ColumnKind, cell: &TableCell) -> Option<Estimate> {
    match (kind, cell) {
        (
            _,
            TableCell::Below(share)
            | TableCell::Strict(share, _)
            | TableCell::Changed(share, _)
            | TableCell::Effect(share, _),
        )
        | (ColumnKind::Accuracy | ColumnKind::Percent, TableCell::Estimate(share)) => Some(*share),
        _ => None,
    }
}

/// How far the widest of some intervals reaches down and up, in points, as `−7.7 +7.1`; empty without any.
pub(crate) fn reach_of(shares: impl Iterator<Item = Estimate>) -> String {
    let widest = shares.fold(None, |widest: Option<[f64; 2]>, share| {
        let [down, up] = widest.unwrap_or_default();
        Some([
            down.max(share.value - share.low),
            up.max(share.high - share.value),
        ])
    });
    widest.map_or(String::new(), |reach| {
        let [down, up] = reach.map(percent);
        format!("−{down} +{up}")
            .replace("−0.0", "0.0")
            .replace("+0.0", "0.0")
    })
}

/// Both ends of an interval in percent, as `93.0–98.2`.
pub(crate) fn ends(share: Estimate) -> String {
    format!("{}–{}", percent(share.low), percent(share.high))
}

/// A cell as text for people.
pub(crate) fn words(kind: ColumnKind, cell: &TableCell) -> String {
    match cell {
        TableCell::Blank | TableCell::Absent => String::new(),
        TableCell::Missing => "–".to_owned(),
        TableCell::Text(text) | TableCell::Unknown(text) => text.clone(),
        TableCell::Count(count) => count.to_string(),
        TableCell::Number(value) => number(kind, *value),
        TableCell::Estimate(number) | TableCell::Below(number) => estimate(kind, *number),
        TableCell::Guess(share) | TableCell::Strict(share, _) | TableCell::Changed(share, None) => {
            percent(share.value)
        }
        TableCell::Changed(share, Some(change)) => {
            format!("{} ({})", percent(share.value), points(*change))
        }
        TableCell::Effect(difference, _) => points(difference.value),
        TableCell::Threshold(threshold, darkest) => {
            let reach = reach(threshold.low, threshold.high, *darkest);
            format!("{} [{reach}]", stops(threshold.value, *darkest))
        }
        TableCell::Significance(significance) => significance.word().to_owned(),
    }
}

fn number(kind: ColumnKind, number: f64) -> String {
    match kind {
        ColumnKind::P => p(number),
        ColumnKind::Percent | ColumnKind::Share | ColumnKind::Accuracy => percent(number),
        ColumnKind::Points => points(number),
        _ => format!("{number:.2}"),
    }
}

fn estimate(kind: ColumnKind, estimate: Estimate) -> String {
    let [value, low, high] = [estimate.value, estimate.low, estimate.high].map(|x| number(kind, x));
    match kind {
        ColumnKind::Percent | ColumnKind::Accuracy => value,
        _ => format!("{value} [{low}, {high}]"),
    }
}
