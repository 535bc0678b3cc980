//! Sentences about single models and families: the best model in the dark, and a family that loses more than another.
//!
//! Sentences about subjects that are excluded from the means about darkness: people, and models that answered fewer
//! questions than others.

use std::collections::BTreeSet;

use super::darkness::Topic;
use super::sample::{listed, topic_in_light};
use super::sentence::{EffectDirection, NamedNumbers, Sentence, capitalised, level_runs};
use crate::text::words::{family, light};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, Family, UnreadReason, Variant, View};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{BestInTheDark, Claim, Crossing, LevelLead, PooledKind, pool};
use darkqa_score::estimate::{Estimate, largest};
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{ModelInCondition, is_reference};
use darkqa_score::significance::Verdict;

/// The model with the highest mean accuracy in the dark, and the models that it was not detected to be better than; or
/// all models that share that accuracy. If another model is detected to be better at some level and the leader at
/// another, the sentence reports these levels instead. The leader “sees” only if it is detected to be above its own
/// replies without images, or above chance.
pub(super) fn best(findings: &Findings<'_>) -> Option<Sentence> {
    let best = findings.best.as_ref().filter(|best| best.is_possible())?;
    let lenient = findings.lenient_best.as_ref()?;
    let (leader, second) = (best.leader(), best.models.get(1)?);
    let mut numbers = NamedNumbers::new(findings.unit);
    let over = dark_levels(best);
    let axis = best.variant.kind.map_or(Axis::LIGHT, Kind::axis);
    let place = axis.place;
    let leaders = leaders(best);
    let crossing = DetectedCrossing::new(best, lenient);
    let is_best = findings.detected_best().is_some();
    let blind = if best.gain.is_against_blind { "its own replies without images" } else { "chance" };
    let (tone, text) = if let Some(crossing) = &crossing {
        (EffectDirection::Note, crossing.text())
    } else if is_best && best.gain.tested.is_detected() && lenient.gain.tested.is_detected() {
        let text = format!("{} sees best {place} ({over}).", leader.model);
        (EffectDirection::Better, text)
    } else if is_best {
        let text = format!(
            "{} has the highest mean accuracy {place} ({over}), but was not detected to be above {blind}.",
            leader.model
        );
        (EffectDirection::Note, text)
    } else if leaders.len() > 1 {
        let models = listed(&leaders);
        let text = format!("{models} share the highest mean accuracy {place} ({over}).");
        (EffectDirection::NotShown, text)
    } else {
        let others = match &best.not_shown_better_than[..] {
            [] => "the others".to_owned(),
            others => others.join(", "),
        };
        let text = format!(
            "{} has the highest mean accuracy {place} ({over}), but was not detected to be better than {others}.",
            leader.model
        );
        (EffectDirection::NotShown, text)
    };
    let value = numbers.percent("mean", leader.mean.value);
    let ends = numbers.share_ends("mean_", leader.mean);
    let loss = leader.loss.map_or_else(String::new, |loss| {
        let loss = numbers.difference("_from_L0", loss);
        format!(", {loss} points from L0")
    });
    let test = if let Some(crossing) = &crossing {
        crossing.detail(&mut numbers)
    } else {
        let pair = best.pairs.iter().find(|pair| pair.first == leader.model && pair.second == second.model)?;
        let difference = numbers.difference("", pair.tested.difference);
        let p = numbers.p("p", best.p_report.unwrap_or(pair.tested.holm));
        let parsing = if best.is_detected() && !is_best { ", detected in the strict parsing alone" } else { "" };
        let gain = if is_best {
            let gain = numbers.difference("_gain", best.gain.tested.difference);
            let p = numbers.p("p_gain", best.gain.tested.stated_p());
            format!("; {gain} against {blind}, {p}")
        } else {
            String::new()
        };
        format!("{difference} against {}, {p}{parsing}{gain}", second.model)
    };
    let items = numbers.count("n", best.items);
    let clusters = numbers.clusters(best.clusters);
    let without = match &best.without[..] {
        [] => String::new(),
        models => format!("; without {}, which answered less", models.join(", ")),
    };
    let detail =
        format!("{} over {over}: {value} % [{ends}]{loss}; {test}; n = {items} in {clusters}{without}", leader.model);
    let sentence = numbers.sentence("best", tone, text, detail);
    let topics = Topic::all(findings);
    Some(match topics.first() {
        Some(main) => main.add_light(&best.variant, sentence),
        None => sentence,
    })
}

