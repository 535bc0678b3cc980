//! Data of a format that must be imported or converted first: [`with_import_hint`].

use std::path::Path;

use super::root::Root;
use crate::error::Error;
use crate::files::reading::at_most;
use crate::types::shell_word;

/// Maximum size of a description of a data set that is read, in bytes (chosen).
const MAX_INFO_BYTES: u64 = 1 << 20;

/// Python program that unpacks WebDataset shards into the folder `unpacked`, and joins the JSON of each sample with its
/// image.
const UNPACK: &str = "import sys, json, tarfile, pathlib as p; o = p.Path('unpacked'); [tarfile.open(t).extractall(o / p.Path(t).stem, filter='data') for t in sys.argv[1:]]; i = {f.with_suffix(''): str(f.relative_to(o)) for f in o.rglob('*') if f.suffix.lower() in ('.jpg', '.jpeg', '.png', '.webp')}; r = [json.dumps(json.loads(f.read_text()) | {'image': i[f.with_suffix('')]}) for f in sorted(o.rglob('*.json')) if f.with_suffix('') in i]; r and (o / 'set.jsonl').write_text(chr(10).join(r))";

/// Adds the command that imports or converts the data to an error about a place with a LeRobot data set or WebDataset
/// shards.
pub(super) fn with_import_hint(place: Option<&Path>, error: Error) -> Error {
    match (place.and_then(hint), error) {
        (Some(hint), Error::Data { place, problem }) => {
            let problem = format!("{}\n  {hint}", problem.trim_end());
            Error::Data { place, problem }
        }
        (_, error) => error,
    }
}

fn hint(place: &Path) -> Option<String> {
    let text = place.to_string_lossy();
    let word = shell_word(&text);
    if is_lerobot_set(place) {
        return Some(format!("it is a LeRobot data set; take frames of it: darkqa-eval import lerobot {word}"));
    }
    let shards = shards(place)?;
    Some(format!(
        "archives such as WebDataset shards (.tar) are not read; unpack them (Python 3.12): python -c \"{UNPACK}\" {shards}; then --data unpacked, with --ask home if their JSON files have no questions"
    ))
}

/// TAR files at a place, as a word or a pattern of a shell; `None` if there are none.
fn shards(place: &Path) -> Option<String> {
    let is_tar = |path: &Path, ending: &str| path.to_string_lossy().to_lowercase().ends_with(ending);
    let endings = [".tar", ".tar.gz", ".tgz"];
    let text = place.to_string_lossy();
    let word = shell_word(text.trim_end_matches('/'));
    if place.is_file() {
        let found = endings.iter().any(|ending| is_tar(place, ending));
        return found.then(|| word.into_owned());
    }
    let entries = Root::new(place, &[]).ok()?.entries(place, &mut Vec::new()).ok()?;
    let found = endings.into_iter().find(|ending| entries.iter().any(|entry| is_tar(entry, ending)))?;
    Some(format!("{word}/*{found}"))
}

/// True if a folder has the description of a LeRobot data set.
pub(super) fn is_lerobot_set(folder: &Path) -> bool {
    ["meta/info.json", "meta_data/info.json"]
        .iter()
        .filter_map(|name| at_most(&folder.join(name), MAX_INFO_BYTES).ok())
        .any(|bytes| {
            let key: &[u8] = b"\"codebase_version\"";
            bytes.windows(key.len()).any(|part| part == key)
        })
}
