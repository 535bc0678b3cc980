//! Furnishing of bedrooms.

use glam::vec3;

use super::super::furniture::{FurnitureSet, beds, seats, storage, walls};
use super::super::openings::WindowDressing;
use super::super::paint::{ALL_COLORS, Paint};
use super::super::plan::FloorPlan;
use super::super::scene::{Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{dresser, low_stool, nightstand};

pub(super) fn furnish(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(3.6, 4.6), 2.6, rng.between(3.6, 4.6));
    let flooring = rng.pick(&[Flooring::Wood, Flooring::Carpet]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    let wall = plan.rng.pick(&WALLS);
    add_bed(&mut plan, wall);
    plan.add_door(&[wall.opposite()]);
    let width = plan.rng.between(1.1, 1.5);
    let dressing = if plan.rng.chance(0.75) { WindowDressing::Curtains } else { WindowDressing::Blinds };
    plan.add_windows(&wall.neighbours(), width, 0.85, dressing);
    if let Some(pose) = plan.maybe_place_at_wall(0.6, dresser) {
        plan.camera_targets.push(plan.scene.things.len() - 1);
        if plan.rng.chance(0.5) {
            let piece = walls::mirror(0.6, 0.7, &mut plan.rng);
            plan.hang_above(&pose, piece, 1.1);
        } else if plan.rng.chance(0.4) {
            plan.add_relative(&pose, walls::television(0.8, true), vec3(0.0, 0.9, 0.05), 0.0);
        }
    }
    plan.maybe_place_at_wall(0.35, |rng| storage::cabinet(kind("wardrobe", "furniture"), vec3(1.2, 2.0, 0.58), 2, rng));
    plan.maybe_place_at_wall(0.4, |rng| {
        let paint = Paint::random(&ALL_COLORS, rng);
        seats::chair(kind("chair", "chair"), paint, rng)
    });
    plan.maybe_place_at_wall(0.3, low_stool);
    plan.maybe_place_at_wall(0.2, storage::bookshelf);
    plan.maybe_place_plant(0.45);
    plan.hang_pictures(2);
    plan.maybe_hang(0.2, 1.5, storage::wall_shelf);
    plan.add_ceiling_lamp();
    plan
}

/// Places a bed with nightstands, lamps, a rug and a picture.
fn add_bed(plan: &mut FloorPlan, wall: Wall) {
    let set = beds::bed(&mut plan.rng);
    let span = plan.wall_length(wall);
    let along = span / 2.0 + plan.rng.between(-0.3, 0.3);
    let size = set.size;
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    let foot = Pose::new(pose.to_room(vec3(0.0, 0.0, size.z * 0.75)), pose.angle);
    plan.maybe_add_rug(0.5, foot.position, [size.x + 0.9, 1.5], pose.angle);
    for side in [-1.0, 1.0] {
        if plan.rng.chance(0.75) {
            let stand = nightstand(&mut plan.rng);
            let set = FurnitureSet::from_piece(stand);
            let top = set.size.y;
            let place = along + side * (size.x / 2.0 + set.size.x / 2.0 + 0.06);
            if let Some(pose) = plan.try_place_at_wall(set, wall, place)
                && plan.rng.chance(0.75)
            {
                plan.add_part(&pose, "table lamp", vec3(0.0, top, 0.05));
            }
        }
    }
    if plan.rng.chance(0.5) {
        let piece = walls::picture(&mut plan.rng);
        plan.hang_above(&pose, piece, 1.4);
    }
}
