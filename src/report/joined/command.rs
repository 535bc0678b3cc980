//! The `report` command for one run or several: [`report`].
//!
//! `report --common`: a report on only the items that all models answered ([`keep_common_items`]).
//!
//! The curves of a run's story figure: [`story_curves`].

use std::collections::HashSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use super::alerts::duplicate_folder_alerts;
use super::baseline::{Baseline, FAIL_IF_WORSE};
use super::combine::{CombinedRuns, combine};
use super::enhancers::LenientChange;
use super::join::TrialPlaces;
use super::listing::{ReportFolder, write_in_place};
use super::open;
use super::written::{Scored, no_records, write_report};
use crate::charts::figures::{self, StoryCurves};
use crate::content::Report;
use crate::json::SummaryRuns;
use crate::outputs::{PAGE, files as report_files, printed, write_first_failures};
use crate::page::PageInputs;
use crate::text::alert::Alert;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::manifests::{Counts, RunManifest, Status};
use darkqa_base::types::{ChoiceDetail, Decides, ItemKey, ModelColumn, OpenDetail, QuestionId, TrialRef, Truths};
use darkqa_runs::sharded_run::{open_any_run, open_choice_run};
use darkqa_runs::stored::{AnyRun, RunLayout, ShownModels, StoredRun, run_name, unpack_command};
use darkqa_runs::{LUX_AT_L0, Outcome, PrintArgs, StatedArgs, StdoutFormat, Syntax, record_table};
use darkqa_score::accuracies::shared_items;
use darkqa_score::answers::record::{self, Detail as _};
use darkqa_store::{AddressChange, Store, now};

/// The flags of `report`.
#[derive(Debug, Args)]
#[group(arg = "runs")]
pub struct ReportArgs {
    /// Run folders, ZIP files of bundles, or all shards of a run; several runs are compared
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// Read all stored replies again by the rules of this version; asks nothing, and stores the readings that changed
    #[arg(long, add = Decides::Nothing)]
    pub rescore: bool,
    /// Where the report goes: report.html, tables as CSV and LaTeX, figures as SVG; default: the folder of the run if
    /// it is one, else nowhere, as for a ZIP file
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Report only on the items that all models with images answered
    #[arg(long, add = Decides::Nothing)]
    pub common: bool,
    /// Show also the models that the file of models no longer has, and those that it had with other settings
    #[arg(long, add = Decides::Nothing)]
    pub all: bool,
    /// Further columns about models in tables, separated by commas; default: none
    #[arg(long, value_name = "COLUMNS", value_enum, value_delimiter = ',', add = Decides::Nothing)]
    pub columns: Vec<ModelColumn>,
    /// An old run to compare with.
    #[command(flatten)]
    pub baseline: BaselineArgs,
    /// Facts that the user states about the runs.
    #[command(flatten)]
    pub stated: StatedArgs,
    /// How the report is printed.
    #[command(flatten)]
    pub show: ReportShowArgs,
}

/// The flags that determine how a report of stored runs is printed.
#[derive(Debug, Args)]
pub struct ReportShowArgs {
    /// The formats that every report has.
    #[command(flatten)]
    pub show: PrintArgs,
    /// Print the report as Markdown, for an issue or a README
    #[arg(long, conflicts_with = "json", help_heading = "Output", add = Decides::Nothing)]
    pub markdown: bool,
}

/// The flags of a comparison with an old run.
#[derive(Debug, Args)]
pub struct BaselineArgs {
    /// Compare each model and condition with the same ones of an old run: new less old, on the items and images that
    /// both have; default: no comparison
    #[arg(long, value_name = "OLD", add = Decides::Nothing)]
    pub baseline: Option<PathBuf>,
    /// Exit with 1 if any model is detected to be worse than in OLD in any condition, else with 2 if a model or
    /// condition of OLD is not compared or no verdict is possible. If no model changed, at most 5 % of reports exit
    /// with 1, whatever the number of models and conditions. The report names the smallest loss detected with 80 %
    /// power. random and the observer do not count as models
    #[arg(long, add = Decides::Nothing)]
    pub fail_if_worse: bool,
}

impl ReportArgs {
    fn shown_models(&self) -> ShownModels {
        if self.all { ShownModels::All } else { ShownModels::Current }
    }

    /// True if the report is written into the folder of its only run.
    pub fn writes_into_run(&self) -> bool {
        let is_of_single_run = self.runs.len() == 1 && self.baseline.baseline.is_none();
        is_of_single_run && self.out.is_none() && !self.common
    }

