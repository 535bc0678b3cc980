//! Sentences that compare new runs with an old run, the baseline.

use super::sentence::{EffectDirection, NamedNumbers, Sentence};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::paired::POWER;
use darkqa_score::comparisons::{BaselineRow, MIN_PAIRS};
use darkqa_score::estimate::largest;
use darkqa_score::model_in_condition::models_under_test;
use darkqa_score::significance::Verdict;

/// Maximum number of conditions that a sentence names.
const MAX_NAMED: usize = 3;

/// The detected differences of each model from the run `old`; a single sentence if no difference is detected. `random`
/// and the observer are left out if other models exist.
pub fn against_baseline(rows: &[BaselineRow], old: &str, unit: ClusterUnit) -> Vec<Sentence> {
    let judged = models_under_test(rows.iter().map(|row| &*row.subject.model));
    let rows: Vec<&BaselineRow> = rows.iter().filter(|row| judged.contains(&*row.subject.model)).collect();
    let mut sentences = Vec::new();
    for model_rows in rows.chunk_by(|one, other| one.subject.model == other.subject.model) {
        for verdict in [Verdict::Worse, Verdict::Better] {
            let detected: Vec<&BaselineRow> =
                model_rows.iter().copied().filter(|row| row.paired.tested.verdict == verdict).collect();
            sentences.extend(detected_difference(&detected, old, unit));
        }
    }
    if sentences.is_empty() {
        sentences.push(no_difference(&rows, old, unit));
    }
    sentences
}

/// The reason why no verdict about these rows is possible.
pub fn no_verdict(rows: &[&BaselineRow], unit: ClusterUnit) -> String {
    too_few(rows, &mut NamedNumbers::new(unit))
}

/// The reason why no verdict is possible: missing replies, too few shared questions, or too few clusters for a small
/// p-value.
fn too_few(rows: &[&BaselineRow], numbers: &mut NamedNumbers) -> String {
    let shared = rows.iter().map(|row| row.paired.tested.difference.n).max().unwrap_or(0);
    let most_missing = rows
        .iter()
        .filter(|row| {
            row.paired.tested.verdict == Verdict::Missing || row.paired.missing > row.paired.tested.difference.n
        })
        .max_by_key(|row| row.paired.missing);
    if let Some(row) = most_missing {
        format!(
            "at {} {} of {} questions lack a reply in one of the runs, and their replies decide",
            row.subject.condition(),
            numbers.count("missing", row.paired.missing),
            numbers.count("asked", row.paired.missing + row.paired.tested.difference.n)
        )
    } else if shared < MIN_PAIRS {
        format!(
            "no condition shares more than {}, and {} are needed",
            numbers.count("n", shared) + if shared == 1 { " question" } else { " questions" },
            numbers.count("needed", MIN_PAIRS)
        )
    } else {
        let clusters = rows.iter().map(|row| row.paired.clusters).max();
        format!(
            "with {} and this number of conditions, no corrected p-value can be small enough",
            numbers.clusters(clusters.unwrap_or(0))
        )
    }
}

/// The sentence about the conditions of a model that share a verdict; `None` without conditions.
fn detected_difference(rows: &[&BaselineRow], old: &str, unit: ClusterUnit) -> Option<Sentence> {
    let largest = largest(rows, |row| row.paired.tested.difference)?;
    let mut numbers = NamedNumbers::new(unit);
    let verdict = largest.paired.tested.verdict;
    let word = if verdict == Verdict::Worse { "worse" } else { "better" };
    let up_to = if rows.len() > 1 { "up to " } else { "" };
    let text = format!(
        "{} is {word} than in {old} at {}, by {up_to}{} points.",
        largest.subject.model,
        conditions(rows, &mut numbers),
        numbers.size("effect", largest.paired.tested.difference.value)
    );
    let detail = detail(largest, &mut numbers) + &detectable(rows, &mut numbers);
    Some(numbers.sentence("baseline", verdict.into(), text, detail))
}

/// The sentence if no difference is detected, with the largest difference; or if no verdict or no comparison is
/// possible.
fn no_difference(rows: &[&BaselineRow], old: &str, unit: ClusterUnit) -> Sentence {
    let mut numbers = NamedNumbers::new(unit);
    if rows.is_empty() {
        let text = format!("Nothing can be compared with {old}.");
        let detail = "no model answered the same question about the same image in both".to_owned();
        return numbers.sentence("baseline", EffectDirection::Note, text, detail);
    }
    let possible: Vec<&BaselineRow> =
        rows.iter().copied().filter(|row| row.paired.tested.verdict.is_decided()).collect();
    let Some(largest) = largest(&possible, |row| row.paired.tested.difference) else {
        let text = format!("No verdict against {old} is possible.");
        let detail = too_few(rows, &mut numbers);
        return numbers.sentence("baseline", EffectDirection::Note, text, detail);
    };
    let text = format!("It is not shown that any model is worse or better than in {old}.");
    let compared = numbers.count("conditions", possible.len());
    let noun = if possible.len() == 1 { "row" } else { "rows" };
    let without = match rows.len() - possible.len() {
        0 => String::new(),
        more => format!(" ({} more without a verdict)", numbers.count("without", more)),
    };
    let detail = format!(
        "{compared} {noun} of model and condition compared{without}; largest: {} at {}, {}{}",
        largest.subject.model,
        largest.subject.condition(),
        detail(largest, &mut numbers),
        detectable(&possible, &mut numbers)
    );
    numbers.sentence("baseline", EffectDirection::NotShown, text, detail)
}

/// The losses that the tests detect with a power of 80 %: in the most sensitive row, and in all rows.
fn detectable(rows: &[&BaselineRow], numbers: &mut NamedNumbers) -> String {
    let losses = rows.iter().map(|row| row.detectable.min(1.0));
    let least = losses.clone().fold(1.0, f64::min);
    let most = losses.fold(0.0, f64::max);
    let power = numbers.number("power", 100.0 * POWER, 0);
    let [least, most] =
        [("detectable", least), ("detectable_everywhere", most)].map(|(name, loss)| numbers.percent(name, loss));
    let range =
        if least == most { format!("{least} points") } else { format!("{least} points somewhere, {most} everywhere") };
    format!("; a true loss is detected with {power} % probability from {range}")
}

/// The names of the first conditions, and the number of further ones.
fn conditions(rows: &[&BaselineRow], numbers: &mut NamedNumbers) -> String {
    let names: Vec<String> = rows.iter().take(MAX_NAMED).map(|row| row.subject.condition()).collect();
    let names = names.join(", ");
    match rows.len().saturating_sub(MAX_NAMED) {
        0 => names,
        more => format!("{names} and {} more", numbers.count("more", more)),
    }
}

/// Effect, interval, p and n of a row.
fn detail(row: &BaselineRow, numbers: &mut NamedNumbers) -> String {
    let difference = numbers.difference("", row.paired.tested.difference);
    let p = numbers.p("p", row.paired.tested.holm);
    let items = numbers.count("n", row.paired.tested.difference.n);
    let clusters = numbers.clusters(row.paired.clusters);
    format!("{difference}, {p}; n = {items} in {clusters}")
}
