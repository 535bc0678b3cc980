//! Formatting of names and numbers in reports, such as [`family`] and [`percent`]; [`words`] formats any table cell.
//!
//! The outcome of a trial in words: [`outcome`], the reason why a reply was not read ([`unread_reason`]), and why no
//! reply came ([`failure_reason`]).
//!
//! The number of frames in a report, in words: [`frames`].
//!
//! [`ProfileNames`]: the noise profiles of the images in a report.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::text::table::{ColumnKind, TableCell};
use darkqa_base::types::text::counted;
use darkqa_base::types::{
    EnhancerName, FailureKind, Family, FrameId, ProfileName, Record, SentImages, TrialOutcome, UnreadReason, Variant,
};
use darkqa_score::estimate::Estimate;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::significance::ALPHA;

/// Title of a variant and its enhancer, such as `with noise + lift`.
pub fn light(variant: &Variant, enhancer: Option<&EnhancerName>) -> String {
    light_with(variant, enhancer.map(EnhancerName::as_str))
}

/// Title of a variant and its enhancer, like [`light`], with a display name for the enhancer. A group of runs is
/// appended.
pub fn light_with(variant: &Variant, enhancer: Option<&str>) -> String {
    let (title, group) = (variant.title(), variant.group_suffix());
    match enhancer {
        None => title + &group,
        Some(name) => format!("{title} + {name}{group}"),
    }
}

/// Display name of a question family; `None` is all families.
pub fn family(family: Option<&Family>) -> &str {
    family.map_or("all families", Family::title)
}

/// Display name of a subject: its model and condition.
pub fn name(subject: &ModelInCondition) -> String {
    format!("{} {}", subject.model, subject.condition())
}

/// Name of a model in figures and LaTeX tables, which is marked if it is a reference beside models under test.
pub fn marked_reference(name: String, is_reference: bool) -> String {
    if is_reference { format!("{name} (reference)") } else { name }
}

/// Shortens a name to `width` characters by replacing its middle with `…`. Shorter names are unchanged.
pub fn shorten_middle(name: &str, width: usize) -> String {
    let chars: Vec<char> = name.chars().collect();
    if chars.len() <= width {
        return name.to_owned();
    }
    let (head, tail) = (width.div_ceil(2) - 1, width / 2);
    let tail_start = chars.len() - tail;
    chars[..head].iter().chain(&['…']).chain(&chars[tail_start..]).collect()
}

