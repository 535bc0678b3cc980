//! A folder of frames in the format of this program, imported to choose key frames: [`FrameFolder`].

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing};
use crate::data::{Dataset, ImageSource};
use crate::error::{Error, Result};
use crate::files::reading::json_lines;
use crate::types::{DepthKind, Frame, FrameId, Rgb, Segmentation};

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
        let dataset = Dataset::from_frames(folder, further)?;
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
