//! The result of a command ([`Outcome`]), and the format of its results ([`ShowArgs`], [`StdoutFormat`]).

use std::path::PathBuf;

use clap::Args;

use crate::types::Decides;
use crate::types::manifest::Status;

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

    /// A command that wrote something, and says so.
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
        if format != StdoutFormat::Short {
            self.written.clear();
        }
        self
    }
}

/// Flags that say how a report is printed, and what is written with it.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct ShowArgs {
    /// Print every table, not only the findings and the accuracies
    #[arg(long, conflicts_with_all = ["json", "findings"], add = Decides::Nothing)]
    pub full: bool,
    /// Print the findings alone, without a table
    #[arg(long, conflicts_with = "json", add = Decides::Nothing)]
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
        match (self.json, self.full, self.findings) {
            (true, ..) => StdoutFormat::Json,
            (_, true, _) => StdoutFormat::Full,
            (.., true) => StdoutFormat::Findings,
            _ => StdoutFormat::Short,
        }
    }
}

/// Format of a report on standard output. Open questions have one text for all but JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StdoutFormat {
    /// The findings and one table.
    Short,
    /// The findings alone.
    Findings,
    /// The findings and every table.
    Full,
    /// The findings and the table by level, as Markdown.
    Markdown,
    Json,
}

impl StdoutFormat {
    /// Whether the text is a document of its own, to which no line may be added.
    #[must_use]
    pub(crate) fn is_document(self) -> bool {
        matches!(self, Self::Markdown | Self::Json)
    }
}

/// Whether `records.parquet` is written beside the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RecordTable {
    Written,
    /// By `--no-parquet`.
    LeftOut,
}
