//! Refuses settings that a file of models may not have if it came with data: [`check`].
//!
//! Such a file is a stranger's: it could name a variable or a file of this machine, and an address of its own to send it to.

use std::path::{Path, PathBuf};

use super::asking::AskingArgs;
use super::entry::Entry;
use super::file::{Keys, Located, ModelsFile};
use crate::ask::{AccessArgs, BaseUrl, OPENAI_KEY, vendor_variables};
use crate::error::{Error, Result};

/// The value of `key-env` for an endpoint without keys.
const NO_KEY: &str = "none";

/// Whether the user has said that a file of models is the user's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trust {
    /// It may name any variable and file.
    Own,
    /// It may if it does not lie in the folder of the data.
    ByPlace,
}

/// Refuses a file in the folder of the `data` by which variables other than those of the host's own tools would be sent, or files
/// outside the file's own folder. A file is the user's own if the working directory lies in that folder. `entries` are the file's
/// models as merged: what they come to is looked at, and not what single tables say. What the `flags` alone send is the user's own
/// wish, but to the addresses of the flags only.
///
/// # Errors
/// [`Error::Usage`] with the line of the key.
pub(super) fn check(
    file: &ModelsFile,
    entries: &[Entry],
    flags: &AskingArgs,
    data: Option<&Path>,
    trust: Trust,
) -> Result<()> {
    let Some(data) = data.filter(|_| trust == Trust::ByPlace) else {
        return Ok(());
    };
    if !is_strange(&file.path, data) {
        return Ok(());
    }
    for (keys, entry) in file.models.iter().zip(entries) {
        let model = Suspect {
            file,
            keys,
            entry,
            flags,
        };
        model.check_files()?;
        model.check_connection()?;
        model.check_variables()?;
    }
    Ok(())
}

/// Whether a file lies in the folder of the data, and the working directory does not.
fn is_strange(file: &Path, data: &Path) -> bool {
    let folder = if data.is_dir() {
        Some(data)
    } else {
        data.parent()
    };
    let folder = folder.and_then(real);
    let below = |path: Option<PathBuf>| match (&folder, path) {
        (Some(folder), Some(path)) => path.starts_with(folder),
        _ => false,
    };
    below(real(file)) && !below(real(Path::new(".")))
}

/// The path without links; `None` if there is no such file.
fn real(path: &Path) -> Option<PathBuf> {
    let path = if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    };
    path.canonicalize().ok()
}

/// A model of a file that may be a stranger's.
struct Suspect<'a> {
    file: &'a ModelsFile,
    /// Its own table.
    keys: &'a Keys,
    /// The resolved entry.
    entry: &'a Entry,
    flags: &'a AskingArgs,
}

/// A variable that is sent, and the key of the file that states it.
struct Sent<'a> {
    key: &'static str,
    variable: &'a str,
    /// Whether the flags alone send it, too.
    by_flags: bool,
}

