//! Adapters: other data sets → frames of the common interface.
//!
//! An [`Adapter`] lists the frames of one kind of data set and reads their maps one frame at a time. Maps have the units of the
//! interface: millimetres, numbers of a label space, segments from 1. `src/docs/importing.md` shows the layouts.
//! A recording of a robot has no maps, and is no data set: [`recording`] reads it.

mod adapter;
mod files;
mod folder;
mod habitat;
mod hm3d;
mod hypersim;
mod interface;
mod joined;
pub(crate) mod keyframes;
mod left_over;
mod map_files;
mod mp3d;
mod nyu;
mod polygons;
pub(crate) mod recording;
mod renders;
mod replica;
mod scannet;
mod sunrgbd;
mod thor;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::types::flags::flag_words;

pub(crate) use adapter::{Adapter, FrameMaps, ListedFrame, StatedArgs};
pub(crate) use left_over::LeftOver;

/// The kind of data set in a folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum DataSetKind {
    /// Renders of habitat-sim: HM3D-Sem, Matterport3D, Replica.
    Habitat,
    /// Frames of ScanNet, extracted.
    Scannet,
    /// NYU Depth v2 as PNG files.
    Nyu,
    /// SUN RGB-D.
    Sunrgbd,
    /// A dump of AI2-THOR or ProcTHOR.
    Thor,
    /// Hypersim.
    Hypersim,
    /// Folders of images and maps by name, or a folder of the common interface.
    Folder,
}

flag_words!(DataSetKind);

/// Opens the folders of data sets of one kind as one data set. `further` are folders that paths in a list of frames may lead to.
///
/// # Errors
/// As of [`open`], or if the data sets do not fit each other.
pub(crate) fn open_all(
    kind: DataSetKind,
    folders: &[PathBuf],
    stated: &StatedArgs,
    further: &[PathBuf],
) -> Result<Box<dyn Adapter>> {
    let mut parts = Vec::with_capacity(folders.len());
    for folder in folders {
        parts.push(open(kind, folder, stated, further)?);
    }
    if parts.len() > 1 {
        return Ok(Box::new(joined::Joined::new(folders, parts)?));
    }
    let problem = || Error::usage("--src", "a folder of a data set expected");
    parts.pop().ok_or_else(problem)
}

/// The files in the folders of a data set that it does not read.
///
/// # Errors
/// If a folder cannot be read.
pub(crate) fn left_over(folders: &[PathBuf], adapter: &dyn Adapter) -> Result<LeftOver> {
    let read: BTreeSet<PathBuf> = adapter
        .listing()
        .frames
        .iter()
        .map(|frame| frame.rgb.clone())
        .chain(adapter.further_files())
        .collect();
    let mut all = LeftOver::default();
    for folder in folders {
        all.join(LeftOver::in_folder(folder, &read)?);
    }
    Ok(all)
}

/// Opens the folder of a data set.
///
/// # Errors
/// With the file or folder that is missing or has another layout, or with the flag that is required.
fn open(
    kind: DataSetKind,
    folder: &Path,
    stated: &StatedArgs,
    further: &[PathBuf],
) -> Result<Box<dyn Adapter>> {
    if !folder.is_dir() {
        return Err(Error::usage(
            "--src",
            format_args!("{}: no such folder", folder.display()),
        ));
    }
    let adapter: Box<dyn Adapter> = match kind {
        DataSetKind::Habitat => Box::new(habitat::Habitat::open(folder, stated)?),
        DataSetKind::Scannet => Box::new(scannet::Scannet::open(folder, stated)?),
        DataSetKind::Nyu => Box::new(nyu::open(folder, stated)?),
        DataSetKind::Sunrgbd => Box::new(sunrgbd::SunRgbd::open(folder)?),
        DataSetKind::Thor => Box::new(thor::Thor::open(folder, stated)?),
        DataSetKind::Hypersim => Box::new(hypersim::Hypersim::open(folder, stated)?),
        DataSetKind::Folder if folder.join("frames.jsonl").exists() => {
            Box::new(interface::Interface::open(folder, further)?)
        }
        DataSetKind::Folder => Box::new(folder::Folder::open(folder, stated)?),
    };
    if adapter.listing().frames.is_empty() {
        let problem = format_args!(
            "no frames of {kind} in this folder; see the layouts: https://github.com/darkqa-eval/darkqa-eval/blob/main/src/docs/importing.md"
        );
        return Err(Error::data(folder.display(), problem));
    }
    Ok(adapter)
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;

    #[test]
    fn every_kind_is_described_and_tested() {
        let page = include_str!("../docs/importing.md");
        let tests = include_str!("../../tests/program/data/import.rs");
        let missing: Vec<String> = DataSetKind::value_variants()
            .iter()
            .map(ToString::to_string)
            .filter(|kind| {
                !page.contains(&format!("\n## {kind}: ")) || !tests.contains(&format!("\"{kind}\""))
            })
            .collect();
        assert!(
            missing.is_empty(),
            "src/docs/importing.md or tests/program/data/import.rs lacks {missing:?}"
        );
    }
}
