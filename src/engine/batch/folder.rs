//! The batches of a run folder, without the settings of the run: [`FolderBatches`].
//!
//! The state of a run's parts as text: [`lines`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use tokio::runtime;

use super::driver::{Driver, Goal, Notes};
use super::file::StoppedModels;
use super::journal::{BatchPart, Journal, Stage};
use super::recover::recover;
use super::servers::{BatchRunArgs, BatchServers, CollectArgs};
use crate::images::progress::Progress;
use crate::images::workers::thread_start_error;
use darkqa_ask::{AccessArgs, BaseUrl, Endpoint, Sending};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::counted;
use darkqa_score::answers::record::Detail;
use darkqa_store::Store;

/// The task for the batches of a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FolderTask {
    /// Import the replies of ended batches.
    Fetch,
    /// Cancel all batches, wait until they have ended, and import the existing replies.
    Cancel,
}

/// The batches of a run folder, and their server.
pub struct FolderBatches<'a> {
    journal: Journal,
    manifest: &'a RunManifest,
    servers: BatchServers,
}

impl<'a> FolderBatches<'a> {
    /// Opens the batches of a run. Without a base URL in the flags, uses the one at which the batches were created.
    ///
    /// # Errors
    /// If the program submitted no batch of this run, or its server is unknown.
    pub fn open(folder: &Path, manifest: &'a RunManifest, access: &AccessArgs) -> Result<Self> {
        let journal = Journal::open(folder, manifest)?;
        if journal.parts.is_empty() {
            return Err(Error::Run {
                path: folder.to_owned(),
                problem: "batch run has submitted no batch of this run".to_owned(),
            });
        }
        let mut servers = BatchServers::default();
        if let Some(base) = base_url(&journal, access)? {
            let access = AccessArgs { base_url: vec![base], ..access.clone() };
            let sending = Sending::default();
            let endpoint = Endpoint::from_addresses(access.server(sending)?.replicas, sending)?;
            servers = BatchServers::at(endpoint.base().to_string(), endpoint.batch_server()?);
        }
        Ok(Self { journal, manifest, servers })
    }

    /// One line per part, with the state of its batch at the server.
    pub fn status(&self) -> Result<String> {
        let runtime = start_runtime()?;
        let mut counts = BTreeMap::new();
        let mut problems = String::new();
        for part in &self.journal.parts {
            let (Stage::Created, Some(id)) = (&part.stage, &part.batch) else {
                continue;
            };
            let checked = match self.servers.server(&part.facts) {
                Ok(server) => runtime.block_on(server.batch(id)).map_err(|e| e.to_string()),
                Err(error) => Err(error.to_string()),
            };
            match checked {
                Ok(batch) => {
                    let (done, total) = (batch.counts.done, batch.counts.total);
                    let state = format!("{}, {done} of {total}", batch.state.word());
                    counts.insert(part.name.clone(), state);
                }
                Err(problem) => {
                    let _ = writeln!(problems, "{}: {problem}", part.name);
                }
            }
        }
        Ok(lines(&self.journal, &counts) + &problems)
    }

    /// Refuses batches of several accounts at the same base URL, because the flags have only one key.
    fn refuse_several_accounts(&self) -> Result<()> {
        let accounts: BTreeSet<&str> = self
            .journal
            .parts
            .iter()
            .filter(|part| part.stage != Stage::Ended)
            .filter(|part| self.servers.has(&part.facts.base))
            .map(|part| &*part.facts.account)
            // Journals of earlier versions have no accounts.
            .filter(|account| !account.is_empty())
            .collect();
        if accounts.len() < 2 {
            return Ok(());
        }
        let accounts: Vec<&str> = accounts.into_iter().collect();
        let problem = format_args!(
            "the batches of this run were made with several keys or headers, among them those of {}, and these flags have one key; batch \
             run with the file of models imports the replies of all, and the server's own page cancels them",
            accounts.join(" and ")
        );
        Err(Error::usage("--api-key-env", problem))
    }

