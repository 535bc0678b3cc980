//! Import of habitat-sim renders: one folder per scene, with instance names from the original data set.
//!
//! The folder of a scene has these files:
//! - `rgb/<frame>.png`;
//! - `depth/<frame>.npy` (metres) or `.png`, optional;
//! - `semantic/<frame>.npy` or 16-bit `.png` (instance numbers);
//! - one annotation file: `*.semantic.txt` (HM3D-Sem), `*.house` (Matterport3D) or `info_semantic.json` (Replica);
//! - `trajectory.jsonl`, optional, with one line per frame: `{"frame", "t", "pose", "intrinsics"}`.
//!
//! The optional `scenes.json`, next to the scene folders, records how the scenes were rendered (see [`renders`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing, MapArgs, class_numbers};
use super::files::{IMAGES, check_same_size, file_name, files, folders, map_paths, read_frame_depth, read_segments};
use super::{hm3d, mp3d, renders, replica};
use crate::error::{Error, Result};
use crate::files::reading::{json_lines, text};
use crate::types::{Intrinsics, Rgb, SegmentName};

/// Minimum share of a frame's named pixels, in percent, in the region that gives the frame its room type (chosen).
const MIN_REGION_PERCENT: u64 = 60;

/// Folder of rendered scenes.
#[derive(Debug)]
pub(super) struct Habitat {
    listing: Listing,
    /// Paths of the depth map (if any) and the semantic map of each frame.
    maps: Vec<(Option<PathBuf>, PathBuf)>,
    scenes: BTreeMap<String, SceneInfo>,
    /// Number of each class in the class maps, by canonical name.
    class_numbers: BTreeMap<String, u16>,
    depth_scale: Option<f64>,
    /// `scenes.json`, and the annotation file and trajectory of each scene.
    scene_files: Vec<PathBuf>,
}

/// Information from the annotation file of a scene.
#[derive(Debug, Default)]
struct SceneInfo {
    /// Room type of each region.
    rooms: BTreeMap<i64, &'static str>,
    /// Difference of segment numbers from instance numbers. It is 1 if an instance has the number 0, because segment 0
    /// means no segment; else 0.
    offset: u32,
}

/// Names of the segments of a scene, by segment number.
type SegmentNames = BTreeMap<u32, SegmentName>;

/// Line of `trajectory.jsonl`.
#[derive(Deserialize)]
struct TrajectoryStep {
    frame: String,
    t: Option<f64>,
    pose: Option<Vec<f64>>,
    intrinsics: Option<Intrinsics>,
}

impl Habitat {
    pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Self> {
        let listing = Listing { depth_kind: args.depth_kind.unwrap_or_default(), ..Listing::with_mpcat40(args) };
        let mut set = Self {
            class_numbers: class_numbers(&listing.labels),
            listing,
            maps: Vec::new(),
            scenes: BTreeMap::new(),
            depth_scale: args.depth_scale,
            scene_files: vec![folder.join("scenes.json")],
        };
        for scene in folders(folder)? {
            if scene.join("rgb").is_dir() {
                set.add_scene(&scene)?;
            }
        }
        set.listing.renders = renders::read(folder, &set.scenes.keys().collect())?;
        Ok(set)
    }

