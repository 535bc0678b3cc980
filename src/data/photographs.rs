//! Images at a place, without its own questions: [`Photographs`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::dataset::{Dataset, stem};
use super::frames::{self, ImagePaths, MissingFiles, is_image, open_images};
use super::ready_made::SetArgs;
use super::root::Root;
use super::source::{DataSource, is_lerobot_set, with_import_hint};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::counted;
use darkqa_pictures::image_file::format::SUPPORTED_FORMATS;

/// Images at a place, for questions that are asked about every image.
#[derive(Debug)]
pub struct Photographs {
    /// Images without questions.
    pub dataset: Dataset,
    /// Messages for the user: ignored questions, and how images are named.
    pub notes: Vec<String>,
}

impl Photographs {
    /// Lists the images at a place. No image is read.
    ///
    /// - A folder with a `frames.jsonl`: the frames in it.
    /// - Any other folder: all images in it and in its subfolders, named by their relative paths. Hidden files are
    ///   skipped.
    /// - An image file: this image.
    /// - The built-in rooms and ready-made sets: their images. A folder of Parquet files without other images is such a
    ///   set.
    ///
    /// # Errors
    /// If the place cannot be read, or has no image.
    pub fn open(place: &DataSource, set: &SetArgs) -> Result<Self> {
        Self::open_place(place, set).map_err(|e| with_import_hint(place.path(), e))
    }

    fn open_place(place: &DataSource, set: &SetArgs) -> Result<Self> {
        let dataset = match place {
            DataSource::Rooms(rooms) => Dataset::from_rooms(*rooms),
            DataSource::Path(path) if path.is_dir() => return Self::open_folder(path, set),
            DataSource::Path(path) if is_image(path) => open_images(path, &[])?,
            DataSource::Path(_) | DataSource::Files(_) | DataSource::Known { .. } => {
                return Self::open_set(place, set);
            }
        };
        Ok(Self { dataset, notes: Vec::new() })
    }

    /// The images of a ready-made set, whose rows need no questions.
    fn open_set(place: &DataSource, set: &SetArgs) -> Result<Self> {
        let set = SetArgs { images_alone: true, ..set.clone() };
        let dataset = place.open_without_hint(None, &set)?;
        let images = counted(dataset.frames().count(), "image");
        let note = format!("{place}: {images}; questions in it are ignored, and those of --ask are asked");
        Ok(Self { dataset: dataset.without_questions(), notes: vec![note] })
    }

    fn open_folder(folder: &Path, set: &SetArgs) -> Result<Self> {
        let further = &set.root.data_root;
        let mut notes = Vec::new();
        let own = folder.join(frames::QUESTIONS);
        let own = own.exists().then_some(own);
        for file in own.into_iter().chain(frames::other_question_files(folder)) {
            notes.push(format!("{} is ignored: the questions are those of --ask", file.display()));
        }
        if folder.join(frames::FRAMES).exists() {
            let dataset = frames::frames(folder, further, MissingFiles::new(set.bad))?;
            return Ok(Self { dataset, notes });
        }
        let root = Root::new(folder, further)?;
        let mut scan = PhotographScan::default();
        scan.add_folder(&root, folder)?;
        let has_parquet =
            scan.files.iter().any(|path| path.extension().is_some_and(|name| name.eq_ignore_ascii_case("parquet")));
        let found = ImagePaths::from_paths(scan.files);
        let mut sources = BTreeMap::new();
        for path in &found.images {
            let parts: Vec<_> =
                path.strip_prefix(folder).unwrap_or(path).iter().map(|part| part.to_string_lossy()).collect();
            frames::insert_image(&mut sources, parts.join("/"), path)?;
        }
        if sources.is_empty() && has_parquet && !is_lerobot_set(folder) {
            return Self::open_set(&DataSource::Path(folder.to_owned()), set);
        }
        if sources.is_empty() {
            let unread = found.unsupported_note().map_or(String::new(), |unread| format!("; {unread}"));
            let problem = format_args!("no {SUPPORTED_FORMATS} image in this folder or below{unread}");
            return Err(Error::data(folder.display(), problem));
        }
        found.warn_of_unsupported(folder);
        root.warn_of_links_out(&scan.links_out);
        if sources.keys().any(|id| id.0.contains('/')) {
            notes.push(format!(
                "{}: {} in it and in the folders below, each named by its path from there",
                folder.display(),
                counted(sources.len(), "image")
            ));
        }
        Ok(Self { dataset: Dataset::new(stem(folder), sources, Vec::new()), notes })
    }
}