    /// Settings of the manifests of all runs that the user states.
    fn stated_settings(&self) -> impl Iterator<Item = (String, Value)> {
        self.stated.settings().map(|(key, value)| (key.to_owned(), value))
    }

    /// Format of the report on standard output.
    fn format(&self) -> StdoutFormat {
        let format = self.show.show.format();
        if self.show.markdown { StdoutFormat { syntax: Syntax::Markdown, ..format } } else { format }
    }
}

/// Reports on a run, or compares several of the same kind. With `--rescore`, changed readings are stored in their run.
///
/// # Errors
/// If a folder holds no run, a record is broken, or the runs asked different questions.
pub fn report(args: &ReportArgs) -> Result<Outcome> {
    if args.baseline.fail_if_worse && args.baseline.baseline.is_none() {
        let problem = "compares with an old run: name it with --baseline OLD";
        return Err(Error::usage(FAIL_IF_WORSE, problem));
    }
    let (folders, duplicate_alerts) = distinct(&args.runs);
    let (mut choice, mut open) = (Vec::new(), Vec::new());
    for folder in folders {
        match open_any_run(folder)? {
            AnyRun::Choice(run) => choice.push(run),
            AnyRun::Open(run) => open.push(run),
        }
    }
    let outcome = match (choice.is_empty(), open.is_empty()) {
        (_, true) => report_choices(args, choice, &duplicate_alerts)?,
        (true, false) => report_open(args, open, &duplicate_alerts)?,
        (false, false) => {
            return Err(Error::usage(
                "RUN",
                "runs of questions with choices and of open questions cannot be compared; report each kind alone",
            ));
        }
    };
    Ok(outcome.in_format(args.format()))
}

/// Removes duplicates from folders; also returns alerts about them.
pub(super) fn distinct(folders: &[PathBuf]) -> (Vec<&PathBuf>, Vec<Alert>) {
    let mut counted = Vec::<(PathBuf, &PathBuf, usize)>::new();
    for folder in folders {
        // The error about an unreadable folder comes when it is opened.
        let canonical = folder.canonicalize().unwrap_or_else(|_| folder.clone());
        match counted.iter_mut().find(|(known, ..)| *known == canonical) {
            Some((.., count)) => *count += 1,
            None => counted.push((canonical, folder, 1)),
        }
    }
    let duplicates: Vec<(String, usize)> =
        counted.iter().filter(|(.., count)| *count > 1).map(|(_, folder, count)| (run_name(folder), *count)).collect();
    let folders = counted.into_iter().map(|(_, folder, _)| folder);
    (folders.collect(), duplicate_folder_alerts(&duplicates))
}

fn report_choices(
    args: &ReportArgs,
    mut runs: Vec<StoredRun<ChoiceDetail>>,
    duplicate_alerts: &[Alert],
) -> Result<Outcome> {
    let mut rescore_text = String::new();
    for run in &mut runs {
        if run.trials.is_empty() {
            return Err(no_records(run.folder.clone()));
        }
        if args.rescore {
            rescore_text += &reread(run)?;
            let failed = run.trials.iter().map(TrialRef::failed);
            run.manifest.counts = Counts::new(run.manifest.counts.trials, failed);
        }
        run.leave_out(args.shown_models());
        run.manifest.settings.extend(args.stated_settings());
    }
    if args.format().is_document() {
        rescore_text.clear();
    }
    let new_and_old = match &args.baseline.baseline {
        Some(folder) => {
            let mut old = open_choice_run(folder, "--baseline compares runs of questions with choices")?;
            old.leave_out(args.shown_models());
            Some((runs.clone(), old))
        }
        None => None,
    };
    let mut combined = combine(runs)?;
    if combined.truths() == Truths::Unknown {
        refuse_without_truths(args)?;
    }
    if args.common {
        combined = keep_common_items(combined)?;
    }
    combined.listing.add_columns(&args.columns);
    let baseline = new_and_old.map(|(new, old)| Baseline::new(&combined, new, old)).transpose()?;
    let is_worse = match &baseline {
        Some(baseline) if args.baseline.fail_if_worse => baseline.is_worse(combined.unit())?,
        _ => false,
    };
    let in_folder = args.out.is_none() && !args.common && baseline.is_none() && duplicate_alerts.is_empty();
    let written = match &*combined.runs {
        [run] if in_folder => {
            let text =
                write_in_place(&run.folder, run.layout, &run.manifest, |target: &ReportFolder<'_, ChoiceDetail>| {
                    let scored = Scored::new(&combined);
                    let report = scored.report(&combined, &[]);
                    let inputs = combined.page_inputs();
                    write_report(&report, target, &run.manifest, &inputs, args.format()).map(|(text, _)| text)
                })?;
            text.map(|text| (run.folder.clone(), run.layout, text))
        }
        _ => None,
    };
    let (reported, table_folder) = if let Some((folder, layout, text)) = written {
        // A run in shards has a record table in each shard instead.
        let table_folder = (layout == RunLayout::Whole).then(|| folder.clone());
        let reported = Outcome::wrote(folder, Status::Complete, text);
        (reported, table_folder)
    } else {
        let scored = Scored::new(&combined);
        let mut report = scored.report(&combined, duplicate_alerts);
        if let (Some(baseline), Scored::Accuracy(findings)) = (&baseline, &scored) {
            baseline.add_to(&mut report, findings.shown());
        }
        (print_and_write(args, &report, &combined.manifests(), || combined.page_inputs())?, None)
    };
    // Free the trials first, because the record table takes as much memory.
    drop(combined);
    if let Some(folder) = table_folder {
        record_table::update(&folder, args.show.show.record_table())?;
    }
    // `Incomplete` makes the command exit with 1.
    let status = if is_worse { Status::Incomplete } else { Status::Complete };
    Ok(Outcome { status, output: rescore_text + &reported.output, written: reported.written })
}

