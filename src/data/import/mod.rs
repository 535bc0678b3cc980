//! Import of other data sets to a folder of frames.
//!
//! An [`Adapter`] lists the frames of one kind of data set and reads their maps one frame at a time. All adapters use
//! the same units: depth in millimetres, class numbers of a label space, segment numbers from 1.
//! `src/docs/importing.md` shows the layouts. Recordings of robots have no maps and no adapter: [`recording`] and
//! [`lerobot`] read them.
//!
//! NYU Depth v2 as PNG files: folders of images, depth and labels with the same file names, read by [`folder`].
//!
//! The labels have 40 classes (`--labels nyu40`, the default; 0 is void), 13 (`nyu13`), or 40 counted from 0 with 255
//! for void, as several tools write them (`nyu40-1`). Depth files exist in millimetres, in 1/5000 m and scaled to the
//! range of 16 bits, so `--depth-scale` is required.
//!
//! Several data sets of one kind as one: [`Combined`].

mod files;
mod folder;
mod habitat;
mod hypersim;
pub mod keyframes;
pub mod lerobot;
pub mod recording;
mod scannet;
mod sunrgbd;
mod thor;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::Root;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::flag_words;
use darkqa_base::types::{Intrinsics, Rgb};
use files::{Listing, SizedCamera, labels};
use folder::{Folder, NumberOffset};

pub use files::{Adapter, FrameMaps, ListedFrame, MapArgs};
pub use folder::UnreadFiles;

/// Kind of data set in a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum DataSetKind {
    /// Renders of habitat-sim: HM3D-Sem, Matterport3D, Replica.
    Habitat,
    /// Frames of ScanNet, extracted.
    Scannet,
    /// NYU Depth v2 as PNG files.
    Nyu,
    /// SUN RGB-D.
    Sunrgbd,
    /// A dump of AI2-THOR or ProcTHOR.
    Thor,
    /// Hypersim.
    Hypersim,
    /// Folders of images and maps by name, or a folder of the common interface.
    Folder,
}

flag_words!(DataSetKind);

/// Opens data sets of one kind in several folders as one data set. Paths in a list of frames may also lead into the
/// folders in `further`.
///
/// # Errors
/// As [`open`], or if the data sets cannot be combined.
pub fn open_all(
    kind: DataSetKind,
    folders: &[PathBuf],
    args: &MapArgs,
    further: &[PathBuf],
) -> Result<Box<dyn Adapter>> {
    let mut parts = Vec::with_capacity(folders.len());
    for folder in folders {
        parts.push(open(kind, folder, args, further)?);
    }
    if parts.len() > 1 {
        return Ok(Box::new(Combined::new(folders, parts)?));
    }
    parts.pop().ok_or_else(|| Error::usage("--src", "a folder of a data set expected"))
}

/// Files in the folders of a data set that are not read.
///
/// # Errors
/// If a folder cannot be read.
pub fn unread_files(folders: &[PathBuf], adapter: &dyn Adapter) -> Result<UnreadFiles> {
    let read: BTreeSet<PathBuf> =
        adapter.listing().frames.iter().map(|frame| frame.rgb.clone()).chain(adapter.other_files()).collect();
    let mut unread = UnreadFiles::default();
    for folder in folders {
        unread.merge(UnreadFiles::in_folder(folder, &read)?);
    }
    Ok(unread)
}

/// Opens a data set.
///
/// # Errors
/// If a file or folder is missing or has another layout, a link leads out of the folder, or a required flag is missing;
/// the error names it.
fn open(kind: DataSetKind, folder: &Path, args: &MapArgs, further: &[PathBuf]) -> Result<Box<dyn Adapter>> {
    if !folder.is_dir() {
        return Err(Error::usage("--src", format_args!("{}: no such folder", folder.display())));
    }
    Root::new(folder, further)?.refuse_links_out()?;
    let adapter: Box<dyn Adapter> = match kind {
        DataSetKind::Habitat => Box::new(habitat::Habitat::open(folder, args)?),
        DataSetKind::Scannet => Box::new(scannet::Scannet::open(folder, args)?),
        DataSetKind::Nyu => Box::new(open_nyu(folder, args)?),
        DataSetKind::Sunrgbd => Box::new(sunrgbd::SunRgbd::open(folder)?),
        DataSetKind::Thor => Box::new(thor::Thor::open(folder, args)?),
        DataSetKind::Hypersim => Box::new(hypersim::Hypersim::open(folder, args)?),
        DataSetKind::Folder if folder.join("frames.jsonl").exists() => {
            Box::new(folder::FrameFolder::open(folder, further)?)
        }
        DataSetKind::Folder => Box::new(folder::Folder::open(folder, args)?),
    };
    if adapter.listing().frames.is_empty() {
        let problem = format_args!(
            "no frames of {kind} in this folder; see the layouts: https://github.com/darkqa-eval/darkqa-eval/blob/main/src/docs/importing.md"
        );
        return Err(Error::data(folder.display(), problem));
    }
    Ok(adapter)
}

/// Colour camera of the Kinect (NYU Depth v2 toolbox, `camera_params.m`).
const KINECT: SizedCamera = SizedCamera {
    size: (640, 480),
    camera: Intrinsics { fx: 518.857_901, fy: 519.469_612, cx: 325.582_449, cy: 253.736_166 },
};

