//! The flags of `report`.

use std::path::PathBuf;

use clap::Args;

/// The flags of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folders of runs
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<PathBuf>,
    /// Read all kept replies again by the rules of this version; asks nothing, and keeps the readings that changed
    #[arg(long)]
    pub rescore: bool,
    /// Where the report goes: report.html, tables as CSV and LaTeX, figures as SVG; default: the folder of the run where it
    /// is one, else nowhere
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}
