//! Table of new runs compared with an old run, with a row for each model and condition.

use crate::report::text::latex::escape;
use crate::report::text::table::ColumnKind::{self, Count, Number, P, Percent, Points, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use darkqa_score::comparisons::{BaselineRow, BaselineSide, MIN_PAIRS};
use darkqa_score::significance::Significance;

/// Name of the table, and id of its section on the page.
pub(crate) const BASELINE: &str = "baseline";

/// Builds the table of paired differences; `old` is the name of the baseline run.
#[must_use]
pub(crate) fn baseline(rows: &[BaselineRow], old: &str) -> Table {
    let difference = "csv difference low high | terminal new less old, 95 % interval | page new less old [95 %] \
                      | latex Difference [95\\,\\%]";
    let builder = TableBuilder::new(BASELINE, rows)
        .page(BASELINE, &format!("New less {old}"))
        .column(Text, "csv model | terminal model | page model | latex Model", |row| row.subject.model.clone())
        .column(Text, "csv condition | terminal condition | page condition | latex Condition", |row| {
            row.subject.condition()
        })
        .column(Count, "csv n | terminal n | page n | latex $n$", |row| row.paired.difference.n)
        .column(Count, "csv other_images", |row| row.other_images)
        .column(Percent, "csv old | page old in %", |row| row.paired.second)
        .column(Percent, "csv new | page new in %", |row| row.paired.first)
        .column(Points, difference, |row| row.paired.difference)
        .column(Count, "csv only_new | terminal only new | page only new | latex Only new", |row| row.paired.gained)
        .column(Count, "csv only_old | terminal only old | page only old | latex Only old", |row| row.paired.lost)
        .column(P, "csv p", |row| row.paired.p)
        .column(P, "csv p_holm | terminal p (Holm) | page p (Holm) | latex $p$ (Holm)", |row| row.holm);
    let mut table = reply_columns(builder)
        .column(ColumnKind::Significance, "csv verdict | terminal | page | latex", |row| row.significance)
        .build();
    table.heading = Some(format!("New less {old}, paired by question and image"));
    table.latex = Some(format!("New less {}, paired by question, in percentage points.", escape(old)));
    let too_few = rows.iter().filter(|row| row.significance == Significance::TooFew).count();
    if too_few > 0 {
        let line = format!("too few: fewer than {MIN_PAIRS} items are shared, so no verdict is given");
        table.notes.push(line);
    }
    if rows.is_empty() {
        table.notes.push(format!("no model answered the same item about the same image in {old}"));
    }
    table
}

/// An old and a new count, as in `3 → 5`.
fn old_and_new(row: &BaselineRow, count: fn(&BaselineSide) -> usize) -> String {
    let [new, old] = row.sides.each_ref().map(count);
    format!("{old} → {new}")
}

/// Adds columns of unreadable replies, failures and costs in the old and the new run.
fn reply_columns(builder: TableBuilder<&BaselineRow>) -> TableBuilder<&BaselineRow> {
    builder
        .column(Count, "csv unread_old", |row| row.sides[1].unread)
        .column(Count, "csv unread_new", |row| row.sides[0].unread)
        .column(Count, "csv failed_old", |row| row.sides[1].failed)
        .column(Count, "csv failed_new", |row| row.sides[0].failed)
        .column(Number, "csv cost_old", |row| row.sides[1].cost)
        .column(Number, "csv cost_new", |row| row.sides[0].cost)
        .column(Count, "terminal unread | page unread", |row| old_and_new(row, |side| side.unread))
        .column(Count, "terminal failed | page failed", |row| old_and_new(row, |side| side.failed))
        .column(Number, "terminal cost in $ | page cost in $", |row| {
            let [new, old] = row.sides.map(|side| side.cost);
            match new.zip(old) {
                Some((new, old)) => TableCell::Text(format!("{old:.2} → {new:.2}")),
                None => TableCell::Missing,
            }
        })
}
