//! One run or several, of whatever was asked: [`report`].

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

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
use crate::types::Decides;
use crate::types::manifest::Status;
use crate::types::{ChoiceDetail, OpenDetail};

/// The flags of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Folders of runs
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// Read all kept replies again by the rules of this version; asks nothing, and keeps the readings that changed
    #[arg(long, add = Decides::Nothing)]
    pub rescore: bool,
    /// Where the report goes: report.html, tables as CSV and LaTeX, figures as SVG; default: the folder of the run where it
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

/// Shows a run, or compares several of one kind; if readings are made again, those that changed are kept with their run.
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
                "{changed} of {records} records read otherwise than before"
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
            // A run under way, or in a folder that cannot be written to, is shown all the same.
            Err(held) => {
                tracing::warn!("the report is not written: {held}");
                compare(&combined, args)?
            }
        },
        _ => compare(&combined, args)?,
    };
    Ok(output)
}

/// Shows several runs as one, and writes the report where it is wanted.
fn compare(combined: &Combined, args: &ReportArgs) -> Result<String> {
    let findings = combined.findings();
    let (tables, places) = (tables(&findings), combined.places());
    let shown = match args.show() {
        StdoutFormat::Json => {
            summary(&tables, &findings.summary.unread, RunList::Several(&places))?
        }
        StdoutFormat::Table => evaluation(&tables, &places),
    };
    let made = match args.out {
        Some(_) => products(&findings, &tables, &combined.shown())?,
        None => Vec::new(),
    };
    elsewhere(args, shown, made)
}

/// Writes a report into `--out`, or says that this would.
fn elsewhere(args: &ReportArgs, mut text: String, made: Vec<(String, Vec<u8>)>) -> Result<String> {
    let Some(out) = &args.out else {
        if args.show() == StdoutFormat::Table {
            text += "report: --out DIR writes it\n";
        }
        return Ok(text);
    };
    for (name, content) in made {
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
    let alone = runs.len() == 1;
    let scores = open::Scores::new(open::combine(runs)?)?;
    let run = &scores.run;
    if alone && args.out.is_none() {
        match Store::open(&run.folder, &run.manifest, AddressChange::Allowed) {
            Ok(store) => return scores.write(&store, args.show()),
            Err(held) => tracing::warn!("the report is not written: {held}"),
        }
    }
    let made = match args.out {
        Some(_) => scores.products()?,
        None => Vec::new(),
    };
    elsewhere(args, scores.shown(args.show())?, made)
}

/// Reads all kept replies again and keeps the readings that changed; how many did.
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
