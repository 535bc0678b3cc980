//! SUN RGB-D as it is distributed: `<sensor>/…/<frame>/image/*.jpg`, `depth_bfx/*.png` or `depth/*.png`,
//! `intrinsics.txt`, `scene.txt` and `annotation2Dfinal/index.json`.
//!
//! Depth is in millimetres, rotated left by three bits (`read3dPoints.m` of its toolbox), and clamped at 8 m. Classes
//! and segments come from the polygons that annotators drew around objects; each object is a segment. If polygons
//! overlap, the smaller one is in front.
//!
//! Rasterization of polygons into label maps: [`draw`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ndarray::Array2;
use serde::Deserialize;
use serde_json::Value;

use super::files::{
    Adapter, FrameMaps, IMAGES, ListedFrame, Listing, check_same_size, file_name, files, folders, read_numbers,
    read_png,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{json, text};
use darkqa_base::labels::{canonical, class_of};
use darkqa_base::types::{Intrinsics, Label, Labels, Rgb};
use darkqa_pictures::raw_png::SampleForm;

/// Depth folders, in order of preference. `depth_bfx` is `depth` with its holes filled, which the toolbox reads
/// (`depthpath` of its `SUNRGBDMeta`).
const DEPTHS: [&str; 2] = ["depth_bfx", "depth"];

/// Maximum depth in millimetres; the toolbox clamps at the same value.
const MAX_DEPTH: u32 = 8_000;

/// Folder of SUN RGB-D frames.
#[derive(Debug)]
pub(super) struct SunRgbd {
    listing: Listing,
    files: Vec<SunRgbdFiles>,
    /// Number of each object name.
    numbers: BTreeMap<String, u16>,
    /// Files of cameras and room types.
    frame_files: Vec<PathBuf>,
}

#[derive(Debug)]
struct SunRgbdFiles {
    /// Name of the depth folder, and the depth file.
    depth: Option<(&'static str, PathBuf)>,
    annotation: PathBuf,
}

/// Used fields of `index.json`.
#[derive(Deserialize)]
struct Index {
    frames: Vec<SunRgbdFrame>,
    objects: Vec<Option<SunRgbdObject>>,
}

#[derive(Deserialize)]
struct SunRgbdFrame {
    #[serde(default)]
    polygon: Vec<ImageShape>,
}

#[derive(Deserialize)]
struct ImageShape {
    x: Value,
    y: Value,
    object: usize,
}

#[derive(Deserialize)]
struct SunRgbdObject {
    name: String,
}

impl SunRgbd {
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let mut set =
            Self { listing: Listing::default(), files: Vec::new(), numbers: BTreeMap::new(), frame_files: Vec::new() };
        set.find_frames(folder, &[])?;
        set.number_names()?;
        set.listing.frames.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(set)
    }

    /// Finds the frames in a folder and its subfolders; `parents` are the names of the folders from the root to it.
    fn find_frames(&mut self, folder: &Path, parents: &[String]) -> Result<()> {
        let annotation = folder.join("annotation2Dfinal").join("index.json");
        if folder.join("image").is_dir() && annotation.is_file() {
            return self.add_frame(folder, parents, annotation);
        }
        for inner in folders(folder)? {
            let name = file_name(&inner);
            self.find_frames(&inner, &[parents, &[name]].concat())?;
        }
        Ok(())
    }

    fn add_frame(&mut self, folder: &Path, parents: &[String], annotation: PathBuf) -> Result<()> {
        let Some(rgb) = files(&folder.join("image"), &IMAGES)?.into_values().next() else {
            return Err(Error::data(folder.join("image").display(), "no image in this folder"));
        };
        let mut depth = None;
        for name in DEPTHS {
            let first = files(&folder.join(name), &[".png"])?.into_values().next();
            depth = depth.or(first.map(|path| (name, path)));
        }
        let camera = folder.join("intrinsics.txt");
        let intrinsics = if camera.exists() {
            match read_numbers(&camera)?[..] {
                [fx, _, cx, _, fy, cy, ..] => Some(Intrinsics { fx, fy, cx, cy }),
                _ => return Err(Error::data(camera.display(), "nine numbers expected")),
            }
        } else {
            None
        };
        let room_file = folder.join("scene.txt");
        let room = room_file.exists().then(|| text(&room_file)).transpose()?;
        self.frame_files.extend([camera, room_file]);
        let (frame, scene) = parents
            .split_last()
            .map_or_else(|| ("frame".to_owned(), String::new()), |(frame, scene)| (frame.clone(), scene.join("-")));
        self.files.push(SunRgbdFiles { depth, annotation });
        self.listing.frames.push(ListedFrame {
            scene: if scene.is_empty() { "sunrgbd".to_owned() } else { scene },
            frame,
            time: None,
            pose: None,
            intrinsics,
            room: room.map(|room| room.trim().to_lowercase().replace('_', " ")),
            rgb,
            index: self.files.len() - 1,
        });
        Ok(())
    }

    /// Numbers all object names of the data set alphabetically, so that the numbers do not depend on the order of
    /// files.
    fn number_names(&mut self) -> Result<()> {
        let mut counts = BTreeMap::new();
        for files in &self.files {
            for object in json::<Index>(&files.annotation)?.objects.into_iter().flatten() {
                *counts.entry(normalize_name(&object.name)).or_insert(0_usize) += 1;
            }
        }
        let mut labels = Labels { space: "sunrgbd".into(), void: [0].into(), ..Labels::default() };
        for (number, (name, count)) in (1..=u16::MAX).zip(counts) {
            let Some(class) = class_of(&name, &name, count, &mut self.listing.unlisted) else {
                continue;
            };
            let label = Label { name: name.clone(), canonical: class.to_owned() };
            labels.labels.insert(number, label);
            self.numbers.insert(name, number);
        }
        // Annotators used free text, so every class is expressible.
        labels.expressible = canonical().into_iter().collect::<BTreeSet<String>>();
        self.listing.labels = labels;
        Ok(())
    }
}

/// Name of an object in lower case, without the suffix that annotators added to distinguish objects: `chair:1`, `chair
/// 2`.
fn normalize_name(name: &str) -> String {
    let name = name.split(':').next().unwrap_or_default().trim();
    name.trim_end_matches(|letter: char| letter.is_ascii_digit() || letter == '_').trim().to_lowercase()
}

/// Numbers in a JSON array, or a single number, because the files contain both.
fn number_list(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().map(|number| number.as_f64().unwrap_or(f64::NAN)).collect(),
        single => single.as_f64().into_iter().collect(),
    }
}

