//! Renders of habitat-sim: one folder per scene, with the names of instances from the scene's data set.
//!
//! A scene has `<scene>/rgb/<frame>.png`, `depth/<frame>.npy` (metres) or `.png`, and `semantic/<frame>.npy` or 16-bit `.png`
//! (numbers of instances). Beside them lies `*.semantic.txt` (HM3D-Sem), `*.house` (Matterport3D) or `info_semantic.json`
//! (Replica). The optional `trajectory.jsonl` has one line per frame: `{"frame", "t", "pose", "intrinsics"}`. The optional
//! `scenes.json` beside the scenes states how they were rendered (see [`renders`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing, StatedArgs, class_numbers};
use super::files::{
    IMAGES, check_same_size, depth_of, file_name, files, folders, map_paths, segments,
};
use super::{hm3d, mp3d, renders, replica};
use crate::error::{Error, Result};
use crate::files::reading::{json_lines, text};
use crate::types::{Intrinsics, Rgb, SegmentName};

/// Minimum share of the named pixels, in percent, that a region needs to give the frame its room type.
const MIN_REGION_PERCENT: u64 = 60;

/// An open folder of renders.
#[derive(Debug)]
pub(super) struct Habitat {
    listing: Listing,
    /// Paths of the depth and semantic map of each frame.
    maps: Vec<(Option<PathBuf>, PathBuf)>,
    scenes: BTreeMap<String, SceneFiles>,
    numbers: BTreeMap<String, u16>,
    depth_scale: Option<f64>,
    /// The files about scenes.
    about: Vec<PathBuf>,
}

/// Information from the annotation file of a scene.
#[derive(Debug, Default)]
struct SceneFiles {
    /// Room type of each region.
    rooms: BTreeMap<i64, &'static str>,
    /// Offset added to the numbers of instances: 1 if an instance has the number 0, which means no segment here; else 0.
    shift: u32,
}

/// Names of the instances of a scene, by number.
type InstanceNames = BTreeMap<u32, SegmentName>;

/// A line of `trajectory.jsonl`.
#[derive(Deserialize)]
struct TrajectoryStep {
    frame: String,
    t: Option<f64>,
    pose: Option<Vec<f64>>,
    intrinsics: Option<Intrinsics>,
}

impl Habitat {
    pub(super) fn open(folder: &Path, stated: &StatedArgs) -> Result<Self> {
        let listing = Listing {
            depth_kind: stated.depth_kind.unwrap_or_default(),
            ..Listing::of_mpcat40(stated)
        };
        let mut set = Self {
            numbers: class_numbers(&listing.labels),
            listing,
            maps: Vec::new(),
            scenes: BTreeMap::new(),
            depth_scale: stated.depth_scale,
            about: vec![folder.join("scenes.json")],
        };
        for scene in folders(folder)? {
            if scene.join("rgb").is_dir() {
                set.add(&scene)?;
            }
        }
        set.listing.renders = renders::of(folder, &set.scenes.keys().collect())?;
        Ok(set)
    }

    fn add(&mut self, folder: &Path) -> Result<()> {
        let name = file_name(folder);
        let (scene, names) = self.scene(folder)?;
        let images = files(&folder.join("rgb"), &IMAGES)?;
        let depths = files(&folder.join("depth"), &[".npy", ".png"])?;
        let semantics = files(&folder.join("semantic"), &[".npy", ".png"])?;
        let trajectory = folder.join("trajectory.jsonl");
        let mut steps = steps(&trajectory)?;
        self.about.push(trajectory);
        for (frame, rgb) in images {
            let Some(semantic) = semantics.get(&frame) else {
                let problem = format_args!("no semantic map of the frame {frame:?}");
                return Err(Error::data(folder.join("semantic").display(), problem));
            };
            let step = steps.remove(&frame);
            self.listing.frames.push(ListedFrame {
                scene: name.clone(),
                time: step.as_ref().and_then(|step| step.t),
                intrinsics: step.as_ref().and_then(|step| step.intrinsics),
                pose: step.and_then(|step| step.pose),
                room: None,
                rgb,
                index: self.maps.len(),
                frame: frame.clone(),
            });
            self.maps
                .push((depths.get(&frame).cloned(), semantic.clone()));
        }
        self.listing.names.insert(name.clone(), names);
        self.scenes.insert(name, scene);
        Ok(())
    }

