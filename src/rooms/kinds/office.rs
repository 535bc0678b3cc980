//! Offices.

use glam::vec3;

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, clutter, lamps, seats, storage, tables, walls};
use super::super::plan::{FloorPlan, Flooring, WALLS, Wall, WindowDressing};
use super::super::scene::kind;
use super::shared::{SMALL, low_stool, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(3.4, 4.4), 2.6, dice.between(3.4, 4.4));
    let ground = dice.pick(&[Flooring::Carpet, Flooring::Wood]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    desk(&mut plan, wall);
    plan.door(&[wall.opposite()]);
    let width = plan.dice.between(1.1, 1.6);
    let dress = plan.dice.pick(&[
        WindowDressing::Blinds,
        WindowDressing::Curtains,
        WindowDressing::Bare,
    ]);
    plan.window(&sides(wall), width, 0.9, dress);
    if plan.maybe(0.8, storage::bookshelf).is_some() {
        plan.sights.push(plan.scene.things.len() - 1);
    }
    plan.maybe(0.35, super::shared::dresser);
    plan.maybe(0.35, |dice| {
        let size = vec3(0.9, 1.1, 0.42);
        storage::cabinet(kind("cabinet", "cabinet"), size, 2, dice)
    });
    plan.maybe(0.3, seats::armchair);
    plan.maybe(0.2, low_stool);
    plan.maybe(0.3, lamps::floor_lamp);
    plan.plant(0.5);
    plan.pictures(2);
    plan.perhaps(0.3, 1.5, storage::wall_shelf);
    plan.ceiling_lamp();
    plan
}

/// A desk with its chair and what stands on it.
fn desk(plan: &mut FloorPlan, wall: Wall) {
    let set = FurnitureSet::of(tables::desk(&mut plan.dice));
    let size = set.size;
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.5, 0.5);
    plan.sight();
    let Some(pose) = plan.stand_at(set, wall, along) else {
        return;
    };
    let top = size.y;
    if plan.dice.chance(0.9) {
        plan.sight();
        let width = plan.dice.between(0.5, 0.65);
        let x = plan.dice.between(-0.2, 0.1);
        plan.beside(&pose, walls::monitor(width), vec3(x, top, 0.04), 0.0);
        plan.beside(&pose, clutter::keyboard(), vec3(x, top, 0.38), 0.0);
    }
    if plan.dice.chance(0.6) {
        let lamp = lamps::desk_lamp(&mut plan.dice);
        plan.beside(&pose, lamp, vec3(size.x / 2.0 - 0.2, top, 0.1), 0.0);
    }
    plan.top(&pose, top, &[-size.x / 2.0 + 0.2], &SMALL);
    // The chair stands before the desk, turned to it but for a little.
    let turned = pose.angle + std::f32::consts::PI + plan.dice.between(-0.6, 0.6);
    let aside = plan.dice.between(-0.2, 0.1);
    let place = pose.outward(vec3(aside, 0.0, size.z + 0.32));
    let chair = FurnitureSet::of(seats::office_chair(&mut plan.dice));
    plan.sight();
    plan.amid(chair, place, turned);
}
