//! Table of the findings about noise under each noise profile.

use std::collections::BTreeSet;

use crate::text::table::ColumnKind::{Count, Number, P, Text};
use crate::text::table::{ColumnHeads, Table, TableBuilder, TableCell};
use crate::text::words::{self, ends_in_points, points, reach, stops};
use crate::types::degradations::Kind;
use crate::types::{AxisLevel, ReadingName};
use darkqa_score::accuracies::Curve;
use darkqa_score::comparisons::{
    EffectInProfile, FindingByProfile, NoiseHypothesis, Robustness, Support, TestedEffect,
};
use darkqa_score::findings::Findings;

/// One row a claim and reading in the file; one row a claim, with a column a reading, for people. Empty with one reading.
pub(super) fn by_reading(findings: &Findings<'_>) -> Vec<Table> {
    let found = &findings.by_profile;
    let Some(first) = found.first() else {
        return Vec::new();
    };
    let readings: Vec<&ReadingName> = first.effects.iter().map(|effect| &effect.profile).collect();
    vec![file(found), shown(findings, &readings)]
}

/// A row of the file.
type FileRow<'f> = (&'f FindingByProfile, &'f EffectInProfile);

fn file(found: &[FindingByProfile]) -> Table {
    let rows = found
        .iter()
        .flat_map(|finding| finding.effects.iter().map(move |effect| (finding, effect)));
    let tested = |(_, effect): &FileRow<'_>| effect.effect;
    TableBuilder::new("readings", rows)
        .column(Text, "csv model", |(finding, _)| subject(finding))
        .column(Text, "csv finding", |(finding, _)| finding.claim.name())
        .column(Text, "csv enhancer", |(finding, _)| {
            finding.claim.enhancer().map(ToString::to_string)
        })
        .column(Text, "csv family", |(finding, _)| {
            finding.claim.family().map(ToString::to_string)
        })
        .column(Text, "csv levels", |(finding, _)| {
            level_names(&finding.levels, ";")
        })
        .column(Text, "csv blind", |(finding, _)| finding.blind.clone())
        .column(Text, "csv reading", |(_, effect)| {
            effect.profile.to_string()
        })
        .column(Number, "csv effect low high n", |row| {
            tested(row).map(|effect| effect.difference)
        })
        .column(P, "csv p", |row| tested(row).map(|effect| effect.p))
        .column(P, "csv p_holm", |row| tested(row).map(|effect| effect.holm))
        .column(Text, "csv verdict", |row| {
            tested(row).map_or("not asked", |effect| effect.support.word())
        })
        .column(Text, "csv holds", |(finding, _)| finding.robustness.word())
        .column(Count, "csv dropped", |(finding, _)| finding.dropped)
        .build()
}

/// A row of the table that is shown: a finding, or the thresholds of a model.
enum Row<'f> {
    Finding(&'f FindingByProfile),
    Thresholds(&'f FindingByProfile, Vec<&'f Curve>),
}

impl Row<'_> {
    fn finding(&self) -> &FindingByProfile {
        match self {
            Self::Finding(finding) | Self::Thresholds(finding, _) => finding,
        }
    }
}

