//! Furnishing of living rooms and offices.

use glam::vec3;

use super::shared::{dresser, low_stool};
use crate::furniture::{FurnitureSet, parts, seats, storage, walls};
use crate::mesh::kind;
use crate::openings::WindowDressing;
use crate::plan::{FloorPlan, Flooring, WALLS, Wall};
use crate::seeded_rng::SeededRng;

pub(super) fn furnish_living_room(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(4.2, 5.4), 2.65, rng.between(4.2, 5.4));
    let flooring = rng.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Carpet]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    let wall = plan.rng.pick(&WALLS);
    add_sofa_group(&mut plan, wall);
    let facing = wall.opposite();
    add_opposite_sofa(&mut plan, facing);
    plan.add_door(&[wall.neighbours()[0], facing]);
    let width = plan.rng.between(1.3, 1.9);
    let dressing = if plan.rng.chance(0.75) { WindowDressing::Curtains } else { WindowDressing::Bare };
    plan.add_windows(&wall.neighbours(), width, 0.7, dressing);
    plan.maybe_place_at_wall(0.45, storage::bookshelf);
    plan.maybe_place_at_wall(0.6, |rng| parts::piece("floor lamp", rng));
    plan.maybe_place_at_wall(0.25, low_stool);
    plan.maybe_place_at_wall(0.25, dresser);
    plan.maybe_place_plant(0.6);
    plan.hang_pictures(3);
    plan.maybe_hang(0.15, 1.3, |rng| walls::mirror(0.7, 0.9, rng));
    plan.add_ceiling_lamp();
    plan
}

/// Places a sofa with a table, an armchair, a side table and a rug.
fn add_sofa_group(plan: &mut FloorPlan, wall: Wall) {
    let seats = 2 + plan.rng.below(2);
    let set = seats::sofa(seats, &mut plan.rng);
    let size = set.size;
    let along = plan.wall_length(wall) / 2.0 + plan.rng.between(-0.4, 0.4);
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    if plan.rng.chance(0.6) {
        let piece = walls::picture(&mut plan.rng);
        plan.hang_above(&pose, piece, 1.35);
    }
    let before = pose.to_room(vec3(0.0, 0.0, 1.55));
    plan.maybe_add_rug(0.65, before, [2.3, 1.6], pose.angle);
    if plan.rng.chance(0.8) {
        let name = kind("coffee table", "table");
        let piece = if plan.rng.chance(0.3) {
            seats::round(name, 0.42, 0.42, &mut plan.rng)
        } else {
            seats::table(name, vec3(1.0, 0.42, 0.55), &mut plan.rng)
        };
        let piece = FurnitureSet::from_piece(piece);
        plan.camera_targets.push(plan.scene.things.len());
        plan.place_away_from_walls(piece, before, pose.angle);
    }
    if plan.rng.chance(0.55) {
        let side = if plan.rng.chance(0.5) { -1.0 } else { 1.0 };
        let place = pose.to_room(vec3(side * (size.x / 2.0 + 0.3), 0.0, 1.75));
        let piece = FurnitureSet::from_piece(seats::armchair(&mut plan.rng));
        plan.place_away_from_walls(piece, place, pose.angle - side * 1.9);
    }
    if plan.rng.chance(0.5) {
        let piece = FurnitureSet::from_piece(seats::round(kind("side table", "table"), 0.24, 0.5, &mut plan.rng));
        let place = along + size.x / 2.0 + 0.32;
        if let Some(pose) = plan.try_place_at_wall(piece, wall, place) {
            plan.add_part(&pose, "table lamp", vec3(0.0, 0.5, 0.1));
        }
    }
}

