//! Data sets: images, their maps, and the questions that came with them.
//!
//! The entry point is [`Dataset::open`]. The path decides the reader: a folder of frames ([`frames`]) or a
//! ready-made multiple-choice set ([`ready_made`]). Without a path the data are the built-in rooms ([`rooms`]).

mod bank;
mod dark_photos;
mod family;
mod frame_facts;
pub(crate) mod frame_folder;
pub(crate) mod frames;
pub(crate) mod image_paths;
mod image_source;
pub(crate) mod import;
mod import_hint;
pub(crate) mod inputs;
mod label_folders;
pub(crate) mod maps;
pub(crate) mod openeqa;
mod pair_frames;
pub(crate) mod pairs;
mod photographs;
pub(crate) mod picture;
mod ready_made;
mod root;
mod scene_args;
mod settings;
mod similar_path;
mod unusable;

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::error::{Error, Result};
use crate::pictures::{DecodeRule, ImageFile};
use crate::rooms::{self, Rooms};
use crate::types::text::excerpt;
use crate::types::{Frame, FrameId, Labels, PhotoName, Question};

pub(crate) use bank::{Bank, BankPlace};
use dark_photos::DarkPhoto;
use frame_facts::FrameFacts;
pub(crate) use frame_facts::FrameFiles;
use frames::MissingFiles;
pub(crate) use image_source::ImageSource;
use import_hint::with_import_hint;
use maps::MapPaths;
pub(crate) use photographs::Photographs;
pub(crate) use picture::Picture;
pub use ready_made::SetArgs;
use ready_made::{FileQuestions, LEFT_OUT, RowCounts, SceneNames, Series, SetFormat};
pub(crate) use ready_made::{ParquetColumns, SkipBad, cached_snapshot, refuse_lfs_pointer};
pub(crate) use root::Root;
pub(crate) use root::RootArgs;
pub(crate) use scene_args::SceneArgs;
pub(crate) use settings::{BankArgs, DataArgs, DecodeArgs, FolderArgs, PixelLimit, SelectionArgs, parse_data_place};
use similar_path::folded;

/// Where the data are, as given by `--data`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataPlace {
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

impl DataPlace {
    /// The folder or file (the first of several files); `None` for the built-in rooms.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Rooms(_) => None,
            Self::Path(path) | Self::Known { path, .. } => Some(path),
            Self::Files(paths) => paths.first().map(PathBuf::as_path),
        }
    }
}

/// Images and the questions about them.
#[derive(Debug)]
pub struct Dataset {
    name: String,
    /// The `name` in `dataset.json`; empty if there is none.
    title: String,
    pub(crate) sources: BTreeMap<FrameId, ImageSource>,
    /// Frames of each question with several images, by the name that stands for all of them in [`Question::frame`].
    series: Series,
    /// Scenes that the questions assign to their frames. They take precedence over the scenes of the frames.
    scenes: SceneNames,
    questions: Vec<Question>,
    labels: Option<Labels>,
    rule: DecodeRule,
    /// How a ready-made set was read (column mapping, omissions), one fact per line; empty for other data.
    summary: Vec<String>,
    format: SetFormat,
    rows: RowCounts,
}

impl Dataset {
    fn new(name: String, sources: BTreeMap<FrameId, ImageSource>, questions: Vec<Question>) -> Self {
        Self {
            name,
            title: String::new(),
            sources,
            series: Series::new(),
            scenes: SceneNames::new(),
            questions,
            labels: None,
            rule: DecodeRule::default(),
            summary: Vec::new(),
            format: SetFormat::Native,
            rows: RowCounts::default(),
        }
    }

    /// Opens the frames at a place, without questions. Paths may also lead into the folders in `further`. No image is
    /// read.
    ///
    /// # Errors
    /// If the place is not a folder of frames.
    pub fn open_without_questions(place: &DataPlace, further: &[PathBuf]) -> Result<Self> {
        match place {
            DataPlace::Rooms(rooms) => Ok(Self::from_rooms(*rooms)),
            DataPlace::Path(folder) | DataPlace::Known { path: folder, .. } => Self::from_frames(folder, further),
            DataPlace::Files(_) => Err(Error::usage("--data", format_args!("{place}: one folder of frames expected"))),
        }
    }

    /// The built-in rooms, without questions. No image is drawn yet.
    fn from_rooms(rooms: Rooms) -> Self {
        let sources = rooms.all().map(|(id, room)| (id, ImageSource::Room(room))).collect();
        Self {
            title: rooms.title(),
            labels: Some(rooms::labels()),
            ..Self::new("rooms".to_owned(), sources, Vec::new())
        }
    }