fn shown(findings: &Findings<'_>, readings: &[&ReadingName]) -> Table {
    let mut rows = Vec::new();
    let found = &findings.by_profile;
    let is_same =
        |a: &FindingByProfile, b: &FindingByProfile| (&a.model, &a.group) == (&b.model, &b.group);
    for block in found.chunk_by(is_same) {
        rows.extend(block.iter().map(Row::Finding));
        rows.push(Row::Thresholds(&block[0], thresholds(findings, &block[0])));
    }
    let mut table = TableBuilder::new("readings", &rows)
        .page(
            "readings",
            "Findings by reading, in percentage points [95 %]",
        )
        .column(Text, "terminal model | page model", |row| {
            subject(row.finding())
        })
        .column(Text, "terminal finding | page finding", |row| match row {
            Row::Finding(finding) => title(finding),
            Row::Thresholds(..) => "the break (threshold EV)".to_owned(),
        });
    for (index, reading) in readings.iter().enumerate() {
        let heads = ColumnHeads {
            terminal: vec![reading.to_string()],
            page: Some(reading.to_string()),
            ..ColumnHeads::default()
        };
        table = table.column(Text, heads, |row| match row {
            Row::Finding(finding) => effect(finding.effects[index].effect.as_ref()),
            Row::Thresholds(_, curves) => threshold(curves, reading),
        });
    }
    let mut table = table
        .column(Text, "terminal holds | page holds", |row| match row {
            Row::Finding(finding) => TableCell::from(match finding.robustness {
                Robustness::Reversed => "opposite effects",
                other => other.word(),
            }),
            Row::Thresholds(..) => TableCell::Blank,
        })
        .column(Count, "page n", |row| match row {
            Row::Finding(finding) => TableCell::Count(items(finding)),
            Row::Thresholds(..) => TableCell::Blank,
        })
        .column(Text, "page in words", |row| match row {
            Row::Finding(finding) => TableCell::from(sentence(finding)),
            Row::Thresholds(..) => TableCell::Blank,
        })
        .build();
    let heading = "Does each finding hold under every reading? Effects in percentage points [95 %], on the same items";
    table.heading = Some(heading.to_owned());
    table.notes = notes(found);
    table
}

/// The raw curves of a finding's model with noise, all families together.
fn thresholds<'f>(findings: &'f Findings<'_>, finding: &FindingByProfile) -> Vec<&'f Curve> {
    findings
        .curves
        .iter()
        .filter(|curve| {
            curve.model == finding.model
                && curve.variant.group == finding.group
                && curve.variant.kind.is_some_and(Kind::has_readings)
                && curve.enhancer.is_none()
                && curve.family.is_none()
        })
        .collect()
}

fn threshold(curves: &[&Curve], reading: &ReadingName) -> String {
    let Some(curve) = curves
        .iter()
        .find(|curve| curve.variant.reading.as_ref() == Some(reading))
    else {
        return "not asked".to_owned();
    };
    let darkest = curve.summary.darkest.value();
    curve.summary.threshold.as_ref().map_or_else(
        |_| "not known".to_owned(),
        |threshold| {
            let value = stops(threshold.value, darkest);
            format!(
                "{value} [{}]",
                reach(threshold.low, threshold.high, darkest)
            )
        },
    )
}

fn subject(finding: &FindingByProfile) -> String {
    let group = finding.group.as_ref().map(ToString::to_string);
    finding.model.clone() + &group.unwrap_or_default()
}

/// The effect with its interval and what it says, as `+12.3 [8.1, 16.2] holds`.
fn effect(effect: Option<&TestedEffect>) -> String {
    effect.map_or_else(
        || "not asked".to_owned(),
        |effect| {
            let value = points(effect.difference.value);
            let ends = ends_in_points(effect.difference);
            format!("{value} [{ends}] {}", effect.support.word())
        },
    )
}

fn items(finding: &FindingByProfile) -> usize {
    finding
        .effects
        .iter()
        .find_map(|effect| Some(effect.effect?.difference.n))
        .unwrap_or(0)
}

fn level_names(levels: &[AxisLevel], by: &str) -> String {
    let names: Vec<String> = levels.iter().map(ToString::to_string).collect();
    names.join(by)
}

/// The levels as `L1–L5`, or one by one if some are missing.
fn span(levels: &[AxisLevel], whole: usize) -> String {
    match levels {
        [first, .., last] if levels.len() == whole => format!("{first}–{last}"),
        _ => level_names(levels, ", "),
    }
}

