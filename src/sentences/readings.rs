//! The sentence about light readings: how many findings hold under all of them.

use super::sentence::{Numbers, Sentence, Tone};
use darkqa_score::by_reading::{FindingByReading, NoiseHypothesis, Robustness};
use darkqa_score::cluster::ClusterUnit;

/// How many findings about noise hold under which readings; `None` with one reading. The levels of one finding count once.
pub(super) fn readings(found: &[FindingByReading], unit: ClusterUnit) -> Option<Sentence> {
    let readings = found.first()?.effects.len();
    let whole = found.iter();
    let whole = whole.filter(|one| !matches!(one.claim, NoiseHypothesis::NoiseCompounds(Some(_))));
    let whole: Vec<&FindingByReading> = whole.collect();
    let of = |robustness: Robustness| {
        let mut findings = whole.iter();
        findings
            .by_ref()
            .filter(|one| one.robustness == robustness)
            .count()
    };
    let [all, some, reversed, none, open] = [
        Robustness::All,
        Robustness::Some,
        Robustness::Reversed,
        Robustness::None,
        Robustness::Open,
    ]
    .map(of);
    let mut numbers = Numbers::of(unit);
    let text = format!(
        "Of {} findings about noise, {} under all {} noise profiles, {} under some, {} under none; {} reversed between profiles, {} open.",
        numbers.count("findings", whole.len()),
        verb(&numbers.count("all", all), "holds", "hold"),
        numbers.count("readings", readings),
        numbers.count("some", some),
        numbers.count("none", none),
        verb(&numbers.count("reversed", reversed), "is", "are"),
        verb(&numbers.count("open", open), "is", "are"),
    );
    let detail = "corrected over all claims, models and profiles; under none: the opposite is detected under a profile; the table by reading names them";
    Some(numbers.sentence("readings", Tone::Note, text, detail.to_owned()))
}

fn verb(count: &str, one: &str, several: &str) -> String {
    let verb = if count == "1" { one } else { several };
    format!("{count} {verb}")
}
