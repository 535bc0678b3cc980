//! LeRobot data sets, versions 2.0 to 3.0: episodes of robots with the images of their cameras.
//!
//! ```text
//! meta/info.json ─ Info: version, frames per second, cameras, patterns of paths
//! meta/episodes, tasks ─ LeRobotSet ─ Episode: its data file, and its video of each camera
//! data/…parquet ─ rows ─ DataRow: episode, time, task
//! ```
//!
//! The input is untrusted: paths from patterns lead to no file outside the folder, and numbers of rows are limited.
//!
//! The description of a LeRobot data set, `meta/info.json`: [`Info`].
//!
//! The episodes of a LeRobot data set: [`Episode`].
//!
//! Rows of the data files of a LeRobot data set: [`read`].
//!
//! A LeRobot data set in a folder: [`LeRobotSet`].
//!
//! Patterns of paths in `info.json`, such as `data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet`: [`fill`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value};

use crate::{ParquetColumns, Root, cached_snapshot, refuse_lfs_pointer};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{at_most, entries, json_lines, json_problem};
use darkqa_base::types::text::excerpt;

/// Files in a chunk if `info.json` does not state it, as in LeRobot.
const CHUNK_SIZE: u64 = 1000;

/// Patterns of paths if `info.json` does not state them, as in LeRobot: of data files and of videos.
const PATHS_V2: [&str; 2] = [
    "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
];

const PATHS_V3: [&str; 2] = [
    "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
    "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
];

/// Layout of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layout {
    /// Versions 2.0 and 2.1: one file an episode.
    V2,
    /// Version 3.0: several episodes a file.
    V3,
}

/// Description of a data set.
#[derive(Debug)]
pub(super) struct Info {
    layout: Layout,
    /// The version as stated, such as `v3.0`.
    version: String,
    /// Frames per second of the data files.
    fps: f64,
    /// Episodes in a chunk, in layout V2.
    chunk_size: u64,
    /// Pattern of the paths of data files.
    data_path: String,
    /// Pattern of the paths of videos.
    video_path: String,
    robot: Option<String>,
    /// Cameras, sorted by name.
    cameras: Vec<Camera>,
    /// Number of features that are no cameras.
    other_features: usize,
}

/// A camera of a data set: a feature with images.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub name: String,
    pub form: CameraImages,
    /// True if the images are depth maps, which are not read.
    pub is_depth: bool,
    /// Size and codec as stated, such as `640×480 av1`; may be empty.
    pub description: String,
    /// Frames per second of its videos.
    pub fps: f64,
}

/// Where the images of a camera are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraImages {
    /// In video files.
    Video,
    /// In the data files, as image files in a column.
    Images,
}

impl CameraImages {
    /// The `dtype` in `info.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Video => "video",
            Self::Images => "image",
        }
    }
}

impl Info {
    /// Parses `info.json`.
    ///
    /// # Errors
    /// If the version is not supported, or a required field is missing; the message has the remedy.
    fn parse(value: &Value) -> Result<Self, String> {
        let stated = value.get("codebase_version").and_then(Value::as_str);
        let version =
            stated.ok_or("no codebase_version; v2.0, v2.1 or v3.0 expected, as LeRobot writes it in this file")?;
        let layout = layout(version)?;
        let fps = positive(value.get("fps")).ok_or("no fps; the frames per second expected, a number above 0")?;
        let features = value
            .get("features")
            .and_then(Value::as_object)
            .ok_or("no features; an object with the columns and cameras expected")?;
        let cameras: Vec<Camera> =
            features.iter().filter_map(|(name, feature)| Camera::parse(name, feature, fps)).collect();
        let [data_path, video_path] = match layout {
            Layout::V2 => PATHS_V2,
            Layout::V3 => PATHS_V3,
        };
        let text = |key: &str| value.get(key).and_then(Value::as_str);
        Ok(Self {
            layout,
            version: version.to_owned(),
            fps,
            chunk_size: value.get("chunks_size").and_then(Value::as_u64).filter(|size| *size > 0).unwrap_or(CHUNK_SIZE),
            data_path: text("data_path").unwrap_or(data_path).to_owned(),
            video_path: text("video_path").unwrap_or(video_path).to_owned(),
            robot: text("robot_type").map(str::to_owned),
            other_features: features.len() - cameras.len(),
            cameras,
        })
    }
}

