//! A folder of the common interface: taken over as it is, so that key frames can be chosen of it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::adapter::{Adapter, Incoming, Read};
use super::files::text;
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::types::{DepthKind, Frame, FrameId, Intrinsics, Labels, Rgb, SegmentName, Segmentation};

/// The frames of a folder.
#[derive(Debug)]
pub(super) struct Interface {
    dataset: Dataset,
    frames: Vec<Incoming>,
    labels: Labels,
    depth_kind: DepthKind,
    segmentation: Segmentation,
    segmented: bool,
    unlisted: BTreeMap<String, usize>,
}

/// What is read of a line of `frames.jsonl` beyond what the data set itself reads.
#[derive(Deserialize)]
struct Line {
    scene: String,
    frame: String,
    t: Option<f64>,
    pose: Option<Vec<f64>>,
    intrinsics: Option<Intrinsics>,
    room_gt: Option<String>,
    over: Option<String>,
    over_source: Option<String>,
    depth_kind: Option<DepthKind>,
}

impl Interface {
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let dataset = Dataset::of_frames(folder)?;
        let Some(labels) = dataset.labels().cloned() else {
            return Err(Error::data(
                folder.display(),
                "no classes.json in this folder",
            ));
        };
        let list = folder.join("frames.jsonl");
        let content = text(&list)?;
        let lines = content
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty());
        let lines = lines
            .map(|(i, line)| {
                serde_json::from_str(line).map_err(|e| Error::json_line(&list, i + 1, &e))
            })
            .collect::<Result<Vec<Line>>>()?;
        let parts = lines
            .iter()
            .any(|line| line.over_source.as_deref() == Some("superpixel"));
        let mut set = Self {
            labels,
            depth_kind: lines
                .iter()
                .find_map(|line| line.depth_kind)
                .unwrap_or_default(),
            segmentation: if parts {
                Segmentation::Parts
            } else {
                Segmentation::Instances
            },
            segmented: lines.iter().any(|line| line.over.is_some()),
            unlisted: BTreeMap::new(),
            frames: Vec::new(),
            dataset,
        };
        for (index, line) in lines.into_iter().enumerate() {
            let id = FrameId(format!("{}/{}", line.scene, line.frame));
            let Some(rgb) = set.dataset.image_file(&id) else {
                continue;
            };
            set.frames.push(Incoming {
                rgb: rgb.to_owned(),
                scene: line.scene,
                frame: line.frame,
                time: line.t,
                pose: line.pose,
                intrinsics: line.intrinsics,
                room: line.room_gt,
                index,
            });
        }
        set.frames
            .sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(set)
    }

    fn frame(&self, frame: &Incoming) -> Result<Frame> {
        self.dataset
            .frame(&FrameId(format!("{}/{}", frame.scene, frame.frame)))
    }
}

impl Adapter for Interface {
    fn frames(&self) -> &[Incoming] {
        &self.frames
    }

    fn labels(&self) -> &Labels {
        &self.labels
    }

    fn names(&self, scene: &str) -> BTreeMap<u32, SegmentName> {
        let of_scene = self.frames.iter().find(|frame| frame.scene == scene);
        let frame = of_scene.and_then(|frame| self.frame(frame).ok());
        frame.map_or_else(BTreeMap::new, |frame| frame.names.as_ref().clone())
    }

    fn depth_kind(&self) -> DepthKind {
        self.depth_kind
    }

    fn segmentation(&self) -> Segmentation {
        self.segmentation
    }

    fn has_segments(&self) -> bool {
        self.segmented
    }

    fn unlisted(&self) -> &BTreeMap<String, usize> {
        &self.unlisted
    }

    fn read(&self, frame: &Incoming, _rgb: &Rgb) -> Result<Read> {
        let Frame {
            depth,
            semantic,
            segments,
            ..
        } = self.frame(frame)?;
        Ok(Read {
            depth,
            semantic,
            segments,
            room: None,
        })
    }
}
