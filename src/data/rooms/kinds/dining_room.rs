//! Furnishing of dining rooms.

use glam::{Vec3, vec3};

use super::super::furniture::seats::{self, ChairBack};
use super::super::furniture::{FurnitureSet, parts, storage, tables, walls};
use super::super::openings::WindowDressing;
use super::super::paint::{COMMON_COLORS, Paint};
use super::super::plan::FloorPlan;
use super::super::scene::{Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::shell::{Flooring, WALLS};
use super::super::surface::Surface;
use super::shared::{dresser, low_stool};

pub(super) fn furnish(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(4.0, 4.9), 2.65, rng.between(4.0, 4.9));
    let flooring = rng.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Tiles]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    add_table(&mut plan);
    plan.add_door(&WALLS);
    let width = plan.rng.between(1.2, 1.8);
    let dressing = if plan.rng.chance(0.7) { WindowDressing::Curtains } else { WindowDressing::Bare };
    plan.add_windows(&WALLS, width, 0.75, dressing);
    if plan.rng.chance(0.65) {
        let (width, name) = (plan.rng.between(1.2, 1.6), kind("cabinet", "cabinet"));
        let piece = storage::cabinet(name, vec3(width, 0.85, 0.45), 3, &mut plan.rng);
        if plan.place_at_wall(&FurnitureSet::from_piece(piece), &WALLS).is_some() {
            plan.camera_targets.push(plan.scene.things.len() - 1);
        }
    }
    plan.maybe_place_at_wall(0.3, dresser);
    plan.maybe_place_at_wall(0.3, storage::bookshelf);
    if plan.maybe_place_at_wall(0.45, |rng| parts::piece("fireplace", rng)).is_some() {
        plan.camera_targets.push(plan.scene.things.len() - 1);
    }
    plan.maybe_place_at_wall(0.2, low_stool);
    plan.maybe_place_plant(0.6);
    plan.hang_pictures(3);
    plan.maybe_hang(0.2, 1.25, |rng| walls::mirror(0.6, 0.9, rng));
    plan.maybe_hang(0.2, 1.45, storage::wall_shelf);
    plan
}

/// Places the table, its chairs, and the lamp above it.
fn add_table(plan: &mut FloorPlan) {
    let name = kind("dining table", "table");
    let middle = vec3(plan.size.x / 2.0, 0.0, plan.size.z / 2.0)
        + vec3(plan.rng.between(-0.4, 0.4), 0.0, plan.rng.between(-0.4, 0.4));
    let angle = if plan.rng.chance(0.5) { 0.0 } else { std::f32::consts::FRAC_PI_2 };
    let round = plan.rng.chance(0.3);
    let (piece, length, depth) = if round {
        (tables::round(name, 0.6, 0.75, &mut plan.rng), 1.2, 1.2)
    } else {
        let length = plan.rng.between(1.4, 1.8);
        (tables::table(name, vec3(length, 0.75, 0.9), &mut plan.rng), length, 0.9)
    };
    plan.maybe_add_rug(0.4, middle, [length + 1.2, depth + 1.3], angle);
    plan.focus_on_next();
    let pose = Pose::new(Pose::new(middle, angle).to_room(vec3(0.0, 0.0, -depth / 2.0)), angle);
    plan.add(piece, pose);
    // The chairs are added without checking for free space, so the floor around the table is reserved for them.
    let around = Pose::new(middle, angle);
    plan.reserve_floor(
        &Pose::new(around.to_room(vec3(0.0, 0.0, -depth / 2.0 - 0.5)), angle),
        vec3(length + 0.9, 0.0, depth + 1.0),
        0.0,
    );
    add_chairs(plan, &around, [length, depth], round);
    let decoration = plan.rng.pick(&["bowl of fruit", "vase", "vase:2", "candle"]);
    plan.add_part(&pose, decoration, vec3(0.0, 0.75, depth / 2.0 - 0.1));
    let lamp = plan.rng.pick(&["chandelier", "ceiling lamp:2"]);
    let ceiling = vec3(middle.x, plan.size.y, middle.z);
    plan.add_part(&Pose::new(ceiling, 0.0), lamp, Vec3::ZERO);
}

/// Places two to six chairs of one kind around a table of this length and depth.
fn add_chairs(plan: &mut FloorPlan, around: &Pose, [length, depth]: [f32; 2], round: bool) {
    let mut paint = Paint::random(&COMMON_COLORS, &mut plan.rng);
    if plan.rng.chance(0.4) {
        paint = Paint::random(&["brown"], &mut plan.rng);
    }
    let back = plan.rng.pick(&[ChairBack::Slats, ChairBack::Closed]);
    let surface = if paint.name == "brown" { Surface::wood(paint, 1) } else { Surface::paint(paint) };
    let add_chair = |plan: &mut FloorPlan, position: Vec3, angle: f32| {
        plan.focus_on_next();
        let piece = seats::chair_with_back(kind("dining chair", "chair"), paint, &surface, back);
        plan.add_relative(around, piece, position, angle);
    };
    let out = depth / 2.0 + 0.3;
    let columns: &[f32] = if round { &[0.0] } else { &[-0.36, 0.36] };
    for x in columns {
        add_chair(plan, vec3(*x, 0.0, -out), 0.0);
        add_chair(plan, vec3(*x, 0.0, out), std::f32::consts::PI);
    }
    if round || plan.rng.chance(0.4) {
        let side = length / 2.0 + 0.3;
        add_chair(plan, vec3(-side, 0.0, 0.0), std::f32::consts::FRAC_PI_2);
        add_chair(plan, vec3(side, 0.0, 0.0), -std::f32::consts::FRAC_PI_2);
    }
}