    /// Carries out a task; returns a text about the batches.
    ///
    /// # Errors
    /// If the server refuses all further calls.
    pub fn carry_out<D: Detail>(
        mut self,
        task: FolderTask,
        store: &mut Store<D>,
        collect: &CollectArgs,
        progress: &Progress,
    ) -> Result<String> {
        self.refuse_several_accounts()?;
        recover(&mut self.journal, store)?;
        let args = BatchRunArgs::collecting(collect);
        let mut stopped = StoppedModels::default();
        let mut driver = Driver {
            store,
            manifest: self.manifest,
            journal: &mut self.journal,
            servers: &self.servers,
            models: &[],
            args: &args,
            money: None,
            progress,
            until: match task {
                FolderTask::Fetch => Goal::Checked,
                FolderTask::Cancel => Goal::Cancelled,
            },
            refused: &mut BTreeSet::new(),
            stopped: &mut stopped,
            notes: Notes::default(),
        };
        start_runtime()?.block_on(driver.drive())?;
        if let Some(first) = stopped.take_errors().into_iter().next() {
            return Err(first);
        }
        Ok(lines(&self.journal, &BTreeMap::new()))
    }
}

/// Starts a single-threaded runtime.
pub(super) fn start_runtime() -> Result<runtime::Runtime> {
    runtime::Builder::new_current_thread().enable_all().build().map_err(|e| thread_start_error(&e))
}

/// The base URL of the server: from the flags, or else the one at which the parts were created. `None` if nothing is
/// left to do.
///
/// # Errors
/// If there are several base URLs, or a key would be sent to one that only the folder names.
fn base_url(journal: &Journal, access: &AccessArgs) -> Result<Option<String>> {
    match &access.base_url[..] {
        [] => {}
        [base] => return Ok(Some(base.clone())),
        _ => {
            return Err(Error::usage("--base-url", "batches are at one address; name one"));
        }
    }
    let bases: BTreeSet<&str> =
        journal.parts.iter().filter(|part| part.stage != Stage::Ended).map(|part| part.facts.base.as_str()).collect();
    let mut bases = bases.into_iter();
    let (Some(base), None) = (bases.next(), bases.next()) else {
        if journal.has_open_parts() {
            let problem =
                "the batches of this run are at several addresses; name one of them, with its key, and then the other";
            return Err(Error::usage("--base-url", problem));
        }
        return Ok(None);
    };
    // The journal has no query string, which the variable may have.
    if let Ok(variable) = std::env::var("OPENAI_BASE_URL")
        && variable.parse::<BaseUrl>().is_ok_and(|url| url.to_string() == base)
    {
        return Ok(Some(variable));
    }
    access.check_run_address(&base.parse()?)?;
    Ok(Some(base.to_owned()))
}

/// One line per part, with its file, requests, batch and state. `states` are current states from the server, by name of
/// the part.
pub(super) fn lines(journal: &Journal, states: &BTreeMap<String, String>) -> String {
    let mut text = String::new();
    for part in &journal.parts {
        let batch = part.batch.as_deref().unwrap_or("no batch");
        let _ = writeln!(
            text,
            "{}: {} to {}, {batch}, {}",
            part.name,
            counted(part.facts.requests, "request"),
            part.facts.model,
            states.get(&part.name).cloned().unwrap_or_else(|| state_words(part))
        );
    }
    text
}

/// The state of a part, in words.
fn state_words(part: &BatchPart) -> String {
    match (&part.stage, part.outcome) {
        (Stage::Written | Stage::Uploading | Stage::Uploaded, _) => "not submitted yet".to_owned(),
        (Stage::Creating, _) => "being submitted".to_owned(),
        (Stage::Created, _) if part.state.is_empty() => "submitted".to_owned(),
        (Stage::Fetched { state }, _) => format!("{state}, fetched"),
        (Stage::Imported | Stage::Ended, Some((answered, failed))) => {
            format!("{}: {answered} answered, {failed} not", part.state)
        }
        (Stage::Created | Stage::Imported | Stage::Ended, _) => part.state.clone(),
    }
}
