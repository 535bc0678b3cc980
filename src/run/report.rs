//! `report`: what runs hold, from their records alone.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Verdict, count, record};
use crate::config::{Readings, Report, Show};
use crate::error::{Error, Result};
use crate::report::{files, table};
use crate::score::accuracy::{Summary, summarize};
use crate::score::chance::Offer;
use crate::store::{self, Moved, Store};
use crate::types::manifest::{RunManifest, Status};
use crate::types::{QuestionId, Record};

/// Shows each run; where readings are made anew, those that changed are kept with it, and its summary is written again.
///
/// # Errors
/// Where a folder holds no run, or a record is broken.
pub fn report(config: &Report) -> Result<Verdict> {
    let mut output = String::new();
    for folder in &config.runs {
        output += &one(folder, config)?;
    }
    Ok(Verdict {
        status: Status::Complete,
        output,
    })
}

fn one(folder: &Path, config: &Report) -> Result<String> {
    let mut manifest = kept(folder)?;
    let mut records = store::read_records(folder)?;
    let mut text = String::new();
    if config.readings == Readings::Anew {
        let mut store = Store::open(folder, &manifest, Moved::Allowed)?;
        let mut changed = 0;
        for record in &mut records {
            let anew = record::reread(record.clone())?;
            if anew != *record {
                store.append(&anew)?;
                changed += 1;
                *record = anew;
            }
        }
        store.sync()?;
        manifest.counts = count(manifest.counts.trials, &records);
        write(&store, &manifest, &summary(&records))?;
        if config.show == Show::Table {
            text = format!(
                "{changed} of {} records read otherwise than before\n",
                records.len()
            );
        }
    }
    let summary = summary(&records);
    text += &match config.show {
        Show::Json => files::json(&summary, &manifest, Some(folder))?,
        Show::Table => table::render(&summary, &manifest, folder),
    };
    Ok(text)
}

/// The manifest of a run.
pub(super) fn kept(folder: &Path) -> Result<RunManifest> {
    store::read_manifest(folder)?.ok_or_else(|| Error::Run {
        path: folder.to_owned(),
        problem: "no run in this folder: it has no manifest.json".to_owned(),
    })
}

/// The scores of records, with the chance line of the questions in them.
pub(super) fn summary(records: &[Record]) -> Summary {
    let questions: BTreeMap<&QuestionId, &Record> = records
        .iter()
        .map(|record| (&record.question, record))
        .collect();
    let offers = questions.into_values().map(|record| Offer {
        family: record.family.clone(),
        choices: record.choices.len(),
    });
    summarize(records, offers)
}

/// Leaves a summary in the folder of its run.
pub(super) fn write(store: &Store, manifest: &RunManifest, summary: &Summary) -> Result<()> {
    store.write("summary.csv", &files::csv(summary)?)?;
    let json = files::json(summary, manifest, None)?;
    store.write("summary.json", json.as_bytes())?;
    store.write_manifest(manifest)
}
