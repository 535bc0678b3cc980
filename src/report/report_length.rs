//! How much of a report is printed: [`ReportLength`].

/// How much of a report is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReportLength {
    /// The summary, the first finding of each group, and the table by level.
    Summary,
    /// The summary and all findings.
    Findings,
    /// All findings and every table.
    Full,
}
