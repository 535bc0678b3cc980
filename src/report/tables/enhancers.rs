//! Table of the use of each enhancer: preprocessing, resizing, and the brightness of its images.

use super::sections::ENHANCERS;
use crate::report::text::table::ColumnKind::Text;
use crate::report::text::table::{Table, TableBuilder};

/// Use of an enhancer in a run, as texts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EnhancerRow {
    /// Name of the enhancer, with the name of its run if there are several.
    pub(crate) name: String,
    /// Input and output conventions of the model, and changes of image size.
    pub(crate) how: String,
    /// Appearance of its images of the probe and of the run's dark frames.
    pub(crate) looks: String,
}

/// Builds the table; `None` without an enhancer.
pub(crate) fn enhancers(rows: &[EnhancerRow]) -> Option<Table> {
    if rows.is_empty() {
        return None;
    }
    let name = "csv enhancer | terminal enhancer | page enhancer";
    let how = "csv how | terminal fed and read | page fed and read";
    let looks = "csv dark_images | terminal dark images | page its images of dark frames";
    let table = TableBuilder::new("enhancer_use", rows)
        .page(ENHANCERS, "How each enhancer was used")
        .column(Text, name, |row| row.name.clone())
        .column(Text, how, |row| row.how.clone())
        .column(Text, looks, |row| row.looks.clone())
        .build();
    Some(table)
}