impl Adapter for SunRgbd {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn depth_folder(&self, frame: &ListedFrame) -> Option<&'static str> {
        let (folder, _) = self.files[frame.index].depth.as_ref()?;
        Some(folder)
    }

    fn other_files(&self) -> Vec<PathBuf> {
        self.files
            .iter()
            .flat_map(|files| files.depth.iter().map(|(_, path)| path).chain([&files.annotation]))
            .chain(&self.frame_files)
            .cloned()
            .collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let files = &self.files[frame.index];
        let depth = match &files.depth {
            Some((_, path)) => {
                let rotated = read_png(path, &[SampleForm::Grey16])?;
                check_same_size(path, &rotated, rgb)?;
                Some(rotated.mapv(|value| u32::from(value.rotate_right(3)).min(MAX_DEPTH)))
            }
            None => None,
        };
        let index: Index = json(&files.annotation)?;
        let shapes = index.frames.into_iter().next().map_or_else(Vec::new, |view| view.polygon);
        let polygons: Vec<Polygon<(u16, u32)>> = shapes
            .into_iter()
            .filter_map(|shape| {
                let name = &index.objects.get(shape.object)?.as_ref()?.name;
                let number = self.numbers.get(&normalize_name(name)).copied().unwrap_or(0);
                let corners = number_list(&shape.x).into_iter().zip(number_list(&shape.y)).collect();
                Some(Polygon { corners, value: (number, shape.object as u32 + 1) })
            })
            .collect();
        let map: Array2<(u16, u32)> = draw(&polygons, [rgb.width(), rgb.height()]);
        Ok(FrameMaps {
            depth,
            semantic: Some(map.mapv(|(number, _)| number)),
            segments: Some(map.mapv(|(_, object)| object)),
            room: None,
        })
    }
}

/// A closed polygon and the value of the pixels inside. Corners are in pixels; (0, 0) is the centre of the first pixel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Polygon<T> {
    pub(super) corners: Vec<(f64, f64)>,
    pub(super) value: T,
}

impl<T> Polygon<T> {
    /// Twice the area in square pixels, by the shoelace formula.
    fn size(&self) -> f64 {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|((x, y), (u, v))| x * v - u * y).sum::<f64>().abs()
    }
}

/// Draws polygons, the largest first, so that a large object does not hide objects on it or in front of it. A pixel is
/// inside a polygon if its centre is, by the even-odd rule.
pub(super) fn draw<T: Copy + Default>(polygons: &[Polygon<T>], [width, height]: [usize; 2]) -> Array2<T> {
    let mut map = Array2::default((height, width));
    let mut order: Vec<&Polygon<T>> = polygons.iter().collect();
    order.sort_by(|a, b| b.size().total_cmp(&a.size()));
    for polygon in order {
        for y in 0..height {
            let mut row = map.row_mut(y);
            for pair in crossings(&polygon.corners, y as f64).chunks_exact(2) {
                let from = libm::ceil(pair[0]).max(0.0) as usize;
                let to = (libm::ceil(pair[1]).max(0.0) as usize).min(width);
                row.iter_mut().take(to).skip(from).for_each(|pixel| *pixel = polygon.value);
            }
        }
    }
    map
}

/// X coordinates where the edges of a polygon cross a row of pixels, from left to right.
fn crossings(corners: &[(f64, f64)], y: f64) -> Vec<f64> {
    let next = corners.iter().cycle().skip(1);
    let mut crossings: Vec<f64> = corners
        .iter()
        .zip(next)
        .filter(|((_, a), (_, b))| (*a <= y) != (*b <= y))
        .map(|((x, a), (u, b))| x + (y - a) / (b - a) * (u - x))
        .filter(|x| x.is_finite())
        .collect();
    crossings.sort_by(f64::total_cmp);
    crossings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(left: f64, side: f64, value: u8) -> Polygon<u8> {
        Polygon { corners: vec![(left, 0.0), (left + side, 0.0), (left + side, side), (left, side)], value }
    }

    #[test]
    fn small_polygons_are_drawn_over_large_ones() {
        let map = draw(&[square(1.0, 1.0, 7), square(0.0, 3.0, 5)], [4, 3]);
        assert_eq!(map.into_raw_vec_and_offset().0, [5, 7, 5, 0, 5, 5, 5, 0, 5, 5, 5, 0]);
    }

    #[test]
    fn unusual_polygons_do_not_fail() {
        for corners in [
            vec![],
            vec![(1.0, 1.0)],
            vec![(f64::NAN, 0.0), (3.0, 9.0), (1.0, 2.0)],
            vec![(-9.0, -9.0), (99.0, -9.0), (99.0, 99.0), (-9.0, 99.0)],
        ] {
            let map = draw(&[Polygon { corners: corners.clone(), value: 1_u8 }], [3, 2]);
            let whole = corners.len() == 4;
            assert_eq!(map.sum(), if whole { 6 } else { map.sum() });
        }
    }
}