/// Refuses flags that need accuracies, for runs whose questions have no true answers.
fn refuse_without_truths(args: &ReportArgs) -> Result<()> {
    let flags = [
        (
            "--common",
            args.common,
            "each model is compared with its own answers, on the questions that it answered at L0",
        ),
        (
            "--baseline",
            args.baseline.baseline.is_some(),
            "it compares accuracies, and nobody knows the true answers (--ask)",
        ),
    ];
    match flags.iter().find(|(_, is_set, _)| *is_set) {
        Some((flag, _, why)) => Err(Error::usage(*flag, format_args!("{why}: leave it out"))),
        None => Ok(()),
    }
}

/// Prints a report, and writes its files into `--out` if it is set. `runs` are the manifests and folders of its runs.
fn print_and_write<'a>(
    args: &ReportArgs,
    report: &Report<'_>,
    runs: &[(&RunManifest, &Path)],
    inputs: impl FnOnce() -> PageInputs<'a>,
) -> Result<Outcome> {
    let folders: Vec<&Path> = runs.iter().map(|(_, folder)| *folder).collect();
    let list = SummaryRuns::Several(runs);
    let mut text = printed(report, list, &folders, args.format())?;
    let Some(out) = &args.out else {
        if !args.format().is_document() {
            text += "report: not written; --out DIR writes one\n";
        }
        return Ok(Outcome::text(Status::Complete, text));
    };
    let files = report_files(report, list, &inputs())?;
    write_first_failures(report, out)?;
    for (name, content) in files {
        files::write(&out.join(name), &content)?;
    }
    if !args.format().is_document() {
        let _ = writeln!(text, "report: {}", out.join(PAGE).display());
    }
    Ok(Outcome::wrote(out, Status::Complete, text))
}

fn report_open(args: &ReportArgs, mut runs: Vec<StoredRun<OpenDetail>>, duplicate_alerts: &[Alert]) -> Result<Outcome> {
    let flags = [("--common", args.common), ("--baseline", args.baseline.baseline.is_some())];
    if let Some((flag, _)) = flags.iter().find(|(_, is_set)| *is_set) {
        let problem =
            "compares runs of questions with choices; marks of open questions have no such test: leave it out";
        return Err(Error::usage(*flag, problem));
    }
    if args.stated.lux_at_l0.is_some() {
        return Err(Error::usage(LUX_AT_L0, "a report on open questions has no threshold: leave it out"));
    }
    if let Some(run) = runs.iter().find(|run| run.trials.is_empty()) {
        return Err(no_records(run.folder.clone()));
    }
    for run in &mut runs {
        run.leave_out(args.shown_models());
        run.manifest.settings.extend(args.stated_settings());
    }
    let is_single = runs.len() == 1 && duplicate_alerts.is_empty();
    let mut joined = open::combine(runs)?;
    joined.alerts.splice(..0, duplicate_alerts.iter().cloned());
    joined.listing.add_columns(&args.columns);
    let scores = open::Scores::new(joined)?;
    let run = &scores.run;
    if is_single && args.out.is_none() {
        let text = write_in_place(&run.folder, run.layout, &run.manifest, |target: &ReportFolder<'_, OpenDetail>| {
            let inputs = run.page_inputs();
            write_report(&scores.report(), target, &run.manifest, &inputs, args.format()).map(|(text, _)| text)
        })?;
        if let Some(text) = text {
            if run.layout == RunLayout::Whole {
                record_table::update(&run.folder, args.show.show.record_table())?;
            }
            return Ok(Outcome::wrote(&run.folder, Status::Complete, text));
        }
    }
    print_and_write(args, &scores.report(), &run.manifests(), || run.page_inputs())
}