/// The models with the highest mean accuracy in the dark: the leader, and those with the same accuracy.
fn leaders(best: &BestInTheDark) -> Vec<String> {
    let highest = best.leader().mean.value;
    best.models.iter().filter(|other| highest - other.mean.value < ROUNDING).map(|other| other.model.clone()).collect()
}

/// Maximum rounding error of equal means (chosen).
const ROUNDING: f64 = 1e-9;

/// Two models, each detected to be better than the other at some levels.
struct DetectedCrossing<'b> {
    crossing: &'b Crossing,
    /// Levels at which the leader in the light is better.
    light: Vec<&'b LevelLead>,
    /// Levels at which the leader in the dark is better.
    dark: Vec<&'b LevelLead>,
}

impl<'b> DetectedCrossing<'b> {
    /// The levels that are detected in both parsings with the same direction; `None` unless both models are better at
    /// some level.
    fn new(strict: &'b BestInTheDark, lenient: &BestInTheDark) -> Option<Self> {
        let (crossing, other) = (strict.crossing.as_ref()?, lenient.crossing.as_ref()?);
        if (&crossing.light, &crossing.dark) != (&other.light, &other.dark) {
            return None;
        }
        let detected = crossing
            .levels
            .iter()
            .zip(&other.levels)
            .filter(|(one, other)| {
                let [one, other] = [one.tested, other.tested];
                let is_same_direction = one.difference.value * other.difference.value > 0.0;
                one.is_detected() && other.is_detected() && is_same_direction
            })
            .map(|(level, _)| level);
        let (light, dark): (Vec<_>, Vec<_>) = detected.partition(|level| level.tested.difference.value > 0.0);
        (!light.is_empty() && !dark.is_empty()).then_some(Self { crossing, light, dark })
    }

    fn text(&self) -> String {
        let all: Vec<AxisLevel> = self.crossing.levels.iter().map(|one| one.level).collect();
        let [light, dark] =
            [&self.light, &self.dark].map(|levels| levels.iter().map(|one| one.level).collect::<Vec<_>>());
        let rest: Vec<AxisLevel> =
            all.iter().copied().filter(|level| !light.contains(level) && !dark.contains(level)).collect();
        let [light, dark, rest] = [light, dark, rest].map(|levels| level_runs(&levels, &all));
        let not_told_apart = if rest.is_empty() { String::new() } else { format!("; not told apart at {rest}") };
        let (first, second) = (&self.crossing.light, &self.crossing.dark);
        format!("{first} is better at {light}, {second} at {dark}{not_told_apart}.")
    }

    /// The largest difference in each direction, and the larger p-value of the two.
    fn detail(&self, numbers: &mut NamedNumbers) -> String {
        let ends = [(&self.light, "_before"), (&self.dark, "_after")];
        let mut p = 0.0_f64;
        let differences: Vec<String> = ends
            .into_iter()
            .filter_map(|(levels, name)| {
                let largest = largest(levels, |one| one.tested.difference)?;
                p = p.max(largest.tested.stated_p());
                let lead = numbers.difference(name, largest.tested.difference);
                Some(format!("{lead} at {}", largest.level))
            })
            .collect();
        format!(
            "{} less {}: {}, {}",
            self.crossing.light,
            self.crossing.dark,
            differences.join(", "),
            numbers.p("p", p)
        )
    }
}

/// The dark levels over which models are compared, as `L3–L5`.
pub fn dark_levels(best: &BestInTheDark) -> String {
    level_runs(&best.levels, &best.asked)
}

