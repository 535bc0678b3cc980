//! Folders of images and maps with the same file names.
//!
//! The folders are `rgb`, `depth`, `sem` and `over` (or the names of other tools), in the folder itself or in one
//! folder per scene.
//!
//! A folder of frames in the format of this program, imported to choose key frames: [`FrameFolder`].
//!
//! Files of a folder that an import does not read: [`UnreadFiles`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::files::{
    Adapter, FrameMaps, IMAGES, ListedFrame, Listing, MAPS, MapArgs, MapFiles, files, first_folder, folders, labels,
};
use crate::frames::ImagePaths;
use crate::{Dataset, ImageSource, open_frames};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{entries, json_lines};
use darkqa_base::types::{DepthKind, Frame, FrameId, Labels, Rgb, Segmentation};

/// Names of the folders of images, depth, classes and segments.
const RGB: [&str; 6] = ["rgb", "image", "images", "color", "img", "RGB"];
const DEPTH: [&str; 3] = ["depth", "depths", "Depth"];
const CLASSES: [&str; 8] = ["sem", "semantic", "semantics", "label", "labels", "semantic_class", "mask", "masks"];
const SEGMENTS: [&str; 6] = ["over", "instance", "instances", "semantic_instance", "segment", "segments"];

/// Data set in folders of images and maps.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) listing: Listing,
    maps: Vec<MapFiles>,
    depth_scale: Option<f64>,
    /// Conversion from the numbers of the class maps to those of the label space.
    offset: NumberOffset,
    /// All files in the folders of images.
    image_folder_files: Vec<PathBuf>,
    /// File of the label space, if it is in the folder.
    labels_file: Option<PathBuf>,
}

/// Offset between the numbers of class maps and of the label space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberOffset {
    /// The numbers are equal.
    None,
    /// The numbers of class maps are one less, with 255 for void.
    One,
}

impl Folder {
    pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Self> {
        let own_labels = folder.join("classes.json");
        let (labels, labels_file) = match labels(args)? {
            Some(labels) => (labels, None),
            None if own_labels.is_file() => (darkqa_base::labels::read(&own_labels)?, Some(own_labels)),
            None => {
                let problem = "the label space of the class maps is missing; nyu40, nyu13, mpcat40, ade150 or the path of a classes.json expected";
                return Err(Error::usage("--labels", problem));
            }
        };
        let set = Self::with_labels(folder, args, labels, NumberOffset::None)?;
        Ok(Self { labels_file, ..set })
    }

    pub(super) fn with_labels(folder: &Path, args: &MapArgs, labels: Labels, offset: NumberOffset) -> Result<Self> {
        let mut set = Self {
            listing: Listing {
                labels,
                depth_kind: args.depth_kind.unwrap_or_default(),
                hfov: args.hfov,
                ..Listing::default()
            },
            maps: Vec::new(),
            depth_scale: args.depth_scale,
            offset,
            image_folder_files: Vec::new(),
            labels_file: None,
        };
        if first_folder(folder, &RGB).is_some() {
            set.add_scene(folder)?;
        } else {
            let nested = folder.join("scenes");
            for scene in folders(if nested.is_dir() { &nested } else { folder })? {
                if first_folder(&scene, &RGB).is_some() {
                    set.add_scene(&scene)?;
                }
            }
        }
        ImagePaths::from_paths(std::mem::take(&mut set.image_folder_files)).warn_of_unsupported(folder);
        Ok(set)
    }

    fn add_scene(&mut self, folder: &Path) -> Result<()> {
        let scene = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let scene = scene.file_name().map_or_else(|| "scene".into(), |name| name.to_string_lossy().into_owned());
        let images = files_in_first(folder, &RGB, &IMAGES)?;
        if let Some(folder) = first_folder(folder, &RGB) {
            self.image_folder_files.extend(entries(&folder)?);
        }
        let mut depths = files_in_first(folder, &DEPTH, &MAPS)?;
        let mut classes = files_in_first(folder, &CLASSES, &MAPS)?;
        let mut segments = files_in_first(folder, &SEGMENTS, &MAPS)?;
        for (frame, rgb) in images {
            self.maps.push(MapFiles {
                depth: depths.remove(&frame),
                classes: classes.remove(&frame),
                segments: segments.remove(&frame),
            });
            let index = self.maps.len() - 1;
            let listed = ListedFrame::new(&scene, frame, rgb, index);
            self.listing.frames.push(listed);
        }
        let unmatched = depths.into_values().chain(classes.into_values()).chain(segments.into_values());
        if let Some(map) = unmatched.min() {
            return Err(Error::data(map.display(), "no image has the name of this map"));
        }
        Ok(())
    }
}

