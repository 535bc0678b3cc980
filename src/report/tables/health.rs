//! Table of replies, unreadable replies and failures for each model in a condition.

use crate::report::text::table::ColumnKind::{Count, Failures};
use crate::report::text::table::{Table, TableBuilder};
use crate::report::text::words::percent;
use crate::types::{FailureKind, UnreadReason};
use darkqa_score::accuracies::Health;

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
pub(crate) fn health(health: &[Health]) -> Table {
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
