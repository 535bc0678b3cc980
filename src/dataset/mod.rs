//! Data sets: images, their maps, and the questions that came with them.
//!
//! The entry point is [`Dataset::open`]. The path decides the reader: a folder of frames ([`frames`]) or a
//! ready-made multiple-choice set ([`ready_made`]). Without a path the data are the built-in rooms ([`rooms`]).

mod bank;
mod dark_photos;
mod family;
pub(crate) mod frame_folder;
pub(crate) mod frames;
pub(crate) mod image_names;
mod image_source;
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
mod unusable;
mod view;

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::error::{Error, Result};
use crate::picture::{ImageFile, ReadingRule};
use crate::rooms::{self, Rooms};
use crate::types::text::excerpt;
use crate::types::{Frame, FrameId, Labels, PhotoName, Question};

pub(crate) use bank::{Bank, BankPlace};
use dark_photos::DarkPhoto;
use frames::MissingFiles;
pub(crate) use image_source::ImageSource;
use maps::MapPaths;
pub(crate) use photographs::Photographs;
pub(crate) use picture::Picture;
pub use ready_made::SetArgs;
pub(crate) use ready_made::SkipBad;
use ready_made::{Form, LEFT_OUT, ReadQuestions, RowCounts, SceneNames, Series};
pub(crate) use root::Root;
pub(crate) use root::RootArgs;
pub(crate) use scene_args::SceneArgs;
pub(crate) use settings::{
    BankArgs, DataArgs, DecodeArgs, FolderArgs, PixelLimit, SelectionArgs, place,
};
use view::FrameFacts;
pub(crate) use view::FrameFiles;

/// The place of the data: what `--data` names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataPlace {
    /// The built-in rooms with these settings.
    Rooms(Rooms),
    /// A folder or file of the user.
    Path(PathBuf),
    /// Several files of one set, in this order.
    Files(Vec<PathBuf>),
    /// A well-known set, read by its rules.
    Known {
        /// The name of the set.
        name: String,
        /// Its file or folder.
        path: PathBuf,
    },
}

impl DataPlace {
    /// The folder or file, of several files the first; `None` for the built-in rooms.
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
    /// The frames of each question that shows several, by the name that the question has for all of them.
    series: Series,
    /// The scenes that the questions give to their frames; they go before those of the frames themselves.
    scenes: SceneNames,
    questions: Vec<Question>,
    labels: Option<Labels>,
    rule: ReadingRule,
    /// The inferred column mapping of a ready-made set, one line per column; empty for other data.
    reading: Vec<String>,
    form: Form,
    rows: RowCounts,
}

impl Dataset {
    fn new(
        name: String,
        sources: BTreeMap<FrameId, ImageSource>,
        questions: Vec<Question>,
    ) -> Self {
        Self {
            name,
            title: String::new(),
            sources,
            series: Series::new(),
            scenes: SceneNames::new(),
            questions,
            labels: None,
            rule: ReadingRule::default(),
            reading: Vec::new(),
            form: Form::Own,
            rows: RowCounts::default(),
        }
    }

    /// The frames at a place, without questions; `further` are folders that its paths may lead to. No image is read.
    ///
    /// # Errors
    /// If the place is not a folder of frames.
    pub fn open_without_questions(place: &DataPlace, further: &[PathBuf]) -> Result<Self> {
        match place {
            DataPlace::Rooms(rooms) => Ok(Self::from_rooms(*rooms)),
            DataPlace::Path(folder) | DataPlace::Known { path: folder, .. } => {
                Self::from_frames(folder, further)
            }
            DataPlace::Files(_) => Err(Error::usage(
                "--data",
                format_args!("{place}: one folder of frames expected"),
            )),
        }
    }

    /// The built-in rooms, without questions. No image is drawn yet.
    fn from_rooms(rooms: Rooms) -> Self {
        let sources = rooms
            .all()
            .map(|(id, room)| (id, ImageSource::Room(room)))
            .collect();
        Self {
            title: rooms.title(),
            labels: Some(rooms::labels()),
            ..Self::new("rooms".to_owned(), sources, Vec::new())
        }
    }