    fn from_set(set: ready_made::ReadySet) -> Self {
        Self {
            title: set.title,
            summary: set.summary,
            format: set.format,
            rows: set.rows,
            series: set.series,
            scenes: set.scenes,
            ..Self::new(set.name, set.sources, set.questions)
        }
    }

    /// Replaces the questions.
    #[must_use]
    pub fn with_questions(self, questions: Vec<Question>) -> Self {
        Self { questions, ..self }
    }

    /// Takes the questions out, to avoid a second copy of a large set.
    #[must_use]
    pub(crate) fn take_questions(&mut self) -> Vec<Question> {
        std::mem::take(&mut self.questions)
    }

    /// Replaces the questions by those of a file.
    ///
    /// # Errors
    /// If a question is about a frame that the data set does not have. With `--skip bad`, such questions are left out
    /// instead.
    fn with_file_questions(self, file: &Path, read: FileQuestions, skip: Option<SkipBad>) -> Result<Self> {
        let FileQuestions { questions, scenes, summary, format, rows } = read;
        let unmatched = questions.iter().find(|question| !self.sources.contains_key(&question.frame));
        let problem = unmatched.map(|unmatched| {
            let wanted = folded(&unmatched.frame.0);
            let same = self.sources.keys().find(|id| folded(&id.0) == wanted);
            let names = match (same, self.sources.keys().next()) {
                (Some(id), _) => format!("its frame {:?} differs only in spelling", id.0),
                (None, Some(id)) => format!("its frames are named like {:?}", id.0),
                (None, None) => "it has no frames".to_owned(),
            };
            format!(
                "{}: question {:?} is about the frame {:?}, which {} does not have ({names})",
                file.display(),
                excerpt(&unmatched.id.0, 60),
                excerpt(&unmatched.frame.0, 80),
                self.name
            )
        });
        let dataset = Self { scenes, questions, summary, format, rows, ..self };
        match (problem, skip) {
            (None, _) => Ok(dataset),
            (Some(problem), Some(skip)) => dataset.without_unmatched_questions(&problem, skip),
            (Some(problem), None) => Err(Error::data(problem, "--skip bad leaves such questions out")),
        }
    }

    /// Opens an image file or a folder of frames, without questions. Paths may also lead into the folders in `further`.
    /// No image is read.
    pub fn from_images(path: &Path, further: &[PathBuf]) -> Result<Self> {
        let sources = if path.is_dir() {
            let sources = frames::sources(path, further, MissingFiles::Refuse)?;
            if !path.join(frames::FRAMES).exists() {
                frames::warn_of_subfolders(path, further)?;
            }
            sources
        } else {
            frames::image(path)?
        };
        Ok(Self::new(stem(path), sources, Vec::new()))
    }

    /// Opens a folder of frames with the labels of its maps, without questions. No image is read.
    pub fn from_frames(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        if !folder.is_dir() {
            return Err(Error::usage("DATA", format_args!("{}: no such folder of frames", folder.display())));
        }
        frames::frames(folder, further, MissingFiles::Refuse)
    }

    /// Labels of the semantic maps at a place; `None` without a `classes.json`, which may also lie in the folders in
    /// `further`.
    ///
    /// # Errors
    /// If `classes.json` cannot be read; the error names the file.
    pub fn labels_at(place: &DataPlace, further: &[PathBuf]) -> Result<Option<Labels>> {
        match place {
            DataPlace::Rooms(_) => Ok(Some(rooms::labels())),
            DataPlace::Path(path) if path.is_dir() => frames::labels(path, further),
            DataPlace::Path(_) | DataPlace::Files(_) | DataPlace::Known { .. } => Ok(None),
        }
    }

    /// Meaning of each number in the semantic maps; `None` if the data set has no `classes.json`.
    #[must_use]
    pub fn labels(&self) -> Option<&Labels> {
        self.labels.as_ref()
    }

    /// Sets the rule by which images are decoded.
    #[must_use]
    pub fn with_rule(self, rule: DecodeRule) -> Self {
        Self { rule, ..self }
    }

    /// The ids of the frames, in alphabetical order.
    pub fn frames(&self) -> impl Iterator<Item = &FrameId> {
        self.sources.keys()
    }

    /// Frames that a question about `frame` shows, in order: `frame` itself, or each image of a question with several
    /// images.
    #[must_use]
    pub(crate) fn shown_frames<'a>(&'a self, frame: &'a FrameId) -> &'a [FrameId] {
        match self.series.get(frame) {
            Some(frames) => frames,
            None => std::slice::from_ref(frame),
        }
    }