    /// Reads the file that names the instances of a scene.
    fn scene(&mut self, folder: &Path) -> Result<(SceneFiles, InstanceNames)> {
        let annotations = files(folder, &[".semantic.txt", ".house", "info_semantic.json"])?;
        let Some(path) = annotations.into_values().next() else {
            let problem = "none of *.semantic.txt (HM3D-Sem), *.house (Matterport3D), info_semantic.json (Replica) in this folder; one of them must name the instances of the semantic maps";
            return Err(Error::data(folder.display(), problem));
        };
        let content = text(&path)?;
        self.about.push(path.clone());
        let at_line = |(line, problem): (usize, String)| Error::line(&path, line, problem);
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (names, rooms) = if ending == "house" {
            let house = mp3d::parse(&content, &self.listing.labels.expressible).map_err(at_line)?;
            (house.names, house.rooms)
        } else if ending == "json" {
            let names = replica::parse(&content, &mut self.listing.unlisted);
            let names = names.map_err(|problem| Error::data(path.display(), problem))?;
            (names, BTreeMap::new())
        } else {
            let names = hm3d::parse(&content, &mut self.listing.unlisted);
            (names.map_err(at_line)?, BTreeMap::new())
        };
        if names.is_empty() {
            return Err(Error::data(
                path.display(),
                "no instance is named in this file",
            ));
        }
        let shift = u32::from(names.contains_key(&0));
        let names = names.into_iter().map(|(id, name)| (id + shift, name));
        Ok((SceneFiles { rooms, shift }, names.collect()))
    }
}

/// The steps of a trajectory, by frame; empty if the file does not exist.
fn steps(path: &Path) -> Result<BTreeMap<String, TrajectoryStep>> {
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let steps = json_lines::<TrajectoryStep>(path)?.into_iter();
    Ok(steps.map(|(_, step)| (step.frame.clone(), step)).collect())
}

impl Adapter for Habitat {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn further_files(&self) -> Vec<PathBuf> {
        map_paths(&self.maps).chain(&self.about).cloned().collect()
    }

    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let (depth_path, semantic) = &self.maps[frame.index];
        let scene = &self.scenes[&frame.scene];
        let names = &self.listing.names[&frame.scene];
        let depth = depth_of(depth_path.as_deref(), self.depth_scale, rgb)?;
        let ids = segments(semantic)?;
        check_same_size(semantic, &ids, rgb)?;
        let (mut regions, mut named) = (BTreeMap::new(), 0_u64);
        let (mut last, mut found) = (None, (0, None));
        let mut segments = ids;
        let classes = segments.mapv(|id| {
            if last != Some(id) {
                let name = id.checked_add(scene.shift).and_then(|id| names.get(&id));
                let class = name.and_then(|name| self.numbers.get(&name.canonical));
                (last, found) = (
                    Some(id),
                    (class.copied().unwrap_or(0), name.and_then(|n| n.region)),
                );
            }
            if found.0 != 0 {
                named += 1;
                *regions.entry(found.1).or_insert(0_u64) += 1;
            }
            found.0
        });
        if named == 0 {
            let problem = "no pixel has the number of an instance that the scene names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json";
            return Err(Error::data(semantic.display(), problem));
        }
        segments.mapv_inplace(|id| match id.checked_add(scene.shift) {
            Some(id) if names.contains_key(&id) => id,
            _ => 0,
        });
        let (region, pixels) = regions
            .into_iter()
            .max_by_key(|(_, count)| *count)
            .unwrap_or((None, 0));
        let room = region.and_then(|region| scene.rooms.get(&region));
        let room = room.filter(|_| pixels * 100 >= named * MIN_REGION_PERCENT);
        Ok(FrameMaps {
            depth,
            semantic: Some(classes),
            segments: Some(segments),
            room: room.map(|room| (*room).to_owned()),
        })
    }
}
