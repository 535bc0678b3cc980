//! The line below tables about the training data of enhancers: [`with_training`].

use crate::text::table::{Table, TableCell};
use crate::text::words::names_enhancer;
use crate::types::ModelListing;

/// The tables with a line below each one that has results of an enhancer whose training data are known.
pub(crate) fn with_training(mut tables: Vec<Table>, listing: &ModelListing) -> Vec<Table> {
    for (enhancer, training) in listing.trainings() {
        for table in tables
            .iter_mut()
            .filter(|table| has_results(table, enhancer))
        {
            let line = format!("{enhancer}: {training}");
            table.foot = Some(match table.foot.take() {
                Some(foot) => format!("{foot}; {line}"),
                None => line,
            });
        }
    }
    tables
}

/// Whether a row is about an enhancer.
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
    use crate::text::table::ColumnKind::Text;
    use crate::text::table::TableBuilder;

    #[test]
    fn training_data_stand_below_results_of_the_enhancer_alone() {
        let table = |row: &'static str| {
            TableBuilder::new("levels", [row])
                .page("accuracy", "Accuracy")
                .column(Text, "page condition", |row| (*row).to_owned())
                .build()
        };
        let mut listing = ModelListing::default();
        listing.add_training("lift", "drawn rooms".to_owned());
        let tables = ["L3-noise+lift", "with noise + lift", "lift-2", "raw"].map(table);
        let tables = with_training(tables.to_vec(), &listing);
        let feet: Vec<Option<&str>> = tables.iter().map(|table| table.foot.as_deref()).collect();
        let line = Some("lift: trained on drawn rooms");
        assert_eq!(feet, [line, line, None, None]);
    }
}
