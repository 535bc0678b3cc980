//! SUN RGB-D as it is distributed: `<sensor>/…/<frame>/image/*.jpg`, `depth_bfx/*.png` or `depth/*.png`, `intrinsics.txt`,
//! `scene.txt` and `annotation2Dfinal/index.json`.
//!
//! A depth file holds millimetres rotated left by three bits (`read3dPoints.m` of its toolbox), clamped at 8 m. The classes and
//! segments are the polygons that annotators drew around objects, each object a segment; where they overlap the smaller one is
//! in front.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use ndarray::Array2;
use serde::Deserialize;
use serde_json::Value;

use super::adapter::{Adapter, FrameMaps, ListedFrame, Listing};
use super::files::{files, folders, last, numbers, png, same_size};
use super::polygons::{Polygon, draw};
use crate::dataset::raw_png::SampleForm;
use crate::error::{Error, Result};
use crate::files::reading::{json, text};
use crate::labels::canonical;
use crate::labels::names::class_of;
use crate::types::{Intrinsics, Label, Labels, Rgb};

/// What the toolbox takes for the end of the sensor's range, in millimetres.
const MOST_DEPTH: u32 = 8_000;

/// The frames of a folder.
#[derive(Debug)]
pub(super) struct SunRgbd {
    listing: Listing,
    files: Vec<SunRgbdFiles>,
    numbers: BTreeMap<String, u16>,
}

#[derive(Debug)]
struct SunRgbdFiles {
    depth: Option<PathBuf>,
    annotation: PathBuf,
}

/// `index.json`, as far as it is used.
#[derive(Deserialize)]
struct Index {
    frames: Vec<SunRgbdFrame>,
    objects: Vec<Option<SunRgbdObject>>,
}

#[derive(Deserialize)]
struct SunRgbdFrame {
    #[serde(default)]
    polygon: Vec<Shape>,
}

#[derive(Deserialize)]
struct Shape {
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
        let mut set = Self {
            listing: Listing::default(),
            files: Vec::new(),
            numbers: BTreeMap::new(),
        };
        set.walk(folder, &[])?;
        set.name()?;
        set.listing
            .frames
            .sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
        Ok(set)
    }

    /// Looks for frames in a folder and those in it; `way` leads to it.
    fn walk(&mut self, folder: &Path, way: &[String]) -> Result<()> {
        let annotation = folder.join("annotation2Dfinal").join("index.json");
        if folder.join("image").is_dir() && annotation.is_file() {
            return self.add(folder, way, annotation);
        }
        for inner in folders(folder)? {
            let name = last(&inner);
            self.walk(&inner, &[way, &[name]].concat())?;
        }
        Ok(())
    }

    fn add(&mut self, folder: &Path, way: &[String], annotation: PathBuf) -> Result<()> {
        let Some(rgb) = files(&folder.join("image"), &[".jpg", ".jpeg", ".png"])?
            .into_values()
            .next()
        else {
            return Err(Error::data(
                folder.join("image").display(),
                "no image in this folder",
            ));
        };
        let mut depths = files(&folder.join("depth_bfx"), &[".png"])?;
        depths.extend(files(&folder.join("depth"), &[".png"])?);
        let camera = folder.join("intrinsics.txt");
        let intrinsics = match camera
            .exists()
            .then(|| numbers(&camera))
            .transpose()?
            .as_deref()
        {
            Some(&[fx, _, cx, _, fy, cy, ..]) => Some(Intrinsics { fx, fy, cx, cy }),
            Some(_) => return Err(Error::data(camera.display(), "nine numbers expected")),
            None => None,
        };
        let room = folder.join("scene.txt");
        let room = room.exists().then(|| text(&room)).transpose()?;
        let (frame, scene) = way.split_last().map_or_else(
            || ("frame".to_owned(), String::new()),
            |(frame, scene)| (frame.clone(), scene.join("-")),
        );
        self.files.push(SunRgbdFiles {
            depth: depths.into_values().next(),
            annotation,
        });
        self.listing.frames.push(ListedFrame {
            scene: if scene.is_empty() {
                "sunrgbd".to_owned()
            } else {
                scene
            },
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

    /// Gives each word of the whole data set a number: in the order of the words, so that it does not depend on that of files.
    fn name(&mut self) -> Result<()> {
        let mut words = BTreeMap::new();
        for files in &self.files {
            for object in json::<Index>(&files.annotation)?
                .objects
                .into_iter()
                .flatten()
            {
                *words.entry(word(&object.name)).or_insert(0_usize) += 1;
            }
        }
        let mut labels = Labels {
            space: "sunrgbd".into(),
            void: [0].into(),
            ..Labels::default()
        };
        for (number, (word, count)) in (1..=u16::MAX).zip(words) {
            let Some(class) = class_of(&word, &word, count, &mut self.listing.unlisted) else {
                continue;
            };
            let label = Label {
                name: word.clone(),
                canonical: class.to_owned(),
            };
            labels.labels.insert(number, label);
            self.numbers.insert(word, number);
        }
        // Annotators wrote whatever they saw.
        labels.expressible = canonical().into_iter().collect::<BTreeSet<String>>();
        self.listing.labels = labels;
        Ok(())
    }
}

/// A name without what annotators added to tell objects apart: `chair:1`, `chair 2`.
fn word(name: &str) -> String {
    let name = name.split(':').next().unwrap_or_default().trim();
    name.trim_end_matches(|letter: char| letter.is_ascii_digit() || letter == '_')
        .trim()
        .to_lowercase()
}

/// A list of numbers; a single number is one, as the files have it.
fn list(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list
            .iter()
            .map(|number| number.as_f64().unwrap_or(f64::NAN))
            .collect(),
        single => single.as_f64().into_iter().collect(),
    }
}

impl Adapter for SunRgbd {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn read(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let files = &self.files[frame.index];
        let depth = match &files.depth {
            Some(path) => {
                let rotated = png(path, &[SampleForm::Grey16])?;
                same_size(path, &rotated, rgb)?;
                Some(rotated.mapv(|value| u32::from(value.rotate_right(3)).min(MOST_DEPTH)))
            }
            None => None,
        };
        let index: Index = json(&files.annotation)?;
        let shapes = index
            .frames
            .into_iter()
            .next()
            .map_or_else(Vec::new, |view| view.polygon);
        let polygons: Vec<Polygon<(u16, u32)>> = shapes
            .into_iter()
            .filter_map(|shape| {
                let name = &index.objects.get(shape.object)?.as_ref()?.name;
                let number = self.numbers.get(&word(name)).copied().unwrap_or(0);
                let corners = list(&shape.x).into_iter().zip(list(&shape.y)).collect();
                Some(Polygon {
                    corners,
                    value: (number, shape.object as u32 + 1),
                })
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
