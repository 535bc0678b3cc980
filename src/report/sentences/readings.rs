//! The sentence about noise profiles: how many findings hold under all of them.

use super::sentence::{Numbers, Sentence, Tone};
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{FindingByProfile, NoiseHypothesis, Robustness};

/// The numbers of findings about noise that hold under all, some or none of the noise profiles; `None` without
/// findings. Findings that are repeated by level count once.
pub(super) fn readings(found: &[FindingByProfile], unit: ClusterUnit) -> Option<Sentence> {
    let readings = found.first()?.effects.len();
    let whole: Vec<&FindingByProfile> =
        found.iter().filter(|one| !matches!(one.claim, NoiseHypothesis::NoiseCompounds(Some(_)))).collect();
    let [all, some, reversed, none, open] =
        [Robustness::All, Robustness::Some, Robustness::Reversed, Robustness::None, Robustness::Open]
            .map(|robustness| whole.iter().filter(|one| one.robustness == robustness).count());
    let mut numbers = Numbers::new(unit);
    let text = format!(
        "{} of {} findings about noise {} under all {} noise profiles.",
        numbers.count("all", all),
        numbers.count("findings", whole.len()),
        if all == 1 { "holds" } else { "hold" },
        numbers.count("readings", readings),
    );
    let detail = format!(
        "{} under some; {} with opposite effects under two; {} with the opposite effect alone; {} open; corrected over all claims, models \
         and profiles; the table by noise profile names them",
        numbers.count("some", some),
        numbers.count("reversed", reversed),
        numbers.count("none", none),
        numbers.count("open", open),
    );
    Some(numbers.sentence("readings", Tone::Note, text, detail))
}
