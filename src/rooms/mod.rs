//! The built-in rooms: furnished indoor views with exact truth, made by a seed.
//!
//! Each scene is one room of one of six kinds, furnished by rule and chance out of parametric pieces (`furniture`), and lit
//! by its windows and lamps. Two frames show it: from the height of a person's eyes, and from that of a small robot. A frame
//! is traced, so that its image, depth, classes and segments belong to each other to the pixel; it is a function of seed, its
//! number and its size, the same bytes on every machine and for every number of threads. No model has trained on them.

mod bvh;
mod camera;
mod dice;
mod furniture;
mod kinds;
mod light;
mod mesh;
mod paint;
mod plan;
mod render;
mod scene;
mod spot;
mod surface;
mod viewpoint;

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, LazyLock};

use clap::Args;
use ndarray::Array2;

use self::dice::Dice;
use self::kinds::RoomKind;
use self::plan::FloorPlan;
use self::viewpoint::Height;
use crate::error::{Error, Result};
use crate::labels;
use crate::types::recent::Recent;
use crate::types::{Decides, DepthKind, Digest, Frame, FrameId, Labels, SegmentName, Segmentation};

/// What the rooms are made by. Any change of a pixel or a name is another version.
pub const VERSION: u32 = 1;

/// The label space of the rooms.
const SPACE: &str = "mpcat40";

/// The bytes of the frames that are kept: a room is drawn when its image is needed, and not again when its maps are.
const KEPT: usize = 104 << 20;

/// The bytes of a pixel: three of colour, four of depth, two of class, four of segment.
const PIXEL: usize = 13;

/// How many frames of a size are kept; at least one.
fn frames_kept([width, height]: [usize; 2]) -> usize {
    (KEPT / (width * height * PIXEL).max(1)).max(1)
}

/// Which rooms are made: `frames=48,seed=7,size=1280x720`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Args)]
pub struct Rooms {
    /// This many frames, two of each room
    #[arg(long, value_name = "N", value_parser = frames, default_value = "48", add = Decides::Trials)]
    pub frames: usize,
    /// What decides the rooms
    #[arg(long, value_name = "N", default_value_t = 7, add = Decides::Pixels)]
    pub seed: u64,
    /// Width and height in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size, default_value = "640x480", add = Decides::Pixels)]
    pub size: [usize; 2],
}

impl Default for Rooms {
    fn default() -> Self {
        Self {
            frames: 48,
            seed: 7,
            size: [640, 480],
        }
    }
}

/// The longest side that a room is drawn with.
const LONGEST: usize = 8192;
/// The most frames that are made.
const MOST: usize = 1_000_000;

impl fmt::Display for Rooms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(
            f,
            "frames={},seed={},size={width}x{height}",
            self.frames, self.seed
        )
    }
}

/// One frame of the rooms, by its place among them.
#[derive(Debug, Clone)]
pub struct Room {
    rooms: Rooms,
    index: usize,
    cache: Arc<Recent<usize, Arc<Frame>>>,
}

/// What the generator knows of a frame: the truth that questions can be held to.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomTruth {
    /// The kind of the room.
    pub room: &'static str,
    /// Everything in the room; the number of a segment is its place, from 1.
    pub things: Vec<ThingTruth>,
}

/// Places on a thing are looked at so near to each other, in metres.
const REACH: f32 = 0.06;

/// What the generator knows of a thing.
#[derive(Debug, Clone, PartialEq)]
pub struct ThingTruth {
    /// Its own word.
    pub word: &'static str,
    /// Its class in mpcat40.
    pub class: &'static str,
    /// The name of the colour of most of it; empty where it has none that people agree on.
    pub color: &'static str,
    /// How far the nearest place of its shape that is within the view is from the camera, in metres, hidden or not; to within
    /// a few centimetres.
    pub near: f32,
}

impl FromStr for Rooms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut rooms = Self::default();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let wrong = |expected: String| format!("{key}={value}: {expected}");
            match (key.trim(), value.trim()) {
                ("frames", value) => rooms.frames = frames(value).map_err(wrong)?,
                ("seed", value) => {
                    let seed = value.parse();
                    rooms.seed = seed.map_err(|_| wrong("a whole number expected".to_owned()))?;
                }
                ("size", value) => rooms.size = size(value).map_err(wrong)?,
                _ => {
                    return Err(wrong(
                        "frames=N, seed=N or size=WIDTHxHEIGHT expected".to_owned(),
                    ));
                }
            }
        }
        Ok(rooms)
    }
}

