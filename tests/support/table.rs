//! Tables of cases: every row is checked, and all rows that fail are reported.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::thread;

/// Checks every row of a table. Fails at the end with the number and the message of each row that failed.
pub(crate) fn check_rows<T>(rows: impl IntoIterator<Item = T>, mut check: impl FnMut(T)) {
    let mut failures = Vec::new();
    for (number, row) in rows.into_iter().enumerate() {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| check(row))) {
            failures.push(format!("row {number}: {}", message(&*panic)));
        }
    }
    assert!(failures.is_empty(), "{} rows failed:\n{}", failures.len(), failures.join("\n"));
}

/// Checks every row of a table at once, for rows that mostly wait; reports them as [`check_rows`] does.
pub(crate) fn check_rows_at_once<T: Send>(rows: impl IntoIterator<Item = T>, check: impl Fn(T) + Sync) {
    let check = &check;
    thread::scope(|scope| {
        let checks: Vec<_> = rows.into_iter().map(|row| scope.spawn(move || check(row))).collect();
        check_rows(checks, |row| {
            row.join().unwrap_or_else(|panic| resume_unwind(panic));
        });
    });
}

/// The message of a panic.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}
