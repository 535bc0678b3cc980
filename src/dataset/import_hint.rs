//! Data of a format that `import` converts, given as they are: [`with_import_hint`].

use std::path::Path;

use crate::error::Error;
use crate::files::reading::at_most;
use crate::types::shell_word;

/// Maximum size of a description of a data set that is read, in bytes (chosen).
const MAX_INFO_BYTES: u64 = 1 << 20;

/// Adds the command that imports the data to an error about a folder, if the folder has a LeRobot data set.
pub(super) fn with_import_hint(place: Option<&Path>, error: Error) -> Error {
    match (place, error) {
        (Some(folder), Error::Data { place, problem }) if is_lerobot_set(folder) => {
            let word = folder.to_string_lossy();
            let word = shell_word(&word);
            let problem = format!(
                "{}\n  it is a LeRobot data set; take frames of it: darkqa-eval import lerobot {word}",
                problem.trim_end()
            );
            Error::Data { place, problem }
        }
        (_, error) => error,
    }
}

/// True if a folder has the description of a LeRobot data set.
fn is_lerobot_set(folder: &Path) -> bool {
    ["meta/info.json", "meta_data/info.json"]
        .iter()
        .filter_map(|name| at_most(&folder.join(name), MAX_INFO_BYTES).ok())
        .any(|bytes| {
            let key: &[u8] = b"\"codebase_version\"";
            bytes.windows(key.len()).any(|part| part == key)
        })
}
