//! The built-in rooms: images of furnished rooms with exact ground truth, generated from a seed.
//!
//! Each scene is one room of one of six kinds. Rules and random draws furnish the room with parametric pieces
//! (`furniture`); windows and lamps light it. Each scene has two frames: one from the eye height of a person and one
//! from the camera height of a small robot. Frames are ray traced, so image, depth, classes and segments agree in every
//! pixel. Seed, frame index and image size determine a frame: its bytes are the same on every machine and for any
//! number of threads. No model was trained on these rooms.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod bvh;
mod camera;
mod clutter;
mod furniture;
mod kinds;
mod light;
mod mesh;
mod openings;
mod pattern;
mod plan;
mod render;
mod seeded_rng;
mod settings;
mod viewpoint;

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, LazyLock};

use self::bvh::Bvh;
use self::camera::Pinhole;
use self::kinds::RoomKind;
use self::plan::FloorPlan;
use self::seeded_rng::SeededRng;
use self::viewpoint::CameraHeight;
use camera::RenderedFrame;
use darkqa_base::error::Result;
use darkqa_base::labels;
use darkqa_base::types::values::Recent;
use darkqa_base::types::{Digest, Frame, FrameId, Labels, Light, Pixels, Rgb};
use mesh::ThingKind;

pub use self::settings::Rooms;
pub use light::RoomLight;

/// Version of the generator. Any change of a pixel or a name needs a new version.
pub const VERSION: u32 = 2;

/// Name of the label space of the semantic maps.
const LABEL_SPACE: &str = "mpcat40";

/// Maximum size of the frame cache, in bytes. The 48 frames of the default data set fit in, so each is drawn only once
/// for its questions and its image.
const CACHE_BYTES: usize = 104 << 20;

/// Number of frames of a size, in pixels, that fit in the cache; at least one.
fn cached_frames([width, height]: [usize; 2], light: RoomLight) -> usize {
    let bytes = match light {
        RoomLight::Display => RenderedFrame::BYTES_PER_PIXEL,
        RoomLight::Linear => RenderedFrame::BYTES_PER_PIXEL + RenderedFrame::LIGHT_BYTES_PER_PIXEL,
    };
    (CACHE_BYTES / (width * height * bytes).max(1)).max(1)
}

/// One frame of a set of rooms, drawn only when needed.
#[derive(Debug, Clone)]
pub struct Room {
    rooms: Rooms,
    index: usize,
    cache: Arc<Recent<usize, Arc<RenderedFrame>>>,
}

/// Ground truth of a frame, for checking questions.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomTruth {
    /// Kind of the room, such as `living room`.
    pub room: &'static str,
    /// All things in the room, in order of their segment numbers, which start at 1.
    pub things: Vec<ThingTruth>,
}

/// Maximum distance between neighbouring sample points on the surface of a thing, in metres (chosen).
const SAMPLE_SPACING: f32 = 0.06;

/// Ground truth of one thing in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct ThingTruth {
    /// Name of the thing, such as `coffee table`.
    pub word: &'static str,
    /// Class of the thing in mpcat40.
    pub class: &'static str,
    /// Name of the main colour; empty if people would not agree on one.
    pub color: &'static str,
    /// Distance from the camera to the nearest point of the thing in the field of view, even if that point is hidden,
    /// in metres. It is accurate to a few centimetres. `f32::MAX` if no point is in the field of view.
    pub distance: f32,
}

impl Rooms {
    /// Name of the data set; it depends only on the seed.
    #[must_use]
    pub fn title(&self) -> String {
        format!("rooms-{}", self.seed)
    }

    /// All frames with their ids, without drawing them.
    pub fn all(self) -> impl Iterator<Item = (FrameId, Room)> {
        let cache = Arc::new(Recent::new(cached_frames(self.size, self.light)));
        (0..self.frames).map(move |index| {
            let room = Room { rooms: self, index, cache: Arc::clone(&cache) };
            (room.id(), room)
        })
    }
}

/// Labels of the semantic maps.
#[must_use]
pub fn labels() -> Labels {
    labels::space(LABEL_SPACE).unwrap_or_default()
}

impl Room {
    fn kind(&self) -> RoomKind {
        RoomKind::ALL[self.index / 2 % RoomKind::ALL.len()]
    }

    fn camera_height(&self) -> CameraHeight {
        if self.index.is_multiple_of(2) { CameraHeight::Eye } else { CameraHeight::Robot }
    }

