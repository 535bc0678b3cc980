//! The servers of a run's parts: [`Servers`].

use std::collections::BTreeMap;

use crate::ask::batch_api::BatchServer;
use crate::error::{Error, Result};

/// Servers with files and batches, by address.
#[derive(Debug, Default)]
pub(crate) struct Servers(BTreeMap<String, BatchServer>);

impl Servers {
    /// Adds a server, if there is none at its address.
    pub(crate) fn add(&mut self, base: String, server: BatchServer) {
        self.0.entry(base).or_insert(server);
    }

    /// Whether there is a server at an address.
    pub(super) fn has(&self, base: &str) -> bool {
        self.0.contains_key(base)
    }

    /// The server at an address.
    ///
    /// # Errors
    /// If no flag names it.
    pub(super) fn of(&self, base: &str) -> Result<&BatchServer> {
        self.0.get(base).ok_or_else(|| {
            let known: Vec<&str> = self.0.keys().map(String::as_str).collect();
            let problem = format_args!(
                "this run has batches at {base}, and the flags name {} alone; name that address, with its key",
                known.join(" and ")
            );
            Error::usage("--base-url", problem)
        })
    }
}
