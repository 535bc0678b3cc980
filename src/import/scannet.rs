//! Extracted frames of ScanNet: one folder per scene.
//!
//! A scene has `<scene>/color/<n>.jpg`, `depth/<n>.png` (millimetres), `pose/<n>.txt` and one of two kinds of label maps:
//! `label-filt` and `instance-filt` (ScanNet's numbers, with `scannetv2-labels.combined.tsv` beside the scenes) or, as in
//! frames_25k, `label` (NYU40) and `instance` (label · 1000 + number). Depth maps are smaller than images and are resampled
//! with both cameras; labels are never scaled. A frame whose pose is unknown (`-inf`) is left out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ndarray::Array2;
use serde::Deserialize;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing, StatedArgs};
use super::files::{
    IMAGES, check_same_size, depth, file_name, files, first_folder, folders, numbers, png,
};
use crate::error::{Error, Result};
use crate::files::reading::{bytes, json, text};
use crate::labels::names::{UNKNOWN, overridden};
use crate::labels::{canonical, space};
use crate::picture::raw_png::SampleForm;
use crate::types::{Intrinsics, Label, Labels, Rgb};

/// File name of the table of ScanNet's label numbers.
const TABLE: &str = "scannetv2-labels.combined.tsv";
/// Frames per second of the sensor; a frame's name is its number.
const RATE: f64 = 30.0;
/// Metres per unit of depth.
const SCALE: f64 = 0.001;

/// An open folder of scenes.
#[derive(Debug)]
pub(super) struct Scannet {
    listing: Listing,
    maps: Vec<ScannetMaps>,
    depth_scale: f64,
    /// The files about scenes, and the table of labels.
    about: Vec<PathBuf>,
}

#[derive(Debug)]
struct ScannetMaps {
    depth: Option<PathBuf>,
    labels: PathBuf,
    instances: Option<PathBuf>,
    /// Camera of the depth map, if its intrinsics are given.
    depth_camera: Option<Intrinsics>,
}

/// Numbering of the labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Numbering {
    /// The label numbers of ScanNet's table.
    Own,
    /// The label numbers of NYU40.
    Nyu40,
}

impl Scannet {
    pub(super) fn open(folder: &Path, stated: &StatedArgs) -> Result<Self> {
        let mut set = Self {
            listing: Listing::default(),
            maps: Vec::new(),
            depth_scale: stated.depth_scale.unwrap_or(SCALE),
            about: Vec::new(),
        };
        let scenes: Vec<PathBuf> = folders(folder)?
            .into_iter()
            .filter(|scene| scene.join("color").is_dir())
            .collect();
        let own = scenes.iter().any(|scene| scene.join("label-filt").is_dir());
        let numbering = if own {
            Numbering::Own
        } else {
            Numbering::Nyu40
        };
        set.listing.labels = match numbering {
            Numbering::Own => {
                let path = folder.join(TABLE);
                let labels = table(&path)?;
                set.about.push(path);
                labels
            }
            Numbering::Nyu40 => space("nyu40").unwrap_or_default(),
        };
        for scene in scenes {
            set.add(&scene, numbering)?;
        }
        Ok(set)
    }

    fn add(&mut self, folder: &Path, numbering: Numbering) -> Result<()> {
        let name = file_name(folder);
        check_overflow(folder, &name)?;
        let camera = |names: [String; 2]| {
            let path = names
                .into_iter()
                .map(|name| folder.join(name))
                .find(|path| path.exists());
            path.as_deref()
                .map(intrinsics)
                .transpose()
                .map(|camera| (path, camera))
        };
        let of = |which: &str| {
            camera([
                format!("intrinsic/intrinsic_{which}.txt"),
                format!("intrinsics_{which}.txt"),
            ])
        };
        let ((color_file, color), (depth_file, depth_camera)) = (of("color")?, of("depth")?);
        let room_file = folder.join(format!("{name}.txt"));
        let room = room(&room_file)?;
        self.about.extend(color_file.into_iter().chain(depth_file));
        self.about
            .extend([room_file, folder.join(format!("{name}.aggregation.json"))]);
        let within = |folders: &[&str]| match first_folder(folder, folders) {
            Some(folder) => files(&folder, &[".png"]),
            None => Ok(BTreeMap::new()),
        };
        let (labels, instances) = match numbering {
            Numbering::Own => (within(&["label-filt"])?, within(&["instance-filt"])?),
            Numbering::Nyu40 => (within(&["label"])?, within(&["instance"])?),
        };
        let depths = within(&["depth"])?;
        let poses = files(&folder.join("pose"), &[".txt"])?;
        self.about.extend(poses.values().cloned());
        for (frame, rgb) in files(&folder.join("color"), &IMAGES)? {
            let pose = poses.get(&frame).map(|path| numbers(path)).transpose()?;
            if pose
                .as_ref()
                .is_some_and(|pose| pose.iter().any(|number| !number.is_finite()))
            {
                continue;
            }
            let Some(label) = labels.get(&frame) else {
                let problem = format_args!(
                    "no labels of the frame {frame:?}: label-filt/{frame}.png or label/{frame}.png expected"
                );
                return Err(Error::data(folder.display(), problem));
            };
            let number: Option<u32> = frame.parse().ok();
            self.maps.push(ScannetMaps {
                depth: depths.get(&frame).cloned(),
                labels: label.clone(),
                instances: instances.get(&frame).cloned(),
                depth_camera,
            });
            self.listing.frames.push(ListedFrame {
                scene: name.clone(),
                time: number.map(|number| f64::from(number) / RATE),
                pose,
                intrinsics: color,
                room: room.clone(),
                rgb,
                index: self.maps.len() - 1,
                frame,
            });
        }
        Ok(())
    }
}

