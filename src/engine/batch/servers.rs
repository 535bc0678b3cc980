//! The batch servers of a run: [`Servers`].

use std::collections::BTreeSet;

use super::event::PartFacts;
use crate::ask::batch_api::BatchServer;
use crate::engine::models::ModelUnderTest;
use crate::error::{Error, Result};

/// Batch servers, each with the key and headers of a model.
#[derive(Debug, Default)]
pub(crate) struct Servers(Vec<ModelServer>);

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

impl Servers {
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
