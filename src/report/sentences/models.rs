//! Sentences about single models and families: the best model in the dark, and a family that loses more than another.

use super::lights::Topic;
use super::sample::listed;
use super::sentence::{Numbers, Sentence, Tone, capitalised, level_runs};
use crate::report::text::words::family;
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, Family, Variant};
use darkqa_score::comparisons::{BestInTheDark, Claim, Crossing, LevelLead, PooledKind};
use darkqa_score::estimate::largest;
use darkqa_score::findings::Findings;
use darkqa_score::significance::Significance;

/// The model with the highest mean accuracy in the dark, and the models that it was not detected to be better than; or
/// all models that share that accuracy. If another model is detected to be better at some level and the leader at
/// another, the sentence reports these levels instead. The leader “sees” only if it is detected to be above its own
/// replies without images, or above chance.
pub(super) fn best(findings: &Findings<'_>) -> Option<Sentence> {
    let best = findings.best.as_ref().filter(|best| best.is_possible())?;
    let lenient = findings.lenient_best.as_ref()?;
    let (leader, second) = (best.leader(), best.models.get(1)?);
    let mut numbers = Numbers::new(findings.unit);
    let over = dark_levels(best);
    let axis = best.variant.kind.map_or(Axis::LIGHT, Kind::axis);
    let place = axis.place;
    let leaders = leaders(best);
    let crossing = DetectedCrossing::new(best, lenient);
    let is_best = findings.detected_best().is_some();
    let blind = if best.gain.is_against_blind { "its own replies without images" } else { "chance" };
    let (tone, text) = if let Some(crossing) = &crossing {
        (Tone::Note, crossing.text())
    } else if is_best && best.gain.is_detected() && lenient.gain.is_detected() {
        let text = format!("{} sees best {place} ({over}).", leader.model);
        (Tone::Better, text)
    } else if is_best {
        let text = format!(
            "{} has the highest mean accuracy {place} ({over}), but was not detected to be above {blind}.",
            leader.model
        );
        (Tone::Note, text)
    } else if leaders.len() > 1 {
        let models = listed(&leaders);
        let text = format!("{models} share the highest mean accuracy {place} ({over}).");
        (Tone::NotShown, text)
    } else {
        let others = match &best.not_shown_better_than[..] {
            [] => "the others".to_owned(),
            others => others.join(", "),
        };
        let text = format!(
            "{} has the highest mean accuracy {place} ({over}), but was not detected to be better than {others}.",
            leader.model
        );
        (Tone::NotShown, text)
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
        let difference = numbers.difference("", pair.difference);
        let p = numbers.p("p", best.p_report.unwrap_or(pair.holm));
        let parsing = if best.is_detected() && !is_best { ", detected in the strict parsing alone" } else { "" };
        let gain = if is_best {
            let gain = numbers.difference("_gain", best.gain.difference);
            let p = numbers.p("p_gain", best.gain.p_report.unwrap_or(best.gain.p));
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
                let is_same_direction = one.lead.value * other.lead.value > 0.0;
                one.is_detected() && other.is_detected() && is_same_direction
            })
            .map(|(level, _)| level);
        let (light, dark): (Vec<_>, Vec<_>) = detected.partition(|level| level.lead.value > 0.0);
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
    fn detail(&self, numbers: &mut Numbers) -> String {
        let ends = [(&self.light, "_before"), (&self.dark, "_after")];
        let mut p = 0.0_f64;
        let differences: Vec<String> = ends
            .into_iter()
            .filter_map(|(levels, name)| {
                let largest = largest(levels, |one| one.lead)?;
                p = p.max(largest.p_report.unwrap_or(largest.p));
                let lead = numbers.difference(name, largest.lead);
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
pub(crate) fn dark_levels(best: &BestInTheDark) -> String {
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
    let (of_most, of_least) = (most.strict.difference, least.strict.difference);
    if whole.claim() != Claim::Detected(Significance::Worse) || of_most.value >= 0.0 {
        return None;
    }
    let mut numbers = Numbers::new(findings.unit);
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
    let p = numbers.p("p", test.p_report.unwrap_or(test.p));
    let pairs = numbers.count("pairs", contrast.pairs);
    let [of_most, of_least] =
        [("_most", of_most), ("_least", of_least)].map(|(at, difference)| numbers.difference(at, difference));
    let sample = [("n_most", most), ("n_least", least)].map(|(name, finding)| numbers.count(name, finding.items));
    let of_pairs = if contrast.pairs == 1 { "the only pair".to_owned() } else { format!("one of {pairs} pairs") };
    let detail = format!(
        "{of_most}, n = {}, against {of_least}, n = {}: difference {difference}, {p}; {of_pairs} of families",
        sample[0], sample[1]
    );
    Some(numbers.sentence("families", Tone::Note, text, detail))
}
