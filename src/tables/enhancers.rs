//! The table of how each enhancer made its images.

use super::sections::ENHANCERS;
use crate::text::table::ColumnKind::Text;
use crate::text::table::{Table, TableBuilder};

/// How an enhancer of a run made its images, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EnhancerRow {
    /// Name of the enhancer; with that of the run if there are several.
    pub(crate) name: String,
    /// How it was fed and read, and what was done because of sizes.
    pub(crate) how: String,
    /// The look of the probe's and the run's images.
    pub(crate) looks: String,
}

pub(crate) fn enhancers(rows: &[EnhancerRow]) -> Option<Table> {
    let row = "csv enhancer | terminal enhancer | page enhancer";
    let how = "csv how | terminal fed and read | page fed and read";
    let looks = "csv dark_images | terminal dark images | page its images of dark frames";
    let builder = TableBuilder::new("enhancer_use", rows)
        .page(ENHANCERS, "How each enhancer was used")
        .column(Text, row, |row| row.name.clone())
        .column(Text, how, |row| row.how.clone())
        .column(Text, looks, |row| row.looks.clone());
    (!rows.is_empty()).then(|| builder.build())
}
