//! The tables of what fails first in the dark: [`fails_first`], question families and frames, under each noise profile.

use std::collections::BTreeMap;

use crate::text::table::ColumnKind::{Count, Percent, Text};
use crate::text::table::{ColumnHeads, Table, TableBuilder};
use crate::text::words::{family as family_name, light, points};
use crate::types::{AxisLevel, Family, FrameId, Variant};
use darkqa_score::choice::ReadingMode;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::Significance;

/// Most frames of a variant; chosen.
const MAX_FRAMES: usize = 5;

/// Fewest questions answered rightly at L0, over all models, of a frame in the table; chosen.
const MIN_RIGHT: usize = 3;

/// The families by the level at which a loss is first detected, and the frames that lose most.
pub(super) fn fails_first(findings: &Findings<'_>) -> [Table; 2] {
    [families(findings), frames(findings)]
}

/// A row for each family and a column for each variant. No loss detected comes last.
fn families(findings: &Findings<'_>) -> Table {
    let variants: Vec<&Variant> = findings.grid.variants().into_iter().collect();
    let mut families: Vec<&Family> = findings.grid.groups().into_iter().flatten().collect();
    let order = |family: &Family| {
        variants
            .iter()
            .filter_map(|variant| first_loss(findings, family, variant))
            .map(|loss| (loss.level, loss.strict.difference.value))
            .min_by(|one, other| one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)))
    };
    families.sort_by(|one, other| match (order(one), order(other)) {
        (Some(one), Some(other)) => one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)),
        (one, other) => other.is_some().cmp(&one.is_some()),
    });
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
    for variant in &variants {
        let name = light(variant, None);
        let heads = ColumnHeads {
            terminal: vec![name.clone()],
            page: Some(name),
            ..ColumnHeads::default()
        };
        builder = builder.column(Text, heads, |family| {
            first_loss(findings, family, variant).map_or_else(
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
    table.heading = (!table.rows.is_empty()).then(|| "Families that fail first".to_owned());
    table
}

/// The loss of a family at the first level where it is detected.
fn first_loss<'f>(
    findings: &'f Findings<'_>,
    family: &Family,
    variant: &Variant,
) -> Option<&'f PooledFinding> {
    findings
        .pooled
        .iter()
        .filter(|finding| {
            finding.kind == PooledKind::Darkness
                && finding.family.as_ref() == Some(family)
                && finding.variant == *variant
                && finding.strict.verdict == Significance::Worse
        })
        .min_by_key(|finding| finding.level)
}

/// The answers of the pooled models to the questions of one frame in one variant.
#[derive(Default)]
struct FrameAnswers {
    /// Right answers at L0.
    right: usize,
    /// Of these, the answers that are still right, by level.
    kept: BTreeMap<AxisLevel, usize>,
}

impl FrameAnswers {
    /// The mean share of right answers that are kept over the levels.
    fn kept_share(&self) -> f64 {
        let kept: usize = self.kept.values().sum();
        kept as f64 / (self.right * self.kept.len().max(1)) as f64
    }

    /// The first level at which at most half of the right answers are kept.
    fn half(&self) -> Option<AxisLevel> {
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

/// The frames that keep the fewest right answers in each variant of raw images, first the worst. It is a description, no test.
fn frames(findings: &Findings<'_>) -> Table {
    let variants = findings.grid.variants();
    let rows = variants
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
            row.answers.half().map(|level| level.to_string())
        })
        .build();
    if !table.rows.is_empty() {
        table.heading = Some("Frames that fail first".to_owned());
        table.foot =
            Some("a description, no test: of many frames, some fail first by chance".to_owned());
    }
    table
}

/// The frames that keep the fewest right answers in a variant, first the worst.
fn frame_rows<'f>(findings: &'f Findings<'_>, variant: &'f Variant) -> Vec<FrameRow<'f>> {
    let mut rows: Vec<FrameRow<'_>> = answers(findings, variant)
        .into_iter()
        .filter(|(_, answers)| answers.right >= MIN_RIGHT && answers.half().is_some())
        .map(|(frame, answers)| FrameRow {
            variant,
            frame,
            answers,
        })
        .collect();
    rows.sort_by(|one, other| {
        let share = |row: &FrameRow<'_>| row.answers.kept_share();
        share(one).total_cmp(&share(other))
    });
    rows.truncate(MAX_FRAMES);
    rows
}

/// What fails first, a line for each variant: the families that lose at the lowest level, and the frame that loses most. Variants in
/// which the same fails first share a line.
pub(crate) fn first_to_fail(findings: &Findings<'_>) -> Vec<String> {
    let findings = findings.shown();
    let mut lines: Vec<(Vec<String>, String)> = Vec::new();
    for variant in findings.grid.variants() {
        let families = findings.grid.groups().into_iter().flatten();
        let losses: Vec<(&Family, &PooledFinding)> = families
            .filter_map(|family| Some((family, first_loss(findings, family, variant)?)))
            .collect();
        let lowest = losses.iter().map(|(_, loss)| loss.level).min();
        let names: Vec<&str> = losses
            .iter()
            .filter(|(_, loss)| Some(loss.level) == lowest)
            .map(|(family, _)| family_name(Some(family)))
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

/// The answers to each frame by the models over which findings are pooled.
fn answers<'f>(
    findings: &'f Findings<'_>,
    variant: &Variant,
) -> BTreeMap<&'f FrameId, FrameAnswers> {
    let grid = &findings.grid;
    let models = findings.models_of(variant);
    let mut by_frame: BTreeMap<&FrameId, FrameAnswers> = BTreeMap::new();
    let curves = findings.first_failures.iter().map(|failure| &failure.curve);
    for curve in curves.filter(|curve| {
        curve.variant == *variant && curve.enhancer.is_none() && models.contains(&&*curve.model)
    }) {
        let [(_, light), dark @ ..] = &curve.subjects[..] else {
            continue;
        };
        for (index, item) in grid.items.iter().enumerate() {
            let is_right = |subject: usize| {
                let reading = grid.result(subject, index).reading(ReadingMode::Strict);
                reading.is_some_and(|chosen| item.is_right(chosen))
            };
            if is_right(*light) {
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