/// The keys of `<scene>.aggregation.json` that are used.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Aggregation {
    seg_groups: Vec<serde_json::Value>,
}

/// Refuses a scene with more than 255 objects if its instance maps have 8 bits, because the numbers overflow to 0.
fn check_overflow(folder: &Path, scene: &str) -> Result<()> {
    let path = folder.join(format!("{scene}.aggregation.json"));
    if !path.exists() || !folder.join("instance-filt").is_dir() {
        return Ok(());
    }
    let objects = json::<Aggregation>(&path)?.seg_groups.len();
    if objects > 255 {
        let problem = format_args!(
            "{objects} objects, but the 8 bits of instance-filt hold 255: their numbers overflow; export them with 16 bits, as in frames_25k"
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok(())
}

/// The label space of ScanNet's label numbers.
fn table(path: &Path) -> Result<Labels> {
    let bytes = bytes(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(b'\t')
        .flexible(true)
        .from_reader(&*bytes);
    let header = reader
        .headers()
        .map_err(|e| Error::data(path.display(), e))?
        .clone();
    let column = |name: &str| {
        header
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| Error::data(path.display(), format_args!("no column {name:?}")))
    };
    let [id, raw, class] = [column("id")?, column("raw_category")?, column("mpcat40")?];
    let known = canonical();
    let mut labels = Labels {
        space: "scannet".into(),
        void: [0].into(),
        ..Labels::default()
    };
    for row in reader.records() {
        let row = row.map_err(|e| Error::data(path.display(), e))?;
        let cell = |column: usize| row.get(column).unwrap_or_default().trim();
        let Ok(id) = cell(id).parse::<u16>() else {
            continue;
        };
        let class = overridden(cell(raw)).unwrap_or(cell(class));
        if matches!(class, "void" | "unlabeled") {
            labels.void.insert(id);
            continue;
        }
        let class = if known.contains(class) {
            class
        } else {
            UNKNOWN
        };
        let label = Label {
            name: cell(raw).to_owned(),
            canonical: class.to_owned(),
        };
        labels.labels.insert(id, label);
    }
    // Annotators used free text, so every class of the table is expressible.
    let classes = labels.labels.values().map(|label| label.canonical.clone());
    labels.expressible = classes.collect::<BTreeSet<String>>();
    Ok(labels)
}

/// The camera in a file with a 4 × 4 matrix.
fn intrinsics(path: &Path) -> Result<Intrinsics> {
    match numbers(path)?[..] {
        [fx, _, cx, _, _, fy, cy, ..] => Ok(Intrinsics { fx, fy, cx, cy }),
        _ => Err(Error::data(path.display(), "a 4 × 4 matrix expected")),
    }
}

/// The room type in the file of a scene, from a line such as `sceneType = Bedroom / Hotel`.
fn room(path: &Path) -> Result<Option<String>> {
    if !path.exists() {
        return Ok(None);
    }
    let content = text(path)?;
    let stated = content
        .lines()
        .filter_map(|line| line.split_once('='))
        .find(|(key, _)| key.trim() == "sceneType");
    Ok(stated.map(|(_, room)| {
        room.split('/')
            .next()
            .unwrap_or_default()
            .trim()
            .to_lowercase()
    }))
}

/// Depth resampled to the pixels of an image: the nearest pixel through both cameras, or by position if a camera is unknown.
fn resampled(depth: &Array2<u32>, rgb: &Rgb, cameras: Option<[Intrinsics; 2]>) -> Array2<u32> {
    let (height, width) = depth.dim();
    let scale = [
        width as f64 / rgb.width() as f64,
        height as f64 / rgb.height() as f64,
    ];
    let along = |i: usize, axis: usize| -> f64 {
        match &cameras {
            Some([color, depth]) if axis == 0 => {
                (i as f64 - color.cx) / color.fx * depth.fx + depth.cx
            }
            Some([color, depth]) => (i as f64 - color.cy) / color.fy * depth.fy + depth.cy,
            None => (i as f64 + 0.5) * scale[axis] - 0.5,
        }
    };
    let columns: Vec<f64> = (0..rgb.width()).map(|x| along(x, 0).round()).collect();
    let rows: Vec<f64> = (0..rgb.height()).map(|y| along(y, 1).round()).collect();
    Array2::from_shape_fn((rgb.height(), rgb.width()), |(y, x)| {
        let (row, column) = (rows[y], columns[x]);
        let within = row >= 0.0 && column >= 0.0;
        depth
            .get((row as usize, column as usize))
            .copied()
            .filter(|_| within)
            .unwrap_or(0)
    })
}

impl Adapter for Scannet {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn further_files(&self) -> Vec<PathBuf> {
        let maps = self.maps.iter();
        maps.flat_map(|maps| {
            maps.depth
                .iter()
                .chain([&maps.labels])
                .chain(&maps.instances)
        })
        .chain(&self.about)
        .cloned()
        .collect()
    }

    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let maps = &self.maps[frame.index];
        let labels = png(&maps.labels, &[SampleForm::Grey8, SampleForm::Grey16])?;
        check_same_size(&maps.labels, &labels, rgb)?;
        let segments = match &maps.instances {
            Some(path) => {
                let instances = png(path, &[SampleForm::Grey8, SampleForm::Grey16])?;
                check_same_size(path, &instances, rgb)?;
                // Each pair of label and instance gets a number. If 8 bits overflowed, objects with different labels stay
                // separate.
                let mut pairs = BTreeMap::new();
                let both = || {
                    labels
                        .iter()
                        .zip(&instances)
                        .filter(|(_, instance)| **instance != 0)
                };
                for (label, instance) in both() {
                    pairs.entry((*label, *instance)).or_insert(0);
                }
                for (number, id) in (1..).zip(pairs.values_mut()) {
                    *id = number;
                }
                let ids = labels
                    .iter()
                    .zip(&instances)
                    .map(|pair| pairs.get(&(*pair.0, *pair.1)).copied().unwrap_or(0));
                let ids = Array2::from_shape_vec(labels.dim(), ids.collect());
                Some(ids.map_err(|e| Error::data(path.display(), e))?)
            }
            None => None,
        };
        let depth = match &maps.depth {
            Some(path) => {
                let depth = depth(path, Some(self.depth_scale))?;
                let same = depth.dim() == (rgb.height(), rgb.width());
                let cameras = frame
                    .intrinsics
                    .zip(maps.depth_camera)
                    .map(|(color, depth)| [color, depth]);
                Some(if same {
                    depth
                } else {
                    resampled(&depth, rgb, cameras)
                })
            }
            None => None,
        };
        Ok(FrameMaps {
            depth,
            semantic: Some(labels),
            segments,
            room: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_resampled_to_the_pixels_of_the_image() {
        let depth = Array2::from_shape_vec((1, 2), vec![7, 9]).unwrap();
        let rgb = Rgb::black(2, 4);
        let found = resampled(&depth, &rgb, None);
        assert_eq!(found.into_raw_vec_and_offset().0, [7, 7, 9, 9, 7, 7, 9, 9]);
        // A colour camera with half the field of view sees the middle of the depth map.
        let deep = Array2::from_shape_vec((1, 5), vec![1, 2, 3, 4, 5]).unwrap();
        let camera = |fx, cx| Intrinsics {
            fx,
            fy: 1.0,
            cx,
            cy: 0.0,
        };
        let found = resampled(
            &deep,
            &Rgb::black(1, 3),
            Some([camera(2.0, 1.0), camera(2.0, 2.0)]),
        );
        assert_eq!(found.into_raw_vec_and_offset().0, [2, 3, 4]);
        let found = resampled(
            &deep,
            &Rgb::black(1, 3),
            Some([camera(1.0, 1.0), camera(3.0, 2.0)]),
        );
        assert_eq!(found.into_raw_vec_and_offset().0, [0, 3, 0]);
    }
}