/// Two families of which one is detected to lose more than the other at the darkest level, if a loss over all families
/// is detected there.
pub(super) fn families(findings: &Findings<'_>, variant: &Variant) -> Option<Sentence> {
    let contrast = findings.contrasts.iter().find(|found| found.variant == *variant && found.is_detected())?;
    let at_darkest = |family: Option<&Family>| {
        findings.pooled.iter().find(|finding| {
            finding.kind == PooledKind::Darkness
                && finding.family.as_ref() == family
                && finding.variant == *variant
                && finding.level == contrast.level
        })
    };
    let whole = at_darkest(None)?;
    let (most, least) = (at_darkest(Some(&contrast.most))?, at_darkest(Some(&contrast.least))?);
    let (of_most, of_least) = (most.strict.tested.difference, least.strict.tested.difference);
    if whole.claim() != Claim::Detected(Verdict::Worse) || of_most.value >= 0.0 {
        return None;
    }
    let mut numbers = NamedNumbers::new(findings.unit);
    let text = format!(
        "{} costs more in {} ({} points at {}) than in {} ({}).",
        capitalised(contrast.level.axis().unwrap_or(Axis::LIGHT).cause),
        family(Some(&contrast.most)),
        numbers.points("effect_most", of_most.value),
        contrast.level,
        family(Some(&contrast.least)),
        numbers.points("effect_least", of_least.value)
    );
    let test = contrast.strict;
    let difference = numbers.difference("", test.difference);
    let p = numbers.p("p", test.stated_p());
    let pairs = numbers.count("pairs", contrast.pairs);
    let [of_most, of_least] =
        [("_most", of_most), ("_least", of_least)].map(|(at, difference)| numbers.difference(at, difference));
    let sample = [("n_most", most), ("n_least", least)].map(|(name, finding)| numbers.count(name, finding.items));
    let of_pairs = if contrast.pairs == 1 { "the only pair".to_owned() } else { format!("one of {pairs} pairs") };
    let detail = format!(
        "{of_most}, n = {}, against {of_least}, n = {}: difference {difference}, {p}; {of_pairs} of families",
        sample[0], sample[1]
    );
    Some(numbers.sentence("families", EffectDirection::Note, text, detail))
}

/// One sentence for each person, and for each model excluded from the mean cost of darkness in a light: its accuracy at
/// L0 and at the darkest level, and the mean accuracy of the other models on the same questions.
pub(super) fn apart(findings: &Findings<'_>) -> Vec<Sentence> {
    let topics = Topic::all(findings);
    let mut names: Vec<&str> = findings
        .grid
        .subjects
        .iter()
        .filter(|subject| subject.view == Some(View::Image))
        .map(|subject| &*subject.model)
        .collect();
    names.dedup();
    names
        .into_iter()
        .filter_map(|name| {
            topics
                .iter()
                .flat_map(|topic| &topic.lights)
                .filter(|variant| is_excluded(findings, name, variant))
                .find_map(|variant| sentence(findings, name, variant))
        })
        .collect()
}

/// True for people, and for models that the mean cost of darkness with a variant leaves out.
fn is_excluded(findings: &Findings<'_>, name: &str, variant: &Variant) -> bool {
    findings.grid.listing.is_people(name)
        || findings.left_out.iter().any(|set| {
            set.kind == PooledKind::Darkness
                && set.variant == *variant
                && !set.is_more
                && set.models.iter().any(|model| model == name)
        })
}

/// Models that the mean cost of darkness with a variant includes.
fn models_in_mean<'f>(findings: &'f Findings<'_>, variant: &Variant) -> Vec<&'f str> {
    pool(&findings.grid)
        .into_iter()
        .filter(|model| !is_excluded(findings, model, variant) && !is_reference(model))
        .collect()
}

/// Accuracies of a subject and of other models on the same questions, at one level.
struct SameQuestionAccuracy {
    level: AxisLevel,
    /// Accuracy of the subject.
    own: Estimate,
    /// Mean accuracy of the other models that answered any of the questions; `None` if none did.
    others: Option<f64>,
    /// Number of the subject's "cannot tell" replies.
    cannot_tell: usize,
    /// Number of the subject's missing replies, with its accuracy if all of them were wrong, and if all were right;
    /// `None` without any.
    missing: Option<(usize, [f64; 2])>,
}

impl SameQuestionAccuracy {
    fn new(findings: &Findings<'_>, name: &str, others: &[&str], level: AxisLevel, variant: &Variant) -> Option<Self> {
        let grid = &findings.grid;
        let find = |model: &str| grid.find_up_to_group(&ModelInCondition::with_images(model, level, variant, None));
        let subject = find(name)?;
        let cell = findings.summary.cell(&grid.subjects[subject], None, ParsingMode::Strict)?;
        let answered: Vec<usize> =
            (0..grid.items.len()).filter(|item| grid.result(subject, *item).is_reply()).collect();
        let other_accuracies: Vec<f64> =
            others.iter().filter_map(|model| accuracy(grid, find(model)?, &answered)).collect();
        let cannot_tell = answered
            .iter()
            .filter_map(|item| grid.trial(subject, *item)?.strict()?.why)
            .filter(|why| *why == UnreadReason::CannotTell)
            .count();
        Some(Self {
            level,
            own: cell.accuracy?,
            others: (!other_accuracies.is_empty())
                .then(|| other_accuracies.iter().sum::<f64>() / other_accuracies.len() as f64),
            cannot_tell,
            missing: cell.bounds().map(|bounds| (cell.failed, bounds)),
        })
    }
}

