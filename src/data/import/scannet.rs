//! Extracted frames of ScanNet: one folder per scene.
//!
//! A scene has `<scene>/color/<n>.jpg`, `depth/<n>.png` (millimetres), `pose/<n>.txt` and one of two kinds of label
//! maps: `label-filt` and `instance-filt` (ScanNet's numbers, with `scannetv2-labels.combined.tsv` in the folder of the
//! scenes) or, as in frames_25k, `label` (NYU40) and `instance` (label · 1000 + number). Depth maps are smaller than
//! images and are resampled with both cameras; labels are never scaled. A frame whose pose is unknown (`-inf`) is left
//! out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ndarray::{Array2, ShapeError};
use serde::Deserialize;

use super::files::{
    Adapter, FrameMaps, IMAGES, ListedFrame, Listing, MapArgs, check_same_size, file_name, files, folders, read_depth,
    read_numbers, read_png,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{bytes, json, text};
use darkqa_base::labels::{UNKNOWN, canonical, class_override, space};
use darkqa_base::types::{Intrinsics, Label, Labels, Rgb};
use darkqa_pictures::raw_png::SampleForm;

/// File name of the table of ScanNet's label numbers.
const LABEL_TABLE: &str = "scannetv2-labels.combined.tsv";

/// Frames per second of the sensor. The name of a frame is its number.
const FRAME_RATE: f64 = 30.0;

/// Metres per unit of depth.
const DEPTH_SCALE: f64 = 0.001;

/// Folder of ScanNet scenes.
#[derive(Debug)]
pub(super) struct Scannet {
    listing: Listing,
    maps: Vec<ScannetMaps>,
    depth_scale: f64,
    /// Files about scenes, and the table of labels.
    scene_files: Vec<PathBuf>,
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
enum LabelNumbering {
    /// The label numbers of ScanNet's table.
    Scannet,
    /// The label numbers of NYU40.
    Nyu40,
}

impl Scannet {
    pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Self> {
        let mut set = Self {
            listing: Listing::default(),
            maps: Vec::new(),
            depth_scale: args.depth_scale.unwrap_or(DEPTH_SCALE),
            scene_files: Vec::new(),
        };
        let scenes: Vec<PathBuf> = folders(folder)?.into_iter().filter(|scene| scene.join("color").is_dir()).collect();
        let numbering = if scenes.iter().any(|scene| scene.join("label-filt").is_dir()) {
            LabelNumbering::Scannet
        } else {
            LabelNumbering::Nyu40
        };
        set.listing.labels = match numbering {
            LabelNumbering::Scannet => {
                let path = folder.join(LABEL_TABLE);
                let labels = read_label_table(&path)?;
                set.scene_files.push(path);
                labels
            }
            LabelNumbering::Nyu40 => space("nyu40").unwrap_or_default(),
        };
        for scene in scenes {
            set.add_scene(&scene, numbering)?;
        }
        Ok(set)
    }

    fn add_scene(&mut self, folder: &Path, numbering: LabelNumbering) -> Result<()> {
        let name = file_name(folder);
        check_overflow(folder, &name)?;
        let color_file = intrinsics_file(folder, "color");
        let depth_file = intrinsics_file(folder, "depth");
        let color_camera = color_file.as_deref().map(read_intrinsics).transpose()?;
        let depth_camera = depth_file.as_deref().map(read_intrinsics).transpose()?;
        let room_file = folder.join(format!("{name}.txt"));
        let room = read_room_type(&room_file)?;
        self.scene_files.extend(color_file.into_iter().chain(depth_file));
        self.scene_files.extend([room_file, folder.join(format!("{name}.aggregation.json"))]);
        let (label_folder, instance_folder) = match numbering {
            LabelNumbering::Scannet => ("label-filt", "instance-filt"),
            LabelNumbering::Nyu40 => ("label", "instance"),
        };
        let labels = files(&folder.join(label_folder), &[".png"])?;
        let instances = files(&folder.join(instance_folder), &[".png"])?;
        let depths = files(&folder.join("depth"), &[".png"])?;
        let poses = files(&folder.join("pose"), &[".txt"])?;
        self.scene_files.extend(poses.values().cloned());
        for (frame, rgb) in files(&folder.join("color"), &IMAGES)? {
            let pose = poses.get(&frame).map(|path| read_numbers(path)).transpose()?;
            if pose.as_ref().is_some_and(|pose| pose.iter().any(|number| !number.is_finite())) {
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
                time: number.map(|number| f64::from(number) / FRAME_RATE),
                pose,
                intrinsics: color_camera,
                room: room.clone(),
                rgb,
                index: self.maps.len() - 1,
                frame,
            });
        }
        Ok(())
    }
}

/// Used fields of `<scene>.aggregation.json`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Aggregation {
    seg_groups: Vec<serde_json::Value>,
}