/// Opens a folder of PNG files.
fn open_nyu(folder: &Path, args: &MapArgs) -> Result<Folder> {
    let (name, offset) = match args.labels.as_deref() {
        None => ("nyu40", NumberOffset::None),
        Some("nyu40-1") => ("nyu40", NumberOffset::One),
        Some(name) => (name, NumberOffset::None),
    };
    let args = &MapArgs { labels: Some(name.to_owned()), ..args.clone() };
    let labels = labels(args)?.unwrap_or_default();
    let mut set = Folder::with_labels(folder, args, labels, offset)?;
    set.listing.sensor = Some(KINECT);
    Ok(set)
}

/// Data sets of several folders. If two of them have a scene of the same name, the number of the folder, from 1, is put
/// before it: `2-kitchen`.
#[derive(Debug)]
pub(super) struct Combined {
    parts: Vec<Box<dyn Adapter>>,
    listing: Listing,
    /// Part of each frame, and its index among the frames of the part.
    part_frames: Vec<(usize, usize)>,
}

impl Combined {
    /// Combines the data sets in these folders.
    ///
    /// # Errors
    /// If their labels, kinds of depth or kinds of segments differ. The error names the two folders.
    fn new(folders: &[PathBuf], parts: Vec<Box<dyn Adapter>>) -> Result<Self> {
        let mut scene_counts: BTreeMap<&String, usize> = BTreeMap::new();
        for part in &parts {
            let scenes: BTreeSet<&String> = part.listing().frames.iter().map(|frame| &frame.scene).collect();
            for scene in scenes {
                *scene_counts.entry(scene).or_default() += 1;
            }
        }
        let unique_name = |number: usize, scene: &String| {
            if scene_counts.get(scene).is_some_and(|count| *count > 1) {
                format!("{}-{scene}", number + 1)
            } else {
                scene.clone()
            }
        };
        let mut combined = Listing::default();
        let mut part_frames = Vec::new();
        for (number, part) in parts.iter().enumerate() {
            let own = part.listing();
            if number == 0 {
                combined.labels = own.labels.clone();
                combined.depth_kind = own.depth_kind;
                combined.segmentation = own.segmentation;
                combined.renders.clone_from(&own.renders);
            }
            let differing = [
                ("class numbers (classes.json, --labels)", combined.labels == own.labels),
                ("kinds of depth", combined.depth_kind == own.depth_kind),
                ("kinds of segments", combined.segmentation == own.segmentation),
            ];
            if let Some((what, _)) = differing.into_iter().find(|(_, is_same)| !is_same) {
                let problem = format_args!(
                    "{} and {} have different {what}; import each with its own --out",
                    folders[0].display(),
                    folders[number].display()
                );
                return Err(Error::usage("--src", problem));
            }
            if number > 0 && (combined.renders.is_some() || own.renders.is_some()) {
                combined.renders = None;
                tracing::warn!("scenes.json is not carried over from several folders");
            }
            for (index, frame) in own.frames.iter().enumerate() {
                combined.frames.push(ListedFrame {
                    scene: unique_name(number, &frame.scene),
                    index: part_frames.len(),
                    ..frame.clone()
                });
                part_frames.push((number, index));
            }
            for (scene, names) in &own.names {
                combined.names.insert(unique_name(number, scene), names.clone());
            }
            for (word, count) in &own.unlisted {
                *combined.unlisted.entry(word.clone()).or_default() += count;
            }
        }
        combined.frames.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(Self { parts, listing: combined, part_frames })
    }

    /// Data set of a frame, and the frame in its listing.
    fn part(&self, frame: &ListedFrame) -> (&dyn Adapter, &ListedFrame) {
        let (part, index) = self.part_frames[frame.index];
        let part = &*self.parts[part];
        (part, &part.listing().frames[index])
    }
}

impl Adapter for Combined {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn camera(&self, frame: &ListedFrame, rgb: &Rgb) -> Option<Intrinsics> {
        let (part, frame) = self.part(frame);
        part.camera(frame, rgb)
    }

    fn depth_folder(&self, frame: &ListedFrame) -> Option<&'static str> {
        let (part, frame) = self.part(frame);
        part.depth_folder(frame)
    }

    fn assumes_metres(&self) -> bool {
        self.parts.iter().any(|part| part.assumes_metres())
    }

    fn other_files(&self) -> Vec<PathBuf> {
        self.parts.iter().flat_map(|part| part.other_files()).collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let (part, frame) = self.part(frame);
        part.read_maps(frame, rgb)
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;

    #[test]
    fn every_kind_is_described_and_tested() {
        let page = include_str!("../../docs/importing.md");
        let tests = include_str!("../../../tests/program/data/import.rs");
        let missing: Vec<String> = DataSetKind::value_variants()
            .iter()
            .map(ToString::to_string)
            .filter(|kind| !page.contains(&format!("\n## {kind}: ")) || !tests.contains(&format!("\"{kind}\"")))
            .collect();
        assert!(missing.is_empty(), "src/docs/importing.md or tests/program/data/import.rs lacks {missing:?}");
    }
}