    /// The data of a ready-made set.
    fn from_set(set: ready_made::ReadySet) -> Self {
        Self {
            title: set.title,
            reading: set.reading,
            form: set.form,
            rows: set.rows,
            series: set.series,
            scenes: set.scenes,
            ..Self::new(set.name, set.sources, set.questions)
        }
    }

    /// The same data set with these questions.
    #[must_use]
    pub fn with_questions(self, questions: Vec<Question>) -> Self {
        Self { questions, ..self }
    }

    /// Its questions, which it has no longer, so that those of large sets are held once.
    #[must_use]
    pub(crate) fn take_questions(&mut self) -> Vec<Question> {
        std::mem::take(&mut self.questions)
    }

    /// The same data set with the questions of a file. Each must be about one of its frames; others are left out with `--skip bad`.
    fn with_questions_of(
        self,
        file: &Path,
        read: ReadQuestions,
        skip: Option<SkipBad>,
    ) -> Result<Self> {
        let ReadQuestions {
            questions,
            scenes,
            reading,
            form,
            rows,
        } = read;
        let unmatched = questions
            .iter()
            .find(|question| !self.sources.contains_key(&question.frame));
        let example = self.sources.keys().next().map_or("", |id| id.0.as_str());
        let problem = unmatched.map(|unmatched| {
            format!(
                "{}: question {:?} is about the frame {:?}, which {} does not have (its frames are named like {example:?})",
                file.display(),
                excerpt(&unmatched.id.0, 60),
                excerpt(&unmatched.frame.0, 80),
                self.name
            )
        });
        let asked = Self {
            scenes,
            questions,
            reading,
            form,
            rows,
            ..self
        };
        match (problem, skip) {
            (None, _) => Ok(asked),
            (Some(problem), Some(skip)) => asked.without_strangers(&problem, skip),
            (Some(problem), None) => {
                Err(Error::data(problem, "--skip bad leaves such questions out"))
            }
        }
    }

    /// The images of an image file or a folder of frames, without questions; `further` are folders that its paths may lead to. No image
    /// is read.
    pub fn from_images(path: &Path, further: &[PathBuf]) -> Result<Self> {
        let sources = if path.is_dir() {
            frames::sources(path, further, MissingFiles::Refused)?
        } else {
            frames::image(path)?
        };
        Ok(Self::new(stem(path), sources, Vec::new()))
    }

    /// The frames of a folder and the labels of its maps, without questions. No image is read.
    pub fn from_frames(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        if !folder.is_dir() {
            return Err(Error::usage(
                "DATA",
                format_args!("{}: no such folder of frames", folder.display()),
            ));
        }
        frames::frames(folder, further, MissingFiles::Refused)
    }

    /// The labels of the semantic maps at a place, whether or not it has questions.
    ///
    /// # Errors
    /// If `classes.json` cannot be read; the error names the file.
    pub fn labels_at(place: &DataPlace) -> Result<Option<Labels>> {
        match place {
            DataPlace::Rooms(_) => Ok(Some(rooms::labels())),
            DataPlace::Path(path) if path.is_dir() => frames::labels(path),
            DataPlace::Path(_) | DataPlace::Files(_) | DataPlace::Known { .. } => Ok(None),
        }
    }

    /// The meaning of each number in the semantic maps; `None` if the data set has no `classes.json`.
    #[must_use]
    pub fn labels(&self) -> Option<&Labels> {
        self.labels.as_ref()
    }

    /// The same data set, whose images are read by this rule.
    #[must_use]
    pub fn with_rule(self, rule: ReadingRule) -> Self {
        Self { rule, ..self }
    }

    /// The ids of the frames, in alphabetical order.
    pub fn frames(&self) -> impl Iterator<Item = &FrameId> {
        self.sources.keys()
    }

    /// The frames that a question about `frame` shows, in order: this frame alone, or the several that it stands for.
    #[must_use]
    pub(crate) fn shown<'a>(&'a self, frame: &'a FrameId) -> &'a [FrameId] {
        match self.series.get(frame) {
            Some(frames) => frames,
            None => std::slice::from_ref(frame),
        }
    }

    /// The frames of a question that shows several, in order; none of a question that shows one.
    #[must_use]
    pub(crate) fn several(&self, frame: &FrameId) -> &[FrameId] {
        self.series.get(frame).map_or(&[], Vec::as_slice)
    }