/// Layout of a version. Minor versions of LeRobot keep the layout.
fn layout(version: &str) -> Result<Layout, String> {
    let number = version.strip_prefix('v').unwrap_or(version);
    let major = number.split('.').next().unwrap_or_default();
    match major.parse::<u32>() {
        Ok(2) => Ok(Layout::V2),
        Ok(3) => Ok(Layout::V3),
        Ok(0 | 1) => Err(old_version(version)),
        _ => Err(format!(
            "version {version:?}; v2.0, v2.1 or v3.0 expected; take a newer darkqa-eval, or the revision v3.0 of the set: hf download USER/NAME --repo-type dataset --revision v3.0 --local-dir NEW"
        )),
    }
}

/// The message for version 1. LeRobot 0.3.3 is the last release with a converter from it.
fn old_version(version: &str) -> String {
    format!(
        "version {version:?}; v2.0, v2.1 or v3.0 expected. The hub may have a newer revision:\n  hf download USER/NAME --repo-type dataset --revision v2.1 --local-dir NEW\nElse convert your own set on the hub; the converter writes the new files to NEW/v2.0/USER/NAME and to a branch v2 there:\n  pip install lerobot==0.3.3\n  python -m lerobot.datasets.v2.convert_dataset_v1_to_v2 --repo-id USER/NAME --single-task TASK --local-dir NEW --test-branch v2"
    )
}

fn positive(value: Option<&Value>) -> Option<f64> {
    value.and_then(Value::as_f64).filter(|number| number.is_finite() && *number > 0.0)
}

impl Camera {
    /// Parses a feature; `None` if it has no images.
    fn parse(name: &str, feature: &Value, fps: f64) -> Option<Self> {
        let form = match feature.get("dtype").and_then(Value::as_str)? {
            "video" => CameraImages::Video,
            "image" => CameraImages::Images,
            _ => return None,
        };
        // Version 2.0 has `video_info` in some sets.
        let empty = Map::new();
        let info =
            ["info", "video_info"].iter().find_map(|key| feature.get(key).and_then(Value::as_object)).unwrap_or(&empty);
        let is_depth = ["is_depth_map", "video.is_depth_map"]
            .iter()
            .any(|key| info.get(*key).and_then(Value::as_bool) == Some(true));
        let codec = info.get("video.codec").and_then(Value::as_str).filter(|_| form == CameraImages::Video);
        let words: Vec<String> = size(feature).into_iter().chain(codec.map(str::to_owned)).collect();
        Some(Self {
            name: name.to_owned(),
            form,
            is_depth,
            description: words.join(" "),
            fps: positive(info.get("video.fps")).unwrap_or(fps),
        })
    }
}

/// Width and height in the shape of a feature, which is [height, width, channels], or [channels, height, width] in
/// older sets.
fn size(feature: &Value) -> Option<String> {
    let shape: Vec<u64> = feature.get("shape")?.as_array()?.iter().map(Value::as_u64).collect::<Option<_>>()?;
    let [first, second, third] = shape[..] else {
        return None;
    };
    let is_channel = |count: u64| (1..=4).contains(&count);
    let [height, width] = if is_channel(first) && !is_channel(third) { [second, third] } else { [first, second] };
    Some(format!("{width}×{height}"))
}

/// Maximum number of episodes (chosen). The largest sets have some hundred thousand.
const MAX_EPISODES: usize = 1_000_000;

/// Largest index of an episode, chunk or file; larger ones are not exact as a float.
const MAX_INDEX: f64 = 1e15;

/// Numbers in the path of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FilePlace {
    pub chunk: u64,
    /// Number of the file, which is that of the episode in versions 2.0 and 2.1.
    pub file: u64,
}

/// The part of a video file that shows an episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VideoPart {
    pub place: FilePlace,
    /// Time of the first frame of the episode in the file, in seconds.
    pub from: f64,
}

/// An episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    pub index: u32,
    /// Number of frames.
    pub length: u64,
    pub data: FilePlace,
    /// Its video of each requested camera; `None` if the set does not state it.
    pub videos: Vec<Option<VideoPart>>,
}

/// A line of `meta/episodes.jsonl`.
#[derive(Deserialize)]
struct EpisodeLine {
    episode_index: u32,
    length: u64,
}

