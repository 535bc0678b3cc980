//! What a file of models that came with data may not do by itself: [`check`].
//!
//! Such a file is a stranger's: it could name a variable or a file of this machine, and an address of its own to send it to.

use std::path::{Path, PathBuf};

use toml::Value;

use super::entry::Entry;
use super::file::{Keys, Located, ModelsFile};
use crate::ask::{BaseUrl, OPENAI_KEY, own_variables};
use crate::error::{Error, Result};

/// The value of `key-env` for an endpoint without keys.
const NO_KEY: &str = "none";

/// Keys that name a file whose content is sent.
const FILES: [&str; 2] = ["key-file", "system-file"];

/// Whether the user has said that a file of models is the user's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trust {
    /// It may name any variable and file.
    Own,
    /// It may if it does not lie in the folder of the data.
    ByPlace,
}

/// Refuses keys of a file in the folder of the `data` that would send variables other than those of the host's own tools, or files
/// outside the file's own folder. A file is the user's own if the working directory lies in that folder. `entries` are the file's
/// models, with all that flags add.
///
/// # Errors
/// [`Error::Usage`] with the line of the key.
pub(super) fn check(
    file: &ModelsFile,
    entries: &[Entry],
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
        check_model(file, keys, entry)?;
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

fn check_model(file: &ModelsFile, keys: &Keys, entry: &Entry) -> Result<()> {
    let stated = |key: &str| keys.get(key).or_else(|| file.defaults.get(key));
    let own = file.path.parent().and_then(real);
    let is_inside = |path: &str| match (&own, real(Path::new(path))) {
        (Some(own), Some(path)) => path.starts_with(own),
        // What is not there cannot be sent.
        _ => true,
    };
    for key in FILES {
        if let Some(located) = stated(key)
            && let Value::String(path) = &located.value
            && !is_inside(path)
        {
            return Err(strange(
                located,
                format_args!("{key}: {path} is outside its folder"),
            ));
        }
    }
    if let Some(located) = stated("body")
        && let Value::String(text) = &located.value
        && let Some(path) = text.strip_prefix('@')
        && !is_inside(path)
    {
        return Err(strange(
            located,
            format_args!("body: {path} is outside its folder"),
        ));
    }
    if let Some(located) = stated("vendor") {
        let problem = "vendor: such a table says which variables are sent";
        return Err(strange(located, format_args!("{problem}")));
    }
    let hosts = entry.asking.access.addresses()?;
    let headers = stated("headers");
    for (located, key, variable) in variables(stated("key-env"), headers) {
        if let Some(base) = hosts.iter().find(|base| !is_own(base, variable)) {
            let problem = format_args!(
                "{key}: {variable} is no variable of {}'s own tools",
                base.host()
            );
            return Err(strange(located, problem));
        }
    }
    let unknown = |base: &&BaseUrl| own_variables(base.host()).is_empty() && !base.is_loopback();
    let takes_default = stated("key-env").is_none() && stated("key-file").is_none();
    if let (true, Some(located)) = (takes_default, stated("endpoints"))
        && let Some(base) = hosts.iter().find(unknown)
        && std::env::var_os(OPENAI_KEY).is_some_and(|text| !text.is_empty())
    {
        let problem = format_args!(
            "endpoints: {OPENAI_KEY} would be sent to {}, which the table of vendors does not have",
            base.host()
        );
        return Err(strange(located, problem));
    }
    Ok(())
}

/// The variables that are named, each with the key that names it.
fn variables<'a>(
    key_env: Option<&'a Located>,
    headers: Option<&'a Located>,
) -> Vec<(&'a Located, &'static str, &'a str)> {
    let mut found = Vec::new();
    if let Some(located) = key_env
        && let Some(name) = located.value.as_str().filter(|name| *name != NO_KEY)
    {
        found.push((located, "key-env", name));
    }
    if let Some(located) = headers {
        let tables = located.value.as_table().into_iter().flatten();
        let names = tables.filter_map(|(_, value)| value.get("env")?.as_str());
        found.extend(names.map(|name| (located, "headers", name)));
    }
    found
}

fn is_own(base: &BaseUrl, variable: &str) -> bool {
    own_variables(base.host()).contains(&variable)
}

fn strange(located: &Located, problem: std::fmt::Arguments<'_>) -> Error {
    located.error(format_args!(
        "{problem}, and the file lies in the folder of the data, so that it may be a stranger's; --trust-models says that it is yours"
    ))
}