/// Files in the first of these subfolders that exists, by stem.
fn files_in_first(folder: &Path, names: &[&str], endings: &[&str]) -> Result<BTreeMap<String, PathBuf>> {
    match first_folder(folder, names) {
        Some(folder) => files(&folder, endings),
        None => Ok(BTreeMap::new()),
    }
}

impl Adapter for Folder {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn assumes_metres(&self) -> bool {
        self.depth_scale.is_none()
    }

    fn other_files(&self) -> Vec<PathBuf> {
        MapFiles::paths(&self.maps).chain(&self.labels_file).cloned().collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let mut maps = self.maps[frame.index].read(self.depth_scale, rgb)?;
        if let Some(classes) = &mut maps.semantic
            && self.offset == NumberOffset::One
        {
            classes.mapv_inplace(|id| if id == 255 { 0 } else { id + 1 });
        }
        Ok(maps)
    }
}

/// Folder of frames in the format of this program.
#[derive(Debug)]
pub(super) struct FrameFolder {
    folder: PathBuf,
    dataset: Dataset,
    listing: Listing,
}

/// Fields of a line of `frames.jsonl` that [`Dataset`] does not read.
#[derive(Deserialize)]
struct FrameLine {
    scene: String,
    frame: String,
    t: Option<f64>,
    pose: Option<Vec<f64>>,
    depth_kind: Option<DepthKind>,
}

impl FrameFolder {
    pub(super) fn open(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        let dataset = open_frames(folder, further)?;
        let Some(labels) = dataset.labels().cloned() else {
            return Err(Error::data(folder.display(), "no classes.json in this folder"));
        };
        let lines = json_lines::<FrameLine>(&folder.join("frames.jsonl"))?;
        let depth_kind = lines.iter().find_map(|(_, line)| line.depth_kind);
        let mut listing = Listing { labels, depth_kind: depth_kind.unwrap_or_default(), ..Listing::default() };
        for (index, (_, line)) in lines.into_iter().enumerate() {
            let id = FrameId(format!("{}/{}", line.scene, line.frame));
            let Some(ImageSource::File(file)) = dataset.sources.get(&id) else {
                continue;
            };
            let facts = &file.facts;
            if facts.segmentation == Segmentation::Parts {
                listing.segmentation = Segmentation::Parts;
            }
            listing.names.entry(line.scene.clone()).or_insert_with(|| facts.names.as_ref().clone());
            listing.frames.push(ListedFrame {
                rgb: file.rgb.clone(),
                scene: line.scene,
                frame: line.frame,
                time: line.t,
                pose: line.pose,
                intrinsics: facts.intrinsics,
                room: facts.room.clone(),
                index,
            });
        }
        listing.frames.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(Self { folder: folder.to_owned(), dataset, listing })
    }
}

impl Adapter for FrameFolder {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn other_files(&self) -> Vec<PathBuf> {
        let folder_files = ["frames.jsonl", "classes.json", "dataset.json"].map(|name| self.folder.join(name));
        let segment_names =
            self.listing.names.keys().map(|scene| self.folder.join("scenes").join(scene).join("segments.json"));
        let maps = self
            .dataset
            .sources
            .values()
            .filter_map(|source| match source {
                ImageSource::File(file) => Some(file.maps.paths()),
                _ => None,
            })
            .flatten();
        folder_files.into_iter().chain(segment_names).chain(maps).collect()
    }

