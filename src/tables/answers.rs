//! Tables of the answers: false positives and negatives, collapse, and answers given against true answers.

use crate::text::table::ColumnKind::{Count, Number, Percent, Share, Text};
use crate::text::table::{Table, TableBuilder};
use darkqa_score::answers::confusion::{Collapse, Confusion, Hallucination};
use darkqa_score::findings::Findings;

pub(super) fn answers(findings: &Findings<'_>) -> Vec<Table> {
    vec![
        hallucination(&findings.hallucinations),
        collapse(&findings.confusions),
        confusion(&findings.confusions),
    ]
}

fn hallucination(rates: &[Hallucination]) -> Table {
    TableBuilder::new("hallucination", rates)
        .subject(|rates| &rates.subject, ToString::to_string)
        .column(Share, "csv false_positive fp_low fp_high", |rates| {
            rates.false_positive
        })
        .column(Count, "csv fp_n", |rates| {
            rates.false_positive.map_or(0, |rate| rate.n)
        })
        .column(Share, "csv false_negative fn_low fn_high", |rates| {
            rates.false_negative
        })
        .column(Count, "csv fn_n", |rates| {
            rates.false_negative.map_or(0, |rate| rate.n)
        })
        .build()
}

/// A row for each answer that is given most often, with its share: the first columns of a table.
pub(crate) fn commonest_answers<'a>(
    name: &'static str,
    caption: &str,
    confusions: &'a [Confusion],
) -> TableBuilder<(&'a Confusion, &'a Collapse)> {
    let collapses = confusions.iter();
    let collapses =
        collapses.filter_map(|confusion| Some((confusion, confusion.collapse.as_ref()?)));
    TableBuilder::new(name, collapses)
        .page("answers", caption)
        .subject(|(confusion, _)| &confusion.subject, ToString::to_string)
        .family(|(confusion, _)| Some(&confusion.family))
        .column(Text, "csv top_answer | page given most often", |(_, c)| {
            c.top.clone()
        })
        .column(
            Share,
            "csv top_share top_low top_high | page given in % [95 %]",
            |(_, c)| c.share,
        )
}

fn collapse(confusions: &[Confusion]) -> Table {
    let caption = "The answer given most often, and how often it is true";
    commonest_answers("collapse", caption, confusions)
        .column(Percent, "csv true_share | page true in %", |(_, c)| c.truth)
        .column(Number, "csv guess_share", |(_, c)| c.guess)
        .column(
            Number,
            "csv entropy_bits | page entropy in bits",
            |(_, c)| c.entropy,
        )
        .column(
            Number,
            "csv true_entropy_bits | page of the truth",
            |(_, c)| c.true_entropy,
        )
        .column(Count, "csv n | page n", |(_, c)| c.share.n)
        .column(Text, "csv shown", |(_, c)| c.is_shown().to_string())
        .build()
}

/// A row for each true answer and each answer given to it. The answer given is empty if none could be read.
fn confusion(confusions: &[Confusion]) -> Table {
    counted_answers("confusion", "csv truth", confusions)
}

/// A row for each answer that was due (`due` heads its column) and each answer given instead, with their number. The answer given is
/// empty if none could be read.
pub(crate) fn counted_answers(
    name: &'static str,
    due: &'static str,
    confusions: &[Confusion],
) -> Table {
    let non_empty = confusions
        .iter()
        .flat_map(|confusion| {
            confusion
                .counts
                .iter()
                .enumerate()
                .flat_map(|(truth, row)| {
                    let answer = row.iter().enumerate();
                    answer.map(move |(answer, count)| (truth, answer, *count))
                })
                .map(move |cell| (confusion, cell))
        })
        .filter(|(_, (_, _, count))| *count > 0);
    TableBuilder::new(name, non_empty)
        .subject(|(confusion, _)| &confusion.subject, ToString::to_string)
        .family(|(confusion, _)| Some(&confusion.family))
        .column(Text, due, |(confusion, (truth, _, _))| {
            confusion.labels[*truth].clone()
        })
        .column(Text, "csv given", |(confusion, (_, answer, _))| {
            confusion.labels.get(*answer).cloned()
        })
        .column(Count, "csv count", |(_, (_, _, count))| *count)
        .build()
}
