//! Tables of answers: false positives and negatives, collapse to one answer, and a confusion matrix.
//!
//! Table of replies, unreadable replies and failures for each model in a condition.

use crate::text::table::ColumnKind::{Count, Failures, Number, Percent, Share, Text};
use crate::text::table::{Table, TableBuilder};
use crate::text::words::percent;
use darkqa_base::types::{FailureKind, UnreadReason};
use darkqa_score::accuracies::Health;
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
pub fn commonest_answers<'a>(
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
pub fn counted_answers(name: &'static str, expected_head: &'static str, confusions: &[Confusion]) -> Table {
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

/// CSV columns of the reasons for unreadable replies, in the order of [`UnreadReason::ALL`].
const UNREAD: [&str; UnreadReason::ALL.len()] = [
    "empty",
    "refused",
    "truncated",
    "filtered",
    "ambiguous",
    "out_of_range",
    "contradiction",
    "negated",
    "no_choice",
    "cannot_tell",
];

/// CSV columns of the kinds of failure, in the order of [`FailureKind::ALL`].
const FAILED: [&str; FailureKind::ALL.len()] = [
    "failed_connection",
    "failed_timeout",
    "failed_rate_limit",
    "failed_server",
    "failed_request",
    "failed_filtered",
    "failed_response",
    "failed_image",
];

/// Reasons that do not concern the form of the answer.
const OTHER: [UnreadReason; 5] = [
    UnreadReason::Refused,
    UnreadReason::Filtered,
    UnreadReason::Truncated,
    UnreadReason::Empty,
    UnreadReason::CannotTell,
];

/// Builds the table of parse health.
pub fn health(health: &[Health]) -> Table {
    let mut builder = TableBuilder::new("health", health)
        .page("health", "Replies and failures by subject")
        .subject(|health| &health.subject, ToString::to_string)
        .column(Count, "csv replies | page replies", |health| health.replies)
        .column(Count, "csv read", |health| health.read)
        .column(Count, "csv lenient_only", |health| health.lenient_only)
        .column(Count, "page read", |health| count_with_share(health, health.read))
        .column(Count, "page lenient alone", |health| count_with_share(health, health.lenient_only))
        .column(Count, "page other form", |health| {
            // An imported record may have both a choice and a reason.
            (health.replies - health.read).saturating_sub(health.unread_for(&OTHER))
        })
        .column(Count, "page refused or filtered", |health| {
            health.unread_for(&[UnreadReason::Refused, UnreadReason::Filtered])
        })
        .column(Count, "page truncated", |health| health.unread_for(&[UnreadReason::Truncated]))
        .column(Count, "page empty", |health| health.unread_for(&[UnreadReason::Empty]))
        .column(Failures, "page failed", |health| health.failures());
    for (reason, name) in UnreadReason::ALL.into_iter().zip(UNREAD) {
        builder = builder.column(Count, &*format!("csv {name}"), |health| health.unread_for(&[reason]));
    }
    for (kind, name) in FailureKind::ALL.into_iter().zip(FAILED) {
        builder =
            builder.column(Count, &*format!("csv {name}"), |health| health.failed.get(&kind).copied().unwrap_or(0));
    }
    builder.build()
}

/// Count with its share of all replies, as in `3 (12.5 %)`.
fn count_with_share(health: &Health, count: usize) -> String {
    let replies = health.replies.max(1) as f64;
    format!("{count} ({} %)", percent(count as f64 / replies))
}