    fn add_scene(&mut self, folder: &Path) -> Result<()> {
        let name = file_name(folder);
        let (scene, names) = self.read_annotations(folder)?;
        let images = files(&folder.join("rgb"), &IMAGES)?;
        let depths = files(&folder.join("depth"), &[".npy", ".png"])?;
        let semantics = files(&folder.join("semantic"), &[".npy", ".png"])?;
        let trajectory = folder.join("trajectory.jsonl");
        let mut steps = read_trajectory(&trajectory)?;
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
            self.maps.push((depths.get(&frame).cloned(), semantic.clone()));
        }
        if let Some(frame) = steps.keys().next() {
            tracing::warn!(
                "{}: frames without an image in rgb: {}, for example {frame:?}; a frame has the name of its image, without the extension",
                trajectory.display(),
                steps.len()
            );
        }
        self.scene_files.push(trajectory);
        self.listing.names.insert(name.clone(), names);
        self.scenes.insert(name, scene);
        Ok(())
    }

    /// Reads the room types and the segment names from the annotation file of a scene.
    fn read_annotations(&mut self, folder: &Path) -> Result<(SceneInfo, SegmentNames)> {
        let annotations = files(folder, &[".semantic.txt", ".house", "info_semantic.json"])?;
        let Some(path) = annotations.into_values().next() else {
            let problem = "none of *.semantic.txt (HM3D-Sem), *.house (Matterport3D), info_semantic.json (Replica) in this folder; one of them must name the instances of the semantic maps";
            return Err(Error::data(folder.display(), problem));
        };
        let content = text(&path)?;
        self.scene_files.push(path.clone());
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (names, rooms) = if extension == "house" {
            let house = mp3d::parse(&content, &self.listing.labels.expressible)
                .map_err(|(line, problem)| Error::line(&path, line, problem))?;
            (house.names, house.rooms)
        } else if extension == "json" {
            let names = replica::parse(&content, &mut self.listing.unlisted)
                .map_err(|problem| Error::data(path.display(), problem))?;
            (names, BTreeMap::new())
        } else {
            let names = hm3d::parse(&content, &mut self.listing.unlisted)
                .map_err(|(line, problem)| Error::line(&path, line, problem))?;
            (names, BTreeMap::new())
        };
        if names.is_empty() {
            return Err(Error::data(path.display(), "no instance is named in this file"));
        }
        let offset = u32::from(names.contains_key(&0));
        let names = names.into_iter().filter_map(|(id, name)| Some((id.checked_add(offset)?, name))).collect();
        Ok((SceneInfo { rooms, offset }, names))
    }
}

/// Reads the steps of a trajectory, by frame name; empty if the file does not exist.
///
/// # Errors
/// If a line cannot be read, or two lines are about the same frame.
fn read_trajectory(path: &Path) -> Result<BTreeMap<String, TrajectoryStep>> {
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let mut steps = BTreeMap::new();
    for (number, step) in json_lines::<TrajectoryStep>(path)? {
        if let Some(first) = steps.insert(step.frame.clone(), step) {
            let problem = format_args!("a second line of the frame {:?}", first.frame);
            return Err(Error::line(path, number, problem));
        }
    }
    Ok(steps)
}

impl Adapter for Habitat {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn assumes_metres(&self) -> bool {
        self.depth_scale.is_none()
    }

    fn other_files(&self) -> Vec<PathBuf> {
        map_paths(&self.maps).chain(&self.scene_files).cloned().collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let (depth_path, semantic) = &self.maps[frame.index];
        let scene = &self.scenes[&frame.scene];
        let names = &self.listing.names[&frame.scene];
        let depth = read_frame_depth(depth_path.as_deref(), self.depth_scale, rgb)?;
        let mut segments = read_segments(semantic)?;
        check_same_size(semantic, &segments, rgb)?;
        let (mut region_pixels, mut named_pixels) = (BTreeMap::new(), 0_u64);
        // Neighbouring pixels mostly belong to the same instance, so the last lookup is cached.
        let (mut last_id, mut class, mut region) = (None, 0, None);
        let classes = segments.mapv(|id| {
            if last_id != Some(id) {
                let name = id.checked_add(scene.offset).and_then(|id| names.get(&id));
                last_id = Some(id);
                class = name.and_then(|name| self.class_numbers.get(&name.canonical)).copied().unwrap_or(0);
                region = name.and_then(|name| name.region);
            }
            if class != 0 {
                named_pixels += 1;
                *region_pixels.entry(region).or_insert(0_u64) += 1;
            }
            class
        });
        if named_pixels == 0 {
            let problem = "no pixel has the number of an instance that the scene names; habitat-sim writes 0 everywhere if the scene is opened without its *.scene_dataset_config.json";
            return Err(Error::data(semantic.display(), problem));
        }
        segments.mapv_inplace(|id| match id.checked_add(scene.offset) {
            Some(id) if names.contains_key(&id) => id,
            _ => 0,
        });
        let (region, pixels) = region_pixels.into_iter().max_by_key(|(_, count)| *count).unwrap_or((None, 0));
        let room = region
            .and_then(|region| scene.rooms.get(&region))
            .filter(|_| pixels * 100 >= named_pixels * MIN_REGION_PERCENT);
        Ok(FrameMaps {
            depth,
            semantic: Some(classes),
            segments: Some(segments),
            room: room.map(|room| (*room).to_owned()),
        })
    }
}