    /// Frames of a question with several images, in order; empty for a question with one image.
    #[must_use]
    pub(crate) fn image_series(&self, frame: &FrameId) -> &[FrameId] {
        self.series.get(frame).map_or(&[], Vec::as_slice)
    }

    /// True if the data set has the frame, or every frame of a question with several images.
    #[must_use]
    pub(crate) fn has_frames(&self, frame: &FrameId) -> bool {
        self.shown_frames(frame).iter().all(|frame| self.sources.contains_key(frame))
    }

    /// Scene of a frame, or the scene that all frames of a question with several images share; empty if there is none.
    #[must_use]
    pub fn scene(&self, id: &FrameId) -> String {
        if let Some(scene) = self.scenes.get(id) {
            return scene.clone();
        }
        if let Some(shown) = self.series.get(id) {
            let scenes: BTreeSet<String> = shown.iter().map(|frame| self.scene(frame)).collect();
            return match scenes.len() {
                1 => scenes.into_iter().next().unwrap_or_default(),
                _ => String::new(),
            };
        }
        match self.sources.get(id) {
            Some(ImageSource::File(file)) => file.facts.scene.clone(),
            Some(ImageSource::Room(room)) => room.scene(),
            Some(ImageSource::Embedded(_) | ImageSource::Member(_)) | None => String::new(),
        }
    }

    /// Opens the data at a place; `questions` replaces the `questions.jsonl` of a folder of frames.
    ///
    /// No image is read. Every question is checked: its choices, that its answer is one of them, and that its frame
    /// exists. The built-in rooms, and a folder of frames with maps but no questions, have no questions yet: the caller
    /// generates them from [`Self::labels`] and adds them with [`Self::with_questions`].
    pub fn open(place: &DataPlace, questions: Option<&Path>, set: &SetArgs) -> Result<Self> {
        Self::open_place(place, questions, set).map_err(|e| with_import_hint(place.path(), e))
    }

    fn open_place(place: &DataPlace, questions: Option<&Path>, set: &SetArgs) -> Result<Self> {
        let dataset = match place {
            DataPlace::Rooms(rooms) => {
                let rooms = Self::from_rooms(*rooms);
                match questions {
                    Some(file) => {
                        let questions = ready_made::questions_about_frames(file, set)?;
                        rooms.with_file_questions(file, questions, set.bad)?
                    }
                    None => rooms,
                }
            }
            DataPlace::Path(path) if frames::is_folder_of_frames(path, questions) => {
                frames::open(path, questions, set)?
            }
            DataPlace::Path(path) => Self::open_ready_made(std::slice::from_ref(path), questions, set)?,
            DataPlace::Files(paths) => Self::open_ready_made(paths, questions, set)?,
            DataPlace::Known { name, path } => {
                let set = SetArgs { preset: Some(name.clone()), ..set.clone() };
                Self::open_ready_made(std::slice::from_ref(path), questions, &set)?
            }
        };
        if dataset.questions.is_empty() && dataset.labels.is_none() {
            return Err(Error::data(&dataset.name, "no questions in it"));
        }
        let mut seen = HashSet::new();
        if let Some(twice) = dataset.questions.iter().find(|question| !seen.insert(&question.id)) {
            return Err(Error::data(
                &dataset.name,
                format_args!("two questions have the id {:?}", excerpt(&twice.id.0, 60)),
            ));
        }
        Ok(dataset)
    }

    /// Opens a ready-made set, named after its first file or folder.
    ///
    /// # Errors
    /// If the set cannot be read, or the user gives other questions than its own.
    fn open_ready_made(places: &[PathBuf], questions: Option<&Path>, set: &SetArgs) -> Result<Self> {
        refuse_questions(questions, "a ready-made set brings its own questions")?;
        let first = places.first().map_or(Path::new(""), PathBuf::as_path);
        Ok(Self::from_set(ready_made::open(places, &stem(first), set)?))
    }

    /// Short name for tables and folders: the name of the folder, or of the file without its extension.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The `name` in `dataset.json`, which does not change when the folder moves; empty if there is none.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// How a ready-made set was read (column mapping, omissions), one fact per line; empty for other data.
    #[must_use]
    pub fn summary(&self) -> &[String] {
        &self.summary
    }

    /// Lines of [`Self::summary`] to print: only the omissions if the set is in this program's own format.
    pub fn printed_summary(&self) -> impl Iterator<Item = &String> {
        self.summary.iter().filter(|line| self.format == SetFormat::Foreign || line.starts_with(LEFT_OUT))
    }

    /// The questions, in the order of their file.
    #[must_use]
    pub fn questions(&self) -> &[Question] {
        &self.questions
    }

