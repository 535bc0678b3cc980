//! Several data sets of one kind as one: [`Combined`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing};
use crate::error::{Error, Result};
use crate::types::{Intrinsics, Rgb};

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
    pub(super) fn new(folders: &[PathBuf], parts: Vec<Box<dyn Adapter>>) -> Result<Self> {
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
