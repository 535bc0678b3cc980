//! Texts on the measure of a report without true answers: [`AGREEMENT`], [`HOW_TO_READ`].

/// Name of the measure in files.
pub(super) const AGREEMENT: &str = "agreement";

/// Remark below all sentences, on how to interpret agreement.
pub(super) const HOW_TO_READ: &str = "Agreement is with the model's own answer at L0, whether that is true or not; whatever the truth is, the share of right answers falls by at most one minus the agreement. It says little alone: read it between the floor (no image) and the ceiling (the same image asked again), beside κ and the entropy of the answers. Signs and p are corrected over all tests behind these sentences; an interval is of one test, 95 %.";