    fn read_maps(&self, frame: &ListedFrame, _rgb: &Rgb) -> Result<FrameMaps> {
        let Frame { depth, semantic, segments, .. } =
            self.dataset.frame(&FrameId(format!("{}/{}", frame.scene, frame.frame)))?;
        Ok(FrameMaps { depth, semantic, segments, room: None })
    }
}

/// Maximum number of kinds of files in the message.
const MAX_NAMED_KINDS: usize = 8;

/// Unread files by kind: the name of their folder and their extension.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct UnreadFiles(BTreeMap<String, FilesOfKind>);

#[derive(Debug, PartialEq, Eq)]
struct FilesOfKind {
    count: usize,
    /// Relative path of the first file.
    first: String,
}

impl UnreadFiles {
    /// Finds the files in a folder and its subfolders that are not in `read`. Links to folders are not followed.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub(super) fn in_folder(folder: &Path, read: &BTreeSet<PathBuf>) -> Result<Self> {
        let mut unread = Self::default();
        unread.add_folder(folder, folder, read)?;
        Ok(unread)
    }

    fn add_folder(&mut self, root: &Path, folder: &Path, read: &BTreeSet<PathBuf>) -> Result<()> {
        for path in entries(folder)? {
            if path.is_symlink() && path.is_dir() {
                continue;
            }
            if path.is_dir() {
                self.add_folder(root, &path, read)?;
            } else if !read.contains(&path) {
                self.count(path.strip_prefix(root).unwrap_or(&path));
            }
        }
        Ok(())
    }

    /// Counts a file, given by its relative path.
    fn count(&mut self, path: &Path) {
        let folder = text(path.parent().and_then(Path::file_name));
        let name = match path.extension() {
            Some(ending) => format!("*.{}", ending.to_string_lossy()),
            None => text(path.file_name()),
        };
        let kind = if folder.is_empty() { name } else { format!("{folder}/{name}") };
        let files = self.0.entry(kind).or_insert_with(|| FilesOfKind { count: 0, first: path.display().to_string() });
        files.count += 1;
    }

    /// Adds the files of another folder.
    pub(super) fn merge(&mut self, other: Self) {
        for (kind, files) in other.0 {
            self.0.entry(kind).and_modify(|known| known.count += files.count).or_insert(files);
        }
    }

    /// Line with the unread files, the most frequent kinds first; empty if there are none.
    pub fn line(&self) -> String {
        if self.0.is_empty() {
            return String::new();
        }
        let mut kinds: Vec<(&String, &FilesOfKind)> = self.0.iter().collect();
        kinds.sort_by_key(|(kind, files)| (std::cmp::Reverse(files.count), *kind));
        let mut named: Vec<String> = kinds
            .iter()
            .take(MAX_NAMED_KINDS)
            .map(|(kind, files)| match files.count {
                1 => files.first.clone(),
                count => format!("{count} {kind}"),
            })
            .collect();
        let more: usize = kinds.iter().skip(MAX_NAMED_KINDS).map(|(_, files)| files.count).sum();
        if more > 0 {
            named.push(format!("{more} more"));
        }
        format!("not read: {}\n", named.join(", "))
    }
}

fn text(part: Option<&std::ffi::OsStr>) -> String {
    part.unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn write(folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "").unwrap();
        path
    }

    #[test]
    fn unread_files_are_counted_by_kind() {
        let folder = tempfile::tempdir().unwrap();
        let read: BTreeSet<PathBuf> = ["s0/rgb/0.png", "s0/rgb/1.png"].map(|name| write(folder.path(), name)).into();
        assert_eq!(UnreadFiles::in_folder(folder.path(), &read).unwrap().line(), "");
        for name in ["s0/sem/0.tif", "s1/sem/1.tif", "s0/note", "README.md"] {
            write(folder.path(), name);
        }
        let unread = UnreadFiles::in_folder(folder.path(), &read).unwrap();
        assert_eq!(unread.line(), "not read: 2 sem/*.tif, README.md, s0/note\n");
        for number in 0..9 {
            write(folder.path(), &format!("more/{number}.e{number}"));
        }
        let line = UnreadFiles::in_folder(folder.path(), &read).unwrap().line();
        assert!(line.ends_with(", 4 more\n"), "{line}");
    }
}
