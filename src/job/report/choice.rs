//! The report of a run of questions with choices, from its records alone.

use super::alerts::alerts;
use super::combine::{Combined, combine};
use crate::error::Result;
use crate::job::outcome::Outcome;
use crate::job::outcome::StdoutFormat;
use crate::job::stored::StoredRun;
use crate::report::json::{RunList, summary};
use crate::report::products::{PAGE, products};
use crate::report::tables::tables;
use crate::report::terminal::evaluation;
use crate::store::Store;
use crate::types::manifest::RunManifest;
use crate::types::{ChoiceDetail, Record};

/// Reads the replies of a run again, and writes its report and manifest into its folder.
pub(crate) fn write(
    store: &Store,
    mut run: StoredRun<ChoiceDetail>,
    show: StdoutFormat,
) -> Result<Outcome> {
    let manifest = run.manifest.clone();
    let records = run.records.into_iter().map(Record::reread);
    run.records = records.collect::<Result<_>>()?;
    Ok(Outcome {
        status: manifest.status,
        output: in_its_folder(store, &manifest, &combine(vec![run])?, show)?,
    })
}

pub(super) fn in_its_folder(
    store: &Store,
    manifest: &RunManifest,
    combined: &Combined,
    show: StdoutFormat,
) -> Result<String> {
    let (folder, findings) = (store.folder(), combined.findings());
    let (tables, alerts) = (tables(&findings), alerts(combined, &findings));
    for (name, content) in products(&findings, &tables, &combined.shown(&alerts))? {
        store.write(&name, &content)?;
    }
    let unread = &findings.summary.unread;
    let json = |folder| summary(&tables, unread, RunList::One(manifest, folder), &alerts);
    store.write("summary.json", json(None)?.as_bytes())?;
    store.write_manifest(manifest)?;
    Ok(match show {
        StdoutFormat::Json => json(Some(folder))?,
        StdoutFormat::Table => {
            let report = folder.join(PAGE);
            evaluation(&tables, &[(manifest, folder)], &alerts)
                + &format!("report: {}\n", report.display())
        }
    })
}
