//! A data set in memory: its images, their maps and questions, without how they are stored.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::LazyLock;

use super::dark_photos::DarkPhoto;
use super::maps::{FrameFacts, FrameFiles, MapPaths, Picture};
use super::openeqa::ImageSource;
use super::ready_made::{FileQuestions, LEFT_OUT, ReadySet, RowCounts, SceneNames, Series, SetFormat, SkipBad};
use super::root::folded;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{Frame, FrameId, Labels, PhotoName, Question};
use darkqa_pictures::{DecodeRule, ImageFile};
use darkqa_rooms::Rooms;

/// Images and the questions about them.
#[derive(Debug)]
pub struct Dataset {
    name: String,
    /// The `name` in `dataset.json`; empty if there is none.
    title: String,
    pub sources: BTreeMap<FrameId, ImageSource>,
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
    pub(super) fn new(name: String, sources: BTreeMap<FrameId, ImageSource>, questions: Vec<Question>) -> Self {
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

    /// The built-in rooms, without questions. No image is drawn yet.
    pub(super) fn from_rooms(rooms: Rooms) -> Self {
        let sources = rooms.all().map(|(id, room)| (id, ImageSource::Room(room))).collect();
        Self {
            title: rooms.title(),
            labels: Some(darkqa_rooms::labels()),
            ..Self::new("rooms".to_owned(), sources, Vec::new())
        }
    }

    pub(super) fn from_set(set: ReadySet) -> Self {
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

    /// Sets the title, and the labels of the semantic maps.
    #[must_use]
    pub(super) fn with_title_and_labels(self, title: String, labels: Option<Labels>) -> Self {
        Self { title, labels, ..self }
    }

    /// Replaces the questions.
    #[must_use]
    pub fn with_questions(self, questions: Vec<Question>) -> Self {
        Self { questions, ..self }
    }

    /// Leaves the questions out, with the lines on how they were read.
    #[must_use]
    pub(super) fn without_questions(self) -> Self {
        Self { questions: Vec::new(), summary: Vec::new(), ..self }
    }

    /// Takes the questions out, to avoid a second copy of a large set.
    #[must_use]
    pub fn take_questions(&mut self) -> Vec<Question> {
        std::mem::take(&mut self.questions)
    }

    /// Replaces the questions by those of a file.
    ///
    /// # Errors
    /// If a question is about a frame that the data set does not have. With `--skip bad`, such questions are left out
    /// instead.
    pub(super) fn with_file_questions(self, file: &Path, read: FileQuestions, skip: Option<SkipBad>) -> Result<Self> {
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
    pub fn shown_frames<'a>(&'a self, frame: &'a FrameId) -> &'a [FrameId] {
        match self.series.get(frame) {
            Some(frames) => frames,
            None => std::slice::from_ref(frame),
        }
    }

    /// Frames of a question with several images, in order; empty for a question with one image.
    #[must_use]
    pub fn image_series(&self, frame: &FrameId) -> &[FrameId] {
        self.series.get(frame).map_or(&[], Vec::as_slice)
    }

    /// True if the data set has the frame, or every frame of a question with several images.
    #[must_use]
    pub fn has_frames(&self, frame: &FrameId) -> bool {
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
    pub fn photographs(&self, frame: &FrameId) -> &[DarkPhoto] {
        match self.sources.get(frame) {
            Some(ImageSource::File(file)) => &file.dark,
            _ => &[],
        }
    }

    /// Photograph of the frame's scene in the dark, not decoded.
    ///
    /// # Errors
    /// If the frame has no photograph of this name, or its file cannot be read.
    pub fn photograph(&self, frame: &FrameId, name: &PhotoName) -> Result<Picture> {
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

    /// Images that the questions show, without duplicates; all images if there are no questions.
    pub fn shown_images(&self) -> Vec<&FrameId> {
        if self.questions.is_empty() {
            return self.sources.keys().collect();
        }
        self.questions
            .iter()
            .flat_map(|question| self.shown_frames(&question.frame))
            .collect::<BTreeSet<&FrameId>>()
            .into_iter()
            .collect()
    }

    /// Checks that an image, and the photographs of its scene in the dark, can be decoded.
    ///
    /// # Errors
    /// If one of them cannot be decoded; the error names its file.
    pub fn decode_all(&self, frame: &FrameId) -> Result<()> {
        self.picture(frame)?.decode()?;
        for photograph in self.photographs(frame) {
            self.photograph(frame, &photograph.name)?.decode()?;
        }
        Ok(())
    }

    /// Removes unusable images and the questions that show them. `unusable` has the problem of each image.
    ///
    /// # Errors
    /// If more is left out than `skip` allows, including broken rows.
    pub fn without_unusable(mut self, unusable: &BTreeMap<FrameId, String>, skip: SkipBad) -> Result<Self> {
        let Some(first) = unusable.values().next() else {
            return Ok(self);
        };
        self.sources.retain(|frame, _| !unusable.contains_key(frame));
        if self.questions.is_empty() {
            let (bad, all) = (unusable.len(), unusable.len() + self.sources.len());
            return self.record_omission(bad, all, "images", first, skip);
        }
        let problem = format!("{first} (of {} images)", unusable.len());
        let first = if unusable.len() == 1 { first } else { &problem };
        self.without_unmatched_questions(first, skip)
    }

    /// Removes the questions about images that the data set does not have. `first` is the problem of the first one.
    ///
    /// # Errors
    /// As [`Self::without_unusable`].
    fn without_unmatched_questions(mut self, first: &str, skip: SkipBad) -> Result<Self> {
        let questions = self.take_questions();
        let all = questions.len();
        self.questions = questions.into_iter().filter(|question| self.has_frames(&question.frame)).collect();
        let bad = all - self.questions.len();
        let rows = self.rows.all.max(all);
        self.record_omission(bad, rows, "questions", first, skip)
    }

    /// Checks that `bad` of `all` may be left out, and adds a line to the summary.
    fn record_omission(mut self, bad: usize, all: usize, noun: &str, first: &str, skip: SkipBad) -> Result<Self> {
        self.rows.bad += bad;
        skip.check(self.rows.bad, all, noun, first).map_err(|problem| Error::data(&self.name, problem))?;
        self.summary.push(format!("{LEFT_OUT}{bad} of {all} {noun} (unusable images); the first: {first}"));
        Ok(self)
    }
}

/// Name of a folder, or of a file without its extension.
pub(super) fn stem(path: &Path) -> String {
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
