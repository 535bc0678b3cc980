//! Sections of the page before the items: [`sections`].

use serde::Serialize;

use super::tables;
use crate::report::charts::chart::Figure;
use crate::report::charts::samples::{SampleTable, samples};
use crate::report::tables::{ENHANCERS, Section};
use crate::report::text::table::Table;
use crate::types::Thumbnail;

/// Section for the template.
#[derive(Serialize)]
pub(super) struct PageSection<'a> {
    id: &'static str,
    title: &'static str,
    note: &'static str,
    figures: Vec<&'a Figure>,
    samples: Vec<SampleTable>,
    tables: Vec<tables::PageTable<'a>>,
}

/// Sections that have a table, a figure or samples.
pub(super) fn sections<'a>(
    sections: &[Section],
    tables: &'a [Table],
    figures: &'a [Figure],
    thumbnails: &[Thumbnail],
) -> Vec<PageSection<'a>> {
    sections
        .iter()
        .filter_map(|&(id, title, note, figure_names)| {
            let figures: Vec<&Figure> = figures.iter().filter(|figure| figure_names.contains(&figure.name)).collect();
            let samples = match id {
                ENHANCERS => samples(thumbnails),
                _ => Vec::new(),
            };
            let tables = tables::page_tables(tables, id);
            let has_content = !tables.is_empty() || !figures.is_empty() || !samples.is_empty();
            has_content.then_some(PageSection { id, title, note, figures, samples, tables })
        })
        .collect()
}
