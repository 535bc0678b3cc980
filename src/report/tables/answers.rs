//! Tables of answers: false positives and negatives, collapse to one answer, and a confusion matrix.

use crate::report::text::table::ColumnKind::{Count, Number, Percent, Share, Text};
use crate::report::text::table::{Table, TableBuilder};
use darkqa_score::answers::confusion::{Collapse, Confusion, Hallucination};
use darkqa_score::findings::Findings;

pub(super) fn answers(findings: &Findings<'_>) -> Vec<Table> {
    vec![hallucination(&findings.hallucinations), collapse(&findings.confusions), confusion(&findings.confusions)]
}

fn hallucination(rates: &[Hallucination]) -> Table {
    TableBuilder::new("hallucination", rates)
        .subject(|rates| &rates.subject, ToString::to_string)
        .column(Share, "csv false_positive fp_low fp_high", |rates| rates.false_positive)
        .column(Count, "csv fp_n", |rates| rates.false_positive.map_or(0, |rate| rate.n))
        .column(Share, "csv false_negative fn_low fn_high", |rates| rates.false_negative)
        .column(Count, "csv fn_n", |rates| rates.false_negative.map_or(0, |rate| rate.n))
        .build()
}

/// Starts a table of the answer that each model gives most often, with its share. The caller adds further columns.
pub(crate) fn commonest_answers<'a>(
    name: &'static str,
    caption: &str,
    confusions: &'a [Confusion],
) -> TableBuilder<(&'a Confusion, &'a Collapse)> {
    let collapses = confusions.iter().filter_map(|confusion| Some((confusion, confusion.collapse.as_ref()?)));
    TableBuilder::new(name, collapses)
        .page("answers", caption)
        .subject(|(confusion, _)| &confusion.subject, ToString::to_string)
        .family(|(confusion, _)| Some(&confusion.family))
        .column(Text, "csv top_answer | page given most often", |(_, c)| c.top.clone())
        .column(Share, "csv top_share top_low top_high | page given in % [95 %]", |(_, c)| c.share)
}

fn collapse(confusions: &[Confusion]) -> Table {
    let caption = "The answer given most often, and how often it is true";
    commonest_answers("collapse", caption, confusions)
        .column(Percent, "csv true_share | page true in %", |(_, c)| c.truth)
        .column(Number, "csv guess_share", |(_, c)| c.guess)
        .column(Number, "csv entropy_bits | page entropy in bits", |(_, c)| c.entropy)
        .column(Number, "csv true_entropy_bits | page of the truth", |(_, c)| c.true_entropy)
        .column(Count, "csv n | page n", |(_, c)| c.share.n)
        .column(Text, "csv shown", |(_, c)| c.is_shown().to_string())
        .build()
}

/// Confusion matrix of the answers, with a row for each true answer and each answer given to it.
fn confusion(confusions: &[Confusion]) -> Table {
    counted_answers("confusion", "csv truth", confusions)
}

/// Non-zero cell of a confusion matrix.
struct ConfusionCell<'a> {
    confusion: &'a Confusion,
    /// Index of the expected answer's label.
    expected: usize,
    /// Index of the given answer's label; out of range if no answer could be parsed.
    given: usize,
    count: usize,
}

/// Confusion matrix as a table: the number of replies for each expected answer and each answer given to it. The answer
/// given is empty if none could be parsed. `expected_head` is the head of the column of expected answers.
pub(crate) fn counted_answers(name: &'static str, expected_head: &'static str, confusions: &[Confusion]) -> Table {
    let mut cells = Vec::new();
    for confusion in confusions {
        for (expected, row) in confusion.counts.iter().enumerate() {
            for (given, &count) in row.iter().enumerate() {
                if count > 0 {
                    cells.push(ConfusionCell { confusion, expected, given, count });
                }
            }
        }
    }
    TableBuilder::new(name, cells)
        .subject(|cell| &cell.confusion.subject, ToString::to_string)
        .family(|cell| Some(&cell.confusion.family))
        .column(Text, expected_head, |cell| cell.confusion.labels[cell.expected].clone())
        .column(Text, "csv given", |cell| cell.confusion.labels.get(cell.given).cloned())
        .column(Count, "csv count", |cell| cell.count)
        .build()
}
