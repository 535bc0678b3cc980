//! Walks through houses: their folder (`WalkFolder`), and the flags that decide which frames are shown and how ([`Walk`]).

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use rayon::prelude::*;
use serde::Serialize;

use crate::dataset::Picture;
use crate::dataset::openeqa::{sampled, walk};
use crate::error::Result;
use crate::images::frames::source::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use crate::picture::Scaling;
use crate::picture::{ImageFile, ReadingRule};
use crate::types::{Decides, FrameId};

/// Flags that decide which frames of a walk are shown, and how.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "OpenEQA")]
pub(crate) struct Walk {
    /// The folder of walks: the frames of a question lie in DIR/EPISODE_HISTORY/*-rgb.png
    #[arg(id = "frames", long, value_name = "DIR", add = Decides::Reply)]
    pub folder: PathBuf,
    /// How many frames of a walk are shown, spread evenly over it: 50 as upstream shows GPT-4V (Claude 3: 20, Gemini: 15)
    #[arg(id = "num-frames", long, value_name = "K", default_value = "50", add = Decides::Reply)]
    pub frames: NonZeroUsize,
    /// The longer side of the frames as sent, in pixels, or native; scaled as upstream does (OpenCV, bilinear)
    #[arg(id = "image-size", long, value_name = "PIXELS|native", value_parser = longer_side, default_value = "512", add = Decides::Pixels)]
    pub side: Scaling,
    /// When light is reduced: before or after scaling
    #[arg(id = "degrade", long, value_enum, default_value_t = DegradedAt::Native, add = Decides::Pixels)]
    pub degraded_at: DegradedAt,
    /// The frames that share one state of the camera
    #[arg(id = "sensor", long, value_enum, default_value_t = CameraOf::Episode, add = Decides::Pixels)]
    pub camera: CameraOf,
}

/// When the light of a frame is reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum DegradedAt {
    /// Before the frames are scaled, as a camera would
    Native,
    /// After the frames are scaled, so that scaling averages no noise away
    Resized,
}

/// The frames that share one state of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum CameraOf {
    /// All frames of a walk: one camera recorded it
    Episode,
    /// Each frame has its own
    Frame,
}

/// Longest side that a frame is scaled to, in pixels; chosen.
const MAX_SIDE: usize = 65_536;

/// Reads `512` or `native`.
fn longer_side(text: &str) -> Result<Scaling, String> {
    match (text, text.parse()) {
        ("native", _) => Ok(Scaling::Never),
        (_, Ok(side)) if (1..=MAX_SIDE).contains(&side) => Ok(Scaling::LongerSide(side)),
        _ => Err("a side in pixels or native expected".to_owned()),
    }
}

/// A folder of walks, each a folder of frames. The name of a frame is `WALK/FRAME`.
#[derive(Debug)]
pub(crate) struct WalkFolder {
    folder: PathBuf,
    rule: ReadingRule,
}

impl Frames for WalkFolder {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        let path = self.folder.join(format!("{frame}.png"));
        ImageFile::open(&path, self.rule).map(Picture::Encoded)
    }

    /// Folders of walks do not state it.
    fn focal(&self, _: &FrameId) -> Option<f64> {
        None
    }
}

impl WalkFolder {
    pub(crate) fn new(walk: &Walk, rule: ReadingRule) -> Self {
        Self {
            folder: walk.folder.clone(),
            rule,
        }
    }

    /// The sources of these walks. Every frame that is shown is read once. So a missing or broken one is found before anything is paid
    /// for, and its content enters the keys of its trials. A walk with such a frame cannot be shown; the others can.
    pub(crate) fn inspect(
        &self,
        names: &[String],
        settings: &Walk,
        progress: &Progress,
    ) -> Vec<Source> {
        let bar = progress.bar("reading walks", names.len());
        names
            .par_iter()
            .map(|name| {
                let source = self.source(name, settings);
                bar.inc();
                source.unwrap_or_else(|problem| Source {
                    problem: Some(problem.to_string()),
                    ..Source::unseen(FrameId(name.clone()))
                })
            })
            .collect()
    }

    /// The source of a walk, with the frames that are shown.
    ///
    /// # Errors
    /// If its folder is missing or has no frame, or one of the frames is broken.
    pub(crate) fn source(&self, name: &str, settings: &Walk) -> Result<Source> {
        let paths = walk(&self.folder, name)?;
        let shown = sampled(paths.len(), settings.frames.get());
        let mut positions = BTreeMap::new();
        for index in &shown {
            let next = positions.len();
            positions.entry(*index).or_insert(next);
        }
        let frames = positions.keys().map(|index| {
            let stem = paths[*index].file_stem().unwrap_or_default();
            let id = FrameId(format!("{name}/{}", stem.to_string_lossy()));
            SourceFrame::inspect(self, &id)
        });
        Ok(Source {
            name: FrameId(name.to_owned()),
            frames: frames.collect::<Result<_>>()?,
            order: shown.iter().map(|index| positions[index]).collect(),
            problem: None,
        })
    }
}
