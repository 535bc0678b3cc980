//! Recorded walks through houses (OpenEQA): their folder ([`WalkFolder`]) and the flags for their frames
//! ([`WalkArgs`]).

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use rayon::prelude::*;
use serde::Serialize;

use crate::images::frames::source::{Frames, Source, SourceFrame};
use crate::images::progress::Progress;
use darkqa_base::error::Result;
use darkqa_base::types::{Decides, FrameId};
use darkqa_data::Picture;
use darkqa_data::openeqa::{sample_indices, walk_frames};
use darkqa_data::{Root, RootArgs};
use darkqa_pictures::Scaling;
use darkqa_pictures::{DecodeRule, ImageFile};

/// Flags that decide which frames of a walk are shown, and how.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "OpenEQA")]
pub struct WalkArgs {
    /// The folder of walks: the frames of a question lie in DIR/EPISODE_HISTORY/*-rgb.png
    #[arg(id = "frames", long, value_name = "DIR", add = Decides::Reply)]
    pub folder: PathBuf,
    /// How many frames of a walk are shown, spread evenly over it: 50 as upstream shows GPT-4V (Claude 3: 20, Gemini:
    /// 15)
    #[arg(id = "num-frames", long, value_name = "K", default_value = "50", add = Decides::Reply)]
    pub frames: NonZeroUsize,
    /// The longer side of the frames as sent, in pixels, or native; scaled as upstream does (OpenCV, bilinear)
    #[arg(id = "image-size", long, value_name = "PIXELS|native", value_parser = longer_side, default_value = "512", add = Decides::Pixels)]
    pub side: Scaling,
    /// When light is reduced: before or after scaling
    #[arg(id = "degrade", long, value_enum, default_value_t = DegradeStage::Native, add = Decides::Pixels)]
    pub degraded_at: DegradeStage,
    /// The frames that share one state of the camera
    #[arg(id = "sensor", long, value_enum, default_value_t = CameraScope::Episode, add = Decides::Pixels)]
    pub camera: CameraScope,
}

/// When the light of a frame is reduced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum DegradeStage {
    /// Before the frames are scaled, as a camera would
    Native,
    /// After the frames are scaled, so that scaling averages no noise away
    Resized,
}

/// The frames that share one camera state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum CameraScope {
    /// All frames of a walk: one camera recorded it
    Episode,
    /// Each frame has its own
    Frame,
}

/// Largest side that `--image-size` accepts, in pixels (chosen).
const MAX_SIDE: usize = 65_536;

/// Parses `--image-size`: the longer side in pixels, such as `512`, or `native`.
fn longer_side(text: &str) -> Result<Scaling, String> {
    match (text, text.parse()) {
        ("native", _) => Ok(Scaling::Never),
        (_, Ok(side)) if (1..=MAX_SIDE).contains(&side) => Ok(Scaling::LongerSide(side)),
        _ => Err("a side in pixels or native expected".to_owned()),
    }
}

/// Folder of walks, each a folder of frames. The id of a frame is `WALK/FRAME`, without the file extension.
#[derive(Debug)]
pub struct WalkFolder {
    folder: PathBuf,
    /// Further folders that the walks may lie in.
    further: Vec<PathBuf>,
    rule: DecodeRule,
}

impl Frames for WalkFolder {
    fn picture(&self, frame: &FrameId) -> Result<Picture> {
        let path = self.folder.join(format!("{frame}.png"));
        ImageFile::open(&path, self.rule).map(Picture::Encoded)
    }

    /// Returns `None`: folders of walks have no focal length.
    fn focal(&self, _: &FrameId) -> Option<f64> {
        None
    }
}

impl WalkFolder {
    pub fn new(walk: &WalkArgs, root: &RootArgs, rule: DecodeRule) -> Self {
        Self { folder: walk.folder.clone(), further: root.data_root.clone(), rule }
    }

    /// Reads every sampled frame once and returns one source per walk. Missing or broken frames are found here, before
    /// any paid request, and the trial keys include the content of the frames. A walk with such a frame gets a problem;
    /// other walks are unaffected.
    pub fn inspect(&self, names: &[String], settings: &WalkArgs, progress: &Progress) -> Vec<Source> {
        let bar = progress.bar("reading walks", names.len());
        names
            .par_iter()
            .map(|name| {
                let source = self.source(name, settings);
                bar.inc();
                source.unwrap_or_else(|problem| Source {
                    problem: Some(problem.to_string()),
                    ..Source::without_frames(FrameId(name.clone()))
                })
            })
            .collect()
    }

    /// Reads the sampled frames of a walk.
    ///
    /// # Errors
    /// If the folder of the walk is missing, has no frame or lies outside the folder of walks, or if a sampled frame is
    /// broken.
    pub fn source(&self, name: &str, settings: &WalkArgs) -> Result<Source> {
        let root = Root::new(&self.folder, &self.further)?;
        let paths = walk_frames(&root, name)?;
        let sample = sample_indices(paths.len(), settings.frames.get());
        // A frame that is sampled twice is read once: `order` refers to it by its position.
        let mut positions = BTreeMap::new();
        for index in &sample {
            let next = positions.len();
            positions.entry(*index).or_insert(next);
        }
        let frames = positions
            .keys()
            .map(|index| {
                let stem = paths[*index].file_stem().unwrap_or_default();
                let id = FrameId(format!("{name}/{}", stem.to_string_lossy()));
                SourceFrame::inspect(self, &id)
            })
            .collect::<Result<_>>()?;
        Ok(Source {
            name: FrameId(name.to_owned()),
            frames,
            order: sample.iter().map(|index| positions[index]).collect(),
            problem: None,
        })
    }
}
