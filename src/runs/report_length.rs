//! Length of a report: [`ReportLength`].

/// Parts of a report that are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReportLength {
    /// Summary, main finding of each group, and table by level.
    Summary,
    /// Summary and all findings.
    Findings,
    /// All findings and every table.
    Full,
}
