//! Where a room is looked at from: of many places, the one that shows the most of it: [`camera`].

use glam::{Vec3, vec3};

use super::camera::Camera;
use super::dice::Dice;
use super::plan::FloorPlan;
use super::render::glimpse;

/// How high a camera is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Height {
    /// That of a person's eyes.
    Eye,
    /// That of a small robot.
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

/// So many places are looked from.
const PLACES: usize = 36;
/// The size of a look, in pixels.
const GLIMPSE: [usize; 2] = [64, 40];

/// The camera of a view.
pub(super) fn camera(
    plan: &FloorPlan,
    height: Height,
    size: [usize; 2],
    dice: &mut Dice,
) -> Camera {
    let tree = plan.scene.tree();
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
        let target = sight(plan, dice);
        let sway = vec3(dice.between(-0.5, 0.5), 0.0, dice.between(-0.5, 0.5));
        let way = target + sway - place;
        let far = vec3(way.x, 0.0, way.z).length();
        if !plan.walkable(place, margin) || far < 0.8 {
            continue;
        }
        // At angle 0 the camera looks along −z.
        let angle = libm::atan2f(-way.x, -way.z);
        let tilt = libm::atan2f((-way.y).max(0.0), far.max(1.5)) * 0.55;
        let camera = Camera::new(place, angle, tilt, size);
        let score = score(plan, &glimpse(&plan.scene, &tree, &camera.sized(GLIMPSE)));
        if best.as_ref().is_none_or(|(most, _)| score > *most) {
            best = Some((score, camera));
        }
    }
    let middle = vec3(plan.size.x / 2.0, up, plan.size.z / 2.0);
    best.map_or_else(|| Camera::new(middle, 0.0, 0.1, size), |(_, camera)| camera)
}

/// The place of something worth looking at.
fn sight(plan: &FloorPlan, dice: &mut Dice) -> Vec3 {
    let known: Vec<usize> = plan
        .sights
        .iter()
        .copied()
        .filter(|thing| *thing < plan.scene.things.len())
        .collect();
    if known.is_empty() {
        return plan.size / 2.0;
    }
    let thing = &plan.scene.things[dice.pick(&known)];
    thing.pose.outward(vec3(0.0, 0.5, 0.3))
}

/// How good a view is: many things, none of them too large, and what is worth looking at among them.
fn score(plan: &FloorPlan, seen: &[u32]) -> f32 {
    let mut counts = vec![0_usize; plan.scene.things.len() + 1];
    let mut cut = vec![0_usize; counts.len()];
    let [width, height] = GLIMPSE;
    for (i, thing) in seen.iter().enumerate() {
        counts[*thing as usize] += 1;
        let [x, y] = [i % width, i / width];
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            cut[*thing as usize] += 1;
        }
    }
    let building = ["wall", "floor", "ceiling", "door", "window"];
    let mut score = 0.0;
    for (i, thing) in plan.scene.things.iter().enumerate() {
        let share = counts[i + 1] as f32 / seen.len() as f32;
        if share == 0.0 {
            continue;
        }
        if building.contains(&thing.kind.class) {
            score -= (share - 0.35).max(0.0) * 3.0;
            continue;
        }
        if share > 0.003 {
            score += 0.1 + share.min(0.06) * 4.0;
        }
        if plan.sights.contains(&i) && share > 0.012 {
            score += 0.35;
        }
        score -= (cut[i + 1] as f32 / width as f32).min(0.5) * 0.5;
        score -= (share - 0.22).max(0.0) * 6.0;
    }
    score
}