    /// Image of a frame, not decoded.
    ///
    /// # Errors
    /// If there is no such frame, its file cannot be read, or the orientation of the image does not fit its maps.
    pub fn picture(&self, frame: &FrameId) -> Result<Picture> {
        match self.sources.get(frame) {
            Some(ImageSource::File(file)) => {
                let image = ImageFile::open(&file.rgb, self.rule)?;
                file.maps.match_orientation(image).map(Picture::Encoded)
            }
            Some(ImageSource::Embedded(image)) => image.read_image(self.rule).map(Picture::Encoded),
            Some(ImageSource::Member(archive)) => {
                let place = format!("{}, {}", archive.path().display(), frame.0);
                let file = ImageFile::new(archive.read_image(&frame.0)?, place, self.rule);
                Ok(Picture::Encoded(file))
            }
            Some(ImageSource::Room(room)) => Ok(Picture::Drawn(room.clone(), self.rule)),
            None => Err(Error::data(&self.name, format_args!("no frame {:?} in it", frame.0))),
        }
    }

    /// Photographs of the frame's scene in the dark, in the order of the data.
    #[must_use]
    pub(crate) fn photographs(&self, frame: &FrameId) -> &[DarkPhoto] {
        match self.sources.get(frame) {
            Some(ImageSource::File(file)) => &file.dark,
            _ => &[],
        }
    }

    /// Photograph of the frame's scene in the dark, not decoded.
    ///
    /// # Errors
    /// If the frame has no photograph of this name, or its file cannot be read.
    pub(crate) fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        let Some(photo) = self.photographs(frame).iter().find(|photo| photo.name == *name) else {
            let problem = format_args!("no photograph {name} of the frame {:?} in it", frame.0);
            return Err(Error::data(&self.name, problem));
        };
        ImageFile::open(&photo.path, self.rule).map(Picture::Encoded)
    }

    /// Horizontal focal length of a frame, in pixels of its image; `None` if unknown.
    #[must_use]
    pub fn focal(&self, frame: &FrameId) -> Option<f64> {
        match self.sources.get(frame)? {
            ImageSource::File(file) => file.facts.intrinsics.map(|camera| camera.fx),
            ImageSource::Room(room) => Some(room.focal()),
            ImageSource::Embedded(_) | ImageSource::Member(_) => None,
        }
    }

    /// Image file of a frame; `None` for an image in a table or a ZIP file, and for a built-in room.
    #[must_use]
    pub fn image_file(&self, frame: &FrameId) -> Option<&Path> {
        match self.sources.get(frame)? {
            ImageSource::File(file) => Some(&file.rgb),
            ImageSource::Embedded(_) | ImageSource::Member(_) | ImageSource::Room(_) => None,
        }
    }

    /// Reads the files of a frame without decoding them.
    ///
    /// # Errors
    /// If a file cannot be read; the error names it.
    pub fn files<'a>(&'a self, frame: &'a FrameId) -> Result<FrameFiles<'a>> {
        const NONE: &MapPaths = &MapPaths::NONE;
        static UNKNOWN: LazyLock<FrameFacts> = LazyLock::new(FrameFacts::default);
        let (maps, facts) = match self.sources.get(frame) {
            Some(ImageSource::File(file)) => (&file.maps, &file.facts),
            _ => (NONE, &*UNKNOWN),
        };
        Ok(FrameFiles { id: frame, picture: self.picture(frame)?, maps: maps.read()?, facts })
    }

    /// Decodes a frame with its image and its maps.
    ///
    /// # Errors
    /// If an image or a map cannot be read, or a map has another size than the image; the error names the file.
    pub fn frame(&self, frame: &FrameId) -> Result<Frame> {
        self.files(frame)?.decode()
    }
}

/// Error if `--questions` is given for data that cannot use it.
fn refuse_questions(questions: Option<&Path>, why: &str) -> Result<()> {
    match questions {
        None => Ok(()),
        Some(path) => Err(Error::usage("--questions", format_args!("{} cannot be used: {why}", path.display()))),
    }
}

/// Name of a folder, or of a file without its extension.
fn stem(path: &Path) -> String {
    let named = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = if named.is_dir() { named.file_name() } else { named.file_stem() };
    name.map_or_else(|| "data".to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn only_files_lose_their_extension() {
        let folder = tempfile::tempdir().unwrap();
        let (inner, set) = (folder.path().join("data.v1"), folder.path().join("set.v2.tsv"));
        fs::create_dir(&inner).unwrap();
        fs::write(&set, "").unwrap();
        assert_eq!((stem(&inner), stem(&set)), ("data.v1".into(), "set.v2".into()));
        assert_eq!(stem(&inner.join(".")), "data.v1");
    }
}
