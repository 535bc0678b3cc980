//! Tables of the findings about noise under each noise profile. Files and code call a noise profile a "reading".

use std::collections::BTreeSet;

use crate::text::table::ColumnKind::{Count, Number, P, Text};
use crate::text::table::{ColumnHeads, Table, TableBuilder, TableCell};
use crate::text::words::{self, ends_in_points, points, reach, stops};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::text::counted;
use darkqa_base::types::{AxisLevel, ProfileName};
use darkqa_score::accuracies::Curve;
use darkqa_score::comparisons::{ClaimVerdict, EffectInProfile, FindingByProfile, NoiseHypothesis, Robustness};
use darkqa_score::findings::Findings;

/// Two tables: the file has a row for each finding and profile; the report has a row for each finding and a column for
/// each profile. Empty unless several noise profiles were tested.
pub(super) fn by_profile(findings: &Findings<'_>) -> Vec<Table> {
    let found = &findings.by_profile;
    let Some(first) = found.first() else {
        return Vec::new();
    };
    let profiles: Vec<&ProfileName> = first.effects.iter().map(|effect| &effect.profile).collect();
    vec![file_table(found), report_table(findings, &profiles)]
}

/// Table for the file.
fn file_table(found: &[FindingByProfile]) -> Table {
    let rows = found.iter().flat_map(|finding| finding.effects.iter().map(move |effect| (finding, effect)));
    TableBuilder::new("readings", rows)
        .column(Text, "csv model", |(finding, _)| subject(finding))
        .column(Text, "csv finding", |(finding, _)| finding.claim.name())
        .column(Text, "csv enhancer", |(finding, _)| finding.claim.enhancer().map(ToString::to_string))
        .column(Text, "csv family", |(finding, _)| finding.claim.family().map(ToString::to_string))
        .column(Text, "csv levels", |(finding, _)| level_names(&finding.levels, ";"))
        .column(Text, "csv blind", |(finding, _)| finding.blind.clone())
        .column(Text, "csv reading", |(_, effect)| effect.profile.to_string())
        .column(Number, "csv effect low high n", |(_, effect)| effect.effect.map(|effect| effect.difference))
        .column(P, "csv p", |(_, effect)| effect.effect.map(|effect| effect.p))
        .column(P, "csv p_holm", |(_, effect)| effect.effect.map(|effect| effect.holm))
        .column(Text, "csv verdict", |(_, effect)| effect.effect.map_or("not asked", |_| effect.verdict.word()))
        .column(Text, "csv holds", |(finding, _)| finding.robustness.word())
        .column(Count, "csv dropped", |(finding, _)| finding.dropped)
        .build()
}

/// Row of the report's table: a finding, or the thresholds of a finding's model.
enum ProfileRow<'f> {
    Finding(&'f FindingByProfile),
    Thresholds(&'f FindingByProfile, Vec<&'f Curve>),
}

impl ProfileRow<'_> {
    fn finding(&self) -> &FindingByProfile {
        match self {
            Self::Finding(finding) | Self::Thresholds(finding, _) => finding,
        }
    }
}

/// Table for the terminal and the page: the findings of each model, then its thresholds.
fn report_table(findings: &Findings<'_>, profiles: &[&ProfileName]) -> Table {
    let mut rows = Vec::new();
    let found = &findings.by_profile;
    for same_model in found.chunk_by(|a, b| (&a.model, &a.group) == (&b.model, &b.group)) {
        rows.extend(same_model.iter().map(ProfileRow::Finding));
        let curves = noise_curves(findings, &same_model[0]);
        rows.push(ProfileRow::Thresholds(&same_model[0], curves));
    }
    let mut table = TableBuilder::new("readings", &rows)
        .page("readings", "Findings by noise profile, in percentage points [95 %]")
        .column(Text, "terminal model | page model", |row| subject(row.finding()))
        .column(Text, "terminal finding | page finding", |row| match row {
            ProfileRow::Finding(finding) => title(finding),
            ProfileRow::Thresholds(..) => "the break (threshold EV)".to_owned(),
        });
    for (index, profile) in profiles.iter().enumerate() {
        let heads = ColumnHeads {
            terminal: vec![profile.to_string()],
            page: Some(profile.to_string()),
            ..ColumnHeads::default()
        };
        table = table.column(Text, heads, |row| match row {
            ProfileRow::Finding(finding) => effect(&finding.effects[index]),
            ProfileRow::Thresholds(_, curves) => threshold(curves, profile),
        });
    }
    let mut table = table
        .column(Text, "terminal holds | page holds", |row| match row {
            ProfileRow::Finding(finding) => TableCell::from(match finding.robustness {
                Robustness::Reversed => "opposite effects",
                other => other.word(),
            }),
            ProfileRow::Thresholds(..) => TableCell::Blank,
        })
        .column(Count, "page n", |row| match row {
            ProfileRow::Finding(finding) => TableCell::Count(items(finding)),
            ProfileRow::Thresholds(..) => TableCell::Blank,
        })
        .column(Text, "page in words", |row| match row {
            ProfileRow::Finding(finding) => TableCell::from(sentence(finding)),
            ProfileRow::Thresholds(..) => TableCell::Blank,
        })
        .build();
    let heading =
        "Does each finding hold under every noise profile? Effects in percentage points [95 %], on the same items";
    table.heading = Some(heading.to_owned());
    table.notes = notes(found);
    table
}

