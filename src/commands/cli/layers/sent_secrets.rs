//! Refuses a file of flags that sends secrets to an address of its own: [`check`].
//!
//! Such a file may come from a stranger, for example from the repository of a paper. It may name an address, or what is
//! sent to one. With both it could send any file or variable of the user to its author. So a file that names an address
//! may only send files from its own folder, and variables that belong to this address.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::expansion::LayeredValue;
use darkqa_ask::{BaseUrl, OPENAI_KEY, vendor_variables};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::flag_spelling;

/// The flags that decide where requests go, or who may read them on their way.
const ADDRESSES: [&str; 3] = ["base-url", "judge-base-url", "ca-file"];

/// The flags that name an address, each with the flags that decide which key goes there.
const KEYS: [(&str, [&str; 2]); 2] =
    [("base-url", ["api-key-env", "api-key-file"]), ("judge-base-url", ["judge-api-key-env", "judge-api-key-file"])];

/// The flags that change which key goes to which address: a table of vendors names the variable of a host's key.
const KEY_RULES: [&str; 2] = ["key-anyway", "vendor"];

/// The flags that name a variable whose value is sent. In `header-env`, the variable stands after `=`.
const VARIABLES: [&str; 3] = ["api-key-env", "judge-api-key-env", "header-env"];

/// The flags that name a file whose text is sent. In `extra-body`, the file stands after `@`.
const FILES: [&str; 5] = ["api-key-file", "judge-api-key-file", "system-file", "extra-body", "prompts"];

/// Refuses a file of flags that sets an address and also sends a variable of another host, or a file outside its own
/// folder. `values` are those of the file that are in effect. `flags_set` has the flags that any layer sets. `has_key`
/// is true if there is a default key, which is sent to addresses of unknown vendors.
///
/// # Errors
/// Names the key of the file, and the flag to type instead.
pub(super) fn check(
    file: &Path,
    values: &BTreeMap<String, &LayeredValue>,
    flags_set: &BTreeSet<String>,
    has_key: bool,
) -> Result<()> {
    let address = ADDRESSES.iter().find(|flag| values.contains_key(**flag));
    let Some(address) = address else {
        return Ok(());
    };
    if let Some((flag, value)) = KEY_RULES.iter().find_map(|flag| entry(values, flag)) {
        return Err(refusal(address, flag, value, "a key of yours"));
    }
    let unnamed = KEYS.iter().filter(|(_, keys)| !keys.iter().any(|flag| flags_set.contains(*flag)));
    for (key_address, [key, _]) in unnamed {
        let value = values.get(*key_address).filter(|value| has_key && goes_elsewhere(value));
        if let Some(value) = value {
            let problem = format!(
                "{OPENAI_KEY} would be sent to this address, which the table of vendors does not have; to allow that, add --{key} \
                 {OPENAI_KEY} to the command line, or name another key there, or none"
            );
            return Err(Error::usage(&value.origin, problem));
        }
    }
    for (flag, value) in VARIABLES.iter().filter_map(|flag| entry(values, flag)) {
        for text in value.values.iter().filter_map(|value| value.to_str()) {
            let name = text.split_once('=').map_or(text, |(_, name)| name).trim();
            if name != "none" && !host_variables(values).any(|own| own.contains(&name)) {
                return Err(refusal(address, flag, value, "a variable of yours"));
            }
        }
    }
    for (flag, value) in FILES.iter().filter_map(|flag| entry(values, flag)) {
        for named in value.values.iter().map(Path::new) {
            let text = named.to_str().unwrap_or_default();
            let named = match flag {
                "extra-body" => text.strip_prefix('@').map(Path::new),
                _ => Some(named),
            };
            if named.is_some_and(|named| !is_beside(file, named)) {
                return Err(refusal(address, flag, value, "a file of yours"));
            }
        }
    }
    Ok(())
}

/// The error that `flag` sends something of the user to an address that the file sets with the flag `address`.
fn refusal(address: &str, flag: &str, value: &LayeredValue, what: &str) -> Error {
    let problem = format!(
        "the file sets --{address}, too, so that {what} could be sent to an unknown server; name it on the command line with \
         {}, or remove --{address} from the file",
        flag_spelling(flag)
    );
    Error::usage(&value.origin, problem)
}

/// A flag with its value in the file.
fn entry<'a>(
    values: &BTreeMap<String, &'a LayeredValue>,
    flag: &'static str,
) -> Option<(&'static str, &'a LayeredValue)> {
    Some((flag, *values.get(flag)?))
}

/// The variables in which the vendor of each host that the file names keeps its key.
fn host_variables(values: &BTreeMap<String, &LayeredValue>) -> impl Iterator<Item = Vec<&'static str>> {
    ["base-url", "judge-base-url"]
        .into_iter()
        .filter_map(|flag| values.get(flag))
        .flat_map(|value| &value.values)
        .filter_map(|text| text.to_str()?.parse::<BaseUrl>().ok())
        .map(|url| vendor_variables(url.host()))
}

/// Returns true if one of these addresses is on another machine and belongs to no known vendor.
fn goes_elsewhere(addresses: &LayeredValue) -> bool {
    addresses
        .values
        .iter()
        .filter_map(|text| text.to_str()?.parse::<BaseUrl>().ok())
        .any(|url| !url.is_loopback() && vendor_variables(url.host()).is_empty())
}

/// Returns true if a file lies in the folder of the file of flags or below it, with links followed. A file that does
/// not exist also returns true: it is refused later.
fn is_beside(file: &Path, named: &Path) -> bool {
    let folder = file.canonicalize().ok();
    let folder = folder.as_deref().and_then(Path::parent);
    match (folder, named.canonicalize()) {
        (Some(folder), Ok(named)) => named.starts_with(folder),
        (_, found) => found.is_err(),
    }
}
