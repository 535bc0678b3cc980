//! Furnishing of living rooms.

use glam::vec3;

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, parts, seats, storage, tables, walls};
use super::super::openings::WindowDressing;
use super::super::plan::FloorPlan;
use super::super::scene::kind;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{low_stool, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(4.2, 5.4), 2.65, dice.between(4.2, 5.4));
    let ground = dice.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Carpet]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    sofa_group(&mut plan, wall);
    let facing = wall.opposite();
    opposite_sofa(&mut plan, facing);
    plan.door(&[sides(wall)[0], facing]);
    let width = plan.dice.between(1.3, 1.9);
    let dressing = if plan.dice.chance(0.75) {
        WindowDressing::Curtains
    } else {
        WindowDressing::Bare
    };
    plan.windows(&sides(wall), width, 0.7, dressing);
    plan.maybe_stand(0.45, storage::bookshelf);
    plan.maybe_stand(0.6, |dice| parts::piece("floor lamp", dice));
    plan.maybe_stand(0.25, low_stool);
    plan.maybe_stand(0.25, super::shared::dresser);
    plan.plant(0.6);
    plan.pictures(3);
    plan.maybe_hang(0.15, 1.3, |dice| walls::mirror(0.7, 0.9, dice));
    plan.ceiling_lamp();
    plan
}

/// Places a sofa with a table, an armchair, a side table and a rug.
fn sofa_group(plan: &mut FloorPlan, wall: Wall) {
    let seats = 2 + plan.dice.below(2);
    let set = seats::sofa(seats, &mut plan.dice);
    let size = set.size;
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.4, 0.4);
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    if plan.dice.chance(0.6) {
        let piece = walls::picture(&mut plan.dice);
        plan.hang_above(&pose, piece, 1.35);
    }
    let before = pose.to_room(vec3(0.0, 0.0, 1.55));
    plan.rug(0.65, before, [2.3, 1.6], pose.angle);
    if plan.dice.chance(0.8) {
        let name = kind("coffee table", "table");
        let piece = if plan.dice.chance(0.3) {
            tables::round(name, 0.42, 0.42, &mut plan.dice)
        } else {
            tables::table(name, vec3(1.0, 0.42, 0.55), &mut plan.dice)
        };
        let piece = FurnitureSet::from_piece(piece);
        plan.camera_targets.push(plan.scene.things.len());
        plan.place_away_from_walls(piece, before, pose.angle);
    }
    if plan.dice.chance(0.55) {
        let side = if plan.dice.chance(0.5) { -1.0 } else { 1.0 };
        let place = pose.to_room(vec3(side * (size.x / 2.0 + 0.3), 0.0, 1.75));
        let piece = FurnitureSet::from_piece(seats::armchair(&mut plan.dice));
        plan.place_away_from_walls(piece, place, pose.angle - side * 1.9);
    }
    if plan.dice.chance(0.5) {
        let piece = FurnitureSet::from_piece(tables::round(
            kind("side table", "table"),
            0.24,
            0.5,
            &mut plan.dice,
        ));
        let place = along + size.x / 2.0 + 0.32;
        if let Some(pose) = plan.try_place_at_wall(piece, wall, place) {
            plan.add_part(&pose, "table lamp", vec3(0.0, 0.5, 0.1));
        }
    }
}

/// Places a television or a fireplace opposite the sofa.
fn opposite_sofa(plan: &mut FloorPlan, wall: Wall) {
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.3, 0.3);
    plan.focus_on_next();
    if plan.dice.chance(0.5) {
        let piece = FurnitureSet::from_piece(parts::piece("fireplace", &mut plan.dice));
        if let Some(pose) = plan.try_place_at_wall(piece, wall, along)
            && plan.dice.chance(0.5)
        {
            let piece = walls::mirror(0.8, 0.6, &mut plan.dice);
            plan.hang_above(&pose, piece, 1.35);
        }
        return;
    }
    let width = plan.dice.between(1.3, 1.7);
    let cabinet = storage::cabinet(
        kind("cabinet", "cabinet"),
        vec3(width, 0.5, 0.42),
        3,
        &mut plan.dice,
    );
    if let Some(pose) = plan.try_place_at_wall(FurnitureSet::from_piece(cabinet), wall, along) {
        let screen = plan.dice.between(1.0, 1.25);
        let tv = walls::television(screen, true);
        let top = plan.add_relative(&pose, tv, vec3(0.0, 0.5, 0.06), 0.0);
        plan.camera_targets.push(top);
    }
}
