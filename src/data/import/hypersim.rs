//! Hypersim as it is distributed: `<scene>/images/scene_cam_<nn>_final_preview/frame.<nnnn>.tonemap.jpg` and maps in
//! HDF5, `<scene>/images/scene_cam_<nn>_geometry_hdf5/frame.<nnnn>.{depth_meters,semantic,semantic_instance}.hdf5`.
//!
//! Depth is the distance along the ray. Classes are numbered as in NYU40, with −1 for none (README of
//! apple/ml-hypersim). The cameras of a scene show the same rooms, so their frames belong to one scene.

use std::path::{Path, PathBuf};

use super::files::{Adapter, FrameMaps, ListedFrame, Listing, MapArgs, MapFiles, file_name, files, folders, labels};
use darkqa_base::error::Result;
use darkqa_base::types::{DepthKind, Rgb};

/// Horizontal field of view of most scenes, π/3, in degrees.
const HFOV: f64 = 60.0;

/// File name endings of images.
const IMAGES: [&str; 2] = [".tonemap.jpg", ".tonemap.png"];

/// Folder of Hypersim scenes.
#[derive(Debug)]
pub(super) struct Hypersim {
    listing: Listing,
    maps: Vec<MapFiles>,
}

impl Hypersim {
    pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Self> {
        let args = &MapArgs { labels: args.labels.clone().or(Some("nyu40".to_owned())), ..args.clone() };
        let mut set = Self {
            listing: Listing {
                labels: labels(args)?.unwrap_or_default(),
                depth_kind: args.depth_kind.unwrap_or(DepthKind::Euclid),
                hfov: args.hfov.or(Some(HFOV)),
                ..Listing::default()
            },
            maps: Vec::new(),
        };
        if folder.join("images").is_dir() {
            set.add_scene(folder)?;
        } else {
            for scene in folders(folder)? {
                if scene.join("images").is_dir() {
                    set.add_scene(&scene)?;
                }
            }
        }
        Ok(set)
    }

    fn add_scene(&mut self, folder: &Path) -> Result<()> {
        let scene = file_name(&folder.canonicalize().unwrap_or_else(|_| folder.to_owned()));
        let images = folder.join("images");
        for preview in folders(&images)? {
            let name = file_name(&preview);
            let Some(camera) = name.strip_prefix("scene_").and_then(|name| name.strip_suffix("_final_preview")) else {
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
                let number = frame.strip_prefix("frame.").unwrap_or(&frame);
                self.listing.frames.push(ListedFrame::new(
                    &scene,
                    format!("{camera}-{number}"),
                    rgb,
                    self.maps.len() - 1,
                ));
            }
        }
        Ok(())
    }
}

impl Adapter for Hypersim {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn other_files(&self) -> Vec<PathBuf> {
        MapFiles::paths(&self.maps).cloned().collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        self.maps[frame.index].read(None, rgb)
    }
}
