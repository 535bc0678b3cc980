//! What runs of questions with choices hold, from their records alone.

use std::path::Path;

use super::combine::{Combined, combine};
use crate::config::Show;
use crate::error::Result;
use crate::job::outcome::Outcome;
use crate::job::stored::StoredRun;
use crate::report::products::{PAGE, products};
use crate::report::{files, table, verdicts};
use crate::score::findings::Findings;
use crate::store::Store;
use crate::types::manifest::RunManifest;
use crate::types::{ChoiceDetail, Record};

pub(super) fn text(findings: &Findings<'_>, runs: &[(&RunManifest, &Path)]) -> String {
    table::render(&findings.summary, runs) + &verdicts::render(findings)
}

/// Reads the replies of a run again and writes its whole report and its manifest into its folder.
pub(crate) fn write(
    store: &Store,
    mut run: StoredRun<ChoiceDetail>,
    show: Show,
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
    show: Show,
) -> Result<String> {
    let (folder, findings) = (store.folder(), combined.findings());
    for (name, content) in products(&findings, &combined.shown())? {
        store.write(&name, &content)?;
    }
    let json = files::json(&findings.summary, manifest, None)?;
    store.write("summary.json", json.as_bytes())?;
    store.write_manifest(manifest)?;
    Ok(match show {
        Show::Json => files::json(&findings.summary, manifest, Some(folder))?,
        Show::Table => {
            let report = folder.join(PAGE);
            text(&findings, &[(manifest, folder)]) + &format!("report: {}\n", report.display())
        }
    })
}