/// Files in a folder and its subfolders.
#[derive(Debug, Default)]
struct PhotographScan {
    files: Vec<PathBuf>,
    /// Canonical paths of the scanned folders, so that a link to one of them is not followed again.
    seen: BTreeSet<PathBuf>,
    /// Links that lead outside the folder.
    links_out: Vec<PathBuf>,
}

impl PhotographScan {
    fn add_folder(&mut self, root: &Root, folder: &Path) -> Result<()> {
        let real = folder.canonicalize().map_err(|e| Error::file(folder, "read", e))?;
        if !self.seen.insert(real) {
            return Ok(());
        }
        for path in root.entries(folder, &mut self.links_out)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with('.') {
                continue;
            }
            if path.is_dir() {
                self.add_folder(root, &path)?;
            } else {
                self.files.push(path);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use image::RgbImage;

    use super::*;

    fn found(path: &Path) -> Result<(Vec<String>, Vec<String>)> {
        let found = Photographs::open(&DataSource::Path(path.to_owned()), &SetArgs::default())?;
        let names = found.dataset.frames().map(|id| id.0.clone());
        Ok((names.collect(), found.notes))
    }

    fn save(folder: &Path, name: &str) {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        RgbImage::new(2, 1).save(path).unwrap();
    }

    #[test]
    fn images_in_subfolders_are_named_by_path() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.png", "living/a.png", "living/deep/a.png", ".hidden/x.png"] {
            save(folder.path(), name);
        }
        fs::write(folder.path().join("notes.txt"), "").unwrap();
        let (names, notes) = found(folder.path()).unwrap();
        assert_eq!(names, ["b.png", "living/a.png", "living/deep/a.png"]);
        assert!(notes[0].contains("3 images in it and in the folders below"), "{notes:?}");
        let (names, notes) = found(&folder.path().join("living/deep")).unwrap();
        assert_eq!((names, notes.len()), (vec!["a.png".to_owned()], 0));
        assert_eq!(found(&folder.path().join("b.png")).unwrap().0, ["b.png"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_out_and_cycles_are_not_followed() {
        use std::os::unix::fs::symlink;
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        save(folder.path(), "in/a.png");
        save(outside.path(), "secret.png");
        for (target, name) in [
            (&*outside.path().join("secret.png"), "secret.png"),
            (outside.path(), "out"),
            (folder.path(), "in/again"),
            (&folder.path().join("in/a.png"), "b.png"),
        ] {
            symlink(target, folder.path().join(name)).unwrap();
        }
        assert_eq!(found(folder.path()).unwrap().0, ["b.png", "in/a.png"]);
    }

    #[test]
    fn folder_without_image_is_refused_and_its_questions_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let problem = found(folder.path()).unwrap_err().to_string();
        assert!(problem.ends_with("image in this folder or below"), "{problem}");
        fs::write(folder.path().join("a.heic"), "").unwrap();
        let problem = found(folder.path()).unwrap_err().to_string();
        assert!(problem.contains("1 file looks like an image"), "{problem}");
        save(folder.path(), "a.png");
        fs::write(folder.path().join("questions.jsonl"), "not read").unwrap();
        let (names, notes) = found(folder.path()).unwrap();
        assert_eq!(names, ["a.png"]);
        assert!(notes[0].contains("questions.jsonl is ignored"), "{notes:?}");
    }
}
