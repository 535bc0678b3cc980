//! A LeRobot data set in a folder: [`LeRobotSet`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::episodes::{Episode, FilePlace, add_table, index, read_lines};
use super::info::{Camera, Info, Layout, old_version};
use super::path_pattern::{FieldValue, fill};
use super::rows::{self, DataRow};
use crate::data::{ParquetColumns, Root, cached_snapshot, refuse_lfs_pointer};
use crate::error::{Error, Result};
use crate::files::reading::{at_most, entries, json_lines, json_problem};
use crate::types::text::excerpt;

/// The description of a data set, relative to its folder.
const INFO: &str = "meta/info.json";

/// The description of a data set of version 1.
const OLD_INFO: &str = "meta_data/info.json";

/// Maximum size of `info.json` in bytes (chosen); those of large sets have some ten kilobytes.
const MAX_INFO_BYTES: u64 = 16 << 20;

/// Maximum number of tasks (chosen); the largest sets have some ten thousand.
const MAX_TASKS: usize = 100_000;

/// Maximum number of characters of a task (chosen).
const MAX_TASK_CHARS: usize = 2_000;

/// A LeRobot data set. Its files are read when they are needed.
#[derive(Debug)]
pub(crate) struct LeRobotSet {
    folder: PathBuf,
    root: Root,
    info: Info,
}

/// A line of `meta/tasks.jsonl`.
#[derive(Deserialize)]
struct TaskLine {
    task_index: u32,
    task: String,
}

impl LeRobotSet {
    /// Opens the set in a folder, or its newest snapshot if the folder is a repository in a hub's cache. Files may also
    /// be in the folders in `further`.
    ///
    /// # Errors
    /// If the folder has no description of a supported version.
    pub(crate) fn open(place: &Path, further: &[PathBuf]) -> Result<Self> {
        if !place.is_dir() {
            let problem = format_args!("{}: no such folder", place.display());
            return Err(Error::usage("DIR", problem));
        }
        let (folder, blobs) = cached_snapshot(place)?;
        let further: Vec<PathBuf> = further.iter().cloned().chain(blobs.filter(|blobs| blobs.is_dir())).collect();
        let root = Root::new(&folder, &further)?;
        let path = folder.join(INFO);
        if !path.exists() && folder.join(OLD_INFO).exists() {
            let problem = old_version("v1.x");
            return Err(Error::data(folder.join(OLD_INFO).display(), problem));
        }
        if !path.exists() {
            let problem = "no meta/info.json in this folder: not a LeRobot data set; name the folder that has meta, data and videos";
            return Err(Error::data(place.display(), problem));
        }
        let path = root.file(&folder, Path::new(INFO)).map_err(|problem| Error::data(path.display(), problem))?;
        refuse_lfs_pointer(&path)?;
        let bytes = at_most(&path, MAX_INFO_BYTES)?;
        let value = serde_json::from_slice(&bytes).map_err(|e| {
            let problem = json_problem(&bytes, &e).map_or_else(|| e.to_string(), str::to_owned);
            Error::data(path.display(), problem)
        })?;
        let info = Info::parse(&value).map_err(|problem| Error::data(path.display(), problem))?;
        Ok(Self { folder, root, info })
    }

    /// Folder of the set, which is a snapshot for a repository in a hub's cache.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The version as stated, such as `v3.0`.
    pub(crate) fn version(&self) -> &str {
        &self.info.version
    }

    /// Frames per second of the data.
    pub(crate) fn fps(&self) -> f64 {
        self.info.fps
    }

    /// Name of the robot, if stated.
    pub(crate) fn robot(&self) -> Option<&str> {
        self.info.robot.as_deref()
    }

    /// Cameras, sorted by name.
    pub(crate) fn cameras(&self) -> &[Camera] {
        &self.info.cameras
    }

    /// Number of features that are no cameras.
    pub(crate) fn other_features(&self) -> usize {
        self.info.other_features
    }

    /// The episodes, sorted by index, with their videos of these cameras.
    ///
    /// # Errors
    /// If a file about episodes is missing or damaged, two episodes have one index, or there are no episodes.
    pub(crate) fn episodes(&self, cameras: &[&str]) -> Result<Vec<Episode>> {
        let name = self.info.layout.episodes_path();
        let mut episodes = match self.info.layout {
            Layout::V2 => read_lines(&self.file(name)?, &self.info, cameras.len())?,
            Layout::V3 => {
                let mut episodes = Vec::new();
                for path in self.tables(name)? {
                    add_table(&path, cameras, &mut episodes)?;
                }
                episodes
            }
        };
        episodes.sort_by_key(|episode| episode.index);
        let place = self.folder.join(name);
        if let Some(pair) = episodes.windows(2).find(|pair| pair[0].index == pair[1].index) {
            let problem = format_args!("two episodes have the index {}", pair[0].index);
            return Err(Error::data(place.display(), problem));
        }
        if episodes.is_empty() {
            let problem = "the set has no episodes; record some, or download the set again";
            return Err(Error::data(place.display(), problem));
        }
        Ok(episodes)
    }

