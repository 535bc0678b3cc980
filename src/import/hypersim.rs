//! Hypersim as it is distributed: `<scene>/images/scene_cam_<nn>_final_preview/frame.<nnnn>.tonemap.jpg` and maps in HDF5,
//! `<scene>/images/scene_cam_<nn>_geometry_hdf5/frame.<nnnn>.{depth_meters,semantic,semantic_instance}.hdf5`.
//!
//! Depth is the distance along the ray; classes are those of NYU40, and −1 is none (README of apple/ml-hypersim). The cameras of a
//! scene show the same rooms, so that their frames are one scene here.

use std::path::{Path, PathBuf};

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing, StatedArgs, labels};
use super::files::{file_name, files, folders};
use super::map_files::MapFiles;
use crate::error::Result;
use crate::types::{DepthKind, Rgb};

/// The horizontal field of view of most scenes, π/3, in degrees.
const HFOV: f64 = 60.0;

/// The endings of the names of images, the first that a camera has.
const IMAGES: [&str; 2] = [".tonemap.jpg", ".tonemap.png"];

/// An open folder of scenes.
#[derive(Debug)]
pub(super) struct Hypersim {
    listing: Listing,
    maps: Vec<MapFiles>,
}

impl Hypersim {
    pub(super) fn open(folder: &Path, stated: &StatedArgs) -> Result<Self> {
        let stated = &StatedArgs {
            labels: stated.labels.clone().or(Some("nyu40".to_owned())),
            ..stated.clone()
        };
        let mut set = Self {
            listing: Listing {
                labels: labels(stated)?.unwrap_or_default(),
                depth_kind: stated.depth_kind.unwrap_or(DepthKind::Euclid),
                hfov: stated.hfov.or(Some(HFOV)),
                ..Listing::default()
            },
            maps: Vec::new(),
        };
        if folder.join("images").is_dir() {
            set.add(folder)?;
        } else {
            for scene in folders(folder)? {
                if scene.join("images").is_dir() {
                    set.add(&scene)?;
                }
            }
        }
        Ok(set)
    }

    fn add(&mut self, folder: &Path) -> Result<()> {
        let real = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let scene = file_name(&real);
        let images = folder.join("images");
        for preview in folders(&images)? {
            let name = file_name(&preview);
            let camera = name
                .strip_prefix("scene_")
                .and_then(|name| name.strip_suffix("_final_preview"));
            let Some(camera) = camera else {
                continue;
            };
            let geometry = images.join(format!("scene_{camera}_geometry_hdf5"));
            let mut depths = files(&geometry, &[".depth_meters.hdf5"])?;
            let mut semantics = files(&geometry, &[".semantic.hdf5"])?;
            let mut instances = files(&geometry, &[".semantic_instance.hdf5"])?;
            for (frame, rgb) in files(&preview, &IMAGES)? {
                self.maps.push(MapFiles {
                    depth: depths.remove(&frame),
                    classes: semantics.remove(&frame),
                    segments: instances.remove(&frame),
                });
                let frame = frame.strip_prefix("frame.").unwrap_or(&frame);
                let (frame, index) = (format!("{camera}-{frame}"), self.maps.len() - 1);
                let listed = ListedFrame::new(&scene, frame, rgb, index);
                self.listing.frames.push(listed);
            }
        }
        Ok(())
    }
}

impl Adapter for Hypersim {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn further_files(&self) -> Vec<PathBuf> {
        MapFiles::paths(&self.maps).cloned().collect()
    }

    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        self.maps[frame.index].read(None, rgb)
    }
}
