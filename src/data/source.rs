//! Where data are ([`DataSource`]), and how they are opened: a folder of frames, a ready-made set, or the built-in rooms.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::dataset::{Dataset, stem};
use super::frames;
use super::ready_made::{self, SetArgs};
use super::root::Root;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::at_most;
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{Labels, shell_word};
use darkqa_rooms::Rooms;

/// Where the data are, as given by `--data`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataSource {
    /// The built-in rooms with these settings.
    Rooms(Rooms),
    /// A folder or file.
    Path(PathBuf),
    /// Several files of one set, in this order.
    Files(Vec<PathBuf>),
    /// A well-known set, read by its preset.
    Known {
        /// Name of the preset.
        name: String,
        /// File or folder of the set.
        path: PathBuf,
    },
}

impl DataSource {
    /// The folder or file (the first of several files); `None` for the built-in rooms.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Rooms(_) => None,
            Self::Path(path) | Self::Known { path, .. } => Some(path),
            Self::Files(paths) => paths.first().map(PathBuf::as_path),
        }
    }

    /// Opens the data; `questions` replaces the `questions.jsonl` of a folder of frames.
    ///
    /// No image is read. Every question is checked: its choices, that its answer is one of them, and that its frame
    /// exists. The built-in rooms, and a folder of frames with maps but no questions, have no questions yet: the caller
    /// generates them from [`Dataset::labels`] and adds them with [`Dataset::with_questions`].
    pub fn open(&self, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
        self.open_without_hint(questions, set).map_err(|e| with_import_hint(self.path(), e))
    }

    pub(super) fn open_without_hint(&self, questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
        let dataset = match self {
            Self::Rooms(rooms) => {
                let rooms = Dataset::from_rooms(*rooms);
                match questions {
                    Some(file) => {
                        let questions = ready_made::questions_about_frames(file, set)?;
                        rooms.with_file_questions(file, questions, set.bad)?
                    }
                    None => rooms,
                }
            }
            Self::Path(path) if frames::is_folder_of_frames(path, questions) => frames::open(path, questions, set)?,
            Self::Path(path) => open_ready_made(std::slice::from_ref(path), questions, set)?,
            Self::Files(paths) => open_ready_made(paths, questions, set)?,
            Self::Known { name, path } => {
                let set = SetArgs { preset: Some(name.clone()), ..set.clone() };
                open_ready_made(std::slice::from_ref(path), questions, &set)?
            }
        };
        if dataset.questions().is_empty() && dataset.labels().is_none() {
            return Err(Error::data(dataset.name(), "no questions in it"));
        }
        let mut seen = HashSet::new();
        if let Some(twice) = dataset.questions().iter().find(|question| !seen.insert(&question.id)) {
            return Err(Error::data(
                dataset.name(),
                format_args!("two questions have the id {:?}", excerpt(&twice.id.0, 60)),
            ));
        }
        Ok(dataset)
    }

    /// Opens the frames, without questions. Paths may also lead into the folders in `further`. No image is
    /// read.
    ///
    /// # Errors
    /// If the place is not a folder of frames.
    pub fn open_without_questions(&self, further: &[PathBuf]) -> Result<Dataset> {
        match self {
            Self::Rooms(rooms) => Ok(Dataset::from_rooms(*rooms)),
            Self::Path(folder) | Self::Known { path: folder, .. } => frames::open_frames(folder, further),
            Self::Files(_) => Err(Error::usage("--data", format_args!("{self}: one folder of frames expected"))),
        }
    }

    /// Labels of the semantic maps; `None` without a `classes.json`, which may also lie in the folders in
    /// `further`.
    ///
    /// # Errors
    /// If `classes.json` cannot be read; the error names the file.
    pub fn labels(&self, further: &[PathBuf]) -> Result<Option<Labels>> {
        match self {
            Self::Rooms(_) => Ok(Some(darkqa_rooms::labels())),
            Self::Path(path) if path.is_dir() => frames::labels(path, further),
            Self::Path(_) | Self::Files(_) | Self::Known { .. } => Ok(None),
        }
    }
}

/// Opens a ready-made set, named after its first file or folder.
///
/// # Errors
/// If the set cannot be read, or the user gives other questions than its own.
fn open_ready_made(places: &[PathBuf], questions: Option<&Path>, set: &SetArgs) -> Result<Dataset> {
    refuse_questions(questions, "a ready-made set brings its own questions")?;
    let first = places.first().map_or(Path::new(""), PathBuf::as_path);
    Ok(Dataset::from_set(ready_made::open(places, &stem(first), set)?))
}

/// Error if `--questions` is given for data that cannot use it.
pub(super) fn refuse_questions(questions: Option<&Path>, why: &str) -> Result<()> {
    match questions {
        None => Ok(()),
        Some(path) => Err(Error::usage("--questions", format_args!("{} cannot be used: {why}", path.display()))),
    }
}

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