/// Reads a number of frames.
fn frames(text: &str) -> Result<usize, String> {
    let frames = text.parse().ok();
    let frames = frames.filter(|frames| (1..=MOST).contains(frames));
    frames.ok_or_else(|| format!("a number from 1 to {MOST} expected"))
}

/// Reads a width and a height in pixels.
fn size(text: &str) -> Result<[usize; 2], String> {
    let pixels = |text: &str| {
        let pixels = text.parse().ok();
        pixels.filter(|pixels| (32..=LONGEST).contains(pixels))
    };
    let sides = text.split_once('x');
    let sides = sides.and_then(|(width, height)| Some([pixels(width)?, pixels(height)?]));
    sides.ok_or_else(|| format!("WIDTHxHEIGHT of 32 to {LONGEST} pixels expected"))
}

impl Rooms {
    /// The name of the data set: rooms of one seed are one.
    #[must_use]
    pub fn title(&self) -> String {
        format!("rooms-{}", self.seed)
    }

    /// Their frames.
    pub fn all(self) -> impl Iterator<Item = (FrameId, Room)> {
        let cache = Arc::new(Recent::new(frames_kept(self.size)));
        (0..self.frames).map(move |index| {
            let room = Room {
                rooms: self,
                index,
                cache: Arc::clone(&cache),
            };
            (room.id(), room)
        })
    }
}

/// What the numbers of the rooms' maps stand for.
#[must_use]
pub fn labels() -> Labels {
    labels::space(SPACE).unwrap_or_default()
}

impl Room {
    fn kind(&self) -> RoomKind {
        RoomKind::ALL[self.index / 2 % RoomKind::ALL.len()]
    }

    fn height(&self) -> Height {
        if self.index.is_multiple_of(2) {
            Height::Eye
        } else {
            Height::Robot
        }
    }

    /// The name of its scene, as `living-room-0003`.
    #[must_use]
    pub fn scene(&self) -> String {
        let number = self.index / 2 / RoomKind::ALL.len();
        format!("{}-{number:04}", self.kind().name().replace(' ', "-"))
    }

