//! The result of a command ([`Outcome`]), and the format of its results ([`ShowArgs`], [`StdoutFormat`]).

use std::path::PathBuf;

use clap::Args;

use crate::report::report_length::ReportLength;
use crate::types::Decides;
use crate::types::manifests::Status;

/// The status and output of a command that has ended.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// Status that decides the exit code.
    pub status: Status,
    /// Text for standard output.
    pub output: String,
    /// Paths written, which `--quiet` prints alone; empty if the text itself is the result.
    pub written: Vec<PathBuf>,
}

impl Outcome {
    /// The status of a command whose work may have failed in part.
    pub(crate) fn complete_if(is_whole: bool) -> Status {
        if is_whole {
            Status::Complete
        } else {
            Status::Incomplete
        }
    }

    /// A command whose text is its result.
    pub(crate) fn text(status: Status, output: String) -> Self {
        let written = Vec::new();
        Self {
            status,
            output,
            written,
        }
    }

    /// A command that wrote something, and prints that.
    pub(crate) fn wrote(path: impl Into<PathBuf>, status: Status, output: String) -> Self {
        let written = vec![path.into()];
        Self {
            status,
            output,
            written,
        }
    }

    /// The same result, its text wanted as it is unless it is the short one.
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
    /// Do not write records.parquet, the records as a table for DuckDB, pandas and R
    #[arg(long, add = Decides::Nothing)]
    pub no_parquet: bool,
}

impl ShowArgs {
    /// Whether the table of records is written.
    pub(crate) fn table(&self) -> RecordTable {
        if self.written.no_parquet {
            RecordTable::LeftOut
        } else {
            RecordTable::Written
        }
    }

    /// The format that the flags ask for.
    #[must_use]
    pub(crate) fn format(&self) -> StdoutFormat {
        StdoutFormat {
            syntax: if self.json {
                Syntax::Json
            } else {
                Syntax::Text
            },
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
    /// The text without a flag.
    const SUMMARY: Self = Self {
        syntax: Syntax::Text,
        length: ReportLength::Summary,
    };

    /// Whether the text is a document of its own, to which no line may be added.
    #[must_use]
    pub(crate) fn is_document(self) -> bool {
        self.syntax != Syntax::Text
    }

    /// Whether the text is JSON.
    pub(crate) fn is_json(self) -> bool {
        self.syntax == Syntax::Json
    }
}

/// Whether `records.parquet` is written beside the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RecordTable {
    Written,
    /// By `--no-parquet`.
    LeftOut,
}
