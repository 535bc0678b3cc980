//! Several data sets of one kind as one: [`Joined`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing};
use crate::error::{Error, Result};
use crate::types::{Intrinsics, Rgb};

/// The data sets in several folders. A scene whose name occurs in two of them gets the number of its folder, from 1: `2-kitchen`.
#[derive(Debug)]
pub(super) struct Joined {
    parts: Vec<Box<dyn Adapter>>,
    listing: Listing,
    /// The part of each frame, and its index among the frames of the part.
    places: Vec<(usize, usize)>,
}

impl Joined {
    /// Joins the data sets in these folders.
    ///
    /// # Errors
    /// If their labels, depth or segments mean different things. The error names the two folders.
    pub(super) fn new(folders: &[PathBuf], parts: Vec<Box<dyn Adapter>>) -> Result<Self> {
        let mut holders: BTreeMap<&String, usize> = BTreeMap::new();
        for part in &parts {
            let mut scenes: Vec<&String> = part
                .listing()
                .frames
                .iter()
                .map(|frame| &frame.scene)
                .collect();
            scenes.dedup();
            scenes.sort_unstable();
            scenes.dedup();
            for scene in scenes {
                *holders.entry(scene).or_default() += 1;
            }
        }
        let name = |number: usize, scene: &String| {
            if holders.get(scene).is_some_and(|count| *count > 1) {
                format!("{}-{scene}", number + 1)
            } else {
                scene.clone()
            }
        };
        let mut joined = Listing::default();
        let mut places = Vec::new();
        for (number, part) in parts.iter().enumerate() {
            let own = part.listing();
            if number == 0 {
                joined.labels = own.labels.clone();
                joined.depth_kind = own.depth_kind;
                joined.segmentation = own.segmentation;
                joined.renders.clone_from(&own.renders);
            }
            let differing = [
                (
                    "class numbers (classes.json, --labels)",
                    joined.labels == own.labels,
                ),
                ("kinds of depth", joined.depth_kind == own.depth_kind),
                ("kinds of segments", joined.segmentation == own.segmentation),
            ];
            if let Some((what, _)) = differing.into_iter().find(|(_, is_same)| !is_same) {
                let problem = format_args!(
                    "{} and {} have different {what}; import each with its own --out",
                    folders[0].display(),
                    folders[number].display()
                );
                return Err(Error::usage("--src", problem));
            }
            if number > 0 && (joined.renders.is_some() || own.renders.is_some()) {
                joined.renders = None;
                tracing::warn!("scenes.json is not carried over from several folders");
            }
            for (index, frame) in own.frames.iter().enumerate() {
                joined.frames.push(ListedFrame {
                    scene: name(number, &frame.scene),
                    index: places.len(),
                    ..frame.clone()
                });
                places.push((number, index));
            }
            for (scene, names) in &own.names {
                joined.names.insert(name(number, scene), names.clone());
            }
            for (word, count) in &own.unlisted {
                *joined.unlisted.entry(word.clone()).or_default() += count;
            }
        }
        joined
            .frames
            .sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(Self {
            parts,
            listing: joined,
            places,
        })
    }

    /// The data set of a frame, and the frame as it is listed there.
    fn part(&self, frame: &ListedFrame) -> (&dyn Adapter, &ListedFrame) {
        let (part, index) = self.places[frame.index];
        let part = &*self.parts[part];
        (part, &part.listing().frames[index])
    }
}

impl Adapter for Joined {
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

    fn further_files(&self) -> Vec<PathBuf> {
        self.parts
            .iter()
            .flat_map(|part| part.further_files())
            .collect()
    }

    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let (part, frame) = self.part(frame);
        part.read(frame, rgb)
    }
}
