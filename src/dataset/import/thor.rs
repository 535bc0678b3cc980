//! Dumps of AI2-THOR and ProcTHOR: one folder a scene.
//!
//! `<scene>/rgb/<frame>.png`, `depth/<frame>.npy` (metres), `instance/<frame>.png` (the colours of
//! `event.instance_segmentation_frame`) and `colors.json`, `event.color_to_object_id` with keys like `"(12, 34, 56)"`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::adapter::{Adapter, Incoming, Read, Stated, mpcat40, numbers, pinhole};
use super::files::{depth, files, folders, last, picture, same_size, text};
use super::names;
use crate::error::{Error, Result};
use crate::types::{DepthKind, Intrinsics, Labels, Rgb, SegmentName};

/// The scenes of a folder.
#[derive(Debug)]
pub(super) struct Thor {
    frames: Vec<Incoming>,
    /// Depth and instances of each.
    maps: Vec<(Option<PathBuf>, PathBuf)>,
    scenes: BTreeMap<String, Scene>,
    labels: Labels,
    numbers: BTreeMap<String, u16>,
    unlisted: BTreeMap<String, usize>,
    depth_scale: Option<f64>,
    hfov: Option<f64>,
}

/// The objects of a scene.
#[derive(Debug)]
struct Scene {
    /// The segment of each colour.
    colors: BTreeMap<[u8; 3], u32>,
    names: BTreeMap<u32, SegmentName>,
}

impl Thor {
    pub(super) fn open(folder: &Path, stated: &Stated) -> Result<Self> {
        let labels = mpcat40();
        let mut set = Self {
            frames: Vec::new(),
            maps: Vec::new(),
            scenes: BTreeMap::new(),
            numbers: numbers(&labels),
            labels,
            unlisted: BTreeMap::new(),
            depth_scale: stated.depth_scale,
            hfov: stated.hfov,
        };
        for scene in folders(folder)? {
            if scene.join("instance").is_dir() {
                set.add(&scene)?;
            }
        }
        Ok(set)
    }

    fn add(&mut self, folder: &Path) -> Result<()> {
        let name = last(folder);
        let scene = scene(&folder.join("colors.json"))?;
        let depths = files(&folder.join("depth"), &[".npy", ".png"])?;
        let instances = files(&folder.join("instance"), &[".png"])?;
        for (frame, rgb) in files(&folder.join("rgb"), &[".png", ".jpg", ".jpeg"])? {
            let Some(instance) = instances.get(&frame) else {
                let problem = format_args!("no instances of the frame {frame:?}");
                return Err(Error::data(folder.join("instance").display(), problem));
            };
            self.maps
                .push((depths.get(&frame).cloned(), instance.clone()));
            self.frames.push(Incoming {
                scene: name.clone(),
                frame,
                time: None,
                pose: None,
                intrinsics: None,
                room: room(&name).map(str::to_owned),
                rgb,
                index: self.maps.len() - 1,
            });
        }
        self.scenes.insert(name, scene);
        Ok(())
    }
}

/// The objects by their colours: segments in the order of the objects' names.
fn scene(path: &Path) -> Result<Scene> {
    let wrong = |problem: String| Error::data(path.display(), problem);
    let file: BTreeMap<String, String> =
        serde_json::from_str(&text(path)?).map_err(|e| wrong(e.to_string()))?;
    let mut objects: BTreeMap<&str, Vec<[u8; 3]>> = BTreeMap::new();
    for (key, object) in &file {
        let parts: Vec<u8> = key
            .split(|letter: char| !letter.is_ascii_digit())
            .filter_map(|part| part.parse().ok())
            .collect();
        let color = parts.try_into().map_err(|_| {
            wrong(format!(
                "{key:?} is no colour; three numbers expected, as in \"(12, 34, 56)\""
            ))
        })?;
        objects.entry(object).or_default().push(color);
    }
    let (mut colors, mut names) = (BTreeMap::new(), BTreeMap::new());
    for (id, (object, of_object)) in (1..).zip(objects) {
        let kind = object.split('|').next().unwrap_or_default();
        let (name, class) = names::thor(kind);
        let name = SegmentName {
            name,
            canonical: class.to_owned(),
            region: None,
        };
        names.insert(id, name);
        colors.extend(of_object.into_iter().map(|color| (color, id)));
    }
    Ok(Scene { colors, names })
}

/// The room of one of iTHOR's scenes, by its number.
fn room(scene: &str) -> Option<&'static str> {
    let digits: String = scene
        .strip_prefix("FloorPlan")?
        .chars()
        .take_while(char::is_ascii_digit)
        .collect();
    match digits.parse::<u32>().ok()? {
        1..=30 => Some("kitchen"),
        201..=230 => Some("living room"),
        301..=330 => Some("bedroom"),
        401..=430 => Some("bathroom"),
        _ => None,
    }
}

impl Adapter for Thor {
    fn frames(&self) -> &[Incoming] {
        &self.frames
    }

    fn labels(&self) -> &Labels {
        &self.labels
    }

    fn names(&self, scene: &str) -> BTreeMap<u32, SegmentName> {
        self.scenes
            .get(scene)
            .map_or_else(BTreeMap::new, |scene| scene.names.clone())
    }

    fn depth_kind(&self) -> DepthKind {
        DepthKind::Planar
    }

    fn camera(&self, _frame: &Incoming, rgb: &Rgb) -> Option<Intrinsics> {
        self.hfov
            .map(|hfov| pinhole(rgb.width(), rgb.height(), hfov))
    }

    fn has_segments(&self) -> bool {
        true
    }

    fn unlisted(&self) -> &BTreeMap<String, usize> {
        &self.unlisted
    }

    fn read(&self, frame: &Incoming, rgb: &Rgb) -> Result<Read> {
        let (deep, instance) = &self.maps[frame.index];
        let depth = match deep {
            Some(path) => {
                let scale = self
                    .depth_scale
                    .filter(|_| path.extension().is_some_and(|end| end != "npy"));
                let depth = depth(path, scale)?;
                same_size(path, &depth, rgb)?;
                Some(depth)
            }
            None => None,
        };
        let scene = &self.scenes[&frame.scene];
        let colors = picture(instance)?;
        let (pixels, _) = colors.samples().as_chunks::<3>();
        let ids: Vec<u32> = pixels
            .iter()
            .map(|color| scene.colors.get(color).copied().unwrap_or(0))
            .collect();
        let segments = Array2::from_shape_vec((colors.height(), colors.width()), ids);
        let segments = segments.map_err(|e| Error::data(instance.display(), e))?;
        same_size(instance, &segments, rgb)?;
        if segments.iter().all(|id| *id == 0) {
            let problem =
                "no pixel has a colour of colors.json; it must be that of the same scene and run";
            return Err(Error::data(instance.display(), problem));
        }
        let numbers: BTreeMap<u32, u16> = scene
            .names
            .iter()
            .map(|(id, name)| (*id, self.numbers.get(&name.canonical).copied().unwrap_or(0)))
            .collect();
        let semantic = segments.mapv(|id| numbers.get(&id).copied().unwrap_or(0));
        Ok(Read {
            depth,
            semantic: Some(semantic),
            segments: Some(segments),
            room: None,
        })
    }
}
