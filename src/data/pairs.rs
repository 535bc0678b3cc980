//! Image pairs of the same scene in normal and in low light: [`Pairs`].
//!
//! Pairs of photographs as frames, each with a photograph in the dark: [`open`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::dark_photos::DarkPhoto;
use super::dataset::{Dataset, stem};
use super::frames::ImagePaths;
use super::maps::{FrameFacts, MapPaths};
use super::openeqa::{FrameFile, ImageSource};
use super::root::Root;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{FrameId, PhotoName};

/// Names of the normal-light and the low-light folder: plain words, and the names in the LOL and LISU data sets.
const FOLDERS: [[&str; 2]; 3] = [["normal", "low"], ["high", "low"], ["val_rgb_h", "val_rgb_l"]];

/// One scene in normal and in low light.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// The common part of both file names.
    pub name: String,
    /// The image in normal light.
    pub normal: PathBuf,
    /// The image in low light.
    pub low: PathBuf,
}

/// The image pairs of a data set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pairs {
    /// Sorted by name.
    pub pairs: Vec<Pair>,
    /// Images without a partner.
    pub unmatched: Vec<PathBuf>,
}

/// The side of a pair that an image belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PairSide {
    Normal,
    Low,
}

impl Pairs {
    /// Finds the pairs in a folder. Two layouts are known:
    /// - Subfolders `normal` and `low`, `high` and `low`, or `val_rgb_h` and `val_rgb_l`, in upper or lower case.
    /// - All images in the folder itself. Names begin or end with `normal` or `high` in normal light, with `low` in low
    ///   light (`normal00733.png`, `low00733.png`).
    ///
    /// # Errors
    /// If no pair is found, or two images of the same side have the same name. `other_folders` is the command's way to
    /// name two folders.
    pub fn open(folder: &Path, further: &[PathBuf], other_folders: &str) -> Result<Self> {
        let root = Root::new(folder, further)?;
        let mut links_out = Vec::new();
        let entries = root.entries(folder, &mut links_out)?;
        root.warn_of_links_out(&links_out);
        for [normal, low] in FOLDERS {
            if let (Some(normal), Some(low)) = (subfolder(&entries, normal), subfolder(&entries, low)) {
                return Self::from_folders(normal, low, further);
            }
        }
        let mut sides = [BTreeMap::new(), BTreeMap::new()];
        let mut unmatched = Vec::new();
        for path in images(entries, folder) {
            match split_side(&path_stem(&path)) {
                (name, Some(side)) => add_image(&mut sides[side as usize], name, &path)?,
                (_, None) => unmatched.push(path),
            }
        }
        Self::match_names(sides, unmatched).ok_or_else(|| {
            let problem = format_args!(
                "no pairs in it; expected are folders normal and low (or high and low, val_rgb_h and val_rgb_l), or files like normal1.png and low1.png; {other_folders}"
            );
            Error::data(folder.display(), problem)
        })
    }

    /// Pairs the images of two folders by name. The extension and the words `normal`, `high` and `low` at the beginning
    /// or end of a name are ignored.
    ///
    /// # Errors
    /// If no pair is found, or two images of the same folder have the same name.
    pub fn from_folders(normal: &Path, low: &Path, further: &[PathBuf]) -> Result<Self> {
        let mut sides = [BTreeMap::new(), BTreeMap::new()];
        for (side, folder) in sides.iter_mut().zip([normal, low]) {
            let root = Root::new(folder, further)?;
            let mut links_out = Vec::new();
            let entries = root.entries(folder, &mut links_out)?;
            root.warn_of_links_out(&links_out);
            for path in images(entries, folder) {
                let (name, _) = split_side(&path_stem(&path));
                add_image(side, name, &path)?;
            }
        }
        Self::match_names(sides, Vec::new()).ok_or_else(|| {
            let problem = format_args!("no image in it has the name of one in {}", normal.display());
            Error::data(low.display(), problem)
        })
    }

    /// Pairs the images whose names occur on both sides; `None` if there are none.
    fn match_names([mut normal, low]: [BTreeMap<String, PathBuf>; 2], mut unmatched: Vec<PathBuf>) -> Option<Self> {
        let mut pairs = Vec::new();
        for (name, low) in low {
            match normal.remove(&name) {
                Some(normal) => pairs.push(Pair { name, normal, low }),
                None => unmatched.push(low),
            }
        }
        unmatched.extend(normal.into_values());
        unmatched.sort();
        (!pairs.is_empty()).then_some(Self { pairs, unmatched })
    }
}

/// The folder with this name, in any case.
fn subfolder<'a>(entries: &'a [PathBuf], name: &str) -> Option<&'a PathBuf> {
    entries.iter().find(|path| path.is_dir() && file_name(path).eq_ignore_ascii_case(name))
}

/// Adds an image to a side of the pairs.
///
/// # Errors
/// If the side already has an image of this name.
fn add_image(side: &mut BTreeMap<String, PathBuf>, name: String, path: &Path) -> Result<()> {
    match side.insert(name, path.to_owned()) {
        None => Ok(()),
        Some(other) => {
            let problem = format_args!("same name as {}", other.display());
            Err(Error::data(path.display(), problem))
        }
    }
}

/// True if two neighbouring characters belong to the same word. The letter case separates words, so `low` is a word in
/// `sofaLow`, `low1` and `1_low`, but not in `yellow`.
fn are_in_one_word(one: Option<char>, next: Option<char>) -> bool {
    let (Some(one), Some(next)) = (one, next) else {
        return false;
    };
    one.is_alphabetic() && next.is_alphabetic() && one.is_lowercase() == next.is_lowercase()
}

