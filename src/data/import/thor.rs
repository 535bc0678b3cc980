//! Dumps of AI2-THOR and ProcTHOR: one folder per scene.
//!
//! A scene has `<scene>/rgb/<frame>.png`, `depth/<frame>.npy` (metres), `instance/<frame>.png` (the colours of
//! `event.instance_segmentation_frame`) and `colors.json`, `event.color_to_object_id` with keys like `"(12, 34, 56)"`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::files::{
    Adapter, FrameMaps, IMAGES, ListedFrame, Listing, MapArgs, check_same_size, class_numbers, file_name, files,
    folders, map_paths, read_frame_depth, read_id_image,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::json;
use darkqa_base::labels;
use darkqa_base::types::{Rgb, SegmentName};

/// Folder of AI2-THOR scenes.
#[derive(Debug)]
pub(super) struct Thor {
    listing: Listing,
    /// Paths of the depth map and the instance image of each frame.
    maps: Vec<(Option<PathBuf>, PathBuf)>,
    /// Segment number of each colour, by scene.
    colors: BTreeMap<String, BTreeMap<[u8; 3], u32>>,
    /// Number of each class.
    numbers: BTreeMap<String, u16>,
    depth_scale: Option<f64>,
    /// Paths of `colors.json`.
    color_files: Vec<PathBuf>,
}

impl Thor {
    pub(super) fn open(folder: &Path, args: &MapArgs) -> Result<Self> {
        let listing = Listing::with_mpcat40(args);
        let mut set = Self {
            numbers: class_numbers(&listing.labels),
            listing,
            maps: Vec::new(),
            colors: BTreeMap::new(),
            depth_scale: args.depth_scale,
            color_files: Vec::new(),
        };
        for scene in folders(folder)? {
            if scene.join("instance").is_dir() {
                set.add_scene(&scene)?;
            }
        }
        Ok(set)
    }

    fn add_scene(&mut self, folder: &Path) -> Result<()> {
        let name = file_name(folder);
        let color_file = folder.join("colors.json");
        let SceneColors { colors, names } = SceneColors::read(&color_file)?;
        self.color_files.push(color_file);
        let depths = files(&folder.join("depth"), &[".npy", ".png"])?;
        let instances = files(&folder.join("instance"), &[".png"])?;
        for (frame, rgb) in files(&folder.join("rgb"), &IMAGES)? {
            let Some(instance) = instances.get(&frame) else {
                let problem = format_args!("no instances of the frame {frame:?}");
                return Err(Error::data(folder.join("instance").display(), problem));
            };
            self.maps.push((depths.get(&frame).cloned(), instance.clone()));
            self.listing.frames.push(ListedFrame {
                room: room_type(&name).map(str::to_owned),
                ..ListedFrame::new(&name, frame, rgb, self.maps.len() - 1)
            });
        }
        self.listing.names.insert(name.clone(), names);
        self.colors.insert(name, colors);
        Ok(())
    }
}

/// Content of the `colors.json` of a scene. Segments are numbered in the order of their object ids.
struct SceneColors {
    /// Segment number of each colour.
    colors: BTreeMap<[u8; 3], u32>,
    /// Name of each segment.
    names: BTreeMap<u32, SegmentName>,
}

impl SceneColors {
    fn read(path: &Path) -> Result<Self> {
        let file: BTreeMap<String, String> = json(path)?;
        let mut objects: BTreeMap<&str, Vec<[u8; 3]>> = BTreeMap::new();
        for (key, object) in &file {
            let parts: Vec<u8> =
                key.split(|letter: char| !letter.is_ascii_digit()).filter_map(|part| part.parse().ok()).collect();
            let color = parts.try_into().map_err(|_| {
                let problem = format_args!("{key:?} is not a colour; three numbers expected, as in \"(12, 34, 56)\"");
                Error::data(path.display(), problem)
            })?;
            objects.entry(object).or_default().push(color);
        }
        let (mut colors, mut names) = (BTreeMap::new(), BTreeMap::new());
        for (id, (object, object_colors)) in (1..).zip(objects) {
            let kind = object.split('|').next().unwrap_or_default();
            let (name, class) = labels::thor(kind);
            let name = SegmentName { name, canonical: class.to_owned(), region: None };
            names.insert(id, name);
            colors.extend(object_colors.into_iter().map(|color| (color, id)));
        }
        Ok(Self { colors, names })
    }
}

/// Room type of an iTHOR scene, by the number in its name.
fn room_type(scene: &str) -> Option<&'static str> {
    let digits: String = scene.strip_prefix("FloorPlan")?.chars().take_while(char::is_ascii_digit).collect();
    match digits.parse::<u32>().ok()? {
        1..=30 => Some("kitchen"),
        201..=230 => Some("living room"),
        301..=330 => Some("bedroom"),
        401..=430 => Some("bathroom"),
        _ => None,
    }
}

impl Adapter for Thor {
    fn listing(&self) -> &Listing {
        &self.listing
    }

    fn assumes_metres(&self) -> bool {
        self.depth_scale.is_none()
    }

    fn other_files(&self) -> Vec<PathBuf> {
        map_paths(&self.maps).chain(&self.color_files).cloned().collect()
    }

    fn read_maps(&self, frame: &ListedFrame, rgb: &Rgb) -> Result<FrameMaps> {
        let (depth_path, instance) = &self.maps[frame.index];
        let segment_by_color = &self.colors[&frame.scene];
        let colors = read_id_image(instance)?;
        let (pixels, _) = colors.samples().as_chunks::<3>();
        let ids: Vec<u32> = pixels.iter().map(|color| segment_by_color.get(color).copied().unwrap_or(0)).collect();
        let segments = Array2::from_shape_vec((colors.height(), colors.width()), ids)
            .map_err(|e| Error::data(instance.display(), e))?;
        check_same_size(instance, &segments, rgb)?;
        if segments.iter().all(|id| *id == 0) {
            let problem = "no pixel has a colour of colors.json; use the file of the same scene and run";
            return Err(Error::data(instance.display(), problem));
        }
        let numbers: BTreeMap<u32, u16> = self.listing.names[&frame.scene]
            .iter()
            .map(|(id, name)| (*id, self.numbers.get(&name.canonical).copied().unwrap_or(0)))
            .collect();
        let semantic = segments.mapv(|id| numbers.get(&id).copied().unwrap_or(0));
        Ok(FrameMaps {
            depth: read_frame_depth(depth_path.as_deref(), self.depth_scale, rgb)?,
            semantic: Some(semantic),
            segments: Some(segments),
            room: None,
        })
    }
}
