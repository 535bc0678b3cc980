//! Formatting of names and numbers in reports, such as [`family`] and [`percent`]; [`words`] formats any table cell.

use crate::report::text::table::{ColumnKind, TableCell};
use crate::types::{EnhancerName, Family, Variant};
use darkqa_score::estimate::Estimate;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::ALPHA;

/// Title of a variant and its enhancer, such as `with noise + lift`.
pub(crate) fn light(variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
    light_with(variant, enhancer.map(EnhancerName::as_str))
}

/// Title of a variant and its enhancer, like [`light`], with a display name for the enhancer. A group of runs is
/// appended.
pub(crate) fn light_with(variant: &Variant, enhancer: Option<&str>) -> String {
    let (title, group) = (variant.title(), variant.group_suffix());
    match enhancer {
        None => title + &group,
        Some(name) => format!("{title} + {name}{group}"),
    }
}

/// Display name of a question family: the paper's name for its five families, the family's own name for others. `None`
/// is all families.
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

/// Display name of a subject: its model and condition.
pub(crate) fn name(subject: &ModelInCondition) -> String {
    format!("{} {}", subject.model, subject.condition())
}

/// Name of a model in figures and LaTeX tables, which is marked if it is a reference beside models under test.
pub(crate) fn marked_reference(name: String, is_reference: bool) -> String {
    if is_reference { format!("{name} (reference)") } else { name }
}

/// Shortens a name to `width` characters by replacing its middle with `…`. Shorter names are unchanged.
pub(crate) fn shorten_middle(name: &str, width: usize) -> String {
    let chars: Vec<char> = name.chars().collect();
    if chars.len() <= width {
        return name.to_owned();
    }
    let (head, tail) = (width.div_ceil(2) - 1, width / 2);
    let tail_start = chars.len() - tail;
    chars[..head].iter().chain(&['…']).chain(&chars[tail_start..]).collect()
}

