//! Walks through houses as what is shown: [`WalkFolder`].

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use rayon::prelude::*;

use super::progress::Progress;
use super::source::{Frames, Source, SourceFrame};
use crate::config::Walk;
use crate::dataset::Picture;
use crate::dataset::openeqa::{sampled, walk};
use crate::error::{Error, Result};
use crate::types::FrameId;

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
    pub(crate) fn new(config: &Walk) -> Self {
        Self {
            folder: config.folder.clone(),
            most_pixels: config.most_pixels,
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
        let shown = sampled(paths.len(), config.frames);
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
