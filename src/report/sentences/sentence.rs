//! One finding in words: [`Sentence`], with the numbers that it contains.
//!
//! Sentences about the answer format, for differences that only the strict parsing detects: [`format_alone`].

use std::collections::BTreeMap;

use serde::Serialize;

use crate::text::words::{light, p, points, share_decimals};
use darkqa_base::types::text::counted;
use darkqa_base::types::{EnhancerName, ModelListing};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::estimate::Estimate;
use darkqa_score::significance::{SwapMethod, Verdict};

/// A finding in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sentence {
    /// The kind of finding.
    pub kind: &'static str,
    /// The direction of the effect.
    #[serde(rename = "verdict")]
    pub tone: EffectDirection,
    /// One sentence.
    pub text: String,
    /// Effect, interval, p and n.
    pub detail: String,
    /// Every number in text and detail, by name, rounded as it is written there.
    pub values: BTreeMap<String, f64>,
    /// Distinguishes the sentence from others of its kind.
    #[serde(skip)]
    pub scope: SentenceScope,
}

impl Sentence {
    /// Adds a second sentence with the training data of the enhancer to the text, if they are known.
    pub(super) fn add_training_data(&mut self, listing: &ModelListing) {
        if let Some(enhancer) = &self.scope.subject
            && let Some(training) = listing.training(enhancer)
        {
            self.scope.training = format!("{enhancer} was {training}.");
            self.text = format!("{} {}", self.text, self.scope.training);
        }
    }

    /// The text without the sentence about training data and without full stop.
    pub fn claim(&self) -> &str {
        let text = self.text.strip_suffix(&self.scope.training);
        text.unwrap_or(&self.text).trim_end_matches(['.', ' '])
    }
}

/// The part of a run that a sentence is about.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SentenceScope {
    /// The light, if there are several sentences with the same content about different lights.
    pub light: Option<String>,
    /// The enhancer that the sentence is about.
    pub subject: Option<String>,
    /// The level, or the levels, of the difference.
    pub at: Option<String>,
    /// The sentence about the training data of the enhancer at the end of the text; empty if they are unknown.
    pub training: String,
}

/// The direction of a sentence's effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum EffectDirection {
    /// An improvement is detected.
    #[serde(rename = "better")]
    Better,
    /// A loss is detected.
    #[serde(rename = "worse")]
    Worse,
    /// Nothing is detected.
    #[serde(rename = "not shown")]
    NotShown,
    /// The sentence reports no test.
    #[serde(rename = "note")]
    Note,
}

impl EffectDirection {
    /// The sign before the sentence.
    #[must_use]
    pub fn sign(self) -> char {
        match self {
            Self::Better => '+',
            Self::Worse => '−',
            Self::NotShown | Self::Note => '·',
        }
    }

    /// True if a gain or a loss is detected.
    pub fn is_detected(self) -> bool {
        matches!(self, Self::Better | Self::Worse)
    }

    /// The CSS class.
    pub fn class(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::NotShown | Self::Note => "unshown",
        }
    }
}

impl From<Claim> for EffectDirection {
    fn from(claim: Claim) -> Self {
        match claim {
            Claim::Detected(verdict) => verdict.into(),
            _ => Self::NotShown,
        }
    }
}

impl From<Verdict> for EffectDirection {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Better => Self::Better,
            Verdict::Worse => Self::Worse,
            _ => Self::NotShown,
        }
    }
}

/// Builder of a [`Sentence`]: each method returns a number as text and records its value under a name.
#[derive(Debug)]
pub(super) struct NamedNumbers {
    values: BTreeMap<String, f64>,
    unit: ClusterUnit,
    scope: SentenceScope,
}

impl NamedNumbers {
    /// An empty builder; `unit` names the clusters.
    pub(super) fn new(unit: ClusterUnit) -> Self {
        Self { values: BTreeMap::new(), unit, scope: SentenceScope::default() }
    }

    /// Sets the level, or the levels, of the difference.
    pub(super) fn at(&mut self, levels: &impl ToString) {
        self.scope.at = Some(levels.to_string());
    }

