//! Refuses dangerous settings in a models file that may have come with the data: [`check`].
//!
//! Such a file may be written by an attacker: it could name a variable or a file of this machine, and an address to
//! send its content to.

use std::path::{Path, PathBuf};

use super::asking::AskingArgs;
use super::entry::ModelEntry;
use super::file::{Keys, Located, ModelsFile};
use darkqa_ask::{AccessArgs, BaseUrl, OPENAI_KEY, vendor_variables};
use darkqa_base::error::{Error, Result};

/// The value of `key-env` for an endpoint without keys.
const NO_KEY: &str = "none";

/// Trust in a models file. A trusted file may name any variable and file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trust {
    /// Trusted, because a flag states it.
    Stated,
    /// Trusted if it is not in the folder of the data.
    ByLocation,
}

/// Refuses an untrusted models file that would send variables other than those of the host's own tools, or files
/// outside its own folder. A file is untrusted in the folder of the `data`, unless the working directory is in that
/// folder too. The check applies to the merged models of the file, `entries`, and not to single tables. Variables and
/// files that the `flags` name are allowed, but only at the addresses of the flags.
///
/// # Errors
/// [`Error::Usage`] with the line of the key.
pub(super) fn check(
    file: &ModelsFile,
    entries: &[ModelEntry],
    flags: &AskingArgs,
    data: Option<&Path>,
    trust: Trust,
) -> Result<()> {
    let Some(data) = data.filter(|_| trust == Trust::ByLocation) else {
        return Ok(());
    };
    if !is_in_data_folder(&file.path, data) {
        return Ok(());
    }
    for (keys, entry) in file.models.iter().zip(entries) {
        let model = UntrustedModel { file, keys, entry, flags };
        model.check_files()?;
        model.check_connection()?;
        model.check_variables()?;
    }
    Ok(())
}

/// True if a file is in the folder of the data, and the working directory is not.
fn is_in_data_folder(file: &Path, data: &Path) -> bool {
    let folder = if data.is_dir() { Some(data) } else { data.parent() };
    let folder = folder.and_then(canonical_path);
    is_below(folder.as_deref(), file) && !is_below(folder.as_deref(), Path::new("."))
}

fn is_below(folder: Option<&Path>, path: &Path) -> bool {
    match (folder, canonical_path(path)) {
        (Some(folder), Some(path)) => path.starts_with(folder),
        _ => false,
    }
}

/// The absolute path without symbolic links; `None` if there is no such file. An empty path is the working directory.
fn canonical_path(path: &Path) -> Option<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    path.canonicalize().ok()
}

/// A model of an untrusted models file.
struct UntrustedModel<'a> {
    file: &'a ModelsFile,
    /// The model's own table.
    keys: &'a Keys,
    /// The model merged from flags and tables.
    entry: &'a ModelEntry,
    flags: &'a AskingArgs,
}

/// A variable whose value would be sent, and the key of the file that names it.
struct SentVariable<'a> {
    key: &'static str,
    variable: &'a str,
    /// True if the flags name it, too.
    by_flags: bool,
}

