//! Table of the strict score: the share of question groups with all questions right.

use crate::text::table::ColumnKind::{Count, Percent, Share, Text};
use crate::text::table::{Table, TableBuilder, TableCell, TableFormat};
use darkqa_base::types::text::counted;
use darkqa_base::types::{Family, Variant};
use darkqa_score::accuracies::{GroupCell, GroupChance, StrictScore};
use darkqa_score::choice::ParsingMode;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::{CHANCE, ModelInCondition};

/// Row of the table.
enum GroupRow<'a> {
    /// Score of a model in a condition.
    Cell(&'a GroupCell),
    /// Score of guessing, with a subject that names it.
    Chance(&'a GroupChance, ModelInCondition),
}

/// Two tables: all families together, and by family. Empty if the questions have no groups.
pub fn strict_groups(findings: &Findings<'_>) -> Vec<Table> {
    let Some(score) = &findings.strict else {
        return Vec::new();
    };
    let mut all = table(findings, score, "All questions of a group right, in %", |family| family.is_none());
    all.heading = Some(
        "All questions of a group right, in % of the complete groups, with 95 % intervals; accuracy of the same subject beside it"
            .to_owned(),
    );
    all.latex = Some(format!(
        "Groups of which all questions are right, in \\% of the complete groups (strict parsing), with 95\\,\\% intervals; {}.",
        counted(score.groups, "group")
    ));
    all.foot = foot(score);
    let caption = "All questions of a group right, in %, by family";
    let mut by_family = table(findings, score, caption, |family| family.is_some());
    by_family.is_folded = true;
    vec![all, by_family]
}

/// Remarks on the groups, below the table.
fn foot(score: &StrictScore) -> Option<String> {
    let most = score.cells.iter().map(|cell| cell.incomplete).max();
    let joined = score.cells.iter().any(|cell| cell.clusters == 1 && cell.share.is_some_and(|share| share.n > 1));
    let facts = [
        (score.single > 0)
            .then(|| format!("{} of one question, whose strict score is accuracy", counted(score.single, "group"))),
        (score.across_frames > 0).then(|| format!("{} about several frames", counted(score.across_frames, "group"))),
        (score.never_complete > 0).then(|| {
            format!(
                "{} of which questions of the set are left out or not drawn, complete for no model",
                counted(score.never_complete, "group")
            )
        }),
        most.filter(|most| *most > 0)
            .map(|_| "incomplete groups, of which a question was not asked or has no reply, are not scored".to_owned()),
        joined.then(|| "where all groups share frames, intervals take them as independent".to_owned()),
    ];
    let facts: Vec<String> = facts.into_iter().flatten().collect();
    (!facts.is_empty()).then(|| facts.join("; "))
}

fn table(
    findings: &Findings<'_>,
    score: &StrictScore,
    caption: &str,
    is_shown: impl Fn(Option<&Family>) -> bool,
) -> Table {
    let cells = score.cells.iter().filter(|cell| is_shown(cell.family.as_ref())).map(GroupRow::Cell);
    let chance = score
        .chance
        .iter()
        .filter(|chance| is_shown(chance.family.as_ref()))
        .map(|chance| GroupRow::Chance(chance, chance_subject()));
    let lines = cells.chain(chance);
    let builder = TableBuilder::new("groups", lines)
        .page("groups", caption)
        .subject(GroupRow::subject, |variant| variant.word().into_owned())
        .column(Text, "terminal subject | latex Subject", |line| match line {
            GroupRow::Cell(cell) => format!("{} {}", cell.subject.model, cell.subject.condition()),
            GroupRow::Chance(..) => CHANCE.to_owned(),
        })
        .family(GroupRow::family)
        .column(Text, "csv mode", |line| match line {
            GroupRow::Cell(cell) if cell.mode == ParsingMode::Lenient => "lenient",
            GroupRow::Cell(_) | GroupRow::Chance(..) => "strict",
        });
    let builder = number_columns(builder, findings, score)
        .column(Text, "csv reading", |line| TableCell::profile(line.subject()))
        .model_facts(&findings.grid.listing, GroupRow::subject);
    let has_light = score.cells.iter().any(|cell| cell.subject.run_group().is_some());
    let mut builder = if has_light {
        builder.column(Text, "csv light", |line| line.subject().run_group().map(str::to_owned))
    } else {
        builder
    };
    for format in [TableFormat::Terminal, TableFormat::Page, TableFormat::Latex] {
        builder =
            builder.hide(format, |line| matches!(line, GroupRow::Cell(cell) if cell.mode == ParsingMode::Lenient));
    }
    builder.build()
}

fn number_columns<'a>(
    builder: TableBuilder<GroupRow<'a>>,
    findings: &Findings<'_>,
    score: &StrictScore,
) -> TableBuilder<GroupRow<'a>> {
    builder
        .column(Count, "csv n | terminal groups | page groups | latex Groups", |line| {
            line.share().map_or(0, |share| share.n)
        })
        .column(Count, "csv right", |line| line.cell().map(|cell| cell.right))
        .column(Count, "csv incomplete | terminal incomplete | page incomplete | latex Incomplete", |line| {
            count(line, |cell| cell.incomplete)
        })
        .column(Count, "csv clusters", |line| line.cell().map(|cell| cell.clusters))
        .column(Share, "csv value low high | terminal all right | page all right [95 %] | latex All right", |line| {
            match line {
                GroupRow::Cell(cell) => TableCell::from(cell.share),
                GroupRow::Chance(chance, _) => chance.share.map_or(TableCell::Missing, TableCell::Guess),
            }
        })
        .column(Percent, "terminal lenient | page lenient", |line| {
            let lenient = line.cell().and_then(|cell| score.lenient(cell));
            match line {
                GroupRow::Cell(_) => TableCell::from(lenient.and_then(|cell| cell.share)),
                GroupRow::Chance(..) => TableCell::Blank,
            }
        })
        .column(Percent, "terminal accuracy | page accuracy | latex Accuracy", |line| {
            let cell = findings.summary.family_cells(line.family(), ParsingMode::Strict).find(|cell| match line {
                GroupRow::Cell(group_cell) => cell.subject == group_cell.subject,
                GroupRow::Chance(..) => cell.subject.view.is_none(),
            });
            Some(cell?.accuracy?.value)
        })
}

/// Table cell with a count; blank for chance.
fn count(line: &GroupRow<'_>, count: impl Fn(&GroupCell) -> usize) -> TableCell {
    line.cell().map_or(TableCell::Blank, |cell| count(cell).into())
}

impl GroupRow<'_> {
    fn cell(&self) -> Option<&GroupCell> {
        match self {
            Self::Cell(cell) => Some(cell),
            Self::Chance(..) => None,
        }
    }

    fn subject(&self) -> &ModelInCondition {
        match self {
            Self::Cell(cell) => &cell.subject,
            Self::Chance(_, subject) => subject,
        }
    }

    fn family(&self) -> Option<&Family> {
        match self {
            Self::Cell(cell) => cell.family.as_ref(),
            Self::Chance(chance, _) => chance.family.as_ref(),
        }
    }

    fn share(&self) -> Option<Estimate> {
        match self {
            Self::Cell(cell) => cell.share,
            Self::Chance(chance, _) => chance.share,
        }
    }
}

/// Name of a subject's run group; `None` if it has none.
/// Subject that stands for guessing.
fn chance_subject() -> ModelInCondition {
    ModelInCondition { model: CHANCE.to_owned(), view: None, level: None, variant: Variant::NONE, enhancer: None }
}
