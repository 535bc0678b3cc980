//! The key of an endpoint, which a file may replace while a run asks: [`AccountKey`].

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use reqwest::header::HeaderMap;
use tracing::warn;

use super::access::Access;
use crate::ask::secrets::{Scrub, Secret};
use crate::ask::wire_kind::Wire;

/// The key of an endpoint. If it comes from a file, the file is read again after a refusal with status 401: tokens of
/// cloud accounts are valid for an hour, and keys are rotated.
#[derive(Debug)]
pub(crate) struct AccountKey {
    access: Access,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// Key from a later reading of the file; `None` before it.
    renewed: Option<Secret>,
    /// Number of keys read so far, besides the first.
    renewals: u32,
    /// Filter that removes all keys so far.
    scrub: Arc<Scrub>,
}

/// Headers of a request, with the key that they carry.
#[derive(Debug)]
pub(crate) struct KeyedHeaders {
    pub(crate) headers: HeaderMap,
    /// Number of the key.
    renewals: u32,
}

impl AccountKey {
    pub(super) fn new(access: Access, scrub: Scrub) -> Self {
        Self { access, state: Mutex::new(State { renewed: None, renewals: 0, scrub: Arc::new(scrub) }) }
    }

    /// Filter that removes the keys and passwords of the endpoint from text of the server.
    pub(super) fn scrub(&self) -> Arc<Scrub> {
        Arc::clone(&self.state().scrub)
    }

    /// These headers, with the latest key.
    pub(super) fn add_to(&self, headers: &HeaderMap) -> KeyedHeaders {
        let state = self.state();
        let mut headers = headers.clone();
        if let Some(key) = &state.renewed
            && let Ok(latest) = self.access.key_headers(Some(key), Wire::Chat)
        {
            headers.extend(latest);
        }
        KeyedHeaders { headers, renewals: state.renewals }
    }

    /// Reads the file of the key again, after the server refused the key of a request. Returns true if there is another
    /// key since.
    pub(super) fn renew(&self, refused: &KeyedHeaders) -> bool {
        let Some(path) = &self.access.key_file else {
            return false;
        };
        let mut state = self.state();
        if state.renewals != refused.renewals {
            return true;
        }
        let key = match Secret::read(path) {
            Ok(key) => key,
            Err(error) => {
                warn!("the server refuses the key, and a new one could not be read: {error}");
                return false;
            }
        };
        if Some(&key) == state.renewed.as_ref().or(self.access.key.as_ref()) {
            return false;
        }
        state.scrub = Arc::new(state.scrub.with(key.expose().to_owned()));
        state.renewed = Some(key);
        state.renewals += 1;
        true
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_is_read_again_after_a_refusal() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let write = |key: &str| std::fs::write(file.path(), key).unwrap();
        let access = Access {
            key: Some(Secret::new("sk-first-0123456789", "KEY").unwrap()),
            key_file: Some(file.path().to_owned()),
            ..Access::new("https://api.example.org/v1".parse().unwrap())
        };
        let base = access.headers(Wire::Chat).unwrap();
        let scrub = access.scrub();
        let key = AccountKey::new(access, scrub);
        let first = key.add_to(&base);
        write("sk-first-0123456789\n");
        assert!(!key.renew(&first), "the same key");
        write("");
        assert!(!key.renew(&first), "no key");
        write("sk-second-0123456789\n");
        assert!(key.renew(&first));
        assert!(key.renew(&first), "another request has read it");
        let second = key.add_to(&base);
        assert_eq!(second.headers["authorization"], "Bearer sk-second-0123456789");
        assert!(second.headers["authorization"].is_sensitive());
        assert!(!key.renew(&second), "no newer one");
        let text = key.scrub().line("sk-first-0123456789 and sk-second-0123456789");
        assert_eq!(text, "[secret] and [secret]");
    }

    #[test]
    fn key_of_a_variable_is_not_read_again() {
        let access = Access::new("https://api.example.org/v1".parse().unwrap());
        let key = AccountKey::new(access, Scrub::default());
        assert!(!key.renew(&key.add_to(&HeaderMap::new())));
    }
}
