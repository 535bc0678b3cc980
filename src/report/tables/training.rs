//! Notes below tables on the training data of enhancers: [`with_training`].

use crate::report::text::table::{Table, TableCell};
use crate::report::text::words::names_enhancer;
use crate::types::ModelListing;

/// Adds a note on the training data of an enhancer, if known, to each table that has its results.
pub(crate) fn with_training(mut tables: Vec<Table>, listing: &ModelListing) -> Vec<Table> {
    for (enhancer, training) in listing.trainings() {
        for table in tables.iter_mut().filter(|table| has_results(table, enhancer)) {
            let line = format!("{enhancer}: {training}");
            table.foot = Some(match table.foot.take() {
                Some(foot) => format!("{foot}; {line}"),
                None => line,
            });
        }
    }
    tables
}

/// True if a row of the table is about an enhancer.
fn has_results(table: &Table, enhancer: &str) -> bool {
    table.rows.iter().any(|row| {
        row.cells
            .iter()
            .filter_map(|cell| match cell {
                TableCell::Text(text) => Some(&**text),
                _ => None,
            })
            .chain(row.group.as_deref())
            .any(|text| names_enhancer(text, enhancer))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::table::ColumnKind::Text;
    use crate::report::text::table::TableBuilder;

    fn table(condition: &'static str) -> Table {
        TableBuilder::new("levels", [condition])
            .page("accuracy", "Accuracy")
            .column(Text, "page condition", |row| (*row).to_owned())
            .build()
    }

    #[test]
    fn only_tables_with_results_have_a_training_note() {
        let mut listing = ModelListing::default();
        listing.add_training("lift", "drawn rooms".to_owned());
        let tables = ["L3-noise+lift", "with noise + lift", "lift-2", "raw"].map(table);
        let tables = with_training(tables.to_vec(), &listing);
        let feet: Vec<Option<&str>> = tables.iter().map(|table| table.foot.as_deref()).collect();
        let line = Some("lift: trained on drawn rooms");
        assert_eq!(feet, [line, line, None, None]);
    }
}