/// Parses all stored replies again by the current rules. Stores the changed records and the version of the rules, and
/// returns a text about the change.
///
/// # Errors
/// If the run is in shards or a ZIP file, or one of its files cannot be read or written.
fn reread(run: &mut StoredRun<ChoiceDetail>) -> Result<String> {
    if run.layout == RunLayout::Shards {
        let problem = format!(
            "{} holds the parts of a run, and their readings are stored in each: name the parts, or merge them with report merge, which reads all replies again",
            run.folder.display()
        );
        return Err(Error::usage("--rescore", problem));
    }
    if run.layout == RunLayout::Zip {
        let problem = format!(
            "{} is a ZIP file, which is not changed; unpack it and name the folder of the run in it: {}",
            run.folder.display(),
            unpack_command(&run.folder)
        );
        return Err(Error::usage("--rescore", problem));
    }
    let mut store = Store::open(&run.folder, &run.manifest, AddressChange::Allowed)?;
    let mut changed = 0;
    let mut lenient_change = LenientChange::new(&run.manifest);
    for trial in run.trials.iter() {
        let record = run.record(trial)?;
        let current = record::reread(record.clone())?;
        lenient_change.add(&record.detail, &current.detail);
        if current != record {
            store.append(&current)?;
            changed += 1;
        }
    }
    store.sync()?;
    let records = run.trials.len();
    let mut lines = format!("{changed} of {records} records now read differently\n");
    if !lenient_change.is_current() {
        let _ = writeln!(lines, "{}", lenient_change.words());
        run.manifest.reply_reading = ChoiceDetail::REPLY_READING.map(str::to_owned);
        run.manifest.updated = now();
        store.write_manifest(&run.manifest)?;
    }
    if changed > 0 {
        *run = StoredRun::reread(&run.folder, run.manifest.clone(), None)?;
    }
    Ok(lines)
}

/// Keeps only the trials of items to which every model with images has a reply in some condition. Models without any
/// reply are ignored.
///
/// # Errors
/// If there is no such item.
fn keep_common_items(mut combined: CombinedRuns) -> Result<CombinedRuns> {
    let items = combined.trials.items();
    let (is_shared, questions): (Vec<bool>, HashSet<QuestionId>) = {
        let grid = combined.grid();
        let shared = grid.items.iter().zip(shared_items(&grid)).filter(|(_, is_shared)| *is_shared);
        let shared: HashSet<ItemKey<'_>> = shared.map(|(item, _)| item.asked.key()).collect();
        (
            items.into_iter().map(|item| item.is_some_and(|item| shared.contains(&item.key()))).collect(),
            shared.iter().map(|item| item.question.clone()).collect(),
        )
    };
    if questions.is_empty() {
        return Err(Error::usage("--common", "no item was answered by every model; leave it out"));
    }
    // The new place of each trial; `None` if it is removed.
    let mut places = Vec::with_capacity(combined.trials.len());
    let mut next = 0;
    for trial in combined.trials.iter() {
        let is_kept = is_shared[trial.item_number()];
        places.push(is_kept.then_some(next));
        next += u32::from(is_kept);
    }
    for run in &mut combined.runs {
        let kept = run.trials.iter().filter_map(|place| places[place]);
        run.trials = TrialPlaces::Some(kept.collect());
    }
    combined.trials.retain(|trial| is_shared[trial.item_number()]);
    combined.questions.retain(|question| questions.contains(&question.id));
    Ok(combined)
}

/// The curves of a run; `None` if no model was shown a dark image.
///
/// # Errors
/// If a record of the run has no true choice.
pub fn story_curves(run: StoredRun<ChoiceDetail>) -> Result<Option<StoryCurves>> {
    Ok(figures::story_curves(combine(vec![run])?.findings().shown()))
}