    /// Name of the scene, such as `living-room-0003`.
    #[must_use]
    pub fn scene(&self) -> String {
        let number = self.index / 2 / RoomKind::ALL.len();
        format!("{}-{number:04}", self.kind().name().replace(' ', "-"))
    }

    /// Name of the frame within its scene, after the camera height: `eye` or `robot`.
    #[must_use]
    pub fn view(&self) -> &'static str {
        self.camera_height().name()
    }

    fn id(&self) -> FrameId {
        FrameId(format!("{}/{}", self.scene(), self.view()))
    }

    /// Digest of everything that determines the pixels of the frame.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let [width, height] = self.rooms.size.map(|side| (side as u64).to_le_bytes());
        let (version, seed) = (VERSION.to_le_bytes(), self.rooms.seed.to_le_bytes());
        let id = self.id().0;
        let parts: [&[u8]; 6] = [b"darkqa.room/2", &version, &seed, &width, &height, id.as_bytes()];
        let light: Option<&[u8]> = match self.rooms.light {
            RoomLight::Display => None,
            RoomLight::Linear => Some(b"linear light"),
        };
        Digest::from_parts(parts.into_iter().chain(light))
    }

    /// Image width and height in pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.rooms.size
    }

    /// Focal length in pixels.
    #[must_use]
    pub fn focal(&self) -> f64 {
        f64::from(camera::focal(self.rooms.size))
    }

    fn plan(&self) -> FloorPlan {
        let scene = self.scene();
        self.kind().furnish(SeededRng::new(self.rooms.seed, &[&scene, "furniture"]))
    }

    fn camera(&self, plan: &FloorPlan, tree: &Bvh) -> Pinhole {
        let scene = self.scene();
        let mut rng = SeededRng::new(self.rooms.seed, &[&scene, self.view(), "camera"]);
        viewpoint::choose_camera(plan, tree, self.camera_height(), self.rooms.size, &mut rng)
    }

    /// Ground truth of the frame.
    #[must_use]
    pub fn truth(&self) -> RoomTruth {
        let (plan, camera) = (self.plan(), self.drawn().camera);
        let mut distances = vec![f32::MAX; plan.scene.things.len()];
        for (face, owner) in plan.scene.mesh.faces.iter().zip(&plan.scene.face_owners) {
            distances[*owner] = face
                .points(SAMPLE_SPACING)
                .filter(|point| camera.is_in_view(*point))
                .map(|point| point.distance(camera.position))
                .fold(distances[*owner], f32::min);
        }
        RoomTruth {
            room: self.kind().name(),
            things: plan
                .scene
                .things
                .iter()
                .zip(distances)
                .map(|(thing, distance)| ThingTruth {
                    word: thing.kind.word,
                    class: thing.kind.class,
                    color: thing.color,
                    distance,
                })
                .collect(),
        }
    }

    /// The frame with its image and maps, drawn unless it is in the cache.
    ///
    /// # Errors
    /// If the image and a map differ in size, which cannot happen.
    pub fn frame(&self) -> Result<Frame> {
        let drawn = self.drawn();
        drawn.frame(Rgb::clone(&drawn.rgb))
    }

    /// The frame with its maps and a given image in place of its own.
    ///
    /// # Errors
    /// If the image and the maps differ in size.
    pub fn frame_with(&self, rgb: Rgb) -> Result<Frame> {
        self.drawn().frame(rgb)
    }

    /// Pixels of the frame: linear light if the rooms are drawn in linear light, else 8-bit display codes.
    #[must_use]
    pub fn pixels(&self) -> Pixels {
        let drawn = self.drawn();
        match &drawn.light {
            Some(light) => Pixels::Light(Arc::clone(light)),
            None => Pixels::Codes8(Arc::clone(&drawn.rgb)),
        }
    }

    /// Linear light of the frame; `None` if the rooms are drawn in display codes only.
    #[must_use]
    pub fn light(&self) -> Option<Arc<Light>> {
        self.drawn().light.clone()
    }

    /// True if the pixels of the frame are linear light.
    #[must_use]
    pub fn is_light(&self) -> bool {
        self.rooms.light == RoomLight::Linear
    }

    /// The drawn frame, from the cache if possible.
    fn drawn(&self) -> Arc<RenderedFrame> {
        let Ok(drawn) = self.cache.get(&self.index, || Ok::<_, Infallible>(Arc::new(self.draw())));
        drawn
    }

    fn draw(&self) -> RenderedFrame {
        let plan = self.plan();
        let tree = plan.scene.tree();
        let camera = self.camera(&plan, &tree);
        let view = render::render(&plan.scene, &tree, &camera, self.rooms.light);
        let kinds: Vec<ThingKind> = plan.scene.things.iter().map(|thing| thing.kind).collect();
        RenderedFrame {
            id: self.id(),
            scene: self.scene(),
            room: self.kind().name(),
            camera,
            rgb: view.pixels.codes(),
            light: match view.pixels {
                Pixels::Light(light) => Some(light),
                Pixels::Codes8(_) | Pixels::Rgb16Image(_) => None,
            },
            depth: view.depth,
            things: view.things,
            classes: std::iter::once(0).chain(kinds.iter().map(|kind| class_number(kind.class))).collect(),
            names: Arc::new((1..).zip(kinds.iter().map(ThingKind::segment_name)).collect()),
        }
    }

    /// Camera pose in metres: the row-major matrix from camera coordinates (x right, y up, z backwards) to room
    /// coordinates.
    #[must_use]
    pub fn pose(&self) -> [f32; 16] {
        self.drawn().camera.pose()
    }
}

