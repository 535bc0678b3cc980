//! Furnishing of bedrooms and bathrooms.

use glam::vec3;

use super::super::furniture::seats;
use super::shared::{dresser, low_stool, nightstand};
use crate::furniture::{FurnitureSet, beds, fixtures, parts, storage, walls};
use crate::mesh::{Pose, kind};
use crate::openings::WindowDressing;
use crate::pattern::{ALL_COLORS, Paint};
use crate::plan::{FloorPlan, Flooring, WALLS, Wall};
use crate::seeded_rng::SeededRng;

pub(super) fn furnish_bedroom(mut rng: SeededRng) -> FloorPlan {
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

pub(super) fn furnish_bathroom(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(2.6, 3.3), 2.5, rng.between(2.8, 3.6));
    let mut plan = FloorPlan::new(size, Flooring::Tiles, true, rng);
    let door = plan.rng.pick(&WALLS);
    plan.add_door(&[door]);
    let tub = plan.rng.chance(0.65);
    if tub {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(fixtures::bathtub(&mut plan.rng));
        plan.place_in_corner(&set, &WALLS);
    }
    if !tub || plan.rng.chance(0.5) {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(parts::piece(["shower", "shower:2"][plan.rng.below(2)], &mut plan.rng));
        plan.place_in_corner(&set, &WALLS);
    }
    if plan.rng.chance(0.92) {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(parts::piece("toilet", &mut plan.rng));
        if let Some(pose) = plan.place_at_wall(&set, &WALLS) {
            plan.add_part(&pose, "toilet paper", vec3(0.42, 0.72, -0.01));
        }
    }
    if plan.rng.chance(0.85) {
        let set = if plan.rng.chance(0.7) {
            fixtures::vanity(&mut plan.rng)
        } else {
            FurnitureSet::from_piece(parts::piece("sink", &mut plan.rng))
        };
        plan.focus_on_next();
        if let Some(pose) = plan.place_at_wall(&set, &WALLS)
            && plan.rng.chance(0.6)
        {
            let width = plan.rng.between(0.45, 0.65);
            let piece = walls::mirror(width, 0.7, &mut plan.rng);
            plan.hang_above(&pose, piece, 1.22);
        }
    }
    let dressing = plan.rng.pick(&[WindowDressing::Blinds, WindowDressing::Bare, WindowDressing::Curtains]);
    plan.add_window(&WALLS, 0.75, 1.25, dressing);
    for _ in 0..2 {
        plan.maybe_hang(0.7, 1.35, beds::towel);
    }
    plan.maybe_place_at_wall(0.4, low_stool);
    plan.maybe_place_at_wall(0.35, |rng| parts::piece("laundry basket", rng));
    if plan.rng.chance(0.3) {
        plan.maybe_place_plant(1.0);
    }
    plan.maybe_hang(0.35, 1.45, storage::wall_shelf);
    let middle = vec3(size.x / 2.0, 0.0, size.z / 2.0);
    plan.maybe_add_rug(0.5, middle, [0.9, 0.6], 0.0);
    plan.add_ceiling_lamp();
    plan
}