/// Refuses a scene with more than 255 objects if its instance maps have 8 bits, because the numbers wrap around.
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

/// Reads the table of ScanNet's label numbers.
fn read_label_table(path: &Path) -> Result<Labels> {
    let bytes = bytes(path)?;
    let mut reader = csv::ReaderBuilder::new().delimiter(b'\t').flexible(true).from_reader(&*bytes);
    let header = reader.headers().map_err(|e| Error::data(path.display(), e))?.clone();
    let [id, raw, class] = [
        column_index(path, &header, "id")?,
        column_index(path, &header, "raw_category")?,
        column_index(path, &header, "mpcat40")?,
    ];
    let known = canonical();
    let mut labels = Labels { space: "scannet".into(), void: [0].into(), ..Labels::default() };
    for row in reader.records() {
        let row = row.map_err(|e| Error::data(path.display(), e))?;
        let Ok(id) = cell(&row, id).parse::<u16>() else {
            continue;
        };
        let class = class_override(cell(&row, raw)).unwrap_or(cell(&row, class));
        if matches!(class, "void" | "unlabeled") {
            labels.void.insert(id);
            continue;
        }
        let class = if known.contains(class) { class } else { UNKNOWN };
        let label = Label { name: cell(&row, raw).to_owned(), canonical: class.to_owned() };
        labels.labels.insert(id, label);
    }
    // Annotators used free text, so every class of the table is expressible.
    labels.expressible = labels.labels.values().map(|label| label.canonical.clone()).collect::<BTreeSet<String>>();
    Ok(labels)
}

fn column_index(path: &Path, header: &csv::StringRecord, name: &str) -> Result<usize> {
    header
        .iter()
        .position(|column| column == name)
        .ok_or_else(|| Error::data(path.display(), format_args!("no column {name:?}")))
}

fn cell(row: &csv::StringRecord, column: usize) -> &str {
    row.get(column).unwrap_or_default().trim()
}

/// File with the intrinsics of the `color` or `depth` camera, if it exists.
fn intrinsics_file(folder: &Path, camera: &str) -> Option<PathBuf> {
    [format!("intrinsic/intrinsic_{camera}.txt"), format!("intrinsics_{camera}.txt")]
        .into_iter()
        .map(|name| folder.join(name))
        .find(|path| path.exists())
}

/// Reads the intrinsics in a file with a 4 × 4 matrix.
fn read_intrinsics(path: &Path) -> Result<Intrinsics> {
    match read_numbers(path)?[..] {
        [fx, _, cx, _, _, fy, cy, ..] if fx > 0.0 && fy > 0.0 => Ok(Intrinsics { fx, fy, cx, cy }),
        [fx, _, _, _, _, fy, _, ..] => Err(Error::data(
            path.display(),
            format_args!("focal lengths of {fx} and {fy} pixels; numbers above 0 expected"),
        )),
        _ => Err(Error::data(path.display(), "a 4 × 4 matrix expected")),
    }
}

/// Reads the room type of a scene, from a line such as `sceneType = Bedroom / Hotel`.
fn read_room_type(path: &Path) -> Result<Option<String>> {
    if !path.exists() {
        return Ok(None);
    }
    Ok(text(path)?
        .lines()
        .filter_map(|line| line.split_once('='))
        .find(|(key, _)| key.trim() == "sceneType")
        .map(|(_, room)| room.split('/').next().unwrap_or_default().trim().to_lowercase()))
}

/// Resamples depth to the pixels of an image: the nearest pixel through both cameras, or by relative position if a
/// camera is unknown.
fn resample(depth: &Array2<u32>, rgb: &Rgb, cameras: Option<[Intrinsics; 2]>) -> Array2<u32> {
    let (height, width) = depth.dim();
    let scale = [width as f64 / rgb.width() as f64, height as f64 / rgb.height() as f64];
    let along = |i: usize, axis: usize| -> f64 {
        match &cameras {
            Some([color, depth]) if axis == 0 => (i as f64 - color.cx) / color.fx * depth.fx + depth.cx,
            Some([color, depth]) => (i as f64 - color.cy) / color.fy * depth.fy + depth.cy,
            None => (i as f64 + 0.5) * scale[axis] - 0.5,
        }
    };
    let columns: Vec<f64> = (0..rgb.width()).map(|x| along(x, 0).round()).collect();
    let rows: Vec<f64> = (0..rgb.height()).map(|y| along(y, 1).round()).collect();
    Array2::from_shape_fn((rgb.height(), rgb.width()), |(y, x)| {
        let (row, column) = (rows[y], columns[x]);
        // Also false for NaN.
        let is_inside = row >= 0.0 && column >= 0.0;
        depth.get((row as usize, column as usize)).copied().filter(|_| is_inside).unwrap_or(0)
    })
}

