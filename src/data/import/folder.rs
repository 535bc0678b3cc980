//! Folders of images and maps with the same file names.
//!
//! The folders are `rgb`, `depth`, `sem` and `over` (or the names of other tools), in the folder itself or in one
//! folder per scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing, MapArgs, labels};
use super::files::{IMAGES, MAPS, files, first_folder, folders};
use super::map_files::MapFiles;
use crate::data::image_paths::ImagePaths;
use crate::error::{Error, Result};
use crate::files::reading::entries;
use crate::types::{Labels, Rgb};

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
            None if own_labels.is_file() => (crate::labels::read(&own_labels)?, Some(own_labels)),
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
