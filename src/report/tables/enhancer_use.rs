//! Table of the use of each enhancer: preprocessing, resizing, the brightness of its images, and its help for its time.

use std::collections::BTreeSet;

use super::sections::ENHANCERS;
use crate::sentences::level_runs;
use crate::text::table::ColumnKind::Text;
use crate::text::table::{Table, TableBuilder};
use crate::text::words::{light, points};
use darkqa_base::types::manifests::{EnhancerLatency, milliseconds};
use darkqa_base::types::{AxisLevel, Variant};
use darkqa_score::comparisons::{Claim, PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::is_observer;
use darkqa_score::significance::Verdict;

/// Use of an enhancer in one or more runs.
#[derive(Debug, Clone, PartialEq)]
pub struct EnhancerRow {
    /// Name of the enhancer, with the names of its runs if others used it in another way.
    pub name: String,
    /// Name of the enhancer in the findings.
    pub enhancer: String,
    /// Input and output conventions of the model, and changes of image size.
    pub how: String,
    /// Appearance of its images of the probe and of the run's dark frames.
    pub looks: String,
    /// Times that the runs measured; empty without any.
    pub latency: Vec<EnhancerLatency>,
}

/// Builds the table; `None` without an enhancer. `effects` are the effects of all enhancers.
///
/// The times differ between equal runs, so only the page has them.
pub fn enhancers(rows: &[EnhancerRow], effects: &[&PooledFinding]) -> Option<Table> {
    if rows.is_empty() {
        return None;
    }
    let name = "csv enhancer | terminal enhancer | page enhancer";
    let how = "csv how | terminal fed and read | page fed and read";
    let looks = "csv dark_images | terminal dark images | page its images of dark frames";
    let help = |row: &EnhancerRow| {
        // An effect over runs that used the enhancer in several ways belongs to none of them.
        let is_used_in_one_way = rows.iter().filter(|other| other.enhancer == row.enhancer).count() == 1;
        let effects = if is_used_in_one_way { effects } else { &[] };
        help_for_time(&row.enhancer, effects, &row.latency)
    };
    let builder = TableBuilder::new("enhancer_use", rows).page(ENHANCERS, "How each enhancer was used").column(
        Text,
        name,
        |row| row.name.clone(),
    );
    let builder = if rows.iter().any(|row| help(row).is_some()) {
        builder.column(Text, "page help for its time", |row| help(row))
    } else {
        builder
    };
    Some(builder.column(Text, how, |row| row.how.clone()).column(Text, looks, |row| row.looks.clone()).build())
}

/// The effects of all enhancers over all families: the means over levels, and the levels that no mean includes. A mean
/// is left out if no level of it can have a verdict.
pub fn enhancer_effects<'f>(findings: &'f Findings<'_>) -> Vec<&'f PooledFinding> {
    let is_effect = |finding: &&PooledFinding| finding.kind == PooledKind::Enhancer && finding.family.is_none();
    let levels: Vec<&PooledFinding> = findings.pooled.iter().filter(is_effect).collect();
    let is_in = |level: &PooledFinding, mean: &PooledFinding| {
        mean.enhancer == level.enhancer && mean.variant == level.variant && mean.mean_over.contains(&level.level)
    };
    let is_possible = |level: &PooledFinding| level.claim() != Claim::Impossible;
    let means = findings.averaged.iter().filter(is_effect);
    let means: Vec<&PooledFinding> =
        means.filter(|mean| levels.iter().any(|level| is_in(level, mean) && is_possible(level))).collect();
    let others = levels.iter().copied().filter(|level| !means.iter().any(|mean| is_in(level, mean)));
    means.iter().copied().chain(others).collect()
}

/// The effects of an enhancer and the median time that it takes, as `38 ms an image: +4.1 points on average at L4–L5
/// with noise (0.11 points per ms); no help found at L1–L3 with noise`. `None` without effects and times.
///
/// Points per millisecond are given for detected help alone. Of several times, the longest counts.
pub fn help_for_time(enhancer: &str, effects: &[&PooledFinding], latency: &[EnhancerLatency]) -> Option<String> {
    let medians = || latency.iter().map(|latency| latency.median_ms);
    let longest = medians().max_by(f64::total_cmp);
    let time = medians().min_by(f64::total_cmp).zip(longest).map(|(shortest, longest)| {
        let preparation = if latency.iter().any(|latency| latency.with_preparation) { " with preparation" } else { "" };
        match [shortest, longest].map(milliseconds) {
            [one, other] if one == other => format!("{one} ms an image{preparation}"),
            [one, other] => format!("{one}–{other} ms an image{preparation}"),
        }
    });
    let own: Vec<&PooledFinding> = effects
        .iter()
        .copied()
        .filter(|effect| effect.enhancer.as_ref().is_some_and(|name| name.as_str() == enhancer))
        .collect();
    let mut parts: Vec<HelpPart<'_>> = Vec::new();
    for effect in &own {
        let (words, ratio) = effect_words(effect, longest);
        match parts.iter_mut().find(|part| part.words == words && part.ratio == ratio) {
            Some(part) => part.add(effect),
            None => parts.push(HelpPart { words, ratio, places: vec![(&effect.variant, levels(effect))] }),
        }
    }
    let parts: Vec<String> = parts.iter().map(|part| part.text(&own)).collect();
    match (time, parts.is_empty()) {
        (None, true) => None,
        (time, true) => time,
        (None, false) => Some(parts.join("; ")),
        (Some(time), false) => Some(format!("{time}: {}", parts.join("; "))),
    }
}

/// Equal effects at several places.
struct HelpPart<'f> {
    words: String,
    /// Points per millisecond, in brackets; empty without detected help.
    ratio: String,
    /// Levels by variant.
    places: Vec<(&'f Variant, Vec<AxisLevel>)>,
}

impl<'f> HelpPart<'f> {
    fn add(&mut self, effect: &'f PooledFinding) {
        match self.places.iter_mut().find(|(variant, _)| **variant == effect.variant) {
            Some((_, known)) => known.extend(levels(effect)),
            None => self.places.push((&effect.variant, levels(effect))),
        }
    }

    /// The effect with its levels, as parts of those of `all` effects.
    fn text(&self, all: &[&PooledFinding]) -> String {
        let places = self.places.iter().map(|(variant, own)| {
            let of_variant = all.iter().filter(|effect| effect.variant == **variant);
            let all: BTreeSet<AxisLevel> = of_variant.flat_map(|effect| levels(effect)).collect();
            let own: BTreeSet<AxisLevel> = own.iter().copied().collect();
            let [own, all] = [own, all].map(|levels| levels.into_iter().collect::<Vec<_>>());
            format!("{} {}", level_runs(&own, &all), light(variant, None))
        });
        format!("{} at {}{}", self.words, places.collect::<Vec<String>>().join(", "), self.ratio)
    }
}

/// The level of an effect, or all levels of a mean.
fn levels(effect: &PooledFinding) -> Vec<AxisLevel> {
    if effect.mean_over.is_empty() { vec![effect.level] } else { effect.mean_over.clone() }
}

/// The words for an effect, and its points per millisecond; `ms` is the time of an image.
fn effect_words(effect: &PooledFinding, ms: Option<f64>) -> (String, String) {
    let difference = effect.strict.tested.difference;
    let whose = if matches!(&*effect.models, [one] if is_observer(one)) { " of the observer" } else { "" };
    let average = if effect.mean_over.is_empty() { "" } else { " on average" };
    let size = format!("{} points{whose}{average}", points(difference.value));
    match effect.verdict() {
        Some(Verdict::Better) => {
            let ratio = ms.filter(|ms| *ms > 0.0).map(|ms| 100.0 * difference.value / ms);
            (size, ratio.map_or_else(String::new, |ratio| format!(" ({} points per ms)", significant(ratio))))
        }
        Some(Verdict::Worse) => (size, String::new()),
        Some(Verdict::NotShown) | None if difference.low > 0.0 => ("help not confirmed".to_owned(), String::new()),
        Some(Verdict::NotShown) | None => ("no help found".to_owned(), String::new()),
        Some(_) => ("no verdict possible".to_owned(), String::new()),
    }
}

/// A positive number with two significant digits at least: `0.0011`, `0.11`, `4.2`, `38`.
fn significant(value: f64) -> String {
    let decimals = (1.0 - value.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sentences::tests::finding;

    fn took(width: usize, median_ms: f64) -> EnhancerLatency {
        EnhancerLatency {
            width,
            height: 480,
            images: 20,
            median_ms,
            within_95_ms: 2.0 * median_ms,
            with_preparation: false,
            threads: 2,
            machine: "x86_64".to_owned(),
        }
    }

    #[test]
    fn only_detected_help_has_a_price() {
        let effect = |level, difference, verdict| finding(PooledKind::Enhancer, level, difference, verdict);
        let effects = [
            effect(1, 0.01, Verdict::NotShown),
            effect(2, 0.05, Verdict::NotShown),
            effect(3, -0.07, Verdict::Worse),
            effect(4, 0.041, Verdict::Better),
            effect(5, -0.01, Verdict::NotShown),
        ];
        let effects: Vec<&PooledFinding> = effects.iter().collect();
        let help = |latency: &[EnhancerLatency]| help_for_time("lift", &effects, latency).unwrap();
        insta::assert_snapshot!(help(&[took(640, 38.2)]), @"38 ms an image: no help found at L1, L5 with noise; help not confirmed at L2 with noise; −7.0 points at L3 with noise; +4.1 points at L4 with noise (0.11 points per ms)");
        insta::assert_snapshot!(help(&[took(640, 38.2), took(64, 0.5)]), @"0.50–38 ms an image: no help found at L1, L5 with noise; help not confirmed at L2 with noise; −7.0 points at L3 with noise; +4.1 points at L4 with noise (0.11 points per ms)");
        insta::assert_snapshot!(help(&[]), @"no help found at L1, L5 with noise; help not confirmed at L2 with noise; −7.0 points at L3 with noise; +4.1 points at L4 with noise");
        assert_eq!(help_for_time("other", &effects, &[took(64, 0.5)]).as_deref(), Some("0.50 ms an image"));
        assert_eq!(help_for_time("other", &effects, &[]), None);
    }

    #[test]
    fn times_are_on_the_page_alone() {
        let row = |name: &str| EnhancerRow {
            name: name.to_owned(),
            enhancer: "lift".to_owned(),
            how: String::new(),
            looks: String::new(),
            latency: vec![took(640, 38.2)],
        };
        let effect = finding(PooledKind::Enhancer, 4, 0.041, Verdict::Better);
        let texts = |rows: &[EnhancerRow]| {
            let table = enhancers(rows, &[&effect]).unwrap();
            let place =
                table.columns.iter().position(|column| column.heads.page.as_deref() == Some("help for its time"));
            assert!(table.columns[place.unwrap()].heads.csv.is_empty());
            table.rows.iter().map(|row| row.cells[place.unwrap()].clone()).collect::<Vec<_>>()
        };
        assert_eq!(texts(&[row("lift")]), ["38 ms an image: +4.1 points at L4 with noise (0.11 points per ms)".into()]);
        // Two ways of use share the effect.
        assert_eq!(texts(&[row("lift in a"), row("lift in b")]), ["38 ms an image".into(), "38 ms an image".into()]);
    }
}
