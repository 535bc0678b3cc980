//! Import of habitat-sim renders: one folder per scene, with instance names from the original data set.
//!
//! The folder of a scene has these files:
//! - `rgb/<frame>.png`;
//! - `depth/<frame>.npy` (metres) or `.png`, optional;
//! - `semantic/<frame>.npy` or 16-bit `.png` (instance numbers);
//! - one annotation file: `*.semantic.txt` (HM3D-Sem), `*.house` (Matterport3D) or `info_semantic.json` (Replica);
//! - `trajectory.jsonl`, optional, with one line per frame: `{"frame", "t", "pose", "intrinsics"}`.
//!
//! The optional `scenes.json`, next to the scene folders, records how the scenes were rendered (see `renders`).
//!
//! Segment names of an HM3D-Sem scene, from `<scene>.semantic.txt`.
//!
//! The format follows habitat-sim (`src/esp/scene/HM3DSemanticScene.cpp`): the first line is `HM3D Semantic
//! Annotations`, then one line per segment, `id,colour,"name",region`. A name is all text between the quotes and may
//! contain commas.
//!
//! Segment names and room types of a Matterport3D scene, from `<scene>.house`.
//!
//! The first word of a line is its type (Matterport `data_organization.md`): `C` is a category with its class in
//! mpcat40, `O` an object with its region and category, `R` a region with the letter of its room type. In names, `#`
//! represents a space.
//!
//! Record of how scenes were rendered: `scenes.json`, written by the script `hm3d_frames.py`.
//!
//! Segment names of a Replica scene, from `info_semantic.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::files::{
    Adapter, FrameMaps, IMAGES, ListedFrame, Listing, MapArgs, check_same_size, class_numbers, file_name, files,
    folders, map_paths, read_frame_depth, read_segments,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{json_lines, text};
use darkqa_base::labels::{UNKNOWN, class_of, class_override};
use darkqa_base::types::{Intrinsics, Rgb, SegmentName};

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
type SceneSegments = BTreeMap<u32, SegmentName>;

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
        set.listing.renders = read(folder, &set.scenes.keys().collect())?;
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
    fn read_annotations(&mut self, folder: &Path) -> Result<(SceneInfo, SceneSegments)> {
        let annotations = files(folder, &[".semantic.txt", ".house", "info_semantic.json"])?;
        let Some(path) = annotations.into_values().next() else {
            let problem = "none of *.semantic.txt (HM3D-Sem), *.house (Matterport3D), info_semantic.json (Replica) in this folder; one of them must name the instances of the semantic maps";
            return Err(Error::data(folder.display(), problem));
        };
        let content = text(&path)?;
        self.scene_files.push(path.clone());
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (names, rooms) = if extension == "house" {
            let house = parse_mp3d(&content, &self.listing.labels.expressible)
                .map_err(|(line, problem)| Error::line(&path, line, problem))?;
            (house.names, house.rooms)
        } else if extension == "json" {
            let names = parse_replica(&content, &mut self.listing.unlisted)
                .map_err(|problem| Error::data(path.display(), problem))?;
            (names, BTreeMap::new())
        } else {
            let names = parse_hm3d(&content, &mut self.listing.unlisted)
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

const HEAD: &str = "HM3D Semantic Annotations";

/// Parses the names of segments, by number. Segments with an empty or unknown name are left out. Names without a known
/// class are counted in `unlisted`.
///
/// # Errors
/// If a line is invalid: its number, and the problem.
fn parse_hm3d(
    text: &str,
    unlisted: &mut BTreeMap<String, usize>,
) -> Result<BTreeMap<u32, SegmentName>, (usize, String)> {
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines());
    match lines.next() {
        Some((_, head)) if head.trim() == HEAD => {}
        _ => return Err((1, format!("{HEAD:?} expected"))),
    }
    let mut names = BTreeMap::new();
    for (number, line) in lines {
        if line.trim().is_empty() {
            continue;
        }
        let wrong = |problem: &str| (number, format!("{problem} in id,colour,\"name\",region"));
        let mut parts = line.splitn(2, '"');
        let head = parts.next().unwrap_or_default();
        let (name, region) = parts
            .next()
            .and_then(|rest| rest.rsplit_once('"'))
            .ok_or_else(|| wrong("a name between quotes expected"))?;
        let id: u32 = head
            .split(',')
            .next()
            .unwrap_or_default()
            .trim()
            .parse()
            .map_err(|_| wrong("a whole number expected as id"))?;
        let region: i64 =
            region.trim_start_matches(',').trim().parse().map_err(|_| wrong("a whole number expected as region"))?;
        let Some(canonical) = class_of(name, name, 1, unlisted) else {
            continue;
        };
        let segment = SegmentName { name: name.to_owned(), canonical: canonical.to_owned(), region: Some(region) };
        if names.insert(id, segment).is_some() {
            return Err((number, format!("the segment {id} is defined twice")));
        }
    }
    Ok(names)
}

/// Used content of a `.house` file.
#[derive(Debug, Default, PartialEq)]
pub(super) struct House {
    /// Names of segments, by number.
    pub(super) names: BTreeMap<u32, SegmentName>,
    /// Room type of each region, by its number.
    pub(super) rooms: BTreeMap<i64, &'static str>,
}

/// Room type for the letter of a region; `None` for room types that no question asks about.
fn room_type(letter: &str) -> Option<&'static str> {
    Some(match letter {
        "a" | "t" => "bathroom",
        "b" => "bedroom",
        "d" => "dining room",
        "f" | "l" => "living room",
        "j" => "laundry room",
        "k" => "kitchen",
        "o" => "office",
        _ => return None,
    })
}

