//! Walks through houses as what is shown: `WalkFolder`, and how they are shown: [`Walk`].

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use rayon::prelude::*;
use serde::Serialize;

use super::progress::Progress;
use super::scaling::Scaling;
use super::source::{Frames, Source, SourceFrame};
use crate::dataset::openeqa::{sampled, walk};
use crate::dataset::{Picture, PixelLimit};
use crate::error::{Error, Result};
use crate::types::Decides;
use crate::types::FrameId;

/// How a walk is shown.
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
    /// Where light is taken
    #[arg(id = "degrade", long, value_enum, default_value_t = DegradedAt::Native, add = Decides::Pixels)]
    pub darkened: DegradedAt,
    /// Which frames one state of the camera takes
    #[arg(id = "sensor", long, value_enum, default_value_t = CameraOf::Episode, add = Decides::Pixels)]
    pub camera: CameraOf,
}

/// Where light is taken from a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum DegradedAt {
    /// Before the frames are scaled, as a camera would
    Native,
    /// After it, where the scaling averages no noise away
    Resized,
}

/// What one state of the camera takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum CameraOf {
    /// All frames of a walk: one camera recorded it
    Episode,
    /// Each frame
    Frame,
}

/// The longest side that a frame is scaled to, in pixels; chosen.
const LONGEST: usize = 65_536;

/// Reads `512` or `native`.
fn longer_side(text: &str) -> Result<Scaling, String> {
    match (text, text.parse()) {
        ("native", _) => Ok(Scaling::Never),
        (_, Ok(side)) if (1..=LONGEST).contains(&side) => Ok(Scaling::LongerSide(side)),
        _ => Err("a side in pixels or native expected".to_owned()),
    }
}

/// A folder of walks, each a folder of frames. A frame's name is the walk's and its own.
#[derive(Debug)]
pub(crate) struct WalkFolder {
    folder: PathBuf,
    most_pixels: u64,
}

impl Frames for WalkFolder {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        let path = self.folder.join(format!("{frame}.png"));
        let bytes = fs::read(&path).map_err(|e| Error::file(&path, "read", e))?;
        Ok(Picture::Encoded {
            bytes,
            place: path.display().to_string(),
            most_pixels: self.most_pixels,
        })
    }
}

impl WalkFolder {
    pub(crate) fn new(config: &Walk, limit: PixelLimit) -> Self {
        Self {
            folder: config.folder.clone(),
            most_pixels: limit.max_pixels.get(),
        }
    }

    /// Reads every frame that is shown once: a missing or broken one is found before anything is paid for, and the content enters the
    /// keys of its trials. One that cannot be shown takes its walk out, and no other.
    pub(crate) fn inspect(
        &self,
        names: &[String],
        config: &Walk,
        progress: &Progress,
    ) -> Vec<Source> {
        let bar = progress.bar("reading walks", names.len());
        let sources = names.par_iter().map(|name| {
            let source = self.source(name, config);
            bar.inc();
            source.unwrap_or_else(|problem| Source {
                problem: Some(problem.to_string()),
                ..Source::unseen(FrameId(name.clone()))
            })
        });
        sources.collect()
    }

    /// The frames of a walk that are shown.
    ///
    /// # Errors
    /// If its folder is missing, has no frame, or one of them is broken.
    pub(crate) fn source(&self, name: &str, config: &Walk) -> Result<Source> {
        let paths = walk(&self.folder, name)?;
        let shown = sampled(paths.len(), config.frames.get());
        let mut places = BTreeMap::new();
        for index in &shown {
            let next = places.len();
            places.entry(*index).or_insert(next);
        }
        let frames = places.keys().map(|index| {
            let stem = paths[*index].file_stem().unwrap_or_default();
            let id = FrameId(format!("{name}/{}", stem.to_string_lossy()));
            SourceFrame::inspect(self, &id)
        });
        Ok(Source {
            name: FrameId(name.to_owned()),
            frames: frames.collect::<Result<_>>()?,
            order: shown.iter().map(|index| places[index]).collect(),
            problem: None,
        })
    }
}
