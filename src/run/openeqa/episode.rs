//! The walks that are asked about: [`Episode`], looked through before anything is asked.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::config::Walk;
use crate::dataset::Picture;
use crate::dataset::openeqa::{sampled, walk};
use crate::error::{Error, Result};
use crate::run::progress::Progress;
use crate::types::{Digest, FrameId};

/// A frame of a walk.
#[derive(Debug, Clone)]
pub(super) struct Still {
    /// What its noise is drawn from: the walk's name and its own.
    pub(super) id: FrameId,
    pub(super) path: PathBuf,
    /// Its content.
    pub(super) digest: Digest,
    /// Its width and height, in pixels.
    pub(super) size: (u32, u32),
}

/// The frames of a walk that are shown.
#[derive(Debug)]
pub(super) struct Reel {
    /// Each once.
    pub(super) stills: Vec<Still>,
    /// Which of them is shown at each place; one more than once where the walk has fewer frames than are asked for.
    pub(super) order: Vec<usize>,
}

/// A walk.
#[derive(Debug)]
pub(super) struct Episode {
    /// Its name, as `hm3d-v0/000-hm3d-BFRyYbPCCPE`.
    pub(super) name: String,
    /// Its frames, or why it cannot be shown.
    pub(super) reel: std::result::Result<Reel, String>,
}

/// Reads every frame that is shown once: a missing or broken one is found before anything is paid for, and the content enters the
/// keys of its trials. One that cannot be shown takes its walk out, and no other.
pub(super) fn look_through(
    names: &[String],
    frames: &Path,
    config: &Walk,
    progress: &Progress,
) -> Vec<Episode> {
    let bar = progress.bar("reading walks", names.len());
    let episodes = names.par_iter().map(|name| {
        let reel = reel(name, frames, config).map_err(|e| e.to_string());
        bar.inc();
        Episode {
            name: name.clone(),
            reel,
        }
    });
    episodes.collect()
}

fn reel(name: &str, frames: &Path, config: &Walk) -> Result<Reel> {
    let paths = walk(frames, name)?;
    let shown = sampled(paths.len(), config.frames);
    let mut places = BTreeMap::new();
    for index in &shown {
        let next = places.len();
        places.entry(*index).or_insert(next);
    }
    let stills = places
        .keys()
        .map(|index| still(name, &paths[*index], config));
    Ok(Reel {
        stills: stills.collect::<Result<_>>()?,
        order: shown.iter().map(|index| places[index]).collect(),
    })
}

fn still(walk: &str, path: &Path, config: &Walk) -> Result<Still> {
    let picture = picture(path, config.most_pixels)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(Still {
        id: FrameId(format!("{walk}/{stem}")),
        size: picture.check()?,
        digest: picture.digest(),
        path: path.to_owned(),
    })
}

/// A file, not yet decoded.
pub(super) fn picture(path: &Path, most_pixels: u64) -> Result<Picture> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(Picture::Encoded {
        bytes,
        place: path.display().to_string(),
        most_pixels,
    })
}