/// Reads `meta/episodes.jsonl` of versions 2.0 and 2.1, in which each episode has its own files.
fn read_lines(path: &Path, info: &Info, cameras: usize) -> Result<Vec<Episode>> {
    let lines = json_lines::<EpisodeLine>(path)?;
    Ok(lines
        .into_iter()
        .map(|(_, line)| {
            let place = FilePlace {
                chunk: u64::from(line.episode_index) / info.chunk_size,
                file: u64::from(line.episode_index),
            };
            let video = VideoPart { place, from: 0.0 };
            Episode { index: line.episode_index, length: line.length, data: place, videos: vec![Some(video); cameras] }
        })
        .collect())
}

/// Adds the episodes in a file of `meta/episodes` of version 3.0, with the videos of these cameras.
fn add_table(path: &Path, cameras: &[&str], episodes: &mut Vec<Episode>) -> Result<()> {
    let table = ParquetColumns::open(path)?;
    let mut columns: Vec<String> =
        ["episode_index", "length", "data/chunk_index", "data/file_index"].map(str::to_owned).to_vec();
    for camera in cameras {
        columns
            .extend(["chunk_index", "file_index", "from_timestamp"].map(|column| format!("videos/{camera}/{column}")));
    }
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    table.numbers(&columns, |batch| {
        for row in 0..batch.numbers[0].len() {
            let number = |column: usize| batch.numbers[column][row];
            let place =
                |column: usize| Some(FilePlace { chunk: index(number(column))?, file: index(number(column + 1))? });
            let episode = index(number(0)).and_then(|index| u32::try_from(index).ok());
            let (Some(index), Some(length)) = (episode, index(number(1))) else {
                let problem = "an episode without index or length";
                return Err(Error::data(path.display(), problem));
            };
            let Some(data) = place(2) else {
                let problem = format_args!("episode {index} without a data file");
                return Err(Error::data(path.display(), problem));
            };
            let videos = (0..cameras.len())
                .map(|camera| {
                    let column = 4 + 3 * camera;
                    let from = number(column + 2);
                    (0.0..=1e9).contains(&from).then_some(())?;
                    Some(VideoPart { place: place(column)?, from })
                })
                .collect();
            if episodes.len() == MAX_EPISODES {
                let problem = format_args!("more than {MAX_EPISODES} episodes, which are not read");
                return Err(Error::data(path.display(), problem));
            }
            episodes.push(Episode { index, length, data, videos });
        }
        Ok(())
    })
}

/// Converts a number to an index; `None` for NaN, negative and too large numbers, and fractions.
fn index(number: f64) -> Option<u64> {
    ((0.0..=MAX_INDEX).contains(&number) && number.fract() == 0.0).then_some(number as u64)
}

impl Layout {
    /// The file or folder with the episodes.
    fn episodes_path(self) -> &'static str {
        match self {
            Self::V2 => "meta/episodes.jsonl",
            Self::V3 => "meta/episodes",
        }
    }

    /// The file with the tasks.
    fn tasks_path(self) -> &'static str {
        match self {
            Self::V2 => "meta/tasks.jsonl",
            Self::V3 => "meta/tasks.parquet",
        }
    }
}

/// A row of a data file: one time of an episode. Small, because there are millions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataRow {
    /// Index of the episode.
    pub episode: u32,
    /// Number in the episode, from 0.
    pub frame: u32,
    /// Seconds from the start of the episode.
    pub time: f64,
    /// Number of the task.
    pub task: Option<u32>,
    /// Row group.
    pub group: u32,
    /// Index of the row in its row group.
    pub row: u32,
}

/// Columns of a data file that are read, in the order of [`DataRow`].
const COLUMNS: [&str; 4] = ["episode_index", "frame_index", "timestamp", "task_index"];

