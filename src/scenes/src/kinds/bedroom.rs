//! Furnishing of bedrooms.

use glam::vec3;

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, at, beds, seats, storage, walls};
use super::super::openings::WindowDressing;
use super::super::plan::FloorPlan;
use super::super::scene::kind;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{dresser, low_stool, nightstand, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(3.6, 4.6), 2.6, dice.between(3.6, 4.6));
    let ground = dice.pick(&[Flooring::Wood, Flooring::Carpet]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    bed(&mut plan, wall);
    plan.door(&[wall.opposite()]);
    let width = plan.dice.between(1.1, 1.5);
    let dressing = if plan.dice.chance(0.75) {
        WindowDressing::Curtains
    } else {
        WindowDressing::Blinds
    };
    plan.windows(&sides(wall), width, 0.85, dressing);
    if let Some(pose) = plan.maybe_stand(0.6, dresser) {
        plan.camera_targets.push(plan.scene.things.len() - 1);
        if plan.dice.chance(0.5) {
            let piece = walls::mirror(0.6, 0.7, &mut plan.dice);
            plan.hang_above(&pose, piece, 1.1);
        } else if plan.dice.chance(0.4) {
            plan.add_relative(
                &pose,
                walls::television(0.8, true),
                vec3(0.0, 0.9, 0.05),
                0.0,
            );
        }
    }
    plan.maybe_stand(0.35, |dice| {
        storage::cabinet(kind("wardrobe", "furniture"), vec3(1.2, 2.0, 0.58), 2, dice)
    });
    plan.maybe_stand(0.4, |dice| {
        let paint = super::super::paint::Paint::random(&super::super::paint::ALL, dice);
        seats::chair(kind("chair", "chair"), paint, dice)
    });
    plan.maybe_stand(0.3, low_stool);
    plan.maybe_stand(0.2, storage::bookshelf);
    plan.plant(0.45);
    plan.pictures(2);
    plan.maybe_hang(0.2, 1.5, storage::wall_shelf);
    plan.ceiling_lamp();
    plan
}

/// Places a bed with nightstands, lamps, a rug and a picture.
fn bed(plan: &mut FloorPlan, wall: Wall) {
    let set = beds::bed(&mut plan.dice);
    let span = plan.width(wall);
    let along = span / 2.0 + plan.dice.between(-0.3, 0.3);
    let size = set.size;
    plan.focus_on_next();
    let Some(pose) = plan.try_place_at_wall(set, wall, along) else {
        return;
    };
    let foot = at(pose.to_room(vec3(0.0, 0.0, size.z * 0.75)), pose.angle);
    plan.rug(0.5, foot.at, [size.x + 0.9, 1.5], pose.angle);
    for side in [-1.0, 1.0] {
        if plan.dice.chance(0.75) {
            let stand = nightstand(&mut plan.dice);
            let set = FurnitureSet::from_piece(stand);
            let top = set.size.y;
            let place = along + side * (size.x / 2.0 + set.size.x / 2.0 + 0.06);
            if let Some(pose) = plan.try_place_at_wall(set, wall, place)
                && plan.dice.chance(0.75)
            {
                plan.add_part(&pose, "table lamp", vec3(0.0, top, 0.05));
            }
        }
    }
    if plan.dice.chance(0.5) {
        let piece = walls::picture(&mut plan.dice);
        plan.hang_above(&pose, piece, 1.4);
    }
}
