//! Import of other data sets to a folder of frames.
//!
//! An [`Adapter`] lists the frames of one kind of data set and reads their maps one frame at a time. All adapters use
//! the same units: depth in millimetres, class numbers of a label space, segment numbers from 1.
//! `src/docs/importing.md` shows the layouts. Recordings of robots have no maps and no adapter: [`recording`] and
//! [`lerobot`] read them.

mod adapter;
mod combined;
mod files;
mod folder;
mod frame_folder;
mod habitat;
mod hm3d;
mod hypersim;
pub(crate) mod keyframes;
pub(crate) mod lerobot;
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
mod unread_files;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::data::Root;
use crate::error::{Error, Result};
use crate::types::flags::flag_words;

pub(crate) use adapter::{Adapter, FrameMaps, ListedFrame, MapArgs};
pub(crate) use unread_files::UnreadFiles;

/// Kind of data set in a folder.
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

/// Opens data sets of one kind in several folders as one data set. Paths in a list of frames may also lead into the
/// folders in `further`.
///
/// # Errors
/// As [`open`], or if the data sets cannot be combined.
pub(crate) fn open_all(
    kind: DataSetKind,
    folders: &[PathBuf],
    args: &MapArgs,
    further: &[PathBuf],
) -> Result<Box<dyn Adapter>> {
    let mut parts = Vec::with_capacity(folders.len());
    for folder in folders {
        parts.push(open(kind, folder, args, further)?);
    }
    if parts.len() > 1 {
        return Ok(Box::new(combined::Combined::new(folders, parts)?));
    }
    parts.pop().ok_or_else(|| Error::usage("--src", "a folder of a data set expected"))
}

/// Files in the folders of a data set that are not read.
///
/// # Errors
/// If a folder cannot be read.
pub(crate) fn unread_files(folders: &[PathBuf], adapter: &dyn Adapter) -> Result<UnreadFiles> {
    let read: BTreeSet<PathBuf> =
        adapter.listing().frames.iter().map(|frame| frame.rgb.clone()).chain(adapter.other_files()).collect();
    let mut unread = UnreadFiles::default();
    for folder in folders {
        unread.merge(UnreadFiles::in_folder(folder, &read)?);
    }
    Ok(unread)
}

/// Opens a data set.
///
/// # Errors
/// If a file or folder is missing or has another layout, a link leads out of the folder, or a required flag is missing;
/// the error names it.
fn open(kind: DataSetKind, folder: &Path, args: &MapArgs, further: &[PathBuf]) -> Result<Box<dyn Adapter>> {
    if !folder.is_dir() {
        return Err(Error::usage("--src", format_args!("{}: no such folder", folder.display())));
    }
    Root::new(folder, further)?.refuse_links_out()?;
    let adapter: Box<dyn Adapter> = match kind {
        DataSetKind::Habitat => Box::new(habitat::Habitat::open(folder, args)?),
        DataSetKind::Scannet => Box::new(scannet::Scannet::open(folder, args)?),
        DataSetKind::Nyu => Box::new(nyu::open(folder, args)?),
        DataSetKind::Sunrgbd => Box::new(sunrgbd::SunRgbd::open(folder)?),
        DataSetKind::Thor => Box::new(thor::Thor::open(folder, args)?),
        DataSetKind::Hypersim => Box::new(hypersim::Hypersim::open(folder, args)?),
        DataSetKind::Folder if folder.join("frames.jsonl").exists() => {
            Box::new(frame_folder::FrameFolder::open(folder, further)?)
        }
        DataSetKind::Folder => Box::new(folder::Folder::open(folder, args)?),
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
        let page = include_str!("../../docs/importing.md");
        let tests = include_str!("../../../tests/program/data/import.rs");
        let missing: Vec<String> = DataSetKind::value_variants()
            .iter()
            .map(ToString::to_string)
            .filter(|kind| !page.contains(&format!("\n## {kind}: ")) || !tests.contains(&format!("\"{kind}\"")))
            .collect();
        assert!(missing.is_empty(), "src/docs/importing.md or tests/program/data/import.rs lacks {missing:?}");
    }
}
