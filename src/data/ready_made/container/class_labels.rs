//! Names of the classes in a Parquet file that the library `datasets` of Hugging Face wrote: [`ClassLabels`].

use std::collections::HashMap;

use parquet::file::metadata::FileMetaData;
use serde_json::Value;

use crate::data::ready_made::cells::Cell;

/// Names of the classes by column. The cells of such a column are the numbers of classes, counted from 0.
#[derive(Debug, Default)]
pub(super) struct ClassLabels(HashMap<String, Vec<String>>);

impl ClassLabels {
    /// Reads the features in the metadata of a file; none if it has no such metadata.
    ///
    /// Classes that are named after columns of the file, as `choice1` and `choice2`, are left out: their numbers select
    /// the column.
    pub(super) fn new(file: &FileMetaData) -> Self {
        let features = file
            .key_value_metadata()
            .into_iter()
            .flatten()
            .find(|entry| entry.key == "huggingface")
            .and_then(|entry| serde_json::from_str::<Value>(entry.value.as_deref()?).ok())
            .unwrap_or_default();
        let features = features.pointer("/info/features").and_then(Value::as_object);
        let columns = file.schema().get_fields();
        let labels = features.into_iter().flatten().filter_map(|(column, feature)| {
            let names: Vec<String> = feature
                .get("names")
                .filter(|_| feature["_type"] == "ClassLabel")?
                .as_array()?
                .iter()
                .map(|name| name.as_str().map(str::to_owned))
                .collect::<Option<_>>()?;
            let are_columns = names.iter().all(|name| columns.iter().any(|column| column.name() == name));
            (!are_columns).then(|| (column.clone(), names))
        });
        Self(labels.collect())
    }

    /// The name of the class in place of its number; other cells are unchanged.
    pub(super) fn named(&self, column: &str, cell: Cell) -> Cell {
        let name = match &cell {
            Cell::Number(number) => {
                self.0.get(column).zip(number.parse::<usize>().ok()).and_then(|(names, number)| names.get(number))
            }
            _ => None,
        };
        name.map_or(cell, |name| Cell::Text(name.clone()))
    }
}