/// A share (0 to 1) in percent, with one decimal and no percent sign.
pub(crate) fn percent(share: f64) -> String {
    let text = format!("{:.1}", 100.0 * share);
    match &*text {
        "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// The ends of the interval of a share in percent, with one decimal, or as many as it takes to print an interval that
/// has a width.
pub(crate) fn share_ends(low: f64, high: f64) -> [String; 2] {
    let decimals = share_decimals(low, high);
    [low, high].map(|end| match decimals {
        1 => percent(end),
        _ => format!("{:.decimals$}", 100.0 * end).replace('-', "−"),
    })
}

/// Number of decimals with which the ends of an interval of a share, in percent, differ; 1 for an interval without a
/// width.
pub(crate) fn share_decimals(low: f64, high: f64) -> usize {
    (1..MAX_SHARE_DECIMALS)
        .find(|decimals| {
            let [low, high] = [low, high].map(|end| format!("{:.decimals$}", 100.0 * end));
            low != high
        })
        .unwrap_or(1)
}

/// Maximum number of decimals of a share in percent (chosen).
const MAX_SHARE_DECIMALS: usize = 6;

/// True if a condition (`L3-noise+lift`) or the title of a variant (`with noise + lift`) names this enhancer.
pub(crate) fn names_enhancer(text: &str, enhancer: &str) -> bool {
    text.split([' ', '+']).any(|word| word == enhancer)
}

/// A difference of shares (−1 to 1) in percentage points, with its sign and one decimal; zero has no sign.
pub(crate) fn points(difference: f64) -> String {
    let text = format!("{:+.1}", 100.0 * difference);
    match &*text {
        "+0.0" | "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// Interval of a difference in percentage points, such as `−1.2, +5.0`.
pub(crate) fn ends_in_points(difference: Estimate) -> String {
    format!("{}, {}", points(difference.low), points(difference.high))
}

/// A p-value with three decimals, or `< 0.001`. A value below 0.05 has as many decimals as it takes to stay below 0.05,
/// because a result is detected if and only if p is below 0.05.
pub(crate) fn p(value: f64) -> String {
    if value < 0.001 {
        return "< 0.001".to_owned();
    }
    (3..MAX_P_DECIMALS)
        .map(|decimals| format!("{value:.decimals$}"))
        .find(|text| {
            let printed = text.parse::<f64>();
            value >= ALPHA || printed.is_ok_and(|printed| printed < ALPHA)
        })
        .unwrap_or_else(|| format!("< {ALPHA}"))
}

/// Maximum number of decimals of a p-value (chosen).
const MAX_P_DECIMALS: usize = 7;

/// Interval of an exposure drop in EV, such as `1.2 to 3.4`; `–` if the lower end is infinite (beyond the darkest
/// level).
pub(crate) fn reach(low: f64, high: f64, darkest: f64) -> String {
    if low.is_infinite() { "–".to_owned() } else { format!("{} to {}", stops(low, darkest), stops(high, darkest)) }
}

/// An exposure drop in EV with one decimal. An infinite drop is `>` and the drop of the darkest level asked, in EV.
pub(crate) fn stops(value: f64, darkest: f64) -> String {
    if value.is_infinite() { format!("> {darkest}") } else { format!("{value:.1}") }
}

/// A share in percent with its interval, such as `96.4 [93.0, 98.2]`; without an interval if the share is known
/// exactly.
pub(crate) fn with_interval(share: Estimate) -> String {
    let value = percent(share.value);
    if share.high <= share.low {
        return value;
    }
    let [low, high] = share_ends(share.low, share.high);
    format!("{value} [{low}, {high}]")
}

/// Estimate of a cell that [`words`] formats without its interval: an accuracy, a score or an effect. `None` for other
/// cells.
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

/// Largest lower and upper error bars of several estimates, in percentage points, such as `−7.7 +7.1`; empty without
/// estimates.
pub(crate) fn widest_reach_of(shares: impl Iterator<Item = Estimate>) -> String {
    shares
        .map(|share| [share.value - share.low, share.high - share.value])
        .fold(None, |widest: Option<[f64; 2]>, [down, up]| {
            let [widest_down, widest_up] = widest.unwrap_or_default();
            Some([widest_down.max(down), widest_up.max(up)])
        })
        .map_or(String::new(), |widest| {
            let [down, up] = widest.map(percent);
            format!("−{down} +{up}").replace("−0.0", "0.0").replace("+0.0", "0.0")
        })
}

/// Interval of a share in percent, such as `93.0–98.2`.
pub(crate) fn ends(share: Estimate) -> String {
    let [low, high] = share_ends(share.low, share.high);
    format!("{low}–{high}")
}

/// Formats a table cell, by the kind of its column.
pub(crate) fn words(kind: ColumnKind, cell: &TableCell) -> String {
    match cell {
        TableCell::Blank | TableCell::Absent => String::new(),
        TableCell::Missing => "–".to_owned(),
        TableCell::Text(text) | TableCell::Unknown(text) => text.clone(),
        TableCell::Count(count) => count.to_string(),
        TableCell::Number(value) => format_number(kind, *value),
        TableCell::Estimate(estimate) | TableCell::Below(estimate) => format_estimate(kind, *estimate),
        TableCell::Guess(share) | TableCell::Strict(share, _) | TableCell::Changed(share, None) => percent(share.value),
        TableCell::Changed(share, Some(change)) => {
            format!("{} ({})", percent(share.value), points(*change))
        }
        TableCell::Effect(difference, _) => points(difference.value),
        TableCell::Threshold(threshold, darkest) => {
            let range = reach(threshold.low, threshold.high, *darkest);
            format!("{} [{range}]", stops(threshold.value, *darkest))
        }
        TableCell::Significance(significance) => significance.word().to_owned(),
    }
}

fn format_number(kind: ColumnKind, number: f64) -> String {
    match kind {
        ColumnKind::P => p(number),
        ColumnKind::Percent | ColumnKind::Share | ColumnKind::Accuracy => percent(number),
        ColumnKind::Points => points(number),
        _ => format!("{number:.2}"),
    }
}

/// An estimate with its interval; columns of kind `Percent` and `Accuracy` have no interval.
fn format_estimate(kind: ColumnKind, estimate: Estimate) -> String {
    if kind == ColumnKind::Share {
        return with_interval(estimate);
    }
    let [value, low, high] = [estimate.value, estimate.low, estimate.high].map(|number| format_number(kind, number));
    match kind {
        ColumnKind::Percent | ColumnKind::Accuracy => value,
        _ => format!("{value} [{low}, {high}]"),
    }
}

/// Lists up to `most` names and the number of the remaining ones: `a, b and 3 more`.
pub(crate) fn first_names<S: AsRef<str>>(names: &[S], most: usize) -> String {
    let (first, others) = names.split_at(names.len().min(most));
    let first = first.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    match others.len() {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_percent_has_no_sign() {
        assert_eq!(percent(-0.0004), "0.0");
        assert_eq!(percent(-0.0006), "−0.1");
    }

    #[test]
    fn p_never_rounds_to_the_other_side_of_the_level() {
        for (value, text) in [
            (0.0004, "< 0.001"),
            (0.036, "0.036"),
            (0.0494, "0.049"),
            (0.0496, "0.0496"),
            (0.049_97, "0.04997"),
            (0.049_999_999_9, "< 0.05"),
            (0.05, "0.050"),
            (0.0501, "0.050"),
        ] {
            assert_eq!(p(value), text);
        }
    }

    #[test]
    fn an_interval_of_a_share_has_a_width() {
        let share = |low, high| Estimate { value: low, low, high, n: 20_000 };
        assert_eq!(with_interval(share(0.0, 0.000_19)), "0.0 [0.00, 0.02]");
        assert_eq!(ends(share(0.999_999, 1.0)), "99.9999–100.0000");
        assert_eq!(with_interval(share(0.9, 1.0)), "90.0 [90.0, 100.0]");
        assert_eq!(with_interval(share(0.25, 0.25)), "25.0");
    }
}
