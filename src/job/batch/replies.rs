//! The output of a Batch API, taken over into a run: [`import`].

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use crate::ask::batch::{BatchLine, with_letter};
use crate::ask::{Constrain, Wire};
use crate::error::{Error, Result};
use crate::store::Store;
use crate::types::flag::read_word;
use crate::types::manifest::RunManifest;
use crate::types::{Detail, Record, Reply, TrialKey};

/// What became of the lines.
#[derive(Debug, Default)]
struct ReplyCounts {
    answered: usize,
    failed: usize,
    /// Trials whose line was taken over already, or that have been answered otherwise.
    again: usize,
    /// Ids that the run has sent in no batch.
    strange: usize,
}

/// Takes the replies of output and error files over, each of them once, however often a file is given; what became of them.
///
/// # Errors
/// Where nothing of the run is out in a batch, or a line is none of such a file: those before it are kept.
pub(crate) fn import<D: Detail>(
    store: &mut Store<D>,
    manifest: &RunManifest,
    files: &[PathBuf],
) -> Result<String> {
    let blanks = store.batch_trials()?;
    if blanks.is_empty() {
        let problem =
            "nothing of this run is out in a batch: its requests are written first".to_owned();
        let path = store.folder().to_owned();
        return Err(Error::Run { path, problem });
    }
    let blanks: HashMap<TrialKey, Record<D>> =
        blanks.into_iter().map(|blank| (blank.key, blank)).collect();
    let mut out = store.pending_in_batches()?;
    let mut tally = ReplyCounts::default();
    for path in files {
        let file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
        for (i, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(|e| Error::file(path, "read", e))?;
            if line.trim().is_empty() {
                continue;
            }
            let line = BatchLine::read(&line, Wire::Chat).ok_or_else(|| not_a_line(path, i + 1))?;
            take(line, &blanks, manifest, &mut out, store, &mut tally)?;
        }
    }
    store.sync()?;
    Ok(summary(&tally, out.len()))
}

fn not_a_line(path: &Path, line: usize) -> Error {
    let problem =
        "not a line of a Batch API's output: {\"custom_id\", \"response\", \"error\"} expected";
    Error::line(path, line, problem)
}

fn take<D: Detail>(
    line: BatchLine,
    blanks: &HashMap<TrialKey, Record<D>>,
    manifest: &RunManifest,
    out: &mut BTreeSet<TrialKey>,
    store: &mut Store<D>,
    tally: &mut ReplyCounts,
) -> Result<()> {
    let key = line.id.parse::<TrialKey>().ok();
    let Some(blank) = key.and_then(|key| blanks.get(&key)) else {
        tally.strange += 1;
        return Ok(());
    };
    if !out.remove(&blank.key) {
        tally.again += 1;
        return Ok(());
    }
    let blank = blank.clone().batched();
    let record = match line.result {
        Ok(reply) => {
            tally.answered += 1;
            let constrain = constrain(manifest, &blank.model)?;
            let choices = blank.detail.choices().len();
            let reply = Reply {
                attempts: 1,
                ..with_letter(reply, constrain, choices)
            };
            blank.answered(reply)?
        }
        Err(failure) => {
            tally.failed += 1;
            blank.failed_by(failure, 1)
        }
    };
    store.append(&record)
}

/// What the run lets a model say.
fn constrain(manifest: &RunManifest, model: &str) -> Result<Constrain> {
    let models = manifest.columns.get("model");
    let said = models.and_then(|models| models.get(model)?.get("--constrain")?.as_str());
    said.map_or(Ok(Constrain::None), read_word)
}

fn summary(tally: &ReplyCounts, out: usize) -> String {
    let ReplyCounts {
        answered,
        failed,
        again,
        strange,
    } = tally;
    let mut text = format!("{answered} replies taken over, {failed} failed");
    if *again > 0 {
        let _ = write!(text, ", {again} were taken over before");
    }
    if *strange > 0 {
        let _ = write!(text, ", {strange} are of another run");
    }
    if out > 0 {
        let _ = write!(text, ", {out} still out");
    }
    text.push('\n');
    if *failed > 0 {
        text.push_str("what failed is asked again by the next batch, or directly\n");
    }
    text
}
