//! Episodic-memory questions of OpenEQA and the frames of their walks: [`OpenQuestion`], [`read_questions`],
//! [`walk_frames`] and [`sample_indices`]. Follows `facebookresearch/open-eqa` at cfa3fce.
//!
//! Location of an image: [`ImageSource`].

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;

use super::Root;
use super::dark_photos::DarkPhoto;
use super::maps::{FrameFacts, MapPaths};
use super::ready_made::{Archive, EmbeddedImage};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::bytes;
use darkqa_base::types::QuestionId;

/// Open question about a walk through a building.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct OpenQuestion {
    #[serde(rename = "question_id")]
    pub id: QuestionId,
    #[serde(rename = "question")]
    pub text: String,
    pub answer: String,
    /// Further correct answers; `None` if the key is missing. The judge gets another prompt then.
    #[serde(rename = "extra_answers")]
    pub extra: Option<Vec<String>>,
    /// Kind of question, such as "object localization".
    pub category: String,
    /// Name of the walk, such as `hm3d-v0/000-hm3d-BFRyYbPCCPE`.
    #[serde(rename = "episode_history")]
    pub episode: String,
}

impl OpenQuestion {
    /// Split of the question: the first part of the name of its walk, such as `hm3d-v0`.
    #[must_use]
    pub fn split(&self) -> &str {
        self.episode.split('/').next().unwrap_or_default()
    }
}

/// Reads a question file: a JSON array, like `open-eqa-v0.json` of OpenEQA.
///
/// # Errors
/// If the file cannot be read, is not such an array, is empty, or has two questions with the same id.
pub fn read_questions(path: &Path) -> Result<Vec<OpenQuestion>> {
    let text = bytes(path)?;
    let questions: Vec<OpenQuestion> = serde_json::from_slice(&text).map_err(|e| {
        Error::data(
            path.display(),
            format_args!(
                "{e}; a JSON array of {{\"question_id\", \"question\", \"answer\", \"category\", \"episode_history\"}} expected"
            ),
        )
    })?;
    if questions.is_empty() {
        return Err(Error::data(path.display(), "no questions in it"));
    }
    let mut seen = BTreeSet::new();
    if let Some(twice) = questions.iter().find(|question| !seen.insert(&question.id)) {
        return Err(Error::data(path.display(), format_args!("two questions have the id {:?}", twice.id.0)));
    }
    Ok(questions)
}

/// Frames of a walk, sorted by name: the files in its folder that end in `-rgb.png`.
///
/// # Errors
/// If the folder is missing or has no such file, or if the folder or a frame lies outside `root`.
pub fn walk_frames(root: &Root, episode: &str) -> Result<Vec<PathBuf>> {
    let folder =
        root.path(root.folder(), Path::new(episode)).map_err(|problem| Error::data("episode_history", problem))?;
    let mut links_out = Vec::new();
    let is_frame = |path: &PathBuf| path.to_string_lossy().ends_with("-rgb.png");
    let mut paths = root.entries(&folder, &mut links_out)?;
    paths.retain(is_frame);
    // Without it, others would be sampled.
    if let Some(link) = links_out.into_iter().find(is_frame) {
        return Err(root.link_out_error(&link));
    }
    if paths.is_empty() {
        let problem = "no frame in it: files that end in -rgb.png expected";
        return Err(Error::data(folder.display(), problem));
    }
    Ok(paths)
}

/// Indices of `k` frames out of `n`, like `np.round(np.linspace(0, n - 1, k))`: rounded half to even, with repeats if
/// `n` is less than `k`; empty if `n` is 0.
#[must_use]
pub fn sample_indices(n: usize, k: usize) -> Vec<usize> {
    if n == 0 {
        return Vec::new();
    }
    let last = (n - 1) as f64;
    // numpy computes arange(k) · step, and sets the last value to the end of the range.
    let step = if k > 1 { last / (k - 1) as f64 } else { 0.0 };
    (0..k)
        .map(|index| {
            let position = if index + 1 == k && k > 1 { last } else { index as f64 * step };
            position.round_ties_even() as usize
        })
        .collect()
}

/// Location of one image and its maps.
#[derive(Debug, Clone)]
pub enum ImageSource {
    /// An image file.
    File(Box<FrameFile>),
    /// An image in a ZIP file, under the name of the frame.
    Member(Arc<Archive>),
    /// An image inside a table.
    Embedded(EmbeddedImage),
    /// A frame of the built-in rooms.
    Room(darkqa_rooms::Room),
}

/// Image file of a frame, with its maps, metadata and photographs of its scene in the dark.
#[derive(Debug, Clone)]
pub struct FrameFile {
    pub rgb: PathBuf,
    pub maps: MapPaths,
    pub facts: FrameFacts,
    pub dark: Vec<DarkPhoto>,
}

impl ImageSource {
    /// An image file without maps.
    pub(super) fn image(rgb: PathBuf) -> Self {
        Self::File(Box::new(FrameFile {
            rgb,
            maps: MapPaths::default(),
            facts: FrameFacts::default(),
            dark: Vec::new(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn frames_are_sampled_as_numpy_does() {
        // numpy 2.4: np.round(np.linspace(0, n - 1, k)).astype(int).
        assert_eq!(sample_indices(9, 5), [0, 2, 4, 6, 8]);
        assert_eq!(sample_indices(4, 3), [0, 2, 3]);
        assert_eq!(sample_indices(6, 3), [0, 2, 5]);
        assert_eq!(sample_indices(3, 7), [0, 0, 1, 1, 1, 2, 2]);
        assert_eq!(sample_indices(168, 5), [0, 42, 84, 125, 167]);
        assert_eq!((sample_indices(1, 3), sample_indices(5, 1)), (vec![0, 0, 0], vec![0]));
        assert!(sample_indices(0, 4).is_empty());
    }

    fn read_text(path: &Path, text: &str) -> Result<Vec<OpenQuestion>> {
        fs::write(path, text).unwrap();
        read_questions(path)
    }

    #[test]
    fn questions_are_read_and_checked() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let one = r#"{"question": "Where?", "answer": "there", "category": "object localization",
            "question_id": "a", "episode_history": "hm3d-v0/000-x"}"#;
        let extra = one.replace("\"a\"", "\"b\"").replacen('{', "{\"extra_answers\": [\"here\"], ", 1);
        let loaded = read_text(file.path(), &format!("[{one}, {extra}]")).unwrap();
        assert_eq!((loaded[0].split(), &loaded[0].extra), ("hm3d-v0", &None));
        assert_eq!(loaded[1].extra.as_deref(), Some(&["here".to_owned()][..]));
        for (text, message) in [
            ("[]", "no questions in it"),
            ("{}", "a JSON array of"),
            (&*format!("[{one}, {one}]"), "two questions have the id \"a\""),
        ] {
            let error = read_text(file.path(), text).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn walk_frames_are_sorted_color_images() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path().join("hm3d-v0/000-x");
        fs::create_dir_all(&folder).unwrap();
        let root = Root::new(base.path(), &[]).unwrap();
        assert!(walk_frames(&root, "hm3d-v0/000-x").unwrap_err().to_string().contains("-rgb.png"));
        for name in ["00010-rgb.png", "00002-rgb.png", "00002-depth.png", "intrinsic_color.txt"] {
            fs::write(folder.join(name), "").unwrap();
        }
        let names: Vec<_> = walk_frames(&root, "hm3d-v0/000-x").unwrap();
        assert!(names[0].ends_with("00002-rgb.png") && names.len() == 2);
        assert!(walk_frames(&root, "nowhere").is_err());
    }
}
