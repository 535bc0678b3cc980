//! The command `report`, for one run or several: [`report`].

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use super::alerts::alerts;
use super::choice::in_its_folder;
use super::combine::{Combined, combine};
use super::open;
use crate::error::{Error, Result};
use crate::files;
use crate::job::stored::{AnyRun, StoredRun};
use crate::job::{Outcome, StdoutFormat, count};
use crate::report::json::{RunList, summary};
use crate::report::products::{PAGE, products};
use crate::report::tables::tables;
use crate::report::terminal::evaluation;
use crate::store::{AddressChange, Store};
use crate::types::manifest::Status;
use crate::types::{ChoiceDetail, Decides, OpenDetail};

/// The flags of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// The folders of the runs; several runs are compared
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// Read all stored replies again by the rules of this version; asks nothing, and stores the readings that changed
    #[arg(long, add = Decides::Nothing)]
    pub rescore: bool,
    /// Where the report goes: report.html, tables as CSV and LaTeX, figures as SVG; default: the folder of the run if it
    /// is one, else nowhere
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long, add = Decides::Nothing)]
    pub json: bool,
}

impl ReportArgs {
    fn show(&self) -> StdoutFormat {
        StdoutFormat::of(self.json)
    }
}

/// The report of a run, or a comparison of several of the same kind. With `--rescore`, changed readings are stored in their run.
///
/// # Errors
/// If a folder holds no run, a record is broken, or the runs asked different questions.
pub(crate) fn report(args: &ReportArgs) -> Result<Outcome> {
    let (mut choice, mut open) = (Vec::new(), Vec::new());
    for folder in &args.runs {
        match AnyRun::open(folder)? {
            AnyRun::Choice(run) => choice.push(run),
            AnyRun::Open(run) => open.push(run),
        }
    }
    let output = match (choice.is_empty(), open.is_empty()) {
        (_, true) => of_choices(args, choice)?,
        (true, false) => of_open(args, open)?,
        (false, false) => {
            return Err(Error::usage(
                "RUN",
                "runs of questions with choices and of open questions cannot be compared; report each kind alone",
            ));
        }
    };
    Ok(Outcome {
        status: Status::Complete,
        output,
    })
}

fn of_choices(args: &ReportArgs, mut runs: Vec<StoredRun<ChoiceDetail>>) -> Result<String> {
    let mut output = String::new();
    for run in &mut runs {
        if run.records.is_empty() {
            return Err(no_records(run.folder.clone()));
        }
        if args.rescore {
            let changed = reread(run)?;
            let records = run.records.len();
            let _ = writeln!(
                output,
                "{changed} of {records} records now read differently"
            );
            run.manifest.counts = count(run.manifest.counts.trials, &run.records);
        }
    }
    if args.show() == StdoutFormat::Json {
        output.clear();
    }
    let combined = combine(runs)?;
    output += &match (&*combined.runs, &args.out) {
        ([run], None) => match Store::open(&run.folder, &run.manifest, AddressChange::Allowed) {
            Ok(store) => in_its_folder(&store, &run.manifest, &combined, args.show())?,
            // A run that another process writes, or in a read-only folder, is shown anyway.
            Err(error) => {
                tracing::warn!("the report is not written: {error}");
                compare(&combined, args)?
            }
        },
        _ => compare(&combined, args)?,
    };
    Ok(output)
}

/// The text of several runs, joined. Writes the report if `--out` is set.
fn compare(combined: &Combined, args: &ReportArgs) -> Result<String> {
    let findings = combined.findings();
    let (tables, runs) = (tables(&findings), combined.manifests());
    let alerts = alerts(combined, &findings);
    let unread = &findings.summary.unread;
    let json = || summary(&tables, unread, RunList::Several(&runs), &alerts);
    let shown = match args.show() {
        StdoutFormat::Json => json()?,
        StdoutFormat::Table => evaluation(&tables, &runs, &alerts),
    };
    let mut files = Vec::new();
    if args.out.is_some() {
        files = products(&findings, &tables, &combined.shown(&alerts))?;
        files.push(("summary.json".to_owned(), json()?.into_bytes()));
    }
    write_files(args, shown, files)
}

/// The text, with a line about the report. Writes the files of the report into `--out` if it is set.
fn write_files(
    args: &ReportArgs,
    mut text: String,
    contents: Vec<(String, Vec<u8>)>,
) -> Result<String> {
    let Some(out) = &args.out else {
        if args.show() == StdoutFormat::Table {
            text += "report: not written; --out DIR writes one\n";
        }
        return Ok(text);
    };
    for (name, content) in contents {
        files::write(&out.join(name), &content)?;
    }
    if args.show() == StdoutFormat::Table {
        let _ = writeln!(text, "report: {}", out.join(PAGE).display());
    }
    Ok(text)
}

fn of_open(args: &ReportArgs, runs: Vec<StoredRun<OpenDetail>>) -> Result<String> {
    if let Some(run) = runs.iter().find(|run| run.records.is_empty()) {
        return Err(no_records(run.folder.clone()));
    }
    let is_single = runs.len() == 1;
    let scores = open::Scores::new(open::combine(runs)?)?;
    let run = &scores.run;
    if is_single && args.out.is_none() {
        match Store::open(&run.folder, &run.manifest, AddressChange::Allowed) {
            Ok(store) => return scores.write(&store, args.show()),
            Err(error) => tracing::warn!("the report is not written: {error}"),
        }
    }
    let files = match args.out {
        Some(_) => scores.products()?,
        None => Vec::new(),
    };
    write_files(args, scores.shown(args.show())?, files)
}

/// Reads all stored replies again, and stores the readings that changed; returns their number.
fn reread(run: &mut StoredRun<ChoiceDetail>) -> Result<usize> {
    let mut store = Store::open(&run.folder, &run.manifest, AddressChange::Allowed)?;
    let mut changed = 0;
    for record in &mut run.records {
        let now = record.clone().reread()?;
        if now != *record {
            store.append(&now)?;
            changed += 1;
            *record = now;
        }
    }
    store.sync()?;
    Ok(changed)
}

fn no_records(path: PathBuf) -> Error {
    let problem = "the run has no records yet: nothing to report".to_owned();
    Error::Run { path, problem }
}