/// Curves of a finding's model with noise, without enhancement, over all families.
fn noise_curves<'f>(findings: &'f Findings<'_>, finding: &FindingByProfile) -> Vec<&'f Curve> {
    findings
        .curves
        .iter()
        .filter(|curve| {
            curve.model == finding.model
                && curve.variant.group == finding.group
                && curve.variant.kind.is_some_and(Kind::has_profiles)
                && curve.enhancer.is_none()
                && curve.family.is_none()
        })
        .collect()
}

/// Threshold with its interval under one noise profile, in words.
fn threshold(curves: &[&Curve], profile: &ProfileName) -> String {
    let Some(curve) = curves.iter().find(|curve| curve.variant.reading.as_ref() == Some(profile)) else {
        return "not asked".to_owned();
    };
    let darkest = curve.summary.darkest.value();
    curve.summary.threshold.as_ref().map_or_else(
        |_| "not known".to_owned(),
        |threshold| {
            let value = stops(threshold.value, darkest);
            format!("{value} [{}]", reach(threshold.low, threshold.high, darkest))
        },
    )
}

/// Model of a finding, with its run group.
fn subject(finding: &FindingByProfile) -> String {
    let group = finding.group.as_ref().map(ToString::to_string);
    finding.model.clone() + &group.unwrap_or_default()
}

/// Effect with its interval and its verdict for the finding, as in `+12.3 [8.1, 16.2] holds`.
fn effect(in_profile: &EffectInProfile) -> String {
    in_profile.effect.map_or_else(
        || "not asked".to_owned(),
        |effect| {
            let value = points(effect.difference.value);
            let ends = ends_in_points(effect.difference);
            format!("{value} [{ends}] {}", in_profile.verdict.word())
        },
    )
}

/// Number of items that the effects are computed on.
fn items(finding: &FindingByProfile) -> usize {
    finding.effects.iter().find_map(|effect| Some(effect.effect?.difference.n)).unwrap_or(0)
}

fn level_names(levels: &[AxisLevel], separator: &str) -> String {
    let names: Vec<String> = levels.iter().map(ToString::to_string).collect();
    names.join(separator)
}

/// Levels as `L1–L5` if all `complete` of them were tested, else one by one.
fn span(levels: &[AxisLevel], complete: usize) -> String {
    match levels {
        [first, .., last] if levels.len() == complete => format!("{first}–{last}"),
        _ => level_names(levels, ", "),
    }
}

/// Hypothesis with its levels, for the table.
fn title(finding: &FindingByProfile) -> String {
    let levels = &finding.levels;
    match &finding.claim {
        NoiseHypothesis::NoiseCompounds(None) => {
            format!("noise compounds the drop, {}: exposure drop − with noise", span(levels, 5))
        }
        NoiseHypothesis::NoiseCompounds(Some(level)) => format!("· at {level}"),
        NoiseHypothesis::DarknessCosts => "darkness costs: L5 with noise − L0".to_owned(),
        NoiseHypothesis::EnhancerHarms(name) => {
            format!("{name} harms where light is left, {}: enhanced − raw", span(levels, 3))
        }
        NoiseHypothesis::EnhancerHelps(name) => {
            format!("{name} helps in the dark, {}: enhanced − raw", span(levels, 2))
        }
        NoiseHypothesis::BelowBlind(family, level) => {
            let other = finding.blind.as_ref();
            let of = other.map(|name| format!(" of {name}")).unwrap_or_default();
            format!(
                "{} is less often right than without images{of}: {level} with noise − without images",
                words::family(Some(family))
            )
        }
    }
}

/// Hypothesis as the beginning of a sentence.
fn clause(finding: &FindingByProfile) -> String {
    let levels = &finding.levels;
    match &finding.claim {
        NoiseHypothesis::NoiseCompounds(None) => "Noise compounds the drop".to_owned(),
        NoiseHypothesis::NoiseCompounds(Some(level)) => {
            format!("Noise compounds the drop at {level}")
        }
        NoiseHypothesis::DarknessCosts => "Darkness with noise costs accuracy".to_owned(),
        NoiseHypothesis::EnhancerHarms(name) => format!("{name} harms at {}", span(levels, 3)),
        NoiseHypothesis::EnhancerHelps(name) => format!("{name} helps at {}", span(levels, 2)),
        NoiseHypothesis::BelowBlind(family, level) => {
            let family = words::family(Some(family));
            format!("{level} with noise, {family}: less often right than without images")
        }
    }
}

