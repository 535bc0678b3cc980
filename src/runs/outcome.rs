//! The result of a command ([`Outcome`]), and the format of its results ([`PrintArgs`], [`StdoutFormat`]).
//!
//! Length of a report: [`ReportLength`].
//!
//! Note in a manifest that a run cost more than `--max-cost`: [`OverBudget`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use darkqa_base::types::Decides;
use darkqa_base::types::flags::{milliseconds, positive};
use darkqa_base::types::manifests::{RunManifest, Status};
use darkqa_base::types::text::money;

/// The result of a command.
#[derive(Debug)]
pub struct Outcome {
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
    pub fn complete_if(is_whole: bool) -> Status {
        if is_whole { Status::Complete } else { Status::Incomplete }
    }

    /// The result of a command that only prints text.
    pub fn text(status: Status, output: String) -> Self {
        Self { status, output, written: Vec::new() }
    }

    /// The result of a command that wrote a file or folder, and prints text about it.
    pub fn wrote(path: impl Into<PathBuf>, status: Status, output: String) -> Self {
        Self { status, output, written: vec![path.into()] }
    }

    /// Makes the text the result, so that `--quiet` prints it, if a format other than the default summary was
    /// requested.
    #[must_use]
    pub fn in_format(mut self, format: StdoutFormat) -> Self {
        if format != StdoutFormat::SUMMARY {
            self.written.clear();
        }
        self
    }
}

/// Flags that say how a report is printed, and what is written with it.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct PrintArgs {
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

/// Facts that a user states about a run for its report. They do not change what is asked.
#[derive(Debug, Clone, Copy, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct StatedArgs {
    /// Light where the images were taken (L0), measured in lux: the report then states thresholds in lux, too, and keeps
    /// it with the run; default: not known
    #[arg(long, alias = "lux-at-L0", value_name = "LUX", value_parser = positive, add = Decides::Nothing)]
    pub lux_at_l0: Option<f64>,
    /// Time that an enhancer may take for an image, such as 50ms: the report names enhancers that take longer, and keeps
    /// it with the run; default: no limit
    #[arg(long, value_name = "TIME", help_heading = "Enhancement", value_parser = milliseconds, add = Decides::Nothing)]
    pub llie_budget: Option<f64>,
}

/// Key of the light at L0, in lux, in the settings of a manifest.
pub const LUX_AT_L0: &str = "--lux-at-l0";

/// Key of the mean exposure value at ISO 100 of the images, and their number, in the settings of a manifest.
pub const EXPOSURE_VALUE: &str = "exposure value at ISO 100";

/// Key of the prompt templates in the settings of a manifest, if they are not the built-in ones.
pub const PROMPTS: &str = "prompt templates";

/// Key of the time that an enhancer may take for an image, in milliseconds, in the settings of a manifest.
pub const LLIE_BUDGET: &str = "--llie-budget";

impl StatedArgs {
    /// The settings for a manifest, as far as they are stated.
    pub fn settings(self) -> impl Iterator<Item = (&'static str, Value)> {
        let stated = [(LUX_AT_L0, self.lux_at_l0), (LLIE_BUDGET, self.llie_budget)];
        stated.into_iter().filter_map(|(key, value)| Some((key, json!(value?))))
    }
}

/// Flags that say what is written beside a report.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct WrittenArgs {
    /// Do not write records.parquet (the records for DuckDB, pandas and R)
    #[arg(long, add = Decides::Nothing)]
    pub no_parquet: bool,
}

impl PrintArgs {
    /// Whether to write the table of records.
    pub fn record_table(&self) -> RecordTable {
        if self.written.no_parquet { RecordTable::Skip } else { RecordTable::Write }
    }

    /// The format requested by the flags.
    #[must_use]
    pub fn format(&self) -> StdoutFormat {
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct StdoutFormat {
    pub syntax: Syntax,
    pub length: ReportLength,
}

/// Syntax of a report on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Syntax {
    Text,
    Markdown,
    Json,
}

impl StdoutFormat {
    /// The default format.
    const SUMMARY: Self = Self { syntax: Syntax::Text, length: ReportLength::Summary };

    /// True for JSON and Markdown, to which no further lines may be added.
    #[must_use]
    pub fn is_document(self) -> bool {
        self.syntax != Syntax::Text
    }

    pub fn is_json(self) -> bool {
        self.syntax == Syntax::Json
    }
}

/// Whether to write `records.parquet` next to the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordTable {
    Write,
    /// Set by `--no-parquet`.
    Skip,
}

/// Parts of a report that are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum ReportLength {
    /// Summary, main finding of each group, and table by level.
    Summary,
    /// Summary and all findings.
    Findings,
    /// All findings and every table.
    Full,
}

/// Manifest setting with the note.
const ENTRY: &str = "--max-cost exceeded";

/// Cost of a run that exceeded its limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverBudget {
    /// The limit, in US dollars.
    pub limit: f64,
    /// The cost, in US dollars.
    pub spent: f64,
    /// Number of replies that were charged more tokens than their limit, by model.
    #[serde(default)]
    pub longer_replies: BTreeMap<String, usize>,
    /// Number of replies that were charged more than the price table says, by model.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub dearer_replies: BTreeMap<String, usize>,
}

impl OverBudget {
    /// Replaces the note in a manifest; removes it if the run is within its limit.
    pub fn note(over: Option<&Self>, manifest: &mut RunManifest) {
        manifest.settings.remove(ENTRY);
        if let Some(over) = over {
            manifest.settings.insert(ENTRY.to_owned(), json!(over));
        }
    }

    /// Reads the note in a manifest; `None` if there is none.
    pub fn read(manifest: &RunManifest) -> Option<Self> {
        serde_json::from_value(manifest.settings.get(ENTRY)?.clone()).ok()
    }

    /// A sentence about the cost, with the cause if it is known.
    pub fn sentence(&self) -> String {
        let causes = [
            (&self.longer_replies, "replies that were charged more tokens than --max-tokens"),
            (&self.dearer_replies, "replies that were charged more than the price table"),
        ];
        let cause: String = causes
            .into_iter()
            .filter(|(replies, _)| !replies.is_empty())
            .map(|(replies, what)| {
                let replies: Vec<String> = replies.iter().map(|(model, count)| format!("{model} ({count})")).collect();
                format!("; {what}: {}", replies.join(", "))
            })
            .collect();
        format!("The requests cost {}, more than the {} of --max-cost{cause}.", money(self.spent), money(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_names_the_models_that_exceeded_their_limit() {
        let mut over =
            OverBudget { limit: 0.5, spent: 2.0, longer_replies: BTreeMap::new(), dearer_replies: BTreeMap::new() };
        let plain = "The requests cost $2.00, more than the $0.5000 of --max-cost.";
        assert_eq!(over.sentence(), plain);
        over.longer_replies.insert("m".to_owned(), 3);
        assert!(over.sentence().ends_with("than --max-tokens: m (3)."));
        over.longer_replies.clear();
        over.dearer_replies.insert("m".to_owned(), 2);
        let sentence = over.sentence();
        assert!(sentence.ends_with("; replies that were charged more than the price table: m (2)."));
    }
}
