//! Living rooms.

use glam::vec3;

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, lamps, seats, storage, tables, walls};
use super::super::plan::{FloorPlan, Flooring, WALLS, Wall, WindowDressing};
use super::super::scene::kind;
use super::shared::{SMALL, low_stool, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(4.2, 5.4), 2.65, dice.between(4.2, 5.4));
    let ground = dice.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Carpet]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    group(&mut plan, wall);
    let facing = wall.opposite();
    before(&mut plan, facing);
    plan.door(&[sides(wall)[0], facing]);
    let width = plan.dice.between(1.3, 1.9);
    let dress = if plan.dice.chance(0.75) {
        WindowDressing::Curtains
    } else {
        WindowDressing::Bare
    };
    plan.window(&sides(wall), width, 0.7, dress);
    plan.maybe(0.45, storage::bookshelf);
    plan.maybe(0.6, lamps::floor_lamp);
    plan.maybe(0.25, low_stool);
    plan.maybe(0.25, super::shared::dresser);
    plan.plant(0.6);
    plan.pictures(3);
    plan.perhaps(0.15, 1.3, |dice| walls::mirror(0.7, 0.9, dice));
    plan.ceiling_lamp();
    plan
}

/// A sofa, a table before it, an armchair beside it.
fn group(plan: &mut FloorPlan, wall: Wall) {
    let seats = 2 + plan.dice.below(2);
    let set = seats::sofa(seats, &mut plan.dice);
    let size = set.size;
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.4, 0.4);
    plan.sight();
    let Some(pose) = plan.stand_at(set, wall, along) else {
        return;
    };
    if plan.dice.chance(0.6) {
        let piece = walls::picture(&mut plan.dice);
        plan.above(&pose, piece, 1.35);
    }
    let before = pose.outward(vec3(0.0, 0.0, 1.55));
    plan.rug(0.65, before, [2.3, 1.6], pose.angle);
    if plan.dice.chance(0.8) {
        let name = kind("coffee table", "table");
        let piece = if plan.dice.chance(0.3) {
            tables::round(name, 0.42, 0.42, &mut plan.dice)
        } else {
            tables::table(name, vec3(1.0, 0.42, 0.55), &mut plan.dice)
        };
        let piece = FurnitureSet::of(piece);
        plan.sights.push(plan.scene.things.len());
        if let Some(pose) = plan.amid(piece, before, pose.angle) {
            plan.top(&pose, 0.42, &[-0.15, 0.2], &SMALL);
        }
    }
    if plan.dice.chance(0.55) {
        let hand = if plan.dice.chance(0.5) { -1.0 } else { 1.0 };
        let place = pose.outward(vec3(hand * (size.x / 2.0 + 0.3), 0.0, 1.75));
        let piece = FurnitureSet::of(seats::armchair(&mut plan.dice));
        plan.amid(piece, place, pose.angle - hand * 1.9);
    }
    if plan.dice.chance(0.5) {
        let piece = FurnitureSet::of(tables::round(
            kind("side table", "table"),
            0.24,
            0.5,
            &mut plan.dice,
        ));
        let place = along + size.x / 2.0 + 0.32;
        if let Some(pose) = plan.stand_at(piece, wall, place) {
            let lamp = lamps::table_lamp(&mut plan.dice);
            plan.beside(&pose, lamp, vec3(0.0, 0.5, 0.1), 0.0);
        }
    }
}

/// What the sofa looks at: a television or a fireplace.
fn before(plan: &mut FloorPlan, wall: Wall) {
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.3, 0.3);
    plan.sight();
    if plan.dice.chance(0.5) {
        let piece = FurnitureSet::of(walls::fireplace(&mut plan.dice));
        if let Some(pose) = plan.stand_at(piece, wall, along) {
            if plan.dice.chance(0.5) {
                let piece = walls::mirror(0.8, 0.6, &mut plan.dice);
                plan.above(&pose, piece, 1.35);
            } else {
                plan.top(&pose, 1.16, &[-0.4, 0.35], &SMALL);
            }
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
    if let Some(pose) = plan.stand_at(FurnitureSet::of(cabinet), wall, along) {
        let screen = plan.dice.between(1.0, 1.25);
        let tv = walls::television(screen, true);
        let top = plan.beside(&pose, tv, vec3(0.0, 0.5, 0.06), 0.0);
        plan.sights.push(top);
    }
}