/// Numbers the segments: each pair of label and instance gets a number, so that objects with different labels stay
/// separate even if the 8 bits of their instance numbers overflowed.
fn number_segments(labels: &Array2<u16>, instances: &Array2<u16>) -> Result<Array2<u32>, ShapeError> {
    let distinct: BTreeSet<(u16, u16)> =
        labels.iter().copied().zip(instances.iter().copied()).filter(|(_, instance)| *instance != 0).collect();
    let numbers: BTreeMap<(u16, u16), u32> = distinct.into_iter().zip(1..).collect();
    let ids = labels
        .iter()
        .copied()
        .zip(instances.iter().copied())
        .map(|pair| numbers.get(&pair).copied().unwrap_or(0))
        .collect();
    Array2::from_shape_vec(labels.dim(), ids)
}

impl Adapter for Scannet {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn other_files(&self) -> Vec<PathBuf> {
        self.maps
            .iter()
            .flat_map(|maps| maps.depth.iter().chain([&maps.labels]).chain(&maps.instances))
            .chain(&self.scene_files)
            .cloned()
            .collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let maps = &self.maps[frame.index];
        let labels = read_png(&maps.labels, &[SampleForm::Grey8, SampleForm::Grey16])?;
        check_same_size(&maps.labels, &labels, rgb)?;
        let segments = match &maps.instances {
            Some(path) => {
                let instances = read_png(path, &[SampleForm::Grey8, SampleForm::Grey16])?;
                check_same_size(path, &instances, rgb)?;
                let ids = number_segments(&labels, &instances).map_err(|e| Error::data(path.display(), e))?;
                Some(ids)
            }
            None => None,
        };
        let depth = match &maps.depth {
            Some(path) => {
                let depth = read_depth(path, Some(self.depth_scale))?;
                let has_image_size = depth.dim() == (rgb.height(), rgb.width());
                let cameras = frame.intrinsics.zip(maps.depth_camera).map(|(color, depth)| [color, depth]);
                Some(if has_image_size { depth } else { resample(&depth, rgb, cameras) })
            }
            None => None,
        };
        Ok(FrameMaps { depth, semantic: Some(labels), segments, room: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(fx: f64, cx: f64) -> Intrinsics {
        Intrinsics { fx, fy: 1.0, cx, cy: 0.0 }
    }

    #[test]
    fn depth_is_resampled_to_image_pixels() {
        let depth = Array2::from_shape_vec((1, 2), vec![7, 9]).unwrap();
        let rgb = Rgb::black(2, 4);
        let found = resample(&depth, &rgb, None);
        assert_eq!(found.into_raw_vec_and_offset().0, [7, 7, 9, 9, 7, 7, 9, 9]);
        // A colour camera with half the field of view sees the middle of the depth map.
        let deep = Array2::from_shape_vec((1, 5), vec![1, 2, 3, 4, 5]).unwrap();
        let found = resample(&deep, &Rgb::black(1, 3), Some([camera(2.0, 1.0), camera(2.0, 2.0)]));
        assert_eq!(found.into_raw_vec_and_offset().0, [2, 3, 4]);
        let found = resample(&deep, &Rgb::black(1, 3), Some([camera(1.0, 1.0), camera(3.0, 2.0)]));
        assert_eq!(found.into_raw_vec_and_offset().0, [0, 3, 0]);
    }

    #[test]
    fn focal_lengths_must_be_positive() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("intrinsic_color.txt");
        for (fx, is_read) in [("577.87", true), ("0", false), ("-1", false), ("nan", false)] {
            let matrix = format!("{fx} 0 319.5 0\n0 577.87 239.5 0\n0 0 1 0\n0 0 0 1\n");
            std::fs::write(&path, matrix).unwrap();
            assert_eq!(read_intrinsics(&path).is_ok(), is_read, "{fx}");
        }
    }
}
