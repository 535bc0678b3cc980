//! `batch import`: the output of a Batch API, as records.

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use crate::ask::Constrain;
use crate::ask::batch::{BatchLine, unconstrained};
use crate::config::{BatchImport, Show};
use crate::error::{Error, Result};
use crate::run::report::{kept, leave};
use crate::run::{Verdict, count, record};
use crate::store::{Moved, Store};
use crate::types::manifest::{RunManifest, Status};
use crate::types::{Record, Reply, TrialKey, Via};

/// What became of the lines.
#[derive(Debug, Default)]
struct Tally {
    answered: usize,
    failed: usize,
    /// Trials whose line was taken over already, or that have been answered otherwise.
    again: usize,
    /// Ids that the run has sent in no batch.
    strange: usize,
}

/// Takes the replies of output and error files over; each of them once, however often a file is given.
///
/// # Errors
/// Where the folder holds no run or no batch, or a line is none of such a file: those before it are kept.
pub fn import(config: &BatchImport) -> Result<Verdict> {
    let folder = &config.run;
    let mut manifest = kept(folder)?;
    let mut store = Store::open(folder, &manifest, Moved::Allowed)?;
    let blanks = store.batched()?;
    if blanks.is_empty() {
        let problem = "nothing of this run is out in a batch: batch export comes first".to_owned();
        let path = folder.clone();
        return Err(Error::Run { path, problem });
    }
    let blanks: HashMap<TrialKey, Record> =
        blanks.into_iter().map(|blank| (blank.key, blank)).collect();
    let mut out = store.out_in_batches()?;
    let constrain = constrain(&manifest)?;
    let mut tally = Tally::default();
    for path in &config.files {
        let file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
        for (i, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(|e| Error::file(path, "read", e))?;
            if line.trim().is_empty() {
                continue;
            }
            let line = BatchLine::read(&line).ok_or_else(|| not_a_line(path, i + 1))?;
            take(line, &blanks, constrain, &mut out, &mut store, &mut tally)?;
        }
    }
    store.sync()?;
    let records = store.records()?;
    manifest.counts = count(manifest.counts.trials, &records);
    manifest.status = if manifest.counts.answered == manifest.counts.trials {
        Status::Complete
    } else {
        Status::Incomplete
    };
    let mut output = leave(&store, &manifest, records, config.show)?;
    if config.show == Show::Table {
        output.insert_str(0, &told(&tally, out.len()));
    }
    Ok(Verdict {
        status: manifest.status,
        output,
    })
}

fn not_a_line(path: &Path, line: usize) -> Error {
    let problem =
        "not a line of a Batch API's output: {\"custom_id\", \"response\", \"error\"} expected";
    Error::line(path, line, problem)
}

fn take(
    line: BatchLine,
    blanks: &HashMap<TrialKey, Record>,
    constrain: Constrain,
    out: &mut BTreeSet<TrialKey>,
    store: &mut Store,
    tally: &mut Tally,
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
    let blank = Record {
        via: Via::Batch,
        ..blank.clone()
    };
    let record = match line.result {
        Ok(reply) => {
            tally.answered += 1;
            let choices = blank.choices.len();
            let reply = Reply {
                attempts: 1,
                ..unconstrained(reply, constrain, choices)
            };
            record::answered(blank, reply)?
        }
        Err(failure) => {
            tally.failed += 1;
            record::failed(blank, failure, 1)
        }
    };
    store.append(&record)
}

/// What the run lets its models say.
fn constrain(manifest: &RunManifest) -> Result<Constrain> {
    let said = manifest.identity.get("--constrain");
    said.and_then(|said| said.as_str())
        .map_or(Ok(Constrain::None), str::parse)
}

fn told(tally: &Tally, out: usize) -> String {
    let Tally {
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
        text.push_str(
            "what failed is asked again by the next batch export, or by the evaluation itself\n",
        );
    }
    text
}