    /// Sets the enhancer that the sentence is about.
    pub(super) fn about(&mut self, enhancer: &EnhancerName) {
        self.scope.subject = Some(enhancer.to_string());
    }

    /// The sentence with these numbers.
    pub(super) fn sentence(self, kind: &'static str, tone: EffectDirection, text: String, detail: String) -> Sentence {
        Sentence { kind, tone, text, detail, values: self.values, scope: self.scope }
    }

    /// A count, with thousands separators.
    pub(super) fn count(&mut self, name: &str, count: usize) -> String {
        self.values.insert(name.to_owned(), count as f64);
        with_separators(count as u64)
    }

    /// A plain number. Zero has no sign.
    pub(super) fn number(&mut self, name: &str, value: f64, decimals: u8) -> String {
        let text = format!("{value:.*}", usize::from(decimals));
        // Parsed from the text, because formatting and `round` treat halves differently. The sum of −0 and 0 is 0.
        let rounded = text.parse().unwrap_or(value) + 0.0;
        self.values.insert(name.to_owned(), rounded);
        format!("{rounded:.*}", usize::from(decimals)).replace('-', "−")
    }

    /// Records a number that is written already.
    pub(super) fn record(&mut self, name: &str, text: &str) {
        self.values.insert(name.to_owned(), text.parse().unwrap_or(f64::NAN));
    }

    /// A share in percent, without the sign.
    pub(super) fn percent(&mut self, name: &str, share: f64) -> String {
        self.number(name, 100.0 * share, 1)
    }

    /// The ends of the interval of a share in percent, as `93.0, 98.2`. The names begin with `of`.
    pub(super) fn share_ends(&mut self, of: &str, share: Estimate) -> String {
        let decimals = share_decimals(share.low, share.high) as u8;
        let [low, high] = [("low", share.low), ("high", share.high)]
            .map(|(name, value)| self.number(&format!("{of}{name}"), 100.0 * value, decimals));
        format!("{low}, {high}")
    }

    /// The size of a difference in points, without its sign.
    pub(super) fn size(&mut self, name: &str, difference: f64) -> String {
        self.number(name, 100.0 * difference.abs(), 1)
    }

    /// A difference in points with its sign, as `−4.8`.
    pub(super) fn points(&mut self, name: &str, difference: f64) -> String {
        self.number(name, 100.0 * difference, 1);
        points(difference)
    }

    /// A difference in points with its interval, as `−4.8 [−8.5, −1.0]`. The names end in `at`.
    pub(super) fn difference(&mut self, at: &str, difference: Estimate) -> String {
        let ends = [("difference", difference.value), ("low", difference.low), ("high", difference.high)];
        let [value, low, high] = ends.map(|(name, value)| self.points(&format!("{name}{at}"), value));
        format!("{value} [{low}, {high}]")
    }

    /// A p-value, as `p = 0.036` or `p < 0.001`.
    pub(super) fn p(&mut self, name: &str, value: f64) -> String {
        let text = p(value);
        let (sign, number) = match text.strip_prefix("< ") {
            Some(bound) => ("<", bound),
            None => ("=", &*text),
        };
        self.values.insert(name.to_owned(), number.parse().unwrap_or(value));
        format!("p {sign} {number}")
    }

    /// The number of clusters, as `30 scenes`.
    pub(super) fn clusters(&mut self, count: usize) -> String {
        self.count("clusters", count);
        counted(count, &self.unit.to_string())
    }

    /// The numbers of questions and clusters of a finding, with the questions left out and an approximate p-value's
    /// method.
    pub(super) fn sample(&mut self, finding: &PooledFinding) -> String {
        let items = self.count("n", finding.items);
        let mut parts = vec![format!("n = {items} in {}", self.clusters(finding.clusters))];
        let all = finding.items + finding.dropped;
        // Above 5 % the reader should know that the tables include more questions.
        if 20 * finding.dropped > all {
            let dropped = self.count("dropped", finding.dropped);
            parts.push(format!("{dropped} left out because a model has no reply"));
        }
        match finding.strict.tested.p_by {
            None | Some(SwapMethod::Counted) => {}
            Some(SwapMethod::Drawn(draws)) => {
                let draws = self.count("draws", draws);
                parts.push(format!("p by {draws} random swaps"));
            }
            Some(SwapMethod::Normal) => parts.push("p by the normal distribution".to_owned()),
        }
        parts.join(", ")
    }
}