/// A claim in words, with its levels.
fn title(finding: &FindingByProfile) -> String {
    let levels = &finding.levels;
    match &finding.claim {
        NoiseHypothesis::NoiseCompounds(None) => {
            format!(
                "noise compounds the drop, {}: exposure drop − with noise",
                span(levels, 5)
            )
        }
        NoiseHypothesis::NoiseCompounds(Some(level)) => format!("· at {level}"),
        NoiseHypothesis::DarknessCosts => "darkness costs: L5 with noise − L0".to_owned(),
        NoiseHypothesis::EnhancerHarms(name) => {
            format!(
                "{name} harms where light is left, {}: enhanced − raw",
                span(levels, 3)
            )
        }
        NoiseHypothesis::EnhancerHelps(name) => {
            format!(
                "{name} helps in the dark, {}: enhanced − raw",
                span(levels, 2)
            )
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

/// A claim as the beginning of a sentence.
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

/// The findings by reading, as `Noise compounds the drop under paper, eld; open under physical (−1.2 to 5.0 points).`
fn sentence(finding: &FindingByProfile) -> String {
    let of = |support: Support| -> Vec<String> {
        finding
            .effects
            .iter()
            .filter_map(|one| Some((&one.profile, one.effect.as_ref()?)))
            .filter(|(_, effect)| effect.support == support)
            .map(|(reading, effect)| match support {
                Support::Holds => reading.to_string(),
                Support::Opposite | Support::Open => {
                    format!(
                        "{reading} ({} points)",
                        ends_in_points(effect.difference).replace(", ", " to ")
                    )
                }
            })
            .collect()
    };
    let unasked: Vec<String> = finding
        .effects
        .iter()
        .filter(|one| one.effect.is_none())
        .map(|one| one.profile.to_string())
        .collect();
    let parts = [
        ("holds under", of(Support::Holds)),
        ("the opposite under", of(Support::Opposite)),
        ("open under", of(Support::Open)),
        ("not asked under", unasked),
    ];
    let parts: Vec<String> = parts
        .iter()
        .filter(|(_, readings)| !readings.is_empty())
        .map(|(words, readings)| format!("{words} {}", readings.join(", ")))
        .collect();
    format!("{}: {}.", clause(finding), parts.join("; "))
}

/// A sentence for each finding that some reading decides, and the omissions.
fn notes(found: &[FindingByProfile]) -> Vec<String> {
    let models: BTreeSet<String> = found.iter().map(subject).collect();
    let mut notes: Vec<String> = found
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
        notes.push(format!(
            "left out because a side has no reply: up to {}",
            words::counted(dropped, "item")
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Severity;
    use darkqa_score::estimate::Estimate;

    fn effect_of(reading: &str, low: f64, high: f64, support: Support) -> EffectInProfile {
        let value = f64::midpoint(low, high);
        let difference = Estimate {
            value,
            low,
            high,
            n: 9,
        };
        let (p, holm) = (0.01, 0.02);
        EffectInProfile {
            profile: ReadingName::new(reading).unwrap(),
            effect: Some(TestedEffect {
                difference,
                support,
                p,
                holm,
            }),
        }
    }

    #[test]
    fn a_sentence_names_each_reading_and_its_interval_where_it_does_not_hold() {
        let level = AxisLevel::new(Kind::Sensor, Severity::L5);
        let mut finding = FindingByProfile {
            model: "m".to_owned(),
            group: None,
            claim: NoiseHypothesis::NoiseCompounds(None),
            levels: vec![level],
            blind: None,
            effects: vec![
                effect_of("paper", 0.1, 0.3, Support::Holds),
                effect_of("eld", 0.2, 0.4, Support::Holds),
                effect_of("physical", -0.012, 0.05, Support::Open),
            ],
            robustness: Robustness::Some,
            dropped: 0,
        };
        assert_eq!(
            sentence(&finding),
            "Noise compounds the drop: holds under paper, eld; open under physical (−1.2 to +5.0 points)."
        );
        assert_eq!(
            effect(finding.effects[2].effect.as_ref()),
            "+1.9 [−1.2, +5.0] open"
        );
        finding.effects[1] = effect_of("eld", -0.4, -0.2, Support::Opposite);
        finding.effects[2].effect = None;
        finding.claim =
            NoiseHypothesis::EnhancerHarms(crate::types::EnhancerName::new("ruas").unwrap());
        assert_eq!(
            sentence(&finding),
            "ruas harms at L5: holds under paper; the opposite under eld (−40.0 to −20.0 points); not asked under physical."
        );
        assert_eq!(notes(std::slice::from_ref(&finding)).len(), 1);
    }
}
