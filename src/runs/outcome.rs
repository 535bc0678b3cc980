//! The result of a command ([`Outcome`]), and the format of its results ([`ShowArgs`], [`StdoutFormat`]).

use std::path::PathBuf;

use clap::Args;

use crate::runs::report_length::ReportLength;
use crate::types::Decides;
use crate::types::manifests::Status;

/// The result of a command.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// Determines the exit code.
    pub status: Status,
    /// Text for standard output.
    pub output: String,
    /// Paths written. With `--quiet`, only these are printed, unless the list is empty because the text itself is the
    /// result.
    pub written: Vec<PathBuf>,
}

impl Outcome {
    /// `Complete` if all work of the command succeeded, else `Incomplete`.
    pub(crate) fn complete_if(is_whole: bool) -> Status {
        if is_whole { Status::Complete } else { Status::Incomplete }
    }

    /// The result of a command that only prints text.
    pub(crate) fn text(status: Status, output: String) -> Self {
        Self { status, output, written: Vec::new() }
    }

    /// The result of a command that wrote a file or folder, and prints text about it.
    pub(crate) fn wrote(path: impl Into<PathBuf>, status: Status, output: String) -> Self {
        Self { status, output, written: vec![path.into()] }
    }

    /// Makes the text the result, so that `--quiet` prints it, if a format other than the default summary was
    /// requested.
    pub(crate) fn in_format(mut self, format: StdoutFormat) -> Self {
        if format != StdoutFormat::SUMMARY {
            self.written.clear();
        }
        self
    }
}

/// Flags that say how a report is printed, and what is written with it.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct ShowArgs {
    /// Print all findings and every table
    #[arg(long, conflicts_with = "findings", add = Decides::Nothing)]
    pub full: bool,
    /// Print all findings, without a table
    #[arg(long, add = Decides::Nothing)]
    pub findings: bool,
    /// Print the summary as JSON instead of text
    #[arg(long, add = Decides::Nothing)]
    pub json: bool,
    /// Files written beside the report.
    #[command(flatten)]
    pub written: WrittenArgs,
}

/// Flags that say what is written beside a report.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct WrittenArgs {
    /// Do not write records.parquet (the records for DuckDB, pandas and R)
    #[arg(long, add = Decides::Nothing)]
    pub no_parquet: bool,
}

impl ShowArgs {
    /// Whether to write the table of records.
    pub(crate) fn record_table(&self) -> RecordTable {
        if self.written.no_parquet { RecordTable::Skip } else { RecordTable::Write }
    }

    /// The format requested by the flags.
    #[must_use]
    pub(crate) fn format(&self) -> StdoutFormat {
        StdoutFormat {
            syntax: if self.json { Syntax::Json } else { Syntax::Text },
            length: match (self.full, self.findings) {
                (true, _) => ReportLength::Full,
                (_, true) => ReportLength::Findings,
                _ => ReportLength::Summary,
            },
        }
    }
}

/// Format of a report on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StdoutFormat {
    pub(crate) syntax: Syntax,
    pub(crate) length: ReportLength,
}

/// Syntax of a report on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Syntax {
    Text,
    Markdown,
    Json,
}

impl StdoutFormat {
    /// The default format.
    const SUMMARY: Self = Self { syntax: Syntax::Text, length: ReportLength::Summary };

    /// True for JSON and Markdown, to which no further lines may be added.
    #[must_use]
    pub(crate) fn is_document(self) -> bool {
        self.syntax != Syntax::Text
    }

    pub(crate) fn is_json(self) -> bool {
        self.syntax == Syntax::Json
    }
}

/// Whether to write `records.parquet` next to the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RecordTable {
    Write,
    /// Set by `--no-parquet`.
    Skip,
}
