//! Furnishing of kitchens.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::furniture::kitchen::{COUNTER, Style, base_cabinets, wall_cabinets};
use super::super::furniture::{FurnitureSet, at, parts, seats, tables};
use super::super::openings::WindowDressing;
use super::super::paint::{Paint, USUAL};
use super::super::plan::FloorPlan;
use super::super::scene::kind;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{low_stool, sides};

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(3.6, 4.6), 2.6, dice.between(3.4, 4.4));
    let ground = dice.pick(&[Flooring::Tiles, Flooring::Tiles, Flooring::Wood]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    let wall = plan.dice.pick(&WALLS);
    let style = Style::new(&mut plan.dice);
    kitchen_row(&mut plan, wall, &style);
    let [left, right] = sides(wall);
    plan.door(&[wall.opposite()]);
    let dressing = plan.dice.pick(&[
        WindowDressing::Bare,
        WindowDressing::Blinds,
        WindowDressing::Curtains,
    ]);
    plan.windows(&[left, right, wall.opposite()], 1.2, 1.05, dressing);
    eating(&mut plan, wall);
    plan.plant(0.3);
    plan.pictures(2);
    plan.ceiling_lamp();
    plan
}

/// Places the refrigerator, counters, stove and sink along a wall.
fn kitchen_row(plan: &mut FloorPlan, wall: Wall, style: &Style) {
    let span = plan.width(wall);
    let fridge = plan.dice.chance(0.8);
    let taken = if fridge { 0.78 } else { 0.0 };
    let rest = (span - 0.2 - taken - 0.64).min(2.9);
    let (first, second) = (rest * 0.38, rest * 0.62);
    let sinks = plan.dice.chance(0.8);
    let mut from = 0.06;
    let mut next = |width: f32| {
        let middle = from + width / 2.0;
        from += width + 0.045;
        middle
    };
    if fridge {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(style.appliance("refrigerator", &mut plan.dice));
        plan.try_place_at_wall(set, wall, next(0.74));
    }
    let cabinets = base_cabinets(first - 0.05, false, style, &mut plan.dice);
    if let Some(pose) = plan.try_place_at_wall(cabinets, wall, next(first - 0.05)) {
        if plan.dice.chance(0.6) {
            let piece = style.appliance("microwave", &mut plan.dice);
            plan.add_relative(&pose, piece, vec3(0.0, COUNTER, 0.1), 0.0);
        }
        plan.hang_above(&pose, wall_cabinets(first - 0.05, style), 1.48);
    }
    plan.focus_on_next();
    let stove = style.appliance("stove", &mut plan.dice);
    if let Some(pose) = plan.try_place_at_wall(FurnitureSet::from_piece(stove), wall, next(0.63)) {
        let hood = parts::piece("range hood", &mut plan.dice);
        plan.hang_above(&pose, hood, 1.6);
    }
    plan.focus_on_next();
    let cabinets = base_cabinets(second - 0.05, sinks, style, &mut plan.dice);
    if let Some(pose) = plan.try_place_at_wall(cabinets, wall, next(second - 0.05)) {
        plan.hang_above(&pose, wall_cabinets(second - 0.05, style), 1.48);
    }
}

/// Places a table with chairs or stools, and a lamp.
fn eating(plan: &mut FloorPlan, wall: Wall) {
    if plan.dice.chance(0.3) {
        return;
    }
    let before = plan.wall_pose(wall, plan.width(wall) / 2.0, 0.0);
    let side = plan.dice.between(-0.6, 0.6);
    let far = plan.dice.between(2.2, 2.5);
    let place = before.to_room(vec3(side, 0.0, far));
    let table = tables::round(kind("table", "table"), 0.42, 0.75, &mut plan.dice);
    let Some(pose) = plan.place_away_from_walls(FurnitureSet::from_piece(table), place, 0.0) else {
        return;
    };
    plan.camera_targets.push(plan.scene.things.len() - 1);
    let paint = Paint::random(&USUAL, &mut plan.dice);
    let stools = plan.dice.chance(0.4);
    let start = plan.dice.between(0.0, 6.0);
    for i in 0..=plan.dice.below(3) {
        let angle = start + i as f32 * 2.2;
        let out = super::super::mesh::cos_sin(angle);
        let piece = if stools {
            low_stool(&mut plan.dice)
        } else {
            seats::chair(kind("chair", "chair"), paint, &mut plan.dice)
        };
        // Each faces the table: its front is z, which a rotation about y moves to (sin, cos).
        let back = vec3(place.x, 0.0, place.z) - vec3(out.y, 0.0, out.x) * 0.85;
        let set = FurnitureSet::from_piece(piece);
        plan.place_away_from_walls(set, back + vec3(out.y, 0.0, out.x) * 0.2, angle);
    }
    if plan.dice.chance(0.5) {
        let top = vec3(0.0, 0.75, 0.3);
        plan.add_part(&pose, "bowl of fruit", top);
    }
    if plan.dice.chance(0.5) {
        let ceiling = vec3(place.x, plan.size.y, place.z);
        plan.add_part(&at(ceiling, 0.0), "ceiling lamp:2", Vec3::ZERO);
    }
}
