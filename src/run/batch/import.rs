//! `batch import`: the output of a Batch API, as records.

use super::replies::take_over;
use crate::config::{BatchImport, Show};
use crate::error::{Error, Result};
use crate::run::report::{kept, leave};
use crate::run::{Verdict, count};
use crate::store::{self, Moved, Store};
use crate::types::manifest::Status;
use crate::types::{Detail, OpenDetail};

/// Takes the replies of output and error files over; each of them once, however often a file is given.
///
/// # Errors
/// Where the folder holds no run or no batch, or a line is none of such a file: those before it are kept.
pub fn import(config: &BatchImport) -> Result<Verdict> {
    if store::schema(&config.run)?.as_deref() == Some(OpenDetail::SCHEMA) {
        return import_open(config);
    }
    let mut manifest = kept(&config.run)?;
    let mut store = Store::open(&config.run, &manifest, Moved::Allowed)?;
    let said = take_over(&mut store, &manifest, &config.files)?;
    let records = store.records()?;
    manifest.counts = count(manifest.counts.trials, &records);
    manifest.status = if manifest.counts.answered == manifest.counts.trials {
        Status::Complete
    } else {
        Status::Incomplete
    };
    let mut output = leave(&store, &manifest, records, config.show)?;
    if config.show == Show::Table {
        output.insert_str(0, &said);
    }
    Ok(Verdict {
        status: manifest.status,
        output,
    })
}

/// The same for a run of open questions, whose scores the command shows that began it.
fn import_open(config: &BatchImport) -> Result<Verdict> {
    if config.show == Show::Json {
        let problem = "this is a run of open questions: openeqa --json shows its summary";
        return Err(Error::usage("--json", problem));
    }
    let manifest = store::read_manifest(&config.run, OpenDetail::SCHEMA)?;
    let Some(manifest) = manifest else {
        let problem = "no run in this folder: it has no manifest.json".to_owned();
        let path = config.run.clone();
        return Err(Error::Run { path, problem });
    };
    let mut store = Store::<OpenDetail>::open(&config.run, &manifest, Moved::Allowed)?;
    let said = take_over(&mut store, &manifest, &config.files)?;
    Ok(Verdict {
        status: Status::Complete,
        output: said + "the openeqa command that began this run goes on with it\n",
    })
}