/// Noise profiles under which a finding has a verdict. Each but [`ClaimVerdict::Holds`] has its interval.
fn profiles_with_verdict(finding: &FindingByProfile, verdict: ClaimVerdict) -> Vec<String> {
    finding
        .effects
        .iter()
        .filter(|in_profile| in_profile.verdict == verdict)
        .filter_map(|in_profile| Some((&in_profile.profile, in_profile.effect.as_ref()?)))
        .map(|(profile, effect)| match verdict {
            ClaimVerdict::Holds => profile.to_string(),
            ClaimVerdict::Opposite | ClaimVerdict::Open => {
                format!("{profile} ({} points)", ends_in_points(effect.difference).replace(", ", " to "))
            }
        })
        .collect()
}

/// Finding under each noise profile, as in `Noise compounds the drop: holds under paper, eld; open under physical (−1.2
/// to +5.0 points).`
fn sentence(finding: &FindingByProfile) -> String {
    let not_asked: Vec<String> = finding
        .effects
        .iter()
        .filter(|in_profile| in_profile.effect.is_none())
        .map(|in_profile| in_profile.profile.to_string())
        .collect();
    let parts: Vec<String> = [
        ("holds under", profiles_with_verdict(finding, ClaimVerdict::Holds)),
        ("the opposite under", profiles_with_verdict(finding, ClaimVerdict::Opposite)),
        ("open under", profiles_with_verdict(finding, ClaimVerdict::Open)),
        ("not asked under", not_asked),
    ]
    .iter()
    .filter(|(_, profiles)| !profiles.is_empty())
    .map(|(words, profiles)| format!("{words} {}", profiles.join(", ")))
    .collect();
    format!("{}: {}.", clause(finding), parts.join("; "))
}

/// One sentence for each finding that some noise profile decides, and a note on items left out.
fn notes(found: &[FindingByProfile]) -> Vec<String> {
    let models: BTreeSet<String> = found.iter().map(subject).collect();
    let mut notes: Vec<String> =
        found
            .iter()
            .filter(|finding| {
                let is_detail = matches!(finding.claim, NoiseHypothesis::NoiseCompounds(Some(_)));
                finding.robustness != Robustness::Open && !is_detail
            })
            .map(|finding| {
                if models.len() > 1 {
                    format!("{}: {}", subject(finding), sentence(finding))
                } else {
                    sentence(finding)
                }
            })
            .collect();
    let dropped = found.iter().map(|finding| finding.dropped).max();
    if let Some(dropped) = dropped.filter(|dropped| *dropped > 0) {
        notes.push(format!("left out because a side has no reply: up to {}", counted(dropped, "item")));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Severity;
    use darkqa_score::comparisons::Tested;
    use darkqa_score::estimate::Estimate;

    fn effect_in(profile: &str, low: f64, high: f64, verdict: ClaimVerdict) -> EffectInProfile {
        EffectInProfile {
            profile: ProfileName::new(profile).unwrap(),
            effect: Some(Tested::new(Estimate { value: f64::midpoint(low, high), low, high, n: 9 }, 0.01)),
            verdict,
        }
    }

    #[test]
    fn sentences_state_intervals_of_unsupported_findings() {
        let level = AxisLevel::new(Kind::Sensor, Severity::L5);
        let mut finding = FindingByProfile {
            model: "m".to_owned(),
            group: None,
            claim: NoiseHypothesis::NoiseCompounds(None),
            levels: vec![level],
            blind: None,
            effects: vec![
                effect_in("paper", 0.1, 0.3, ClaimVerdict::Holds),
                effect_in("eld", 0.2, 0.4, ClaimVerdict::Holds),
                effect_in("physical", -0.012, 0.05, ClaimVerdict::Open),
            ],
            robustness: Robustness::Some,
            dropped: 0,
        };
        assert_eq!(
            sentence(&finding),
            "Noise compounds the drop: holds under paper, eld; open under physical (−1.2 to +5.0 points)."
        );
        assert_eq!(effect(&finding.effects[2]), "+1.9 [−1.2, +5.0] open");
        finding.effects[1] = effect_in("eld", -0.4, -0.2, ClaimVerdict::Opposite);
        finding.effects[2].effect = None;
        finding.claim = NoiseHypothesis::EnhancerHarms(darkqa_base::types::EnhancerName::new("ruas").unwrap());
        assert_eq!(
            sentence(&finding),
            "ruas harms at L5: holds under paper; the opposite under eld (−40.0 to −20.0 points); not asked under physical."
        );
        assert_eq!(notes(std::slice::from_ref(&finding)).len(), 1);
    }
}