/// A share (0 to 1) in percent, with one decimal and no percent sign.
pub fn percent(share: f64) -> String {
    let text = format!("{:.1}", 100.0 * share);
    match &*text {
        "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// The ends of the interval of a share in percent, with one decimal, or as many as it takes to print an interval that
/// has a width.
pub fn share_ends(low: f64, high: f64) -> [String; 2] {
    let decimals = share_decimals(low, high);
    [low, high].map(|end| match decimals {
        1 => percent(end),
        _ => format!("{:.decimals$}", 100.0 * end).replace('-', "−"),
    })
}

/// Number of decimals with which the ends of an interval of a share, in percent, differ; 1 for an interval without a
/// width.
pub fn share_decimals(low: f64, high: f64) -> usize {
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
pub fn names_enhancer(text: &str, enhancer: &str) -> bool {
    text.split([' ', '+']).any(|word| word == enhancer)
}

/// A difference of shares (−1 to 1) in percentage points, with its sign and one decimal; zero has no sign.
pub fn points(difference: f64) -> String {
    let text = format!("{:+.1}", 100.0 * difference);
    match &*text {
        "+0.0" | "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

/// Interval of a difference in percentage points, such as `−1.2, +5.0`.
pub fn ends_in_points(difference: Estimate) -> String {
    format!("{}, {}", points(difference.low), points(difference.high))
}

/// A p-value with three decimals, or `< 0.001`. A value below 0.05 has as many decimals as it takes to stay below 0.05,
/// because a result is detected if and only if p is below 0.05.
pub fn p(value: f64) -> String {
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
pub fn reach(low: f64, high: f64, darkest: f64) -> String {
    if low.is_infinite() { "–".to_owned() } else { format!("{} to {}", stops(low, darkest), stops(high, darkest)) }
}

/// An exposure drop in EV with one decimal. An infinite drop is `>` and the drop of the darkest level asked, in EV.
pub fn stops(value: f64, darkest: f64) -> String {
    if value.is_infinite() { format!("> {darkest}") } else { format!("{value:.1}") }
}

/// Light in lux at an exposure drop in EV below `at_l0`: each EV halves it.
pub fn lux_at(at_l0: f64, drop: f64) -> f64 {
    at_l0 * (-drop).exp2()
}

/// Light as from [`lux_at`], to two significant digits: `180`, `5.4`, `0.39`.
pub fn lux(at_l0: f64, drop: f64) -> String {
    let light = lux_at(at_l0, drop);
    let digits = 1 - light.log10().floor() as i32;
    let step = 10_f64.powi(-digits);
    format!("{:.*}", digits.max(0) as usize, (light / step).round() * step)
}

/// A share in percent with its interval, such as `96.4 [93.0, 98.2]`; without an interval if the share is known
/// exactly.
pub fn with_interval(share: Estimate) -> String {
    let value = percent(share.value);
    if share.high <= share.low {
        return value;
    }
    let [low, high] = share_ends(share.low, share.high);
    format!("{value} [{low}, {high}]")
}

/// Estimate of a cell that [`words`] formats without its interval: an accuracy, a score or an effect. `None` for other
/// cells.
pub fn interval(kind: ColumnKind, cell: &TableCell) -> Option<Estimate> {
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
pub fn widest_reach_of(shares: impl Iterator<Item = Estimate>) -> String {
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
pub fn ends(share: Estimate) -> String {
    let [low, high] = share_ends(share.low, share.high);
    format!("{low}–{high}")
}

/// Formats a table cell, by the kind of its column.
pub fn words(kind: ColumnKind, cell: &TableCell) -> String {
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
        TableCell::Verdict(verdict) => verdict.word().to_owned(),
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
pub fn first_names<S: AsRef<str>>(names: &[S], most: usize) -> String {
    let (first, others) = names.split_at(names.len().min(most));
    let first = first.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    match others.len() {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// The outcome of a trial of a question with choices, by the strict parsing: `✓ right`, `not read (cut at the token
/// limit)`.
pub fn outcome(record: &Record) -> String {
    match record.detail.outcome {
        TrialOutcome::Right => "✓ right".to_owned(),
        TrialOutcome::Wrong => "✗ wrong".to_owned(),
        TrialOutcome::Answered => "answered".to_owned(),
        TrialOutcome::Unparsed => match record.detail.strict.and_then(|strict| strict.why) {
            None => "not read".to_owned(),
            Some(UnreadReason::CannotTell) => unread_reason(UnreadReason::CannotTell).to_owned(),
            Some(why) => format!("not read ({})", unread_reason(why)),
        },
        TrialOutcome::Failed => match &record.failure {
            None => "failed".to_owned(),
            Some(failure) => format!("failed ({})", failure_reason(failure.kind, failure.status)),
        },
    }
}

/// The reason in words why the strict parsing found no choice in a reply.
pub fn unread_reason(why: UnreadReason) -> &'static str {
    match why {
        UnreadReason::Empty => "the reply is empty",
        UnreadReason::Refused => "the model refused",
        UnreadReason::Truncated => "cut at the token limit before an answer",
        UnreadReason::Filtered => "withheld by a content filter",
        UnreadReason::Ambiguous => "names more than one choice",
        UnreadReason::OutOfRange => "names a letter that no choice has",
        UnreadReason::Contradiction => "names the letter of one choice with the text of another",
        UnreadReason::Negated => "names a choice only to deny it",
        UnreadReason::NoChoice => "names no choice in the form that was asked for",
        UnreadReason::CannotTell => "“I cannot tell”",
    }
}

/// The reason in words why no reply came, with the HTTP status if the server sent one.
pub fn failure_reason(kind: FailureKind, status: Option<u16>) -> String {
    let kind = match kind {
        FailureKind::Connection => "no connection",
        FailureKind::Timeout => "no whole reply in time",
        FailureKind::RateLimit => "refused by a rate limit",
        FailureKind::Server => "the server failed",
        FailureKind::Request => "the request was refused",
        FailureKind::Filtered => "refused by moderation",
        FailureKind::Response => "the response was no reply",
        FailureKind::Image => "the image could not be made",
    };
    match status {
        None => kind.to_owned(),
        Some(status) => format!("{kind}, HTTP {status}"),
    }
}

/// The number of frames that were asked about, as `3 frames (2 of 2 to 4 images)` if some questions show several
/// images.
pub fn frames(grid: &Grid<'_>) -> String {
    let mut images = BTreeMap::<&FrameId, usize>::new();
    for (place, item) in grid.items.iter().enumerate() {
        let counts = (0..grid.subjects.len())
            .filter_map(|subject| grid.trial(subject, place))
            .map(|trial| trial.images().map_or(0, SentImages::count));
        let most = images.entry(&*item.asked.frame).or_default();
        *most = counts.max().unwrap_or(0).max(*most);
    }
    let frames = counted(images.len(), "frame");
    let several: Vec<usize> = images.into_values().filter(|images| *images > 1).collect();
    match (several.iter().min(), several.iter().max()) {
        (Some(least), Some(most)) if least == most => {
            format!("{frames} ({} of {most} images)", several.len())
        }
        (Some(least), Some(most)) => {
            format!("{frames} ({} of {least} to {most} images)", several.len())
        }
        _ => frames,
    }
}

/// The noise profiles of the subjects with noise, `paper` first.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct ProfileNames(BTreeSet<ProfileName>);

impl ProfileNames {
    pub fn new<'s>(subjects: impl IntoIterator<Item = &'s ModelInCondition>) -> Self {
        Self(subjects.into_iter().filter_map(|subject| subject.variant.reading.clone()).collect())
    }

    /// A note that other noise profiles were not run, with the flags to run them; `None` without noise or with several
    /// noise profiles.
    pub fn open_question(&self) -> Option<String> {
        let mut readings = self.0.iter();
        let (Some(only), None) = (readings.next(), readings.next()) else {
            return None;
        };
        Some(format!(
            "One noise profile was run ({only}). Results under the others are unknown: --profile all --resume DIR, with the \
             flags of the run, asks the missing trials."
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Condition;

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

    #[test]
    fn reasons_have_different_words() {
        let reasons: std::collections::BTreeSet<&str> = UnreadReason::ALL.into_iter().map(unread_reason).collect();
        assert_eq!(reasons.len(), UnreadReason::ALL.len());
        let kinds: std::collections::BTreeSet<String> =
            FailureKind::ALL.into_iter().map(|kind| failure_reason(kind, None)).collect();
        assert_eq!(kinds.len(), FailureKind::ALL.len());
        let status = failure_reason(FailureKind::RateLimit, Some(429));
        assert_eq!(status, "refused by a rate limit, HTTP 429");
    }

    #[test]
    fn single_profile_leaves_a_question_open() {
        let one = profiles(&["L0", "L3-ev", "L3-noise@eld", "L5-noise@eld+lift"]);
        let note = one.open_question().unwrap();
        assert!(note.starts_with("One noise profile was run (eld). "));
        for conditions in [&["L0", "L3-ev"][..], &["L3-noise", "L3-noise@physical"]] {
            assert_eq!(profiles(conditions).open_question(), None, "{conditions:?}");
        }
        let several = profiles(&["L3-noise@eld", "L3-noise"]);
        assert_eq!(serde_json::to_string(&several).unwrap(), r#"["paper","eld"]"#);
    }

    fn profiles(conditions: &[&str]) -> ProfileNames {
        let subjects: Vec<ModelInCondition> = conditions
            .iter()
            .map(|text| text.parse::<Condition>().unwrap())
            .map(|condition| ModelInCondition::new("m", Some(&condition)))
            .collect();
        ProfileNames::new(&subjects)
    }
}
