//! Tables of the question families and the frames that fail first in the dark, under each noise profile: [`fails_first`].

use std::cmp::Ordering;
use std::collections::BTreeMap;

use crate::text::table::ColumnKind::{Count, Percent, Text};
use crate::text::table::{ColumnHeads, Table, TableBuilder};
use crate::text::words::{family as family_name, light, points};
use crate::types::{AxisLevel, Family, FrameId, Variant};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::{ALPHA, Significance, holm};

/// Maximum number of frames for each variant (chosen).
const MAX_FRAMES: usize = 5;

/// Minimum number of right answers at L0, over all models, that a frame needs to be in the table (chosen).
const MIN_RIGHT: usize = 3;

/// Families by the level at which a loss is first detected, and the frames that lose most.
pub(super) fn fails_first(findings: &Findings<'_>) -> [Table; 2] {
    [families(findings), frames(findings)]
}

/// Orders losses by level, then from the largest.
fn compare_losses(one: &PooledFinding, other: &PooledFinding) -> Ordering {
    let [one_value, other_value] = [one, other].map(|loss| loss.strict.difference.value);
    one.level
        .cmp(&other.level)
        .then(one_value.total_cmp(&other_value))
}

/// A row for each family and a column for each variant. Families without a detected loss come last.
fn families(findings: &Findings<'_>) -> Table {
    let variants: Vec<(&Variant, BTreeMap<&Family, &PooledFinding>)> = findings
        .grid
        .variants()
        .into_iter()
        .map(|variant| (variant, first_losses(findings, variant)))
        .collect();
    let mut families: Vec<(&Family, Option<&PooledFinding>)> = findings
        .grid
        .groups()
        .into_iter()
        .flatten()
        .map(|family| {
            let loss = variants
                .iter()
                .filter_map(|(_, losses)| losses.get(family).copied())
                .min_by(|one, other| compare_losses(one, other));
            (family, loss)
        })
        .collect();
    families.sort_by(|(_, one), (_, other)| match (one, other) {
        (Some(one), Some(other)) => compare_losses(one, other),
        (one, other) => other.is_some().cmp(&one.is_some()),
    });
    let mut families: Vec<&Family> = families.into_iter().map(|(family, _)| family).collect();
    if families.len() < 2 {
        families.clear();
    }
    let mut builder = TableBuilder::new("families_first", families)
        .page(
            "families",
            "Families that fail first: the first level with a detected loss from L0, in points",
        )
        .column(Text, "terminal family | page family", |family| {
            family_name(Some(family)).to_owned()
        });
    for (variant, losses) in variants {
        let name = light(variant, None);
        let heads = ColumnHeads {
            terminal: vec![name.clone()],
            page: Some(name),
            ..ColumnHeads::default()
        };
        builder = builder.column(Text, heads, move |family| {
            losses.get(family).map_or_else(
                || "no loss detected".to_owned(),
                |loss| {
                    let difference = loss.strict.difference;
                    let [value, low, high] =
                        [difference.value, difference.low, difference.high].map(points);
                    format!("{}: {value} [{low}, {high}]", loss.level)
                },
            )
        });
    }
    let mut table = builder.build();
    if !table.rows.is_empty() {
        table.heading = Some("Families that fail first".to_owned());
        table.foot = Some(
            "p < 0.05 after one correction over the families and levels of a column".to_owned(),
        );
    }
    table
}

/// Loss of each family at the first level where a loss is detected in a variant. One correction (Holm) covers the tests of all families and
/// levels of the variant, so that the many tests do not make a family fail by chance.
fn first_losses<'f>(
    findings: &'f Findings<'_>,
    variant: &Variant,
) -> BTreeMap<&'f Family, &'f PooledFinding> {
    let tested: Vec<(&Family, &PooledFinding)> = findings
        .pooled
        .iter()
        .filter(|finding| finding.kind == PooledKind::Darkness && finding.variant == *variant)
        .filter_map(|finding| Some((finding.family.as_ref()?, finding)))
        .collect();
    let p_values: Vec<f64> = tested.iter().map(|(_, finding)| finding.strict.p).collect();
    let mut losses = BTreeMap::new();
    for ((family, finding), p_holm) in tested.into_iter().zip(holm(&p_values)) {
        if p_holm < ALPHA && finding.strict.verdict == Significance::Worse {
            let first = losses.entry(family).or_insert(finding);
            if finding.level < first.level {
                *first = finding;
            }
        }
    }
    losses
}

/// Answers of the pooled models to the questions about one frame in one variant.
#[derive(Default)]
struct FrameAnswers {
    /// Number of right answers at L0.
    right: usize,
    /// Number of right answers at L0 that are still right at each dark level.
    kept: BTreeMap<AxisLevel, usize>,
}

impl FrameAnswers {
    /// Share of right answers that are still right, as mean over the dark levels.
    fn kept_share(&self) -> f64 {
        let kept: usize = self.kept.values().sum();
        kept as f64 / (self.right * self.kept.len().max(1)) as f64
    }

