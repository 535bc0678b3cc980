//! Choice of the camera position: the best view among many random ones ([`choose_camera`]).

use glam::{Vec3, vec3};

use super::bvh::Bvh;
use super::camera::Pinhole;
use super::plan::FloorPlan;
use super::render::preview;
use super::seeded_rng::SeededRng;

/// CameraHeight of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CameraHeight {
    /// Eye height of a person: 1.4 to 1.65 m.
    Eye,
    /// Camera height of a small robot: 0.55 to 0.85 m.
    Robot,
}

impl CameraHeight {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Eye => "eye",
            Self::Robot => "robot",
        }
    }

    /// Returns a random height in metres.
    fn draw(self, rng: &mut SeededRng) -> f32 {
        match self {
            Self::Eye => rng.between(1.4, 1.65),
            Self::Robot => rng.between(0.55, 0.85),
        }
    }
}

/// Number of camera positions that are tried (chosen).
const CANDIDATES: usize = 36;
/// Width and height in pixels of the previews by which camera positions are rated (chosen).
const PREVIEW_SIZE: [usize; 2] = [64, 40];

/// Chooses the camera of a frame; the middle of the room if no position is suitable.
pub(super) fn choose_camera(
    plan: &FloorPlan,
    tree: &Bvh,
    height: CameraHeight,
    size: [usize; 2],
    rng: &mut SeededRng,
) -> Pinhole {
    let up = height.draw(rng);
    let mut best: Option<(f32, Pinhole)> = None;
    let mut tries = 0;
    while tries < CANDIDATES * 12 && (tries < CANDIDATES || best.is_none()) {
        tries += 1;
        let margin = if tries > CANDIDATES * 6 { 0.2 } else { 0.42 };
        let position = vec3(rng.between(0.0, plan.size.x), up, rng.between(0.0, plan.size.z));
        let target = random_target(plan, rng);
        let sway = vec3(rng.between(-0.5, 0.5), 0.0, rng.between(-0.5, 0.5));
        let offset = target + sway - position;
        let distance = vec3(offset.x, 0.0, offset.z).length();
        if !plan.has_room_for_camera(position, margin) || distance < 0.8 {
            continue;
        }
        // At angle 0 the camera looks along −z.
        let angle = libm::atan2f(-offset.x, -offset.z);
        let tilt = libm::atan2f((-offset.y).max(0.0), distance.max(1.5)) * 0.55;
        let camera = Pinhole::new(position, angle, tilt, size);
        let score = rate_view(plan, &preview(&plan.scene, tree, &camera.with_size(PREVIEW_SIZE)));
        if best.as_ref().is_none_or(|(highest, _)| score > *highest) {
            best = Some((score, camera));
        }
    }
    let middle = vec3(plan.size.x / 2.0, up, plan.size.z / 2.0);
    best.map_or_else(|| Pinhole::new(middle, 0.0, 0.1, size), |(_, camera)| camera)
}

/// Position of a random thing that the camera should look at; the middle of the room without such things.
fn random_target(plan: &FloorPlan, rng: &mut SeededRng) -> Vec3 {
    let targets: Vec<usize> =
        plan.camera_targets.iter().copied().filter(|thing| *thing < plan.scene.things.len()).collect();
    if targets.is_empty() {
        return plan.size / 2.0;
    }
    let thing = &plan.scene.things[rng.pick(&targets)];
    thing.pose.to_room(vec3(0.0, 0.5, 0.3))
}

/// Rates a view, given the number of the thing at each pixel. Many things and camera targets raise the rating; very
/// large and cut-off things lower it.
fn rate_view(plan: &FloorPlan, visible: &[u32]) -> f32 {
    let mut counts = vec![0_usize; plan.scene.things.len() + 1];
    let mut border_counts = vec![0_usize; counts.len()];
    let [width, height] = PREVIEW_SIZE;
    for (i, thing) in visible.iter().enumerate() {
        counts[*thing as usize] += 1;
        let [x, y] = [i % width, i / width];
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            border_counts[*thing as usize] += 1;
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
            // Many small things are good; large ones are near the camera and hide others.
            score += if share > 0.002 { -0.2 } else { 0.02 };
            continue;
        }
        if share > 0.003 {
            score += 0.1 + share.min(0.06) * 4.0;
        }
        if plan.camera_targets.contains(&i) && share > 0.012 {
            score += 0.35;
        }
        score -= (border_counts[i + 1] as f32 / width as f32).min(0.5) * 0.5;
        score -= (share - 0.22).max(0.0) * 6.0;
    }
    score
}