/// Share of right replies of a subject to the questions of `items`; `None` without a reply. Several items may share a
/// question, for instance one item for each person, so items are matched by question.
fn accuracy(grid: &Grid<'_>, subject: usize, items: &[usize]) -> Option<f64> {
    let asked: BTreeSet<_> = items.iter().map(|item| &grid.items[*item].asked.question).collect();
    let (mut right, mut replies) = (0, 0);
    for (index, item) in grid.items.iter().enumerate() {
        let reading = grid.result(subject, index).parsed(ParsingMode::Strict);
        if let (Some(chosen), true) = (reading, asked.contains(&item.asked.question)) {
            replies += 1;
            right += usize::from(item.is_right(chosen));
        }
    }
    (replies > 0).then(|| right as f64 / replies as f64)
}

/// Sentence about a subject at L0 and at the darkest level of a variant; `None` if it answered at neither, or without
/// other models.
fn sentence(findings: &Findings<'_>, name: &str, variant: &Variant) -> Option<Sentence> {
    let grid = &findings.grid;
    let others = models_in_mean(findings, variant);
    if others.is_empty() {
        return None;
    }
    let darkest = grid
        .subjects
        .iter()
        .filter(|subject| subject.model == name && subject.variant == *variant && subject.enhancer.is_none())
        .filter_map(|subject| subject.level)
        .max();
    let accuracies: Vec<SameQuestionAccuracy> = [Some(AxisLevel::L0), darkest]
        .into_iter()
        .flatten()
        .filter_map(|level| SameQuestionAccuracy::new(findings, name, &others, level, variant))
        .collect();
    if accuracies.is_empty() {
        return None;
    }
    let mut numbers = NamedNumbers::new(findings.unit);
    let (mut own_shares, mut other_shares, mut details) = (Vec::new(), Vec::new(), Vec::new());
    for accuracy in &accuracies {
        let level = accuracy.level;
        let percent = numbers.percent(&format!("{level}"), accuracy.own.value);
        let missing = accuracy.missing.map_or_else(String::new, |(count, bounds)| {
            let low = numbers.percent(&format!("if wrong {level}"), bounds[0]);
            let high = numbers.percent(&format!("if right {level}"), bounds[1]);
            let count = numbers.count(&format!("missing {level}"), count);
            format!(" of its replies ({low} to {high} % with the {count} missing ones)")
        });
        own_shares.push(format!("{percent} %{missing} at {level}"));
        if let Some(others) = accuracy.others {
            let percent = numbers.percent(&format!("others {level}"), others);
            other_shares.push(format!("{percent} %"));
        }
        let low = numbers.percent(&format!("low {level}"), accuracy.own.low);
        let high = numbers.percent(&format!("high {level}"), accuracy.own.high);
        let n = numbers.count(&format!("n {level}"), accuracy.own.n);
        let cannot_tell = match accuracy.cannot_tell {
            0 => String::new(),
            count => format!(", {} “I cannot tell”", numbers.count(&format!("cannot tell {level}"), count)),
        };
        details.push(format!("{level} [{low}, {high}], n = {n}{cannot_tell}"));
    }
    let is_dark = accuracies.iter().any(|accuracy| accuracy.level != AxisLevel::L0);
    let place = if is_dark { format!("{}, ", light(variant, None)) } else { String::new() };
    let who = match &others[..] {
        [one] => (*one).to_owned(),
        several => format!("the mean of {} models", numbers.count("models", several.len())),
    };
    let comparison = match &*other_shares {
        [] => String::new(),
        shares => format!("; {who}: {} on the same questions", shares.join(" and ")),
    };
    let text = format!("{}{name}: {}{comparison}.", capitalised(&place), own_shares.join(", "));
    let details = details.join("; ");
    let detail = if grid.listing.is_people(name) {
        format!("people; {details}; in no mean")
    } else {
        let topic = topic_in_light(PooledKind::Darkness, variant, None);
        format!("{details}; in no mean about {topic}")
    };
    Some(numbers.sentence("apart", EffectDirection::Note, text, detail))
}
