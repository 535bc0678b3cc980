//! The sections of the page before the items: [`sections`].

use serde_json::{Value, json};

use super::tables;
use crate::report::chart::Figure;
use crate::report::samples::samples;
use crate::report::table::Table;
use crate::report::tables::{ENHANCERS, SECTIONS};
use crate::types::Thumbnail;

/// All sections that the records have something for.
pub(super) fn sections(
    tables: &[Table],
    figures: &[Figure],
    thumbnails: &[Thumbnail],
) -> Vec<Value> {
    let sections = SECTIONS.iter().filter_map(|&(id, title, note, drawn)| {
        let figures = figures.iter().filter(|figure| drawn.contains(&figure.name));
        let figures: Vec<&Figure> = figures.collect();
        let samples = samples(thumbnails).filter(|_| id == ENHANCERS);
        let tables = tables::shown(tables, id);
        let is_there = !tables.is_empty() || !figures.is_empty() || samples.is_some();
        is_there.then(|| {
            json!({"id": id, "title": title, "note": note, "figures": figures, "samples": samples, "tables": tables})
        })
    });
    sections.collect()
}
