//! `report`: what runs hold, from their records alone.

mod cost;
mod merge;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::written;
use super::{Verdict, count};
use crate::config::{Readings, Report, Show};
use crate::error::{Error, Result};
use crate::report::products::{PAGE, products};
use crate::report::{files, table, verdicts};
use crate::score::findings::Findings;
use crate::store::{self, Moved, Store};
use crate::types::manifest::{RunManifest, Status};
use crate::types::{ChoiceDetail, Detail, Record, RunQuestion, Thumbnail};

use merge::{Merged, merge};

/// A run as it lies in its folder.
struct Kept {
    folder: PathBuf,
    manifest: RunManifest,
    records: Vec<Record>,
    questions: Vec<RunQuestion>,
    thumbnails: Vec<Thumbnail>,
}

impl Kept {
    fn open(folder: &Path, readings: Readings, said: &mut String) -> Result<Self> {
        let mut manifest = kept(folder)?;
        let mut records = store::read_records(folder)?;
        if records.is_empty() {
            let problem = "the run has no records yet: nothing to report".to_owned();
            let path = folder.to_owned();
            return Err(Error::Run { path, problem });
        }
        if readings == Readings::Anew {
            let changed = reread(folder, &manifest, &mut records)?;
            let _ = writeln!(
                said,
                "{changed} of {} records read otherwise than before",
                records.len()
            );
            manifest.counts = count(manifest.counts.trials, &records);
        }
        Ok(Self {
            questions: store::read_questions(folder)?,
            thumbnails: store::read_thumbnails(folder)?,
            folder: folder.to_owned(),
            manifest,
            records,
        })
    }

    /// What the run is called: its folder's own name.
    fn name(&self) -> String {
        let whole = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        let name = whole.file_name().unwrap_or(whole.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

/// Reads all kept replies again and keeps the readings that changed; how many did.
fn reread(folder: &Path, manifest: &RunManifest, records: &mut [Record]) -> Result<usize> {
    let mut store = Store::open(folder, manifest, Moved::Allowed)?;
    let mut changed = 0;
    for record in records {
        let anew = record.clone().reread()?;
        if anew != *record {
            store.append(&anew)?;
            changed += 1;
            *record = anew;
        }
    }
    store.sync()?;
    Ok(changed)
}

/// Shows a run, or compares several; where readings are made anew, those that changed are kept with their run.
///
/// # Errors
/// Where a folder holds no run, a record is broken, or the runs asked different questions.
pub fn report(config: &Report) -> Result<Verdict> {
    let mut said = String::new();
    let runs: Result<Vec<Kept>> = config
        .runs
        .iter()
        .map(|folder| Kept::open(folder, config.readings, &mut said))
        .collect();
    let (merged, mut output) = (merge(runs?)?, said);
    if config.show == Show::Json {
        output.clear();
    }
    output += &match (&*merged.runs, &config.out) {
        ([run], None) => match Store::open(&run.folder, &run.manifest, Moved::Allowed) {
            Ok(store) => in_its_folder(&store, &run.manifest, &merged, config.show)?,
            // A run under way, or in a folder that cannot be written to, is shown all the same.
            Err(held) => {
                tracing::warn!("the report is not written: {held}");
                compare(&merged, config)?
            }
        },
        _ => compare(&merged, config)?,
    };
    Ok(Verdict {
        status: Status::Complete,
        output,
    })
}

/// Shows several runs as one, and leaves the report where it is wanted.
fn compare(merged: &Merged, config: &Report) -> Result<String> {
    let findings = merged.findings();
    let places = merged.places();
    let mut text = match config.show {
        Show::Json => files::json_of_several(&findings.summary, &places)?,
        Show::Table => told(&findings, &places),
    };
    let Some(out) = &config.out else {
        if config.show == Show::Table {
            text += "report: --out DIR writes it\n";
        }
        return Ok(text);
    };
    for (name, content) in products(&findings, &merged.shown())? {
        written::write(&out.join(name), &content)?;
    }
    if config.show == Show::Table {
        let _ = writeln!(text, "report: {}", out.join(PAGE).display());
    }
    Ok(text)
}

/// The manifest of a run.
pub(super) fn kept(folder: &Path) -> Result<RunManifest> {
    store::read_manifest(folder, ChoiceDetail::SCHEMA)?.ok_or_else(|| Error::Run {
        path: folder.to_owned(),
        problem: "no run in this folder: it has no manifest.json".to_owned(),
    })
}

fn told(findings: &Findings<'_>, runs: &[(&RunManifest, &Path)]) -> String {
    table::render(&findings.summary, runs) + &verdicts::render(findings)
}

/// Leaves the whole report of a run in its folder; what belongs on standard output.
pub(super) fn leave(
    store: &Store,
    manifest: &RunManifest,
    records: Vec<Record>,
    show: Show,
) -> Result<String> {
    let folder = store.folder();
    let run = Kept {
        folder: folder.to_owned(),
        manifest: manifest.clone(),
        records,
        questions: store::read_questions(folder)?,
        thumbnails: store::read_thumbnails(folder)?,
    };
    in_its_folder(store, manifest, &merge(vec![run])?, show)
}

fn in_its_folder(
    store: &Store,
    manifest: &RunManifest,
    merged: &Merged,
    show: Show,
) -> Result<String> {
    let (folder, findings) = (store.folder(), merged.findings());
    for (name, content) in products(&findings, &merged.shown())? {
        store.write(&name, &content)?;
    }
    let json = files::json(&findings.summary, manifest, None)?;
    store.write("summary.json", json.as_bytes())?;
    store.write_manifest(manifest)?;
    Ok(match show {
        Show::Json => files::json(&findings.summary, manifest, Some(folder))?,
        Show::Table => {
            let report = folder.join(PAGE);
            told(&findings, &[(manifest, folder)]) + &format!("report: {}\n", report.display())
        }
    })
}