/// Number of a class in the label space; 0 if the class is unknown.
fn class_number(class: &str) -> u16 {
    static NUMBERS: LazyLock<BTreeMap<String, u16>> = LazyLock::new(|| {
        let labels = labels().labels;
        labels.into_iter().map(|(number, label)| (label.canonical, number)).collect()
    });
    NUMBERS.get(class).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::labels::{Meaning, meaning};

    #[test]
    fn words_have_the_classes_of_other_data_sets() {
        let rooms = Rooms { frames: 120, seed: 1, size: [64, 48], light: RoomLight::Display };
        let mut kinds = BTreeMap::new();
        for (_, room) in rooms.all().step_by(2) {
            for thing in room.plan().scene.things {
                kinds.insert(thing.kind.word, thing.kind.class);
            }
        }
        assert!(kinds.len() > 40, "{kinds:?}");
        for (word, class) in kinds {
            assert_ne!(class_number(class), 0, "{class} is no class");
            match meaning(word) {
                Meaning::Class(known) => assert_eq!(class, known, "{word}"),
                // A word that no data set uses may have any class, but this list must name it.
                Meaning::Nothing | Meaning::Unlisted => {
                    assert!(["desk lamp", "bowl of fruit", "mug", "wall", "tv"].contains(&word), "{word}");
                }
            }
        }
    }

    #[test]
    fn room_trees_stay_below_maximum_depth() {
        let rooms = Rooms { frames: 120, ..Rooms::default() };
        let deepest = rooms.all().step_by(2).map(|(_, room)| room.plan().scene.tree().depth()).max().unwrap();
        assert!((5..Bvh::MAX_DEPTH - 4).contains(&deepest), "{deepest}");
    }

    #[test]
    fn default_rooms_fit_in_the_cache() {
        let rooms = Rooms { frames: 2, seed: 1, size: [64, 48], light: RoomLight::Display };
        let all: Vec<Room> = rooms.all().map(|(_, room)| room).collect();
        assert!(Arc::ptr_eq(&all[0].drawn(), &all[0].drawn()));
        let defaults = Rooms::default();
        assert!(cached_frames(defaults.size, defaults.light) >= defaults.frames);
        let sizes = [[640, 480], [3000, 2000], [4000, 4000]];
        assert_eq!(sizes.map(|size| cached_frames(size, RoomLight::Display)), [50, 2, 1]);
        assert_eq!(cached_frames([640, 480], RoomLight::Linear), 18);
    }

    #[test]
    fn drawing_order_does_not_change_frames() {
        for light in [RoomLight::Display, RoomLight::Linear] {
            let rooms = Rooms { frames: 40, seed: 7, size: [64, 48], light };
            // Both frames of scene 17, drawn first, and drawn after the frames of scenes 15 and 16.
            let [alone, in_a_row] = [(34, 2), (30, 6)].map(|(first, count)| {
                let rooms: Vec<Room> = rooms.all().map(|(_, room)| room).skip(first).take(count).collect();
                rooms
                    .iter()
                    .map(|room| {
                        let frame = room.frame().unwrap();
                        let maps = (frame.depth, frame.semantic, frame.segments);
                        let light = room.light().map(|light| light.samples().to_vec());
                        (frame.id, frame.rgb, maps, frame.names, light)
                    })
                    .collect::<Vec<_>>()
            });
            assert!(alone == in_a_row[4..]);
            assert!(alone[0] != alone[1]);
        }
    }
}
