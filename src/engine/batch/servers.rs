//! The batch servers of a run: [`BatchServers`].
//!
//! The flags for batches submitted by the program: [`BatchRunArgs`], [`CollectArgs`].

use std::collections::BTreeSet;
use std::num::NonZeroU64;
use std::time::Duration;

use clap::Args;

use super::journal::PartFacts;
use crate::models::ModelUnderTest;
use darkqa_ask::batch_api::BatchServer;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::{positive, seconds};

/// Batch servers, each with the key and headers of a model.
#[derive(Debug, Default)]
pub(super) struct BatchServers(Vec<ModelServer>);

/// The server of a model.
#[derive(Debug)]
struct ModelServer {
    base: String,
    /// The model's name in tables; empty if the server is for all models.
    name: String,
    /// The model's id at the endpoint.
    id: String,
    /// The name of the first model with the same base URL, key and headers.
    account: String,
    server: BatchServer,
}

impl BatchServers {
    /// The servers of these models.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub(super) fn for_models(models: &[&ModelUnderTest]) -> Result<Self> {
        let mut servers = Vec::new();
        for model in models {
            let Some(server) = model.model.batch_server()? else {
                continue;
            };
            servers.push(ModelServer {
                base: model.model.batch_base().unwrap_or_default(),
                name: model.name.to_string(),
                id: model.model.name().to_owned(),
                account: account(model, models)?,
                server,
            });
        }
        Ok(Self(servers))
    }

    /// A single server, for all models.
    pub(super) fn at(base: String, server: BatchServer) -> Self {
        let [name, id, account] = [(); 3].map(|()| String::new());
        Self(vec![ModelServer { base, name, id, account, server }])
    }

    /// True if there is a server at a base URL.
    pub(super) fn has(&self, base: &str) -> bool {
        self.0.iter().any(|one| one.base == base)
    }

    /// The server of a part, with the key of its model. For a renamed model, all models at the base URL must have the
    /// same account.
    ///
    /// # Errors
    /// If no flag names the base URL, or the account is ambiguous.
    pub(super) fn server(&self, facts: &PartFacts) -> Result<&BatchServer> {
        let PartFacts { base, name, .. } = facts;
        let at_base: Vec<&ModelServer> = self.0.iter().filter(|one| one.base == *base).collect();
        let own = at_base.iter().find(|one| facts.asks(&one.name, &one.id));
        let accounts: BTreeSet<&str> = at_base.iter().map(|one| &*one.account).collect();
        match (own, &at_base[..]) {
            // Parts of earlier versions have no name.
            (Some(own), _) if !name.is_empty() || accounts.len() == 1 => Ok(&own.server),
            (_, [first, ..]) if accounts.len() == 1 => Ok(&first.server),
            (_, []) => {
                let known: BTreeSet<&str> = self.0.iter().map(|one| &*one.base).collect();
                let known: Vec<&str> = known.into_iter().collect();
                let problem = format_args!(
                    "this run has batches at {base}, and the flags name {} alone; name that address, with its key",
                    known.join(" and ")
                );
                Err(Error::usage("--base-url", problem))
            }
            _ => {
                let of = if name.is_empty() { &facts.model } else { name };
                let problem = format_args!(
                    "this run has batches of {of} at {base}, where the models have several keys or headers, and it is not known which of \
                     them made the batches; name the models as they were when the batches were made"
                );
                Err(Error::usage("--models", problem))
            }
        }
    }
}

/// The account charged for the batches of a model: the name of the first model with the same base URL, key and headers.
///
/// # Errors
/// If a header value has characters that HTTP does not allow.
pub(super) fn account(model: &ModelUnderTest, models: &[&ModelUnderTest]) -> Result<String> {
    for other in models {
        if other.model.shares_account_with(&model.model)? {
            return Ok(other.name.to_string());
        }
    }
    Ok(model.name.to_string())
}

/// Flags for looking after batches.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub struct CollectArgs {
    /// Seconds between two checks of the batches; up to 30 times as long while nothing changes
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "10", add = Decides::Nothing)]
    pub poll: Duration,
    /// Leave the files at the server after their replies are imported; default: delete them, as they hold the images
    #[arg(long, add = Decides::Nothing)]
    pub keep_files: bool,
}

/// Flags for submitting batches.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub struct BatchRunArgs {
    /// Flags for looking after batches.
    #[command(flatten)]
    pub collect: CollectArgs,
    /// Submit the batches and return; batch fetch, or the same command, imports the replies
    #[arg(long, add = Decides::Nothing)]
    pub detach: bool,
    /// Send no single request of each model before its batches; such a request finds out what the server refuses
    #[arg(long, add = Decides::Nothing)]
    pub no_scout: bool,
    /// The tokens that the server lets wait for batches of a model; parts have at most 45 % of it; default: what the
    /// server states when it refuses a batch, and parts of 2 million
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub enqueued_tokens: Option<NonZeroU64>,
    /// The time within which the server is to end a batch
    #[arg(long, value_name = "TIME", default_value = "24h", add = Decides::Nothing)]
    pub window: String,
    /// Cancel a batch that has not ended after this time; what it has not answered is asked again; default: never
    #[arg(long, value_name = "HOURS", value_parser = positive, add = Decides::Nothing)]
    pub give_up: Option<f64>,
    /// The purpose under which files are uploaded; default: what is known of the endpoint, else batch
    #[arg(long, value_name = "WORD", add = Decides::Nothing)]
    pub purpose: Option<String>,
}

impl BatchRunArgs {
    /// The flags of a command that submits nothing.
    #[must_use]
    pub(super) fn collecting(collect: &CollectArgs) -> Self {
        Self {
            collect: collect.clone(),
            detach: false,
            no_scout: true,
            enqueued_tokens: None,
            window: String::new(),
            give_up: None,
            purpose: None,
        }
    }
}