/// Reads the rows of a data file in order. Rows without a number of episode, frame or time are counted, and not given
/// to `add`.
///
/// # Errors
/// If the file cannot be read or is damaged.
fn read(path: &Path, mut add: impl FnMut(DataRow)) -> Result<usize> {
    let table = ParquetColumns::open(path)?;
    let has_tasks = table.names().contains(&COLUMNS[3]);
    let columns = if has_tasks { &COLUMNS[..] } else { &COLUMNS[..3] };
    let mut unread = 0;
    table.numbers(columns, |batch| {
        for row in 0..batch.numbers[0].len() {
            let number = |column: usize| batch.numbers[column][row];
            let time = Some(number(2)).filter(|time| (0.0..=1e9).contains(time));
            let small = |column: usize| u32::try_from(index(number(column))?).ok();
            match (small(0), small(1), time) {
                (Some(episode), Some(frame), Some(time)) => add(DataRow {
                    episode,
                    frame,
                    time,
                    task: has_tasks.then(|| small(3)).flatten(),
                    group: batch.group as u32,
                    row: (batch.first_row + row) as u32,
                }),
                _ => unread += 1,
            }
        }
        Ok(())
    })?;
    Ok(unread)
}

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
pub struct LeRobotSet {
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
    pub fn open(place: &Path, further: &[PathBuf]) -> Result<Self> {
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
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The version as stated, such as `v3.0`.
    pub fn version(&self) -> &str {
        &self.info.version
    }

    /// Frames per second of the data.
    pub fn fps(&self) -> f64 {
        self.info.fps
    }

    /// Name of the robot, if stated.
    pub fn robot(&self) -> Option<&str> {
        self.info.robot.as_deref()
    }

    /// Cameras, sorted by name.
    pub fn cameras(&self) -> &[Camera] {
        &self.info.cameras
    }

    /// Number of features that are no cameras.
    pub fn other_features(&self) -> usize {
        self.info.other_features
    }

    /// The episodes, sorted by index, with their videos of these cameras.
    ///
    /// # Errors
    /// If a file about episodes is missing or damaged, two episodes have one index, or there are no episodes.
    pub fn episodes(&self, cameras: &[&str]) -> Result<Vec<Episode>> {
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
    pub fn tasks(&self) -> Result<BTreeMap<u32, String>> {
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
    pub fn data_file(&self, place: FilePlace) -> Result<PathBuf> {
        self.file(&self.fill(&self.info.data_path, "data_path", place, "")?)
    }

    /// Path of a video of a camera.
    ///
    /// # Errors
    /// As [`Self::data_file`].
    pub fn video_file(&self, place: FilePlace, camera: &str) -> Result<PathBuf> {
        let path = self.file(&self.fill(&self.info.video_path, "video_path", place, camera)?)?;
        refuse_lfs_pointer(&path)?;
        Ok(path)
    }

    /// Reads the rows of a data file. Returns the number of rows without an episode, frame or time, which are left out.
    ///
    /// # Errors
    /// If the file is missing or damaged.
    pub fn rows(&self, place: FilePlace, add: impl FnMut(DataRow)) -> Result<usize> {
        read(&self.data_file(place)?, add)
    }

    fn fill(&self, pattern: &str, key: &str, place: FilePlace, camera: &str) -> Result<String> {
        let [chunk, file] = [place.chunk, place.file].map(PatternValue::Number);
        let fields = [
            ("chunk_index", chunk),
            ("file_index", file),
            ("episode_chunk", chunk),
            ("episode_index", file),
            ("video_key", PatternValue::Text(camera)),
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

/// Maximum width of a number (chosen); LeRobot uses 3 and 6.
const MAX_WIDTH: usize = 20;

/// Value of a field of a pattern.
#[derive(Debug, Clone, Copy)]
pub(super) enum PatternValue<'a> {
    Text(&'a str),
    Number(u64),
}

/// Replaces the fields of a pattern, in the syntax of Python's `str.format`: `{name}`, or `{name:06d}` for a number
/// with six digits.
///
/// # Errors
/// If the pattern has another field or another syntax.
fn fill(pattern: &str, fields: &[(&str, PatternValue<'_>)]) -> Result<String, String> {
    let mut path = String::new();
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('{') {
        let (field, after) = after.split_once('}').ok_or_else(|| format!("{pattern:?} has a {{ without a }}"))?;
        let (name, format) = field.split_once(':').unwrap_or((field, ""));
        let value = fields
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| {
                let known: Vec<&str> = fields.iter().map(|(known, _)| *known).collect();
                format!("{pattern:?} has the field {name:?}; one of {} expected", known.join(", "))
            })?
            .1;
        path.push_str(before);
        match value {
            PatternValue::Text(text) if format.is_empty() => path.push_str(text),
            PatternValue::Number(number) => {
                let width = width(format)
                    .ok_or_else(|| format!("{pattern:?} has the format {format:?}; one such as 03d expected"))?;
                let _ = write!(path, "{number:0width$}");
            }
            PatternValue::Text(_) => return Err(format!("{pattern:?} has a format for {name}")),
        }
        rest = after;
    }
    path.push_str(rest);
    Ok(path)
}

/// Width in a format such as `03d`, or 0 for an empty one; `None` for other formats.
fn width(format: &str) -> Option<usize> {
    let digits = format.strip_suffix('d').unwrap_or(format);
    if digits.is_empty() {
        return Some(0);
    }
    let digits = digits.strip_prefix('0')?;
    digits.parse().ok().filter(|width| *width <= MAX_WIDTH)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn info(version: &str) -> Value {
        json!({
            "codebase_version": version, "fps": 30,
            "features": {
                "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "info": {"video.codec": "av1", "video.fps": 15}},
                "observation.image": {"dtype": "image", "shape": [3, 96, 128], "names": null},
                "depth": {"dtype": "video", "shape": [48, 64, 1], "info": {"is_depth_map": true}},
                "old_depth": {"dtype": "video", "shape": [48, 64, 1], "video_info": {"video.is_depth_map": true}},
                "action": {"dtype": "float32", "shape": [2]},
            },
        })
    }

    #[test]
    fn cameras_are_features_with_images() {
        let info = Info::parse(&info("v3.0")).unwrap();
        assert_eq!((info.layout, info.other_features), (Layout::V3, 1));
        let facts: Vec<(&str, &str, bool, f64)> = info
            .cameras
            .iter()
            .map(|camera| (&*camera.name, &*camera.description, camera.is_depth, camera.fps))
            .collect();
        assert_eq!(
            facts,
            [
                ("depth", "64×48", true, 30.0),
                ("observation.image", "128×96", false, 30.0),
                ("observation.images.top", "640×480 av1", false, 15.0),
                ("old_depth", "64×48", true, 30.0),
            ]
        );
        assert_eq!(info.video_path, PATHS_V3[1]);
    }

    #[test]
    fn versions_are_checked() {
        for version in ["v2.0", "v2.1", "2.1", "v3.0", "v3.1"] {
            assert!(Info::parse(&info(version)).is_ok(), "{version}");
        }
        for (version, remedy) in [
            ("v1.6", "convert_dataset_v1_to_v2"),
            ("v4.0", "a newer darkqa-eval"),
            ("new", "v2.0, v2.1 or v3.0 expected"),
        ] {
            let problem = Info::parse(&info(version)).unwrap_err();
            assert!(problem.contains(remedy), "{problem}");
        }
    }

    #[test]
    fn missing_fields_are_named() {
        for key in ["codebase_version", "fps", "features"] {
            let mut value = info("v3.0");
            value[key] = Value::Null;
            assert!(Info::parse(&value).unwrap_err().contains(key));
        }
        let mut value = info("v3.0");
        value["fps"] = json!(0);
        assert!(Info::parse(&value).is_err());
    }

    const FIELDS: [(&str, PatternValue<'_>); 3] = [
        ("video_key", PatternValue::Text("observation.images.top")),
        ("chunk_index", PatternValue::Number(2)),
        ("episode_index", PatternValue::Number(1_234_567)),
    ];

    #[test]
    fn fields_are_replaced() {
        for (pattern, expected) in [
            ("videos/{video_key}/chunk-{chunk_index:03d}/x.mp4", "videos/observation.images.top/chunk-002/x.mp4"),
            ("{chunk_index}/{chunk_index:d}/{episode_index:06d}", "2/2/1234567"),
            ("plain", "plain"),
        ] {
            assert_eq!(fill(pattern, &FIELDS).unwrap(), expected);
        }
    }

    #[test]
    fn other_patterns_are_refused() {
        for (pattern, problem) in [
            ("{chunk_index", "without a }"),
            ("{other:03d}", "the field \"other\""),
            ("{chunk_index:>3}", "the format \">3\""),
            ("{chunk_index:0999999999d}", "the format \"0999999999d\""),
            ("{video_key:03d}", "a format for video_key"),
            ("{chunk_index.__class__}", "the field"),
        ] {
            let error = fill(pattern, &FIELDS).unwrap_err();
            assert!(error.contains(problem), "{pattern}: {error}");
        }
    }
}