    /// First level at which at most half of the right answers are still right.
    fn half_lost_level(&self) -> Option<AxisLevel> {
        self.kept
            .iter()
            .find(|(_, kept)| 2 * **kept <= self.right)
            .map(|(level, _)| *level)
    }
}

/// A frame in a variant.
struct FrameRow<'f> {
    variant: &'f Variant,
    frame: &'f FrameId,
    answers: FrameAnswers,
}

/// Frames that keep the fewest right answers in each variant of raw images, the worst first. This is descriptive, without a test.
fn frames(findings: &Findings<'_>) -> Table {
    let rows = findings
        .grid
        .variants()
        .into_iter()
        .flat_map(|variant| frame_rows(findings, variant));
    let mut table = TableBuilder::new("frames_first", rows)
        .page(
            "accuracy",
            "Frames that fail first: the fewest right answers of L0 kept in the dark",
        )
        .group(|row| Some(light(row.variant, None)))
        .column(Text, "terminal frame | page frame", |row| {
            row.frame.to_string()
        })
        .column(Count, "terminal right at L0 | page right at L0", |row| {
            row.answers.right
        })
        .column(
            Percent,
            "terminal kept % | page kept in the dark, %",
            |row| row.answers.kept_share(),
        )
        .column(Text, "terminal half lost at | page half lost at", |row| {
            row.answers.half_lost_level().map(|level| level.to_string())
        })
        .build();
    if !table.rows.is_empty() {
        table.heading = Some("Frames that fail first".to_owned());
        table.foot =
            Some("a description, no test: of many frames, some fail first by chance".to_owned());
    }
    table
}

/// Frames that keep the fewest right answers in a variant, the worst first.
fn frame_rows<'f>(findings: &'f Findings<'_>, variant: &'f Variant) -> Vec<FrameRow<'f>> {
    let mut rows: Vec<FrameRow<'_>> = answers(findings, variant)
        .into_iter()
        .filter(|(_, answers)| answers.right >= MIN_RIGHT && answers.half_lost_level().is_some())
        .map(|(frame, answers)| FrameRow {
            variant,
            frame,
            answers,
        })
        .collect();
    rows.sort_by(|one, other| {
        let (one, other) = (one.answers.kept_share(), other.answers.kept_share());
        one.total_cmp(&other)
    });
    rows.truncate(MAX_FRAMES);
    rows
}

/// One line for each variant: the families that lose at the lowest level, and the frame that loses most. Variants with the same result
/// share a line.
pub(crate) fn first_to_fail(findings: &Findings<'_>) -> Vec<String> {
    let findings = findings.shown();
    let mut lines: Vec<(Vec<String>, String)> = Vec::new();
    for variant in findings.grid.variants() {
        let losses = first_losses(findings, variant);
        let lowest = losses.values().map(|loss| loss.level).min();
        let names: Vec<&str> = findings
            .grid
            .groups()
            .into_iter()
            .flatten()
            .filter(|family| losses.get(family).map(|loss| loss.level) == lowest)
            .map(|family| family_name(Some(family)))
            .collect();
        let families = lowest.map(|level| format!("{} at {level}", names.join(", ")));
        let frames = frame_rows(findings, variant);
        let frame = frames.first().map(|row| format!("frame {}", row.frame));
        let failed: Vec<String> = families.into_iter().chain(frame).collect();
        let failed = failed.join("; ");
        match lines.iter_mut().find(|(_, other)| *other == failed) {
            _ if failed.is_empty() => {}
            Some((lights, _)) => lights.push(light(variant, None)),
            None => lines.push((vec![light(variant, None)], failed)),
        }
    }
    lines
        .into_iter()
        .map(|(lights, failed)| format!("{}: {failed}", lights.join(", ")))
        .collect()
}

/// Counts the answers of the pooled models for each frame.
fn answers<'f>(
    findings: &'f Findings<'_>,
    variant: &Variant,
) -> BTreeMap<&'f FrameId, FrameAnswers> {
    let grid = &findings.grid;
    let models = findings.models_of(variant);
    let mut by_frame: BTreeMap<&FrameId, FrameAnswers> = BTreeMap::new();
    for failure in &findings.first_failures {
        let curve = &failure.curve;
        let is_pooled = curve.variant == *variant
            && curve.enhancer.is_none()
            && models.contains(&&*curve.model);
        let [(_, clean), dark @ ..] = &curve.subjects[..] else {
            continue;
        };
        if !is_pooled {
            continue;
        }
        for (index, item) in grid.items.iter().enumerate() {
            let is_right = |subject: usize| {
                let answer = grid.result(subject, index).reading(ParsingMode::Strict);
                answer.is_some_and(|choice| item.is_right(choice))
            };
            if is_right(*clean) {
                let answers = by_frame.entry(&*item.asked.frame).or_default();
                answers.right += 1;
                for (level, subject) in dark {
                    *answers.kept.entry(*level).or_default() += usize::from(is_right(*subject));
                }
            }
        }
    }
    by_frame
}
