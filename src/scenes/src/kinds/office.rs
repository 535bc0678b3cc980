//! Furnishing of offices.

use glam::vec3;

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, parts, seats, storage, walls};
use super::super::openings::WindowDressing;
use super::super::plan::FloorPlan;
use super::super::scene::kind;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{low_stool, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(3.4, 4.4), 2.6, dice.between(3.4, 4.4));
    let ground = dice.pick(&[Flooring::Carpet, Flooring::Wood]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    desk(&mut plan, wall);
    plan.door(&[wall.opposite()]);
    let width = plan.dice.between(1.1, 1.6);
    let dressing = plan.dice.pick(&[
        WindowDressing::Blinds,
        WindowDressing::Curtains,
        WindowDressing::Bare,
    ]);
    plan.windows(&sides(wall), width, 0.9, dressing);
    if plan.maybe_stand(0.8, storage::bookshelf).is_some() {
        plan.camera_targets.push(plan.scene.things.len() - 1);
    }
    plan.maybe_stand(0.35, super::shared::dresser);
    plan.maybe_stand(0.35, |dice| {
        let size = vec3(0.9, 1.1, 0.42);
        storage::cabinet(kind("cabinet", "cabinet"), size, 2, dice)
    });
    plan.maybe_stand(0.3, seats::armchair);
    plan.maybe_stand(0.2, low_stool);
    plan.maybe_stand(0.3, |dice| parts::piece("floor lamp", dice));
    plan.plant(0.5);
    plan.pictures(2);
    plan.maybe_hang(0.3, 1.5, storage::wall_shelf);
    plan.ceiling_lamp();
    plan
}

/// Places a desk with its chair, monitor, keyboard and lamp.
fn desk(plan: &mut FloorPlan, wall: Wall) {
    let set = FurnitureSet::from_piece(parts::piece("desk", &mut plan.dice));
    let size = set.size;
    let along = plan.width(wall) / 2.0 + plan.dice.between(-0.5, 0.5);
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    let top = size.y;
    if plan.dice.chance(0.9) {
        plan.focus_on_next();
        let width = plan.dice.between(0.5, 0.65);
        let x = plan.dice.between(-0.2, 0.1);
        plan.add_relative(&pose, walls::monitor(width), vec3(x, top, 0.04), 0.0);
        plan.add_part(&pose, "keyboard", vec3(x, top, 0.38));
    }
    if plan.dice.chance(0.6) {
        plan.add_part(&pose, "desk lamp", vec3(size.x / 2.0 - 0.2, top, 0.1));
    }
    // The chair stands in front of the desk and faces it, up to a small random angle.
    let turned = pose.angle + std::f32::consts::PI + plan.dice.between(-0.6, 0.6);
    let aside = plan.dice.between(-0.2, 0.1);
    let place = pose.to_room(vec3(aside, 0.0, size.z + 0.32));
    let chair = FurnitureSet::from_piece(parts::piece("office chair", &mut plan.dice));
    plan.focus_on_next();
    plan.place_away_from_walls(chair, place, turned);
}