    /// Its name in its scene: how high the camera is.
    #[must_use]
    pub fn view(&self) -> &'static str {
        self.height().name()
    }

    fn id(&self) -> FrameId {
        FrameId(format!("{}/{}", self.scene(), self.view()))
    }

    /// All that decides its pixels.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let [width, height] = self.rooms.size.map(|side| (side as u64).to_le_bytes());
        Digest::of_parts([
            "darkqa.room/2".as_bytes(),
            &VERSION.to_le_bytes(),
            &self.rooms.seed.to_le_bytes(),
            &width,
            &height,
            self.id().0.as_bytes(),
        ])
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.rooms.size
    }

    fn plan(&self) -> FloorPlan {
        let scene = self.scene();
        self.kind()
            .furnish(Dice::new(self.rooms.seed, &[&scene, "furniture"]))
    }

    fn camera(&self, plan: &FloorPlan) -> camera::Camera {
        let scene = self.scene();
        let mut dice = Dice::new(self.rooms.seed, &[&scene, self.view(), "camera"]);
        viewpoint::camera(plan, self.height(), self.rooms.size, &mut dice)
    }

    /// What the generator knows of it.
    #[must_use]
    pub fn truth(&self) -> RoomTruth {
        let plan = self.plan();
        let camera = self.camera(&plan);
        let mut near = vec![f32::MAX; plan.scene.things.len()];
        for (face, owner) in plan.scene.mesh.faces.iter().zip(&plan.scene.owners) {
            let seen = face.places(REACH).filter(|place| camera.sees(*place));
            let nearest = seen.map(|place| place.distance(camera.at));
            near[*owner] = nearest.fold(near[*owner], f32::min);
        }
        let things = plan.scene.things.iter().zip(near);
        RoomTruth {
            room: self.kind().name(),
            things: things
                .map(|(thing, near)| ThingTruth {
                    word: thing.kind.word,
                    class: thing.kind.class,
                    color: thing.color,
                    near,
                })
                .collect(),
        }
    }

    /// The frame with its maps.
    ///
    /// # Errors
    /// None but where a map is not of the image's size, which cannot be.
    pub fn frame(&self) -> Result<Arc<Frame>> {
        let draw = || self.draw().map(Arc::new);
        self.cache.get(&self.index, draw)
    }

    fn draw(&self) -> Result<Frame> {
        let plan = self.plan();
        let camera = self.camera(&plan);
        let view = render::render(&plan.scene, &camera);
        let [width, height] = self.rooms.size;
        let numbers = plan
            .scene
            .things
            .iter()
            .map(|thing| number(thing.kind.class));
        let numbers: Vec<u16> = std::iter::once(0).chain(numbers).collect();
        let classes = view.things.iter().map(|thing| numbers[*thing as usize]);
        let classes: Vec<u16> = classes.collect();
        let shape = |e| Error::data(format_args!("frame {}", self.id()), e);
        let names = plan.scene.things.iter().zip(1..).map(|(thing, number)| {
            let name = SegmentName {
                name: thing.kind.word.to_owned(),
                canonical: thing.kind.class.to_owned(),
                region: None,
            };
            (number, name)
        });
        Ok(Frame {
            id: self.id(),
            scene: self.scene(),
            depth: Some(Array2::from_shape_vec((height, width), view.depth).map_err(shape)?),
            depth_kind: DepthKind::Planar,
            intrinsics: Some(camera.intrinsics()),
            semantic: Some(Array2::from_shape_vec((height, width), classes).map_err(shape)?),
            segments: Some(Array2::from_shape_vec((height, width), view.things).map_err(shape)?),
            segmentation: Segmentation::Instances,
            names: Arc::new(names.collect()),
            room: Some(self.kind().name().to_owned()),
            rgb: view.rgb,
        })
    }

    /// Where the camera is: from its axes (x to the right, y up, z backwards) to those of the room, row by row, in metres.
    #[must_use]
    pub fn pose(&self) -> [f32; 16] {
        self.camera(&self.plan()).pose()
    }
}

/// The number of a class in the label space.
fn number(class: &str) -> u16 {
    static NUMBERS: LazyLock<BTreeMap<String, u16>> = LazyLock::new(|| {
        let labels = labels().labels;
        labels
            .into_iter()
            .map(|(number, label)| (label.canonical, number))
            .collect()
    });
    NUMBERS.get(class).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::names::{Meaning, meaning};

    #[test]
    fn words_have_the_classes_that_they_have_in_other_data_sets() {
        let rooms = Rooms {
            frames: 120,
            seed: 1,
            size: [64, 48],
        };
        let mut kinds = BTreeMap::new();
        for (_, room) in rooms.all().step_by(2) {
            for thing in room.plan().scene.things {
                kinds.insert(thing.kind.word, thing.kind.class);
            }
        }
        assert!(kinds.len() > 40, "{kinds:?}");
        for (word, class) in kinds {
            assert_ne!(number(class), 0, "{class} is no class");
            match meaning(word) {
                Meaning::Class(known) => assert_eq!(class, known, "{word}"),
                // Words that no data set has may have any class but none of another's.
                Meaning::Nothing | Meaning::Unlisted => {
                    assert!(
                        ["desk lamp", "bowl of fruit", "mug", "wall", "tv"].contains(&word),
                        "{word}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_room_is_drawn_once() {
        let rooms = Rooms {
            frames: 2,
            seed: 1,
            size: [64, 48],
        };
        let all: Vec<Room> = rooms.all().map(|(_, room)| room).collect();
        let first = all[0].frame().unwrap();
        assert!(Arc::ptr_eq(&first, &all[0].frame().unwrap()));
        let sizes = [[640, 480], [3000, 2000], [4000, 4000]];
        assert_eq!(sizes.map(frames_kept), [27, 1, 1]);
    }

    #[test]
    fn settings_read_back() {
        for text in [
            "frames=3,seed=9,size=1280x720",
            "frames=48,seed=7,size=640x480",
        ] {
            let rooms: Rooms = text.parse().unwrap();
            assert_eq!(rooms.to_string(), text);
        }
        assert_eq!("".parse::<Rooms>().unwrap(), Rooms::default());
    }
}