/// Parses a `.house` file. Categories with a class that is not in `classes` get the class for unknown objects.
///
/// # Errors
/// If a line is invalid: its number, and the problem.
fn parse_mp3d(text: &str, classes: &BTreeSet<String>) -> Result<House, (usize, String)> {
    let mut categories: BTreeMap<&str, (String, String)> = BTreeMap::new();
    let mut objects = Vec::new();
    let mut house = House::default();
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let short = || (number, format!("a line of {} words is too short", words.len()));
        match words.first() {
            Some(&"C") => {
                let [_, index, _, name, _, class, ..] = words[..] else {
                    return Err(short());
                };
                let name = name.replace('#', " ");
                let class = class_override(&name).unwrap_or(class);
                let class = if classes.contains(class) { class } else { UNKNOWN };
                categories.insert(index, (name, class.to_owned()));
            }
            Some(&"O") => {
                let [_, index, region, category, ..] = words[..] else {
                    return Err(short());
                };
                let index: u32 =
                    index.parse().map_err(|_| (number, format!("{index:?} is not the number of an object")))?;
                let region: i64 =
                    region.parse().map_err(|_| (number, format!("{region:?} is not the number of a region")))?;
                objects.push((index, region, category));
            }
            Some(&"R") => {
                let [_, index, _, _, _, letter, ..] = words[..] else {
                    return Err(short());
                };
                let index: i64 =
                    index.parse().map_err(|_| (number, format!("{index:?} is not the number of a region")))?;
                house.rooms.extend(room_type(letter).map(|room| (index, room)));
            }
            _ => {}
        }
    }
    for (index, region, category) in objects {
        if let Some((name, canonical)) = categories.get(category) {
            let name = SegmentName { name: name.clone(), canonical: canonical.clone(), region: Some(region) };
            house.names.insert(index, name);
        }
    }
    Ok(house)
}

/// Value of `schema` in `scenes.json`.
const SCHEMA: &str = "darkqa.renders/1";