/// Places a television or a fireplace opposite the sofa.
fn add_opposite_sofa(plan: &mut FloorPlan, wall: Wall) {
    let along = plan.wall_length(wall) / 2.0 + plan.rng.between(-0.3, 0.3);
    plan.focus_on_next();
    if plan.rng.chance(0.5) {
        let piece = FurnitureSet::from_piece(parts::piece("fireplace", &mut plan.rng));
        if let Some(pose) = plan.try_place_at_wall(piece, wall, along)
            && plan.rng.chance(0.5)
        {
            let piece = walls::mirror(0.8, 0.6, &mut plan.rng);
            plan.hang_above(&pose, piece, 1.35);
        }
        return;
    }
    let width = plan.rng.between(1.3, 1.7);
    let cabinet = storage::cabinet(kind("cabinet", "cabinet"), vec3(width, 0.5, 0.42), 3, &mut plan.rng);
    if let Some(pose) = plan.try_place_at_wall(FurnitureSet::from_piece(cabinet), wall, along) {
        let screen = plan.rng.between(1.0, 1.25);
        let tv = walls::television(screen, true);
        let top = plan.add_relative(&pose, tv, vec3(0.0, 0.5, 0.06), 0.0);
        plan.camera_targets.push(top);
    }
}

pub(super) fn furnish_office(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(3.4, 4.4), 2.6, rng.between(3.4, 4.4));
    let flooring = rng.pick(&[Flooring::Carpet, Flooring::Wood]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    let wall = plan.rng.pick(&WALLS);
    add_desk(&mut plan, wall);
    plan.add_door(&[wall.opposite()]);
    let width = plan.rng.between(1.1, 1.6);
    let dressing = plan.rng.pick(&[WindowDressing::Blinds, WindowDressing::Curtains, WindowDressing::Bare]);
    plan.add_windows(&wall.neighbours(), width, 0.9, dressing);
    if plan.maybe_place_at_wall(0.8, storage::bookshelf).is_some() {
        plan.camera_targets.push(plan.scene.things.len() - 1);
    }
    plan.maybe_place_at_wall(0.35, dresser);
    plan.maybe_place_at_wall(0.35, |rng| {
        let size = vec3(0.9, 1.1, 0.42);
        storage::cabinet(kind("cabinet", "cabinet"), size, 2, rng)
    });
    plan.maybe_place_at_wall(0.3, seats::armchair);
    plan.maybe_place_at_wall(0.2, low_stool);
    plan.maybe_place_at_wall(0.3, |rng| parts::piece("floor lamp", rng));
    plan.maybe_place_plant(0.5);
    plan.hang_pictures(2);
    plan.maybe_hang(0.3, 1.5, storage::wall_shelf);
    plan.add_ceiling_lamp();
    plan
}

/// Places a desk with its chair, monitor, keyboard and lamp.
fn add_desk(plan: &mut FloorPlan, wall: Wall) {
    let set = FurnitureSet::from_piece(parts::piece("desk", &mut plan.rng));
    let size = set.size;
    let along = plan.wall_length(wall) / 2.0 + plan.rng.between(-0.5, 0.5);
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    let top = size.y;
    if plan.rng.chance(0.9) {
        plan.focus_on_next();
        let width = plan.rng.between(0.5, 0.65);
        let x = plan.rng.between(-0.2, 0.1);
        plan.add_relative(&pose, walls::monitor(width), vec3(x, top, 0.04), 0.0);
        plan.add_part(&pose, "keyboard", vec3(x, top, 0.38));
    }
    if plan.rng.chance(0.6) {
        plan.add_part(&pose, "desk lamp", vec3(size.x / 2.0 - 0.2, top, 0.1));
    }
    // The chair is in front of the desk and faces it, up to a small random angle.
    let angle = pose.angle + std::f32::consts::PI + plan.rng.between(-0.6, 0.6);
    let aside = plan.rng.between(-0.2, 0.1);
    let place = pose.to_room(vec3(aside, 0.0, size.z + 0.32));
    let chair = FurnitureSet::from_piece(parts::piece("office chair", &mut plan.rng));
    plan.focus_on_next();
    plan.place_away_from_walls(chair, place, angle);
}
