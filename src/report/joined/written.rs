//! The report on runs, scored from their records ([`Scored`]) and written into a folder: [`write()`] and [`write_open`]
//! for the run that was just asked, [`write_report`] for a stored one, and [`whole_report`] for a copy of all its files.

use std::path::{Path, PathBuf};

use super::alerts::{alerts, alerts_without_truths};
use super::combine::{CombinedRuns, combine, frame_ties};
use super::listing::ReportFolder;
use super::{enhancers, open, stamp};
use crate::content::Report;
use crate::json::SummaryRuns;
use crate::markdown::markdown;
use crate::outputs::{PAGE, files, first_failures, printed, write_first_failures};
use crate::page::PageInputs;
use crate::tables::help_for_time;
use crate::text::alert::Alert;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{RunManifest, Status};
use darkqa_base::types::{ChoiceDetail, OpenDetail, Truths};
use darkqa_runs::outcome::{Outcome, ReportLength, StdoutFormat};
use darkqa_runs::stored::{AnyRun, ShownModels, StoredRun};
use darkqa_score::answers::record::Detail;
use darkqa_score::comparisons::self_agreement::SelfAgreement;
use darkqa_score::findings::Findings;
use darkqa_store::Store;

/// The results of joined runs of questions with choices, by the measure that their questions allow.
pub(super) enum Scored<'a> {
    /// Accuracy, where the true answers are known.
    Accuracy(Box<Findings<'a>>),
    /// Agreement of each model with its own answers at L0.
    SelfAgreement(Box<SelfAgreement<'a>>),
}

impl<'a> Scored<'a> {
    pub(super) fn new(combined: &'a CombinedRuns) -> Self {
        match combined.truths() {
            Truths::Known => Self::Accuracy(Box::new(combined.findings())),
            Truths::Unknown => {
                let ties = frame_ties(&combined.questions);
                let agreement = SelfAgreement::new(&combined.trials, &ties, &combined.questions, &combined.listing);
                Self::SelfAgreement(Box::new(agreement.with_set(combined.photographed_set())))
            }
        }
    }

    /// The report on the results. The alerts about the runs follow `first_alerts`.
    pub(super) fn report(&'a self, combined: &CombinedRuns, first_alerts: &[Alert]) -> Report<'a> {
        let mut all_alerts = first_alerts.to_vec();
        let report = match self {
            Self::Accuracy(findings) => {
                all_alerts.extend(alerts(combined, findings));
                Report::from_findings(findings, all_alerts)
            }
            Self::SelfAgreement(agreement) => {
                all_alerts.extend(alerts_without_truths(combined, agreement));
                Report::from_self_agreement(agreement, all_alerts)
            }
        };
        report.with_enhancers(&enhancers::rows(&combined.runs))
    }
}

/// The report on one run.
pub struct WholeReport {
    /// Names and contents of the files that `report` writes into the folder of the run.
    pub files: Vec<(String, Vec<u8>)>,
    /// The findings and the table by level, as Markdown.
    pub markdown: String,
}

impl WholeReport {
    fn new(report: &Report<'_>, manifest: &RunManifest, folder: &Path, inputs: &PageInputs<'_>) -> Result<Self> {
        let mut files = files(report, SummaryRuns::One(manifest, None), inputs)?;
        files.extend(first_failures(report)?);
        Ok(Self { files, markdown: markdown(report, &[folder], ReportLength::Summary) })
    }
}

/// The report on a run, without the models that are no longer in the models file.
///
/// # Errors
/// If the run has no record, or a record is broken.
pub fn whole_report(run: AnyRun) -> Result<WholeReport> {
    match run {
        AnyRun::Choice(run) => {
            let combined = combine(vec![without_hidden_models(run)?])?;
            let scored = Scored::new(&combined);
            let (manifest, folder) = combined.manifests()[0];
            WholeReport::new(&scored.report(&combined, &[]), manifest, folder, &combined.page_inputs())
        }
        AnyRun::Open(run) => {
            let scores = open::Scores::new(open::combine(vec![without_hidden_models(run)?])?)?;
            let run = &scores.run;
            WholeReport::new(&scores.report(), &run.manifest, &run.folder, &run.page_inputs())
        }
    }
}

/// Writes the report and the manifest of a run into its folder.
///
/// # Errors
/// If a record is broken, or a file cannot be written.
pub fn write(store: &Store, mut run: StoredRun<ChoiceDetail>, show: StdoutFormat) -> Result<Outcome> {
    let manifest = run.manifest.clone();
    run.leave_out(ShownModels::Current);
    let combined = combine(vec![run])?;
    let scored = Scored::new(&combined);
    let report = scored.report(&combined, &[]);
    let (text, files) = write_report(&report, &ReportFolder::Run(store), &manifest, &combined.page_inputs(), show)?;
    stamp::write(store, &manifest, show, files, &text)?;
    Ok(Outcome::wrote(store.folder(), manifest.status, text).in_format(show))
}

/// Scores a run, and writes its report and manifest into its folder. The run is incomplete if a mark cannot be parsed.
pub fn write_open(store: &Store<OpenDetail>, mut run: StoredRun<OpenDetail>, show: StdoutFormat) -> Result<Outcome> {
    run.leave_out(ShownModels::Current);
    let mut scores = open::Scores::new(open::combine(vec![run])?)?;
    if scores.run.manifest.status == Status::Complete && scores.has_unmarked() {
        scores.run.manifest.status = Status::Incomplete;
    }
    let run = &scores.run;
    let (text, _) = write_report(&scores.report(), &ReportFolder::Run(store), &run.manifest, &run.page_inputs(), show)?;
    Ok(Outcome::wrote(store.folder(), run.manifest.status, text).in_format(show))
}

/// Writes the report of one run into its folder; returns the text for standard output, and the names of the files.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write_report<D: Detail>(
    report: &Report<'_>,
    target: &ReportFolder<'_, D>,
    manifest: &RunManifest,
    inputs: &PageInputs<'_>,
    show: StdoutFormat,
) -> Result<(String, Vec<String>)> {
    let folder = target.path();
    let files = files(report, SummaryRuns::One(manifest, None), inputs)?;
    let first_failures = write_first_failures(report, folder)?;
    target.write(&files, manifest)?;
    let names = files.into_iter().map(|(name, _)| name).chain(first_failures.map(str::to_owned)).collect();
    let text = printed(report, SummaryRuns::One(manifest, Some(folder)), &[folder], show)?;
    if show.is_document() {
        return Ok((text, names));
    }
    let cost = inputs.runs.iter().find_map(|run| run.cost.as_ref());
    let cost = cost.map_or_else(String::new, |cost| format!("cost: {cost}\n"));
    let effects = report.measure.enhancer_effects();
    let latencies: String = manifest
        .enhancers
        .iter()
        .flat_map(|(name, note)| {
            let times = note.latency.iter().map(move |latency| format!("{name}: {latency}\n"));
            let help = (!effects.is_empty() && !note.latency.is_empty())
                .then(|| help_for_time(name, &effects, &note.latency))
                .flatten();
            times.chain(help.map(|help| format!("{name}, {help}\n")))
        })
        .collect();
    Ok((text + &latencies + &cost + &format!("report: {}\n", folder.join(PAGE).display()), names))
}

/// Removes the models that a report leaves out by default.
///
/// # Errors
/// If the run has no records.
pub(super) fn without_hidden_models<D: Detail>(mut run: StoredRun<D>) -> Result<StoredRun<D>> {
    if run.trials.is_empty() {
        return Err(no_records(run.folder));
    }
    run.leave_out(ShownModels::Current);
    Ok(run)
}

/// The error for a run without records.
pub(super) fn no_records(path: PathBuf) -> Error {
    let problem = "the run has no records yet: nothing to report".to_owned();
    Error::Run { path, problem }
}