/// Reads `scenes.json`, without scenes that are not in `present`, the scenes of the folder. `None` if the file does not
/// exist, or, with a warning, if it is from another tool.
///
/// # Errors
/// If the file is not JSON, or is from an unknown version of the script.
pub(super) fn read(folder: &Path, present: &BTreeSet<&String>) -> Result<Option<Value>> {
    let path = folder.join("scenes.json");
    if !path.is_file() {
        return Ok(None);
    }
    let mut record: Value = serde_json::from_str(&text(&path)?).map_err(|e| Error::data(path.display(), e))?;
    match record["schema"].as_str() {
        Some(SCHEMA) => {}
        Some(other) if other.starts_with("darkqa.renders/") => {
            let problem = format_args!("{SCHEMA:?} expected, not {other:?}");
            return Err(Error::data(path.display(), problem));
        }
        _ => {
            tracing::warn!("{}: not the record of hm3d_frames.py, so it is ignored", path.display());
            return Ok(None);
        }
    }
    let Some(scenes) = record["scenes"].as_array_mut() else {
        let problem = "a list of scenes expected at the key scenes";
        return Err(Error::data(path.display(), problem));
    };
    let recorded: BTreeSet<String> = scenes.iter().map(scene_name).collect();
    for scene in present.iter().filter(|scene| !recorded.contains(**scene)) {
        tracing::warn!("{}: nothing about the scene {scene}", path.display());
    }
    scenes.retain(|scene| present.contains(&scene_name(scene)));
    for scene in recorded.iter().filter(|scene| !present.contains(scene)) {
        tracing::warn!("{}: the scene {scene} is not in the folder", path.display());
    }
    Ok(Some(record))
}

fn scene_name(scene: &Value) -> String {
    scene["scene"].as_str().unwrap_or_default().to_owned()
}

/// Used fields of the file.
#[derive(Deserialize)]
struct SemanticInfo {
    objects: Vec<ReplicaObject>,
}

#[derive(Deserialize)]
struct ReplicaObject {
    id: i64,
    class_name: String,
}