impl UntrustedModel<'_> {
    /// Refuses to send the content of files outside the folder of the models file.
    fn check_files(&self) -> Result<()> {
        let (asking, flags) = (&self.entry.asking, self.flags);
        let files = [
            ("key-file", asking.access.api_key_file.clone(), flags.access.api_key_file.clone()),
            ("system-file", asking.request.system_file.clone(), flags.request.system_file.clone()),
            ("body", body_file(asking), body_file(flags)),
        ];
        for (key, path, flag_path) in files {
            if let Some(path) = path
                && Some(&path) != flag_path.as_ref()
                && !self.is_inside(&path)
            {
                let problem = format_args!("{key}: {} is outside its folder", path.display());
                return Err(self.error_at_key(key, problem));
            }
        }
        Ok(())
    }

    /// Refuses settings that select the variables to send or the trusted authorities of a connection, or that allow
    /// unencrypted connections.
    fn check_connection(&self) -> Result<()> {
        let (access, flags) = (&self.entry.asking.access, &self.flags.access);
        if access.vendor != flags.vendor {
            let problem = "vendor: such a table decides which variables are sent";
            return Err(self.error_at_key("vendor", format_args!("{problem}")));
        }
        if access.ca_file != flags.ca_file {
            let problem = "ca-file: its authorities could pass off another server as the vendor's";
            return Err(self.error_at_key("ca-file", format_args!("{problem}")));
        }
        if access.allow_http && !flags.allow_http {
            let problem = "allow-http: others on the way could read what is sent";
            return Err(self.error_at_key("allow-http", format_args!("{problem}")));
        }
        Ok(())
    }

    /// Refuses variables that would be sent to a host whose own tools do not read them.
    fn check_variables(&self) -> Result<()> {
        let access = &self.entry.asking.access;
        let flag_addresses = self.flags.access.addresses()?;
        for base in access.addresses()? {
            let host_variables = vendor_variables(base.host());
            let is_flag_address = flag_addresses.contains(&base);
            let mut variables = named_variables(access, &self.flags.access);
            variables.extend(self.default_key(&base, &host_variables));
            for sent in variables {
                let is_requested = sent.by_flags && is_flag_address;
                if !is_requested && !host_variables.contains(&sent.variable) {
                    return Err(self.foreign_variable_error(sent.key, sent.variable, &base));
                }
            }
        }
        Ok(())
    }

    /// The default key variable, which is sent to hosts without variables of their own if no other key is named and the
    /// variable is set.
    fn default_key(&self, base: &BaseUrl, host_variables: &[&str]) -> Option<SentVariable<'static>> {
        let (access, flags) = (&self.entry.asking.access, &self.flags.access);
        let has_no_key = |access: &AccessArgs| access.api_key_env.is_none() && access.api_key_file.is_none();
        let is_set = std::env::var_os(OPENAI_KEY).is_some_and(|text| !text.is_empty());
        let is_sent = has_no_key(access) && host_variables.is_empty() && !base.is_loopback() && is_set;
        is_sent.then(|| SentVariable { key: "endpoints", variable: OPENAI_KEY, by_flags: has_no_key(flags) })
    }

    /// The error for a variable that the tools of a host do not read.
    fn foreign_variable_error(&self, key: &str, variable: &str, base: &BaseUrl) -> Error {
        let host = base.host();
        if self.stated(key, variable).is_some() && key != "endpoints" {
            let problem = format_args!("{key}: {variable} is not a variable of {host}'s own tools");
            return self.error_at(self.stated(key, variable), problem);
        }
        let problem = if key == "endpoints" {
            format!("{variable} would be sent to {host}, which the table of vendors does not have")
        } else {
            format!("{variable} would be sent to {host}, which no flag names")
        };
        self.error_at_key("endpoints", format_args!("endpoints: {problem}"))
    }

    /// The key of the model's own table, else that of `[defaults]`, if it names the variable.
    fn stated(&self, key: &str, variable: &str) -> Option<&Located> {
        let layers = [self.keys.get(key), self.file.defaults.get(key)];
        layers.into_iter().flatten().find(|located| match &located.value {
            toml::Value::Table(table) => {
                table.values().any(|value| value.get("env").and_then(toml::Value::as_str) == Some(variable))
            }
            value => value.as_str() == Some(variable),
        })
    }

    fn is_inside(&self, path: &Path) -> bool {
        let folder = self.file.path.parent().and_then(canonical_path);
        match (folder, canonical_path(path)) {
            (Some(folder), Some(path)) => path.starts_with(folder),
            // A missing file cannot be sent.
            _ => true,
        }
    }

    /// An error at the line of a key in the model's own table, else in `[defaults]`.
    fn error_at_key(&self, key: &str, problem: std::fmt::Arguments<'_>) -> Error {
        let located = self.keys.get(key).or_else(|| self.file.defaults.get(key));
        self.error_at(located, problem)
    }

    fn error_at(&self, located: Option<&Located>, problem: std::fmt::Arguments<'_>) -> Error {
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

fn body_file(asking: &AskingArgs) -> Option<PathBuf> {
    let text = asking.request.extra_body.as_deref()?;
    text.strip_prefix('@').map(PathBuf::from)
}

/// The variables that the settings of an endpoint name for its key and its headers.
fn named_variables<'a>(access: &'a AccessArgs, flags: &AccessArgs) -> Vec<SentVariable<'a>> {
    let key = access.api_key_env.as_deref().filter(|name| *name != NO_KEY).filter(|_| access.api_key_file.is_none());
    let key = key.map(|variable| SentVariable {
        key: "key-env",
        variable,
        by_flags: access.api_key_env == flags.api_key_env,
    });
    let headers = access.header_env.iter().filter_map(|text| {
        let (_, variable) = text.split_once('=')?;
        Some(SentVariable { key: "headers", variable: variable.trim(), by_flags: flags.header_env.contains(text) })
    });
    key.into_iter().chain(headers).collect()
}
