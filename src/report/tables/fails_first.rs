//! Tables of the levels at which question families lose, and of the frames that keep the fewest right answers, under
//! each noise profile: [`fails_first`]. Both are lists, not findings: no test compares one family or frame with
//! another.

use std::collections::BTreeMap;

use crate::report::text::table::ColumnKind::{Count, Percent, Text};
use crate::report::text::table::{ColumnHeads, Table, TableBuilder};
use crate::report::text::words::{family as family_name, light, points};
use crate::types::{AxisLevel, Family, FrameId, Variant};
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::{ALPHA, Significance, holm};

/// Maximum number of frames for each variant (chosen).
const MAX_FRAMES: usize = 5;

/// Minimum number of right answers at L0, over all models, that a frame needs to be in the table (chosen).
const MIN_RIGHT: usize = 3;

/// The first level with a loss in each family, and the frames that keep the fewest right answers.
pub(super) fn fails_first(findings: &Findings<'_>) -> [Table; 2] {
    [families(findings), frames(findings)]
}

/// A row for each family and a column for each variant. The rows are in the order of families, because a family with
/// more questions reaches a small p at a lighter level.
fn families(findings: &Findings<'_>) -> Table {
    let variants: Vec<(&Variant, BTreeMap<&Family, &PooledFinding>)> =
        findings.grid.variants().into_iter().map(|variant| (variant, first_losses(findings, variant))).collect();
    let mut families: Vec<&Family> = findings.grid.groups().into_iter().flatten().collect();
    if families.len() < 2 {
        families.clear();
    }
    let mut builder = TableBuilder::new("families_first", families)
        .page(
            "families",
            "First level with a loss from L0 in each family, in points: a list, no comparison of families",
        )
        .column(Text, "terminal family | page family", |family| family_name(Some(family)).to_owned());
    for (variant, losses) in variants {
        let name = light(variant, None);
        let heads = ColumnHeads { terminal: vec![name.clone()], page: Some(name), ..ColumnHeads::default() };
        builder = builder.column(Text, heads, move |family| {
            losses.get(family).map_or_else(
                || "no level".to_owned(),
                |loss| {
                    let difference = loss.strict.difference;
                    let [value, low, high] = [difference.value, difference.low, difference.high].map(points);
                    format!("{}: {value} [{low}, {high}]", loss.level)
                },
            )
        });
    }
    let mut table = builder.build();
    if !table.rows.is_empty() {
        table.heading = Some("First level with a loss from L0, by family".to_owned());
        table.foot = Some(
            "p < 0.05 after one correction over the families and levels of a column; a family with more questions gets there at a lighter \
             level, so the rows do not compare families"
                .to_owned(),
        );
    }
    table
}

/// Loss of each family at the first level where a loss is detected in a variant. One correction (Holm) covers the tests
/// of all families and levels of the variant, so that the many tests do not make a family fail by chance.
fn first_losses<'f>(findings: &'f Findings<'_>, variant: &Variant) -> BTreeMap<&'f Family, &'f PooledFinding> {
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
        self.kept.iter().find(|(_, kept)| 2 * **kept <= self.right).map(|(level, _)| *level)
    }
}

/// A frame in a variant.
struct FrameRow<'f> {
    variant: &'f Variant,
    frame: &'f FrameId,
    answers: FrameAnswers,
}

/// Frames that keep the fewest right answers in each variant of raw images.
fn frames(findings: &Findings<'_>) -> Table {
    let rows = findings.grid.variants().into_iter().flat_map(|variant| frame_rows(findings, variant));
    let mut table = TableBuilder::new("frames_first", rows)
        .page("accuracy", "Frames with the fewest right answers of L0 kept in the dark: a list, not a finding")
        .group(|row| Some(light(row.variant, None)))
        .column(Text, "terminal frame | page frame", |row| row.frame.to_string())
        .column(Count, "terminal right at L0 | page right at L0", |row| row.answers.right)
        .column(Percent, "terminal kept % | page kept in the dark, %", |row| row.answers.kept_share())
        .column(Text, "terminal half lost at | page half lost at", |row| {
            row.answers.half_lost_level().map(|level| level.to_string())
        })
        .build();
    if !table.rows.is_empty() {
        table.heading = Some("Frames with the fewest right answers kept in the dark".to_owned());
        table.foot = Some("a list, not a finding: of many frames, some keep few answers by chance".to_owned());
    }
    table
}

/// Frames that keep the fewest right answers in a variant, those with the fewest first.
fn frame_rows<'f>(findings: &'f Findings<'_>, variant: &'f Variant) -> Vec<FrameRow<'f>> {
    let mut rows: Vec<FrameRow<'_>> = answers(findings, variant)
        .into_iter()
        .filter(|(_, answers)| answers.right >= MIN_RIGHT && answers.half_lost_level().is_some())
        .map(|(frame, answers)| FrameRow { variant, frame, answers })
        .collect();
    rows.sort_by(|one, other| {
        let (one, other) = (one.answers.kept_share(), other.answers.kept_share());
        one.total_cmp(&other)
    });
    rows.truncate(MAX_FRAMES);
    rows
}

/// Counts the answers of the pooled models for each frame.
fn answers<'f>(findings: &'f Findings<'_>, variant: &Variant) -> BTreeMap<&'f FrameId, FrameAnswers> {
    let grid = &findings.grid;
    let models = findings.models_of(variant);
    let mut by_frame: BTreeMap<&FrameId, FrameAnswers> = BTreeMap::new();
    for failure in &findings.first_failures {
        let curve = &failure.curve;
        let is_pooled = curve.variant == *variant && curve.enhancer.is_none() && models.contains(&&*curve.model);
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
