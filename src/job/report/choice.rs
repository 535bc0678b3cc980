//! What runs of questions with choices hold, from their records alone.

use super::combine::{Combined, combine};
use crate::config::Show;
use crate::error::Result;
use crate::job::stored::StoredRun;
use crate::report::json::{Runs, summary};
use crate::report::products::{PAGE, products};
use crate::report::tables::tables;
use crate::report::terminal::evaluation;
use crate::store::Store;
use crate::types::manifest::RunManifest;
use crate::types::{ChoiceDetail, Record};

/// Writes the whole report of a run into its folder; what belongs on standard output.
pub(crate) fn write(store: &Store, manifest: &mut RunManifest, show: Show) -> Result<String> {
    let mut run = StoredRun::<ChoiceDetail>::of(store.folder(), manifest.clone())?;
    let records = run.records.into_iter().map(Record::reread);
    run.records = records.collect::<Result<_>>()?;
    in_its_folder(store, manifest, &combine(vec![run])?, show)
}

pub(super) fn in_its_folder(
    store: &Store,
    manifest: &RunManifest,
    combined: &Combined,
    show: Show,
) -> Result<String> {
    let (folder, findings) = (store.folder(), combined.findings());
    let tables = tables(&findings);
    for (name, content) in products(&findings, &tables, &combined.shown())? {
        store.write(&name, &content)?;
    }
    let unread = &findings.summary.unread;
    let json = |folder| summary(&tables, unread, Runs::One(manifest, folder));
    store.write("summary.json", json(None)?.as_bytes())?;
    store.write_manifest(manifest)?;
    Ok(match show {
        Show::Json => json(Some(folder))?,
        Show::Table => {
            let report = folder.join(PAGE);
            evaluation(&tables, &[(manifest, folder)]) + &format!("report: {}\n", report.display())
        }
    })
}
