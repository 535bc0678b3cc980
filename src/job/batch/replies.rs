//! Import of the output of a Batch API into a run: [`import`].

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use crate::ask::Constrain;
use crate::ask::batch::{BatchLine, with_letter};
use crate::error::{Error, Result};
use crate::store::Store;
use crate::types::flag::read_word;
use crate::types::manifest::RunManifest;
use crate::types::{Detail, Record, Reply, TrialKey};

/// Numbers of lines, by what they led to.
#[derive(Debug, Default)]
struct ReplyCounts {
    answered: usize,
    failed: usize,
    /// Lines of trials that were imported before, or answered in another way.
    imported_before: usize,
    /// Lines whose id is in no batch of this run.
    unknown: usize,
}

/// Imports the replies of output and error files; a summary for the user. Each reply is imported once, even if a file is named again.
///
/// # Errors
/// If the run has written no batch, or a line is not one of a Batch API. The lines before it are kept.
pub(crate) fn import<D: Detail>(
    store: &mut Store<D>,
    manifest: &RunManifest,
    files: &[PathBuf],
) -> Result<String> {
    let blanks = store.batch_trials()?;
    if blanks.is_empty() {
        let problem =
            "this run has written no requests for a batch; write them first, by batch export or openeqa --batch".to_owned();
        let path = store.folder().to_owned();
        return Err(Error::Run { path, problem });
    }
    let blanks: HashMap<TrialKey, Record<D>> =
        blanks.into_iter().map(|blank| (blank.key, blank)).collect();
    let mut waiting = store.pending_in_batches()?;
    let mut counts = ReplyCounts::default();
    for path in files {
        let file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
        for (i, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(|e| Error::file(path, "read", e))?;
            if line.trim().is_empty() {
                continue;
            }
            let line = BatchLine::read(&line).ok_or_else(|| not_a_line(path, i + 1))?;
            import_line(line, &blanks, manifest, &mut waiting, store, &mut counts)?;
        }
    }
    store.sync()?;
    Ok(summary(&counts, waiting.len()))
}

fn not_a_line(path: &Path, line: usize) -> Error {
    let problem =
        "not a line of a Batch API's output: {\"custom_id\", \"response\", \"error\"} expected";
    Error::line(path, line, problem)
}

fn import_line<D: Detail>(
    line: BatchLine,
    blanks: &HashMap<TrialKey, Record<D>>,
    manifest: &RunManifest,
    waiting: &mut BTreeSet<TrialKey>,
    store: &mut Store<D>,
    counts: &mut ReplyCounts,
) -> Result<()> {
    let key = line.id.parse::<TrialKey>().ok();
    let Some(blank) = key.and_then(|key| blanks.get(&key)) else {
        counts.unknown += 1;
        return Ok(());
    };
    if !waiting.remove(&blank.key) {
        counts.imported_before += 1;
        return Ok(());
    }
    let blank = blank.clone().batched();
    let record = match line.result {
        Ok(reply) => {
            counts.answered += 1;
            let constrain = constrain(manifest, &blank.model)?;
            let choices = blank.detail.choices().len();
            let reply = Reply {
                attempts: 1,
                ..with_letter(reply, constrain, choices)
            };
            blank.answered(reply)?
        }
        Err(failure) => {
            counts.failed += 1;
            blank.failed_by(failure, 1)
        }
    };
    store.append(&record)
}

/// The constraint on the replies of a model, from the manifest.
fn constrain(manifest: &RunManifest, model: &str) -> Result<Constrain> {
    let models = manifest.columns.get("model");
    let name = models.and_then(|models| models.get(model)?.get("--constrain")?.as_str());
    name.map_or(Ok(Constrain::None), read_word)
}

fn summary(counts: &ReplyCounts, waiting: usize) -> String {
    let ReplyCounts {
        answered,
        failed,
        imported_before,
        unknown,
    } = counts;
    let mut text = format!("replies: {answered} imported, {failed} failed");
    if *imported_before > 0 {
        let _ = write!(text, ", {imported_before} imported before");
    }
    if *unknown > 0 {
        let _ = write!(text, ", {unknown} of another run");
    }
    if waiting > 0 {
        let _ = write!(text, ", {waiting} still waiting for a batch");
    }
    text.push('\n');
    if *failed > 0 {
        text.push_str("failed requests are asked again by the next batch export, or by the evaluation itself\n");
    }
    text
}