impl Suspect<'_> {
    /// Refuses files outside the folder of the file of models, whose content would be sent.
    fn check_files(&self) -> Result<()> {
        let (asking, flags) = (&self.entry.asking, self.flags);
        let body = |asking: &AskingArgs| {
            let text = asking.request.extra_body.as_deref()?;
            text.strip_prefix('@').map(PathBuf::from)
        };
        let files = [
            (
                "key-file",
                asking.access.api_key_file.clone(),
                flags.access.api_key_file.clone(),
            ),
            (
                "system-file",
                asking.request.system_file.clone(),
                flags.request.system_file.clone(),
            ),
            ("body", body(asking), body(flags)),
        ];
        for (key, path, of_flags) in files {
            if let Some(path) = path
                && Some(&path) != of_flags.as_ref()
                && !self.is_inside(&path)
            {
                let problem = format_args!("{key}: {} is outside its folder", path.display());
                return Err(self.strange(key, problem));
            }
        }
        Ok(())
    }

    /// Refuses what decides which variables are sent, whom a connection trusts, and whether others can read it.
    fn check_connection(&self) -> Result<()> {
        let (access, flags) = (&self.entry.asking.access, &self.flags.access);
        if access.vendor != flags.vendor {
            let problem = "vendor: such a table decides which variables are sent";
            return Err(self.strange("vendor", format_args!("{problem}")));
        }
        if access.ca_file != flags.ca_file {
            let problem = "ca-file: its authorities could pass off another server as the vendor's";
            return Err(self.strange("ca-file", format_args!("{problem}")));
        }
        if access.allow_http && !flags.allow_http {
            let problem = "allow-http: others on the way could read what is sent";
            return Err(self.strange("allow-http", format_args!("{problem}")));
        }
        Ok(())
    }

    /// Refuses variables that would be sent to a host whose own tools do not read them.
    fn check_variables(&self) -> Result<()> {
        let access = &self.entry.asking.access;
        let of_flags = self.flags.access.addresses()?;
        for base in access.addresses()? {
            let own = vendor_variables(base.host());
            let is_of_flags = of_flags.contains(&base);
            let mut sent = named(access, &self.flags.access);
            sent.extend(self.default_key(&base, &own));
            let mut foreign = sent.iter().filter(|sent| {
                let is_wished = sent.by_flags && is_of_flags;
                !is_wished && !own.contains(&sent.variable)
            });
            if let Some(Sent { key, variable, .. }) = foreign.next() {
                return Err(self.foreign(key, variable, &base));
            }
        }
        Ok(())
    }

    /// The variable that is taken for a host that the table of vendors does not have, if no other key is named.
    fn default_key(&self, base: &BaseUrl, own: &[&str]) -> Option<Sent<'static>> {
        let (access, flags) = (&self.entry.asking.access, &self.flags.access);
        let none =
            |access: &AccessArgs| access.api_key_env.is_none() && access.api_key_file.is_none();
        let is_set = std::env::var_os(OPENAI_KEY).is_some_and(|text| !text.is_empty());
        let is_sent = none(access) && own.is_empty() && !base.is_loopback() && is_set;
        is_sent.then(|| Sent {
            key: "endpoints",
            variable: OPENAI_KEY,
            by_flags: none(flags),
        })
    }

    /// The error about a variable at a host that is not its own.
    fn foreign(&self, key: &str, variable: &str, base: &BaseUrl) -> Error {
        let host = base.host();
        if self.stated(key, variable).is_some() && key != "endpoints" {
            let problem = format_args!("{key}: {variable} is not a variable of {host}'s own tools");
            return self.strange_at(self.stated(key, variable), problem);
        }
        let problem = if key == "endpoints" {
            format!("{variable} would be sent to {host}, which the table of vendors does not have")
        } else {
            format!("{variable} would be sent to {host}, which no flag names")
        };
        self.strange("endpoints", format_args!("endpoints: {problem}"))
    }

    /// The key of the model's own table, else that of `[defaults]`, if it names the variable.
    fn stated(&self, key: &str, variable: &str) -> Option<&Located> {
        let layers = [self.keys.get(key), self.file.defaults.get(key)];
        let names = |located: &&Located| match &located.value {
            toml::Value::Table(table) => table
                .values()
                .any(|value| value.get("env").and_then(toml::Value::as_str) == Some(variable)),
            value => value.as_str() == Some(variable),
        };
        layers.into_iter().flatten().find(names)
    }

    fn is_inside(&self, path: &Path) -> bool {
        let own = self.file.path.parent().and_then(real);
        match (own, real(path)) {
            (Some(own), Some(path)) => path.starts_with(own),
            // What is not there cannot be sent.
            _ => true,
        }
    }

    /// The error at the line of a key: that of the model's own table, else that of `[defaults]`.
    fn strange(&self, key: &str, problem: std::fmt::Arguments<'_>) -> Error {
        let located = self.keys.get(key).or_else(|| self.file.defaults.get(key));
        self.strange_at(located, problem)
    }

    fn strange_at(&self, located: Option<&Located>, problem: std::fmt::Arguments<'_>) -> Error {
        let problem = format!(
            "{problem}, and the file may have come with the data from someone else; --allow models-file states that you trust it"
        );
        match (located, &self.entry.place) {
            (Some(located), _) => located.error(problem),
            (None, Some(place)) => Error::usage(place, problem),
            (None, None) => Error::usage("--models", problem),
        }
    }
}

/// The variables that an endpoint names for its key and its headers.
fn named<'a>(access: &'a AccessArgs, flags: &AccessArgs) -> Vec<Sent<'a>> {
    let key = access
        .api_key_env
        .as_deref()
        .filter(|name| *name != NO_KEY)
        .filter(|_| access.api_key_file.is_none());
    let key = key.map(|variable| Sent {
        key: "key-env",
        variable,
        by_flags: access.api_key_env == flags.api_key_env,
    });
    let headers = access.header_env.iter().filter_map(|text| {
        let (_, variable) = text.split_once('=')?;
        Some(Sent {
            key: "headers",
            variable: variable.trim(),
            by_flags: flags.header_env.contains(text),
        })
    });
    key.into_iter().chain(headers).collect()
}
