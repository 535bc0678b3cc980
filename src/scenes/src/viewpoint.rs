//! The choice of the camera: of many random places, the one with the best view ([`camera`]).

use glam::{Vec3, vec3};

use super::bvh::Bvh;
use super::camera::Camera;
use super::dice::Dice;
use super::plan::FloorPlan;
use super::render::preview;

/// The height of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Height {
    /// Eye height of a person: 1.4 to 1.65 m.
    Eye,
    /// Camera height of a small robot: 0.55 to 0.85 m.
    Robot,
}

impl Height {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Eye => "eye",
            Self::Robot => "robot",
        }
    }

    fn metres(self, dice: &mut Dice) -> f32 {
        match self {
            Self::Eye => dice.between(1.4, 1.65),
            Self::Robot => dice.between(0.55, 0.85),
        }
    }
}

/// The number of camera places that are tried (chosen).
const PLACES: usize = 36;
/// The size in pixels of the preview that rates a place (chosen).
const PREVIEW: [usize; 2] = [64, 40];

/// The camera of a frame. If no place is suitable, it stands in the middle of the room.
pub(super) fn camera(
    plan: &FloorPlan,
    tree: &Bvh,
    height: Height,
    size: [usize; 2],
    dice: &mut Dice,
) -> Camera {
    let up = height.metres(dice);
    let mut best: Option<(f32, Camera)> = None;
    let mut tries = 0;
    while tries < PLACES * 12 && (tries < PLACES || best.is_none()) {
        tries += 1;
        let margin = if tries > PLACES * 6 { 0.2 } else { 0.42 };
        let place = vec3(
            dice.between(0.0, plan.size.x),
            up,
            dice.between(0.0, plan.size.z),
        );
        let target = focus_place(plan, dice);
        let sway = vec3(dice.between(-0.5, 0.5), 0.0, dice.between(-0.5, 0.5));
        let offset = target + sway - place;
        let distance = vec3(offset.x, 0.0, offset.z).length();
        if !plan.has_room_for_camera(place, margin) || distance < 0.8 {
            continue;
        }
        // At angle 0 the camera looks along −z.
        let angle = libm::atan2f(-offset.x, -offset.z);
        let tilt = libm::atan2f((-offset.y).max(0.0), distance.max(1.5)) * 0.55;
        let camera = Camera::new(place, angle, tilt, size);
        let score = score(plan, &preview(&plan.scene, tree, &camera.sized(PREVIEW)));
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, camera));
        }
    }
    let middle = vec3(plan.size.x / 2.0, up, plan.size.z / 2.0);
    best.map_or_else(|| Camera::new(middle, 0.0, 0.1, size), |(_, camera)| camera)
}

/// The place of a random thing to look at.
fn focus_place(plan: &FloorPlan, dice: &mut Dice) -> Vec3 {
    let known: Vec<usize> = plan
        .camera_targets
        .iter()
        .copied()
        .filter(|thing| *thing < plan.scene.things.len())
        .collect();
    if known.is_empty() {
        return plan.size / 2.0;
    }
    let thing = &plan.scene.things[dice.pick(&known)];
    thing.pose.to_room(vec3(0.0, 0.5, 0.3))
}

/// The rating of a view. Many things and things to look at raise it; very large and cut-off things lower it.
fn score(plan: &FloorPlan, visible: &[u32]) -> f32 {
    let mut counts = vec![0_usize; plan.scene.things.len() + 1];
    let mut cut = vec![0_usize; counts.len()];
    let [width, height] = PREVIEW;
    for (i, thing) in visible.iter().enumerate() {
        counts[*thing as usize] += 1;
        let [x, y] = [i % width, i / width];
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            cut[*thing as usize] += 1;
        }
    }
    let building = ["wall", "floor", "ceiling", "door", "window"];
    let mut score = 0.0;
    for (i, thing) in plan.scene.things.iter().enumerate() {
        let share = counts[i + 1] as f32 / visible.len() as f32;
        if share == 0.0 {
            continue;
        }
        if building.contains(&thing.kind.class) {
            score -= (share - 0.35).max(0.0) * 3.0;
            continue;
        }
        if thing.kind.word == "wall/otherroom" {
            score += if share > 0.01 { 0.25 } else { 0.0 };
            continue;
        }
        if ["objects", "misc", "clothes"].contains(&thing.kind.class) {
            // Many small things are good, near ones hide the others.
            score += if share > 0.002 { -0.2 } else { 0.02 };
            continue;
        }
        if share > 0.003 {
            score += 0.1 + share.min(0.06) * 4.0;
        }
        if plan.camera_targets.contains(&i) && share > 0.012 {
            score += 0.35;
        }
        score -= (cut[i + 1] as f32 / width as f32).min(0.5) * 0.5;
        score -= (share - 0.22).max(0.0) * 6.0;
    }
    score
}