    /// The `.parquet` files in the folders of a folder, in the order of their names.
    fn tables(&self, name: &str) -> Result<Vec<PathBuf>> {
        let top = self.folder.join(name);
        let mut tables = Vec::new();
        if !top.exists() {
            return Ok(tables);
        }
        let mut seen = BTreeSet::new();
        for chunk in entries(&top)?.into_iter().filter(|path| path.is_dir()) {
            for path in self.inside(&chunk).and_then(|chunk| entries(&chunk))? {
                let is_table = path.extension().is_some_and(|ending| ending == "parquet");
                // A link to a folder of the set would give its tables twice.
                if is_table && seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
                    tables.push(self.inside(&path)?);
                }
            }
        }
        Ok(tables)
    }

    /// Texts of the tasks by their number.
    ///
    /// # Errors
    /// If the file with the tasks is missing or damaged.
    pub(crate) fn tasks(&self) -> Result<BTreeMap<u32, String>> {
        let path = self.file(self.info.layout.tasks_path())?;
        if self.info.layout == Layout::V2 {
            let lines = json_lines::<TaskLine>(&path)?;
            return Ok(lines
                .into_iter()
                .map(|(_, line)| (line.task_index, excerpt(&line.task, MAX_TASK_CHARS)))
                .collect());
        }
        let table = ParquetColumns::open(&path)?;
        // LeRobot writes the text as the index of a pandas table, whose column is called `task` or, without a name,
        // `__index_level_0__`.
        let names = table.names();
        let text = ["task", "__index_level_0__"]
            .into_iter()
            .find(|name| names.contains(name))
            .ok_or_else(|| Error::data(path.display(), "no column task or __index_level_0__"))?;
        let texts = table.texts(text, MAX_TASKS)?;
        let mut numbers = Vec::new();
        table.numbers(&["task_index"], |batch| {
            numbers.extend(batch.numbers.into_iter().flatten());
            Ok(())
        })?;
        Ok(numbers
            .into_iter()
            .zip(texts)
            .filter_map(|(number, text)| Some((u32::try_from(index(number)?).ok()?, text?)))
            .collect())
    }

    /// Path of a data file.
    ///
    /// # Errors
    /// If the pattern of paths is wrong or leads outside the folder, or the file is missing.
    pub(crate) fn data_file(&self, place: FilePlace) -> Result<PathBuf> {
        self.file(&self.fill(&self.info.data_path, "data_path", place, "")?)
    }

    /// Path of a video of a camera.
    ///
    /// # Errors
    /// As [`Self::data_file`].
    pub(crate) fn video_file(&self, place: FilePlace, camera: &str) -> Result<PathBuf> {
        let path = self.file(&self.fill(&self.info.video_path, "video_path", place, camera)?)?;
        refuse_lfs_pointer(&path)?;
        Ok(path)
    }

    /// Reads the rows of a data file. Returns the number of rows without an episode, frame or time, which are left out.
    ///
    /// # Errors
    /// If the file is missing or damaged.
    pub(crate) fn rows(&self, place: FilePlace, add: impl FnMut(DataRow)) -> Result<usize> {
        rows::read(&self.data_file(place)?, add)
    }

    fn fill(&self, pattern: &str, key: &str, place: FilePlace, camera: &str) -> Result<String> {
        let [chunk, file] = [place.chunk, place.file].map(FieldValue::Number);
        let fields = [
            ("chunk_index", chunk),
            ("file_index", file),
            ("episode_chunk", chunk),
            ("episode_index", file),
            ("video_key", FieldValue::Text(camera)),
        ];
        fill(pattern, &fields).map_err(|problem| {
            let info = self.folder.join(INFO);
            Error::data(format_args!("{}: {key}", info.display()), problem)
        })
    }

    /// Path of an existing file that the set names.
    fn file(&self, name: &str) -> Result<PathBuf> {
        self.root.file(&self.folder, Path::new(name)).map_err(|problem| {
            let path = self.folder.join(name).display().to_string();
            let problem = problem.replace(&format!("no such file: {path}"), "no such file");
            Error::data(path, problem)
        })
    }

    /// Checks that a path in the folder does not lead outside.
    fn inside(&self, path: &Path) -> Result<PathBuf> {
        let name = path.strip_prefix(&self.folder).unwrap_or(path);
        self.root.path(&self.folder, name).map_err(|problem| Error::data(path.display(), problem))
    }
}