/// Splits a file name into the name of the pair and the side, given by a word at its beginning or end. If the two words
/// contradict each other, the one at the beginning counts.
fn split_side(stem: &str) -> (String, Option<PairSide>) {
    const WORDS: [(&str, PairSide); 3] =
        [("normal", PairSide::Normal), ("high", PairSide::Normal), ("low", PairSide::Low)];
    let lower = stem.to_ascii_lowercase();
    let prefix = WORDS.iter().find(|(word, _)| {
        let rest = lower.strip_prefix(word);
        rest.is_some_and(|rest| rest.starts_with("light") || is_word_boundary(stem, word.len()))
    });
    let suffix = WORDS.iter().find(|(word, side)| {
        lower.ends_with(word)
            && is_word_boundary(stem, stem.len() - word.len())
            && prefix.is_none_or(|(_, prefix_side)| prefix_side == side)
    });
    let start = prefix.map_or(0, |(word, _)| word.len());
    let end = stem.len() - suffix.map_or(0, |(word, _)| word.len());
    match prefix.or(suffix) {
        Some((_, side)) if start <= end => {
            let name = stem[start..end].trim_matches(['_', '-', '.', ' ']);
            (name.to_owned(), Some(*side))
        }
        // The whole name is one word, which is both prefix and suffix.
        Some((_, side)) => (String::new(), Some(*side)),
        None => (stem.to_owned(), None),
    }
}

fn is_word_boundary(stem: &str, at: usize) -> bool {
    let (before, after) = stem.split_at(at);
    !are_in_one_word(before.chars().next_back(), after.chars().next())
}

/// The image files among the paths of a folder. Warns of images in formats that are not supported.
fn images(paths: Vec<PathBuf>, folder: &Path) -> Vec<PathBuf> {
    let found = ImagePaths::from_paths(paths);
    found.warn_of_unsupported(folder);
    found.images
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn path_stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Makes a frame of each photograph in normal light, named by its file, with its partner in low light as dark
/// photograph. Warns about images without a partner. The data set has no questions.
///
/// # Errors
/// If two photographs in normal light have the same name.
pub(super) fn open(folder: &Path, pairs: Pairs) -> Result<Dataset> {
    if let Some(first) = pairs.unmatched.first() {
        tracing::warn!(
            "images without a partner in the other light, which are not asked: {}, first {}",
            pairs.unmatched.len(),
            first.display()
        );
    }
    let mut sources = BTreeMap::new();
    for pair in pairs.pairs {
        let name = pair.normal.file_name().unwrap_or_default();
        let id = FrameId(name.to_string_lossy().into_owned());
        let dark = DarkPhoto { name: PhotoName::numbered(0), path: pair.low, ev: None };
        let source = ImageSource::File(Box::new(FrameFile {
            rgb: pair.normal.clone(),
            maps: MapPaths::default(),
            facts: FrameFacts::default(),
            dark: vec![dark],
        }));
        if sources.insert(id, source).is_some() {
            return Err(Error::data(pair.normal.display(), "a second file of this name"));
        }
    }
    Ok(Dataset::new(stem(folder), sources, Vec::new()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    fn names(pairs: &Pairs) -> Vec<&str> {
        pairs.pairs.iter().map(|pair| pair.name.as_str()).collect()
    }

    #[test]
    fn known_layouts_are_paired() {
        for files in [
            &["normal/1.png", "low/1.png"][..],
            &["high/1.png", "low/1.jpg"],
            &["Normal/normal1.png", "Low/low1.png"],
            &["val_rgb_h/1.png", "val_rgb_l/1.png", "val_lbl/1.png"],
            &["normal1.png", "low1.png", "notes.txt"],
            &["1_normal.png", "1_low.png"],
            &["1Normal.png", "1Low.png"],
            &["normal1.png", "low1_low.png"],
        ] {
            let folder = folder(files);
            let pairs = Pairs::open(folder.path(), &[], "").unwrap();
            assert_eq!(names(&pairs), ["1"], "{files:?}");
            assert!(pairs.unmatched.is_empty(), "{files:?}");
        }
    }

    #[test]
    fn light_words_inside_other_words_are_ignored() {
        let others = ["YELLOW.png", "highway.png", "way.png", "yellow.png"];
        let files = [&["normal1.png", "low1.png"][..], &others].concat();
        let folder = folder(&files);
        let pairs = Pairs::open(folder.path(), &[], "").unwrap();
        let unmatched: Vec<String> = pairs.unmatched.iter().map(|path| file_name(path)).collect();
        assert_eq!((names(&pairs), unmatched), (vec!["1"], others.map(str::to_owned).to_vec()));
    }

    #[test]
    fn images_without_a_partner_are_unmatched() {
        let folder = folder(&["normal1.png", "low1.png", "low1_edited.png", "high3.png", "x.png"]);
        let pairs = Pairs::open(folder.path(), &[], "").unwrap();
        let unmatched: Vec<String> = pairs.unmatched.iter().map(|path| file_name(path)).collect();
        assert_eq!(unmatched, ["high3.png", "low1_edited.png", "x.png"]);
    }

    #[test]
    fn missing_pairs_and_duplicate_names_are_errors() {
        let none = folder(&["a.png", "low/1.png"]);
        let error = Pairs::open(none.path(), &[], "name two folders").unwrap_err().to_string();
        assert!(error.ends_with("; name two folders"), "{error}");
        let two = folder(&["normal1.png", "low1.png", "low1.jpg"]);
        let error = Pairs::open(two.path(), &[], "").unwrap_err().to_string();
        assert!(error.contains("same name"), "{error}");
        let apart = folder(&["normal/1.png", "low/2.png"]);
        assert!(Pairs::open(apart.path(), &[], "").is_err());
    }
}