/// Parses the names of segments, by number. Segments without a name are left out. Names without a known class are
/// counted in `unlisted`.
fn parse_replica(text: &str, unlisted: &mut BTreeMap<String, usize>) -> Result<BTreeMap<u32, SegmentName>, String> {
    let info: SemanticInfo = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let mut names = BTreeMap::new();
    for ReplicaObject { id, class_name } in info.objects {
        let Ok(id) = u32::try_from(id) else {
            continue;
        };
        let words = class_name.replace('-', " ");
        let Some(canonical) = class_of(&words, &class_name, 1, unlisted) else {
            continue;
        };
        let name = SegmentName { name: words, canonical: canonical.to_owned(), region: None };
        names.insert(id, name);
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::labels::canonical;

    #[test]
    fn names_may_have_commas_and_be_empty() {
        let text = "HM3D Semantic Annotations\n1,00FF7F,\"Night stand\",0\n\n2,AA0000,\"books, magazines\",-1\n3,BB,\"\",4\n4,CC,\"unknown\",4\n5,DD,\"flux capacitor\",2\n";
        let mut unlisted = BTreeMap::new();
        let names = parse_hm3d(text, &mut unlisted).unwrap();
        assert_eq!(names.keys().copied().collect::<Vec<_>>(), [1, 2, 5]);
        assert_eq!((names[&1].canonical.as_str(), names[&1].region), ("chest_of_drawers", Some(0)));
        assert_eq!(names[&2].name, "books, magazines");
        assert_eq!(names[&5].canonical, "misc");
        assert_eq!(unlisted.into_keys().collect::<Vec<_>>(), ["books, magazines", "flux capacitor"]);
    }

    #[test]
    fn errors_name_the_invalid_line() {
        for (text, line, message) in [
            ("", 1, "HM3D Semantic"),
            ("id,colour\n", 1, "HM3D Semantic"),
            ("HM3D Semantic Annotations\n1,FF,name,0\n", 2, "between quotes"),
            ("HM3D Semantic Annotations\nx,FF,\"bed\",0\n", 2, "as id"),
            ("HM3D Semantic Annotations\n1,FF,\"bed\"\n", 2, "as region"),
            ("HM3D Semantic Annotations\n1,FF,\"bed\",0\n1,FE,\"bed\",0\n", 3, "segment 1 is defined twice"),
        ] {
            let (found, problem) = parse_hm3d(text, &mut BTreeMap::new()).unwrap_err();
            assert!(found == line && problem.contains(message), "{found}: {problem}");
        }
    }

    #[test]
    fn objects_have_categories_and_regions() {
        let text = "ASCII 1.1\nH x y 0 0\nR 0 0 0 0 b 1 2 3\nR 1 0 0 0 h 1 2 3\nC 4 12 coffee#table 5 table 0 0 0 0 0\nC 7 9 painting 39 objects 0 0 0 0 0\nC 8 9 thing 41 unlabeled 0\nO 0 0 4 1.0 2.0 3.0\nO 1 1 7 1 2 3\nO 2 1 -1 1 2 3\nO 3 1 8 0 0 0\n";
        let house = parse_mp3d(text, &canonical()).unwrap();
        assert_eq!(house.rooms, [(0, "bedroom")].into());
        let names: Vec<(u32, &str, &str)> =
            house.names.iter().map(|(id, name)| (*id, name.name.as_str(), name.canonical.as_str())).collect();
        assert_eq!(names, [(0, "coffee table", "table"), (1, "painting", "picture"), (3, "thing", "misc")]);
        assert_eq!(parse_mp3d("O 1", &canonical()).unwrap_err().0, 1);
        assert!(parse_mp3d("\nO x 1 2", &canonical()).unwrap_err().1.contains("not the number of an object"));
    }

    fn read_text(content: &str) -> Result<Option<Value>> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scenes.json"), content).unwrap();
        read(folder.path(), &BTreeSet::from([&"a".to_owned()]))
    }

    #[test]
    fn record_is_limited_to_present_scenes() {
        assert!(matches!(read(Path::new("/nowhere"), &BTreeSet::new()), Ok(None)));
        let record = r#"{"schema": "darkqa.renders/1", "mode": "cover", "scenes": [{"scene": "a"}, {"scene": "b"}]}"#;
        let found = read_text(record).unwrap().unwrap();
        assert_eq!(found["mode"], "cover");
        assert_eq!(found["scenes"], serde_json::json!([{"scene": "a"}]));
        assert!(matches!(read_text(r#"{"scenes": ["kitchen"]}"#), Ok(None)));
    }

    #[test]
    fn invalid_records_are_refused() {
        for (content, message) in [
            ("{", "scenes.json"),
            (r#"{"schema": "darkqa.renders/2"}"#, "darkqa.renders/1"),
            (r#"{"schema": "darkqa.renders/1"}"#, "a list of scenes"),
        ] {
            let problem = read_text(content).unwrap_err().to_string();
            assert!(problem.contains(message), "{problem}");
        }
    }

    #[test]
    fn objects_have_classes() {
        let text = r#"{"classes":[{"id":1,"name":"bed"}],"objects":[{"id":0,"class_id":1,"class_name":"bed"},{"id":2,"class_name":"coffee-table"},{"id":-1,"class_name":"bed"},{"id":3,"class_name":"gizmo"},{"id":4,"class_name":""}]}"#;
        let mut unlisted = BTreeMap::new();
        let names = parse_replica(text, &mut unlisted).unwrap();
        let classes: Vec<(u32, &str)> = names.iter().map(|(id, name)| (*id, name.canonical.as_str())).collect();
        assert_eq!(classes, [(0, "bed"), (2, "table"), (3, "misc")]);
        assert_eq!(unlisted, [("gizmo".to_owned(), 1)].into());
        assert!(parse_replica("{}", &mut unlisted).unwrap_err().contains("missing field `objects`"));
    }
}