/// A whole number with thousands separators, as `26,781`.
pub fn with_separators(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Models in words: the name of a single model, or their number.
pub(super) fn models(names: &[String], numbers: &mut NamedNumbers) -> String {
    match names {
        [one] => one.clone(),
        several => format!("mean of these {} models", numbers.count("models", several.len())),
    }
}

/// A text with its first letter in upper case.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().into_iter().flat_map(char::to_uppercase).chain(letters).collect()
}

/// Levels in words; levels that are neighbours in `all` become a range, as `L1–L3, L5`.
pub fn level_runs<T: PartialEq + ToString>(levels: &[T], all: &[T]) -> String {
    let runs: Vec<String> = levels
        .chunk_by(|a, b| {
            let [a, b] = [a, b].map(|level| all.iter().position(|other| other == level));
            a.map(|a| a + 1) == b
        })
        .map(|run| match run {
            [one] => one.to_string(),
            [first, .., last] => format!("{}–{}", first.to_string(), last.to_string()),
            [] => String::new(),
        })
        .collect();
    runs.join(", ")
}

/// The largest finding that only the strict parsing detects, among those for which readable replies explain at least
/// half of the difference.
pub(super) fn format_alone(levels: &[&PooledFinding], unit: ClusterUnit) -> Option<Sentence> {
    let strict_only: Vec<&PooledFinding> = levels
        .iter()
        .copied()
        .filter(|finding| {
            let readable = finding.format[0] - finding.format[1];
            let difference = finding.strict.tested.difference.value;
            matches!(finding.claim(), Claim::StrictOnly(_)) && readable / difference >= 0.5
        })
        .collect();
    let largest = PooledFinding::largest(&strict_only)?;
    let is_loss = largest.claim() == Claim::StrictOnly(Verdict::Worse);
    let (more, effect) = if is_loss { ("fewer", "loss") } else { ("more", "gain") };
    let level = largest.level;
    let place = match (largest.kind, &largest.enhancer) {
        (PooledKind::Enhancer, Some(enhancer)) => format!("With {enhancer} at {level}"),
        (PooledKind::Blind, _) => format!("With images at {level}"),
        _ => match &*light(&largest.variant, None) {
            "" => format!("At {level}"),
            light => format!("At {level} {light}"),
        },
    };
    let mut numbers = NamedNumbers::new(unit);
    let readable = numbers.size("format", largest.format[0] - largest.format[1]);
    let lenient = numbers.difference("_lenient", largest.lenient.tested.difference);
    let text = format!(
        "{place}, {readable} % {more} replies keep to the answer format; no {effect} of accuracy was detected ({lenient})."
    );
    let who = models(&largest.models, &mut numbers);
    let [here, there] = [("kept", 0), ("kept_else", 1)].map(|(name, side)| numbers.percent(name, largest.format[side]));
    let strict = numbers.difference("", largest.strict.tested.difference);
    let p = numbers.p("p", largest.strict.tested.p_report.unwrap_or(1.0));
    let sample = numbers.sample(largest);
    let detail = format!("{who}: {here} % keep to it, {there} % without; strict parsing {strict}, {p}; {sample}");
    Some(numbers.sentence("format", EffectDirection::Note, text, detail))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_like_text() {
        let mut numbers = NamedNumbers::new(ClusterUnit::Scene);
        assert_eq!(numbers.percent("share", 0.0625), "6.2");
        assert_eq!(numbers.points("effect", -0.0625), "−6.2");
        assert_eq!(numbers.number("kappa", -0.001, 2), "0.00");
        let values = [("effect", -6.2), ("kappa", 0.0), ("share", 6.2)].map(|(name, value)| (name.to_owned(), value));
        assert_eq!(numbers.values, BTreeMap::from(values));
    }
}
