//! `report`: what runs hold, from their records alone.

mod cost;
mod merge;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::written;
use super::{Verdict, count, record};
use crate::config::{Readings, Report, Show};
use crate::error::{Error, Result};
use crate::report::page::{self, Shown};
use crate::report::products::{PAGE, products};
use crate::report::{files, table, verdicts};
use crate::score::chance::Offer;
use crate::score::findings::Findings;
use crate::store::{self, Moved, Store};
use crate::types::manifest::{RunManifest, Status};
use crate::types::{FrameId, Listed, QuestionId, Record, Thumbnail};

use cost::cost;
use merge::merge;

/// A run as it lies in its folder.
struct Kept {
    folder: PathBuf,
    manifest: RunManifest,
    records: Vec<Record>,
    questions: Vec<Listed>,
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
        let anew = record::reread(record.clone())?;
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
    let (mut runs, mut output) = (runs?, said);
    if config.show == Show::Json {
        output.clear();
    }
    let output = if let [run] = &mut *runs
        && config.out.is_none()
    {
        match Store::open(&run.folder, &run.manifest, Moved::Allowed) {
            Ok(store) => output + &leave(&store, &run.manifest, &run.records, config.show)?,
            // A run under way, or in a folder that cannot be written to, is shown all the same.
            Err(held) => {
                tracing::warn!("the report is not written: {held}");
                output + &compare(runs, config)?
            }
        }
    } else {
        output + &compare(runs, config)?
    };
    Ok(Verdict {
        status: Status::Complete,
        output,
    })
}

/// Shows several runs as one, and leaves the report where it is wanted.
fn compare(runs: Vec<Kept>, config: &Report) -> Result<String> {
    let merged = merge(runs)?;
    let findings = find(&merged.records, &merged.questions);
    let places: Vec<(&RunManifest, &Path)> = merged
        .runs
        .iter()
        .map(|run| (&run.manifest, &*run.folder))
        .collect();
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
    let questions: Vec<&Listed> = merged.questions.iter().collect();
    let runs = merged.runs.iter().map(|run| page::Run {
        name: run.name.clone(),
        manifest: &run.manifest,
        records: &merged.records[run.records.clone()],
        cost: run.cost.clone(),
    });
    let shown = Shown {
        runs: runs.collect(),
        questions: &questions,
        thumbnails: &merged.thumbnails,
    };
    for (name, content) in products(&findings, &shown)? {
        written::write(&out.join(name), &content)?;
    }
    if config.show == Show::Table {
        let _ = writeln!(text, "report: {}", out.join(PAGE).display());
    }
    Ok(text)
}

/// The manifest of a run.
pub(super) fn kept(folder: &Path) -> Result<RunManifest> {
    store::read_manifest(folder)?.ok_or_else(|| Error::Run {
        path: folder.to_owned(),
        problem: "no run in this folder: it has no manifest.json".to_owned(),
    })
}

/// What records say about questions; of a run that kept no questions those in its records are taken.
fn find<'a>(records: &'a [Record], questions: &[Listed]) -> Findings<'a> {
    let scenes = questions
        .iter()
        .map(|question| (question.frame.clone(), question.scene.clone()));
    let scenes: BTreeMap<FrameId, String> = scenes.collect();
    Findings::new(records, &scenes, offers(records, questions))
}

/// What is offered, for the chance line: each question as often as it has orders of its choices, since an answer to each order
/// counts for itself; those not asked yet once. A run that kept no questions has those in its records.
fn offers(records: &[Record], questions: &[Listed]) -> Vec<Offer> {
    let mut orders = BTreeMap::<&QuestionId, BTreeSet<&[String]>>::new();
    let mut all = BTreeMap::<&QuestionId, Offer>::new();
    for record in records {
        orders
            .entry(&record.question)
            .or_default()
            .insert(&record.choices);
        all.entry(&record.question).or_insert_with(|| Offer {
            family: record.family.clone(),
            choices: record.choices.len(),
        });
    }
    for question in questions {
        all.entry(&question.id).or_insert_with(|| Offer {
            family: question.family.clone(),
            choices: question.choices.len(),
        });
    }
    let offers = all.into_iter().flat_map(|(question, offer)| {
        let times = orders.get(question).map_or(1, BTreeSet::len);
        std::iter::repeat_n(offer, times)
    });
    offers.collect()
}

fn told(findings: &Findings<'_>, runs: &[(&RunManifest, &Path)]) -> String {
    table::render(&findings.summary, runs) + &verdicts::render(findings)
}

/// Leaves the whole report of a run in its folder; what belongs on standard output.
pub(super) fn leave(
    store: &Store,
    manifest: &RunManifest,
    records: &[Record],
    show: Show,
) -> Result<String> {
    let folder = store.folder();
    let questions = store::read_questions(folder)?;
    let thumbnails = store::read_thumbnails(folder)?;
    let findings = find(records, &questions);
    let listed: Vec<&Listed> = questions.iter().collect();
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    let shown = Shown {
        runs: vec![page::Run {
            name: name.to_string_lossy().into_owned(),
            manifest,
            records,
            cost: cost(records)?,
        }],
        questions: &listed,
        thumbnails: &thumbnails,
    };
    for (name, content) in products(&findings, &shown)? {
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
