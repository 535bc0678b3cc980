//! Contents of `summary.json`: a head that describes the run, and the rows of `summary.csv` that the report includes.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Serialize, Serializer};

use crate::text::table::{Table, TableRow, fields};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_runs::outcome::ReportLength;

/// JSON document of a head and table rows; each row is an object with the column names as keys.
#[derive(Serialize)]
struct Document<'a, H> {
    #[serde(flatten)]
    head: H,
    /// Rows of the summary; omitted if the report contains only findings.
    #[serde(skip_serializing_if = "Option::is_none")]
    rows: Option<JsonRows<'a>>,
    /// All tables by file name; only in a full report.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    tables: BTreeMap<&'a str, JsonRows<'a>>,
}

/// Rows of tables that have the same columns in their file; each row becomes an object. Tables without a file have no
/// rows.
pub(super) struct JsonRows<'a>(pub(super) &'a [Table]);

impl<'a> JsonRows<'a> {
    /// Rows of one table.
    pub(super) fn new(table: &'a Table) -> Self {
        Self(std::slice::from_ref(table))
    }
}

impl Serialize for JsonRows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(
            self.0
                .iter()
                .filter(|table| table.has_file())
                .flat_map(|table| table.rows.iter().map(move |row| RowObject { table, row })),
        )
    }
}

/// One row as an object with the column names as keys.
struct RowObject<'a> {
    table: &'a Table,
    row: &'a TableRow,
}

impl Serialize for RowObject<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let cells = self.table.cells(self.row);
        serializer.collect_map(cells.flat_map(|(column, cell)| {
            let names = &column.heads.csv;
            names.iter().zip(fields(cell, names.len()))
        }))
    }
}

/// Serialises a head, the rows of the summary and, in a full report, all tables as one JSON document.
///
/// # Errors
/// If the document cannot be serialised.
pub(super) fn document(head: impl Serialize, rows: &Table, tables: &[Table], length: ReportLength) -> Result<String> {
    let document = Document {
        head,
        rows: (length != ReportLength::Findings).then(|| JsonRows::new(rows)),
        tables: tables
            .chunk_by(|one, other| one.name == other.name)
            .filter(|parts| length == ReportLength::Full && parts.iter().any(Table::has_file))
            .map(|parts| (parts[0].name, JsonRows(parts)))
            .collect(),
    };
    serde_json::to_string_pretty(&document).map(|text| text + "\n").map_err(|e| Error::data("summary.json", e))
}

/// Runs in the head of a summary: `run` and `folder` for a single run, `runs` for several; unused fields are omitted.
#[derive(Serialize)]
pub(super) struct RunsHead<'a> {
    schema: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    run: Option<&'a RunManifest>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    runs: Vec<ComparedRun<'a>>,
}

/// One of several runs, with its folder.
#[derive(Serialize)]
struct ComparedRun<'a> {
    folder: &'a Path,
    run: &'a RunManifest,
}

/// Runs that a summary describes.
#[derive(Debug, Clone, Copy)]
pub enum SummaryRuns<'a> {
    /// One run, with its folder if the summary is stored elsewhere.
    One(&'a RunManifest, Option<&'a Path>),
    /// Several runs, each with its folder.
    Several(&'a [(&'a RunManifest, &'a Path)]),
}

impl<'a> SummaryRuns<'a> {
    /// Folder of the first run; `None` for a summary in the folder of its run.
    pub(super) fn first_folder(self) -> Option<&'a Path> {
        match self {
            Self::One(_, folder) => folder,
            Self::Several(runs) => runs.first().map(|(_, folder)| *folder),
        }
    }

    /// Head of a summary, with the name of its schema.
    pub(super) fn head(self, schema: &'static str) -> RunsHead<'a> {
        let (run, folder, runs) = match self {
            Self::One(run, folder) => (Some(run), folder, [].as_slice()),
            Self::Several(runs) => (None, None, runs),
        };
        RunsHead { schema, folder, run, runs: runs.iter().map(|&(run, folder)| ComparedRun { folder, run }).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::table::ColumnKind::Count;
    use crate::text::table::TableBuilder;

    #[test]
    fn tables_without_csv_columns_have_no_rows() {
        let tables = ["csv n | page n", "page n"]
            .map(|heads| TableBuilder::new("readings", [1_usize]).column(Count, heads, |row| *row).build());
        let head = serde_json::json!({});
        let text = document(head, &tables[0], &tables, ReportLength::Full).unwrap();
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(document["tables"], serde_json::json!({"readings": [{"n": 1}]}));
    }
}
