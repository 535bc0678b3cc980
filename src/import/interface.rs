//! A folder of the common interface, imported unchanged, so that key frames can be chosen from it.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing};
use crate::dataset::{Dataset, ImageSource};
use crate::error::{Error, Result};
use crate::files::reading::json_lines;
use crate::types::{DepthKind, Frame, FrameId, Rgb, Segmentation};

/// An open folder of the common interface.
#[derive(Debug)]
pub(super) struct Interface {
    folder: PathBuf,
    dataset: Dataset,
    listing: Listing,
}

/// The keys of a line of `frames.jsonl` that are read here in addition to [`Dataset`].
#[derive(Deserialize)]
struct InterfaceLine {
    scene: String,
    frame: String,
    t: Option<f64>,
    pose: Option<Vec<f64>>,
    depth_kind: Option<DepthKind>,
}

impl Interface {
    pub(super) fn open(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        let dataset = Dataset::from_frames(folder, further)?;
        let Some(labels) = dataset.labels().cloned() else {
            return Err(Error::data(
                folder.display(),
                "no classes.json in this folder",
            ));
        };
        let lines = json_lines::<InterfaceLine>(&folder.join("frames.jsonl"))?;
        let depth_kind = lines.iter().find_map(|(_, line)| line.depth_kind);
        let mut listing = Listing {
            labels,
            depth_kind: depth_kind.unwrap_or_default(),
            ..Listing::default()
        };
        for (index, (_, line)) in lines.into_iter().enumerate() {
            let id = FrameId(format!("{}/{}", line.scene, line.frame));
            let Some(ImageSource::File(file)) = dataset.sources.get(&id) else {
                continue;
            };
            let facts = &file.facts;
            if facts.segmentation == Segmentation::Parts {
                listing.segmentation = Segmentation::Parts;
            }
            listing
                .names
                .entry(line.scene.clone())
                .or_insert_with(|| facts.names.as_ref().clone());
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
        listing
            .frames
            .sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(Self {
            folder: folder.to_owned(),
            dataset,
            listing,
        })
    }
}

impl Adapter for Interface {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn further_files(&self) -> Vec<PathBuf> {
        let about =
            ["frames.jsonl", "classes.json", "dataset.json"].map(|name| self.folder.join(name));
        let scenes = self.listing.names.keys();
        let names =
            scenes.map(|scene| self.folder.join("scenes").join(scene).join("segments.json"));
        let maps = self
            .dataset
            .sources
            .values()
            .filter_map(|source| match source {
                ImageSource::File(file) => Some(file.maps.paths()),
                _ => None,
            });
        about
            .into_iter()
            .chain(names)
            .chain(maps.flatten())
            .collect()
    }

    fn read(&self, frame: &ListedFrame, _rgb: &Rgb) -> Result<FrameMaps> {
        let Frame {
            depth,
            semantic,
            segments,
            ..
        } = self
            .dataset
            .frame(&FrameId(format!("{}/{}", frame.scene, frame.frame)))?;
        Ok(FrameMaps {
            depth,
            semantic,
            segments,
            room: None,
        })
    }
}