    /// Whether the images of a frame, or of the several that it stands for, are in the data set.
    #[must_use]
    pub(crate) fn has(&self, frame: &FrameId) -> bool {
        self.shown(frame)
            .iter()
            .all(|frame| self.sources.contains_key(frame))
    }

    /// The scene of a frame, or of several that a question shows together; empty if the data set names none.
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
            Some(ImageSource::File(file)) => file.view.scene.clone(),
            Some(ImageSource::Room(room)) => room.scene(),
            Some(ImageSource::Embedded(_) | ImageSource::Member(_)) | None => String::new(),
        }
    }

    /// The data at a place; `questions` replaces the `questions.jsonl` of a folder of frames.
    ///
    /// No image is read. Every question is checked: its choices, its answer among them, its frame among the images. The
    /// built-in rooms, and a folder of frames with maps but no questions, have none yet. The caller makes those by rule
    /// from [`Self::labels`] and adds them by [`Self::with_questions`].
    pub fn open(place: &DataPlace, questions: Option<&Path>, set: &SetArgs) -> Result<Self> {
        let dataset = match place {
            DataPlace::Rooms(rooms) => {
                let rooms = Self::from_rooms(*rooms);
                match questions {
                    Some(file) => {
                        let questions = ready_made::about_frames(file, set)?;
                        rooms.with_questions_of(file, questions, set.bad)?
                    }
                    None => rooms,
                }
            }
            DataPlace::Path(path) if frames::is_folder_of_frames(path, questions) => {
                frames::open(path, questions, set)?
            }
            DataPlace::Path(path) => {
                refuse(questions, "a ready-made set brings its own questions")?;
                let places = std::slice::from_ref(path);
                Self::from_set(ready_made::open(places, &stem(path), set)?)
            }
            DataPlace::Files(paths) => {
                refuse(questions, "a ready-made set brings its own questions")?;
                let first = paths.first().map_or(Path::new(""), PathBuf::as_path);
                Self::from_set(ready_made::open(paths, &stem(first), set)?)
            }
            DataPlace::Known { name, path } => {
                refuse(questions, "a ready-made set brings its own questions")?;
                let preset = Some(name.clone());
                Self::from_set(ready_made::open(
                    std::slice::from_ref(path),
                    &stem(path),
                    &SetArgs {
                        preset,
                        ..set.clone()
                    },
                )?)
            }
        };
        if dataset.questions.is_empty() && dataset.labels.is_none() {
            return Err(Error::data(&dataset.name, "no questions in it"));
        }
        let mut seen = HashSet::new();
        if let Some(twice) = dataset
            .questions
            .iter()
            .find(|question| !seen.insert(&question.id))
        {
            return Err(Error::data(
                &dataset.name,
                format_args!("two questions have the id {:?}", excerpt(&twice.id.0, 60)),
            ));
        }
        Ok(dataset)
    }

    /// A short name for tables and folders: the name of the folder, or of the file without its extension.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The `name` in `dataset.json`, which does not change when the folder moves; empty if there is none.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The inferred column mapping of a ready-made set, one line per column; empty for other data.
    #[must_use]
    pub fn reading(&self) -> &[String] {
        &self.reading
    }

    /// The lines of [`Self::reading`] that the user should see: those about the omissions alone where the set has this program's own
    /// form.
    pub fn reading_to_say(&self) -> impl Iterator<Item = &String> {
        let is_said = |line: &&String| self.form == Form::Foreign || line.starts_with(LEFT_OUT);
        self.reading.iter().filter(is_said)
    }

    /// The questions, in the order of their file.
    #[must_use]
    pub fn questions(&self) -> &[Question] {
        &self.questions
    }

    /// The image of a frame as it is stored, not decoded.
    ///
    /// # Errors
    /// If there is no such frame, its file cannot be read, or the image is to be turned and its maps do not fit.
    pub fn picture(&self, frame: &FrameId) -> Result<Picture> {
        match self.sources.get(frame) {
            Some(ImageSource::File(file)) => {
                let image = ImageFile::open(&file.rgb, self.rule)?;
                file.maps.beside(image).map(Picture::Encoded)
            }
            Some(ImageSource::Embedded(image)) => image.image(self.rule).map(Picture::Encoded),
            Some(ImageSource::Member(archive)) => {
                let place = format!("{}, {}", archive.path().display(), frame.0);
                let file = ImageFile::new(archive.image(&frame.0)?, place, self.rule);
                Ok(Picture::Encoded(file))
            }
            Some(ImageSource::Room(room)) => Ok(Picture::Drawn(room.clone(), self.rule)),
            None => Err(Error::data(
                &self.name,
                format_args!("no frame {:?} in it", frame.0),
            )),
        }
    }

    /// The photographs of a frame's scene in the dark, in their order.
    #[must_use]
    pub(crate) fn photographs(&self, frame: &FrameId) -> &[DarkPhoto] {
        match self.sources.get(frame) {
            Some(ImageSource::File(file)) => &file.dark,
            _ => &[],
        }
    }

    /// A photograph of a frame's scene in the dark as it is stored, not decoded.
    ///
    /// # Errors
    /// If the frame has no photograph of this name, or its file cannot be read.
    pub(crate) fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
        let Some(photo) = self
            .photographs(frame)
            .iter()
            .find(|photo| photo.name == *name)
        else {
            let problem = format_args!("no photograph {name} of the frame {:?} in it", frame.0);
            return Err(Error::data(&self.name, problem));
        };
        ImageFile::open(&photo.path, self.rule).map(Picture::Encoded)
    }

    /// The focal length of a frame along a row, in pixels of its image; `None` if the data set does not state it.
    #[must_use]
    pub fn focal(&self, frame: &FrameId) -> Option<f64> {
        match self.sources.get(frame)? {
            ImageSource::File(file) => file.view.intrinsics.map(|camera| camera.fx),
            ImageSource::Room(room) => Some(room.focal()),
            ImageSource::Embedded(_) | ImageSource::Member(_) => None,
        }
    }

    /// The image file of a frame; `None` for a cell of a table or a built-in room.
    #[must_use]
    pub fn image_file(&self, frame: &FrameId) -> Option<&Path> {
        match self.sources.get(frame)? {
            ImageSource::File(file) => Some(&file.rgb),
            ImageSource::Embedded(_) | ImageSource::Member(_) | ImageSource::Room(_) => None,
        }
    }

    /// The files of a frame, not decoded.
    ///
    /// # Errors
    /// If a file cannot be read; the error names it.
    pub fn files<'a>(&'a self, frame: &'a FrameId) -> Result<FrameFiles<'a>> {
        const NONE: &MapPaths = &MapPaths::NONE;
        static UNKNOWN: LazyLock<FrameFacts> = LazyLock::new(FrameFacts::default);
        let (maps, view) = match self.sources.get(frame) {
            Some(ImageSource::File(file)) => (&file.maps, &file.view),
            _ => (NONE, &*UNKNOWN),
        };
        Ok(FrameFiles {
            id: frame,
            picture: self.picture(frame)?,
            maps: maps.read()?,
            view,
        })
    }

    /// A frame with its image and its maps, decoded.
    ///
    /// # Errors
    /// If an image or a map cannot be read, or a map has another size than the image; the error names the file.
    pub fn frame(&self, frame: &FrameId) -> Result<Frame> {
        self.files(frame)?.decode()
    }
}

fn refuse(questions: Option<&Path>, why: &str) -> Result<()> {
    questions.map_or(Ok(()), |path| {
        Err(Error::usage(
            "--questions",
            format_args!("{} cannot be used: {why}", path.display()),
        ))
    })
}

/// The name of a folder, or of a file without its extension.
fn stem(path: &Path) -> String {
    let named = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = if named.is_dir() {
        named.file_name()
    } else {
        named.file_stem()
    };
    name.map_or_else(
        || "data".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn only_a_file_loses_its_extension() {
        let folder = tempfile::tempdir().unwrap();
        let (inner, set) = (
            folder.path().join("data.v1"),
            folder.path().join("set.v2.tsv"),
        );
        fs::create_dir(&inner).unwrap();
        fs::write(&set, "").unwrap();
        assert_eq!(
            (stem(&inner), stem(&set)),
            ("data.v1".into(), "set.v2".into())
        );
        assert_eq!(stem(&inner.join(".")), "data.v1");
    }
}
