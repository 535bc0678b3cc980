//! Furnishing of dining rooms.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::furniture::{FurnitureSet, at, parts, seats, storage, tables, walls};
use super::super::openings::WindowDressing;
use super::super::paint::{Paint, USUAL};
use super::super::plan::FloorPlan;
use super::super::scene::{Pose, kind};
use super::super::shell::{Flooring, WALLS};
use super::super::surface::Surface;
use super::shared::low_stool;

pub(super) fn furnish(mut dice: Dice) -> FloorPlan {
    let size = vec3(dice.between(4.0, 4.9), 2.65, dice.between(4.0, 4.9));
    let ground = dice.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Tiles]);
    let mut plan = FloorPlan::new(size, ground, false, dice);
    table(&mut plan);
    plan.door(&WALLS);
    let width = plan.dice.between(1.2, 1.8);
    let dressing = if plan.dice.chance(0.7) {
        WindowDressing::Curtains
    } else {
        WindowDressing::Bare
    };
    plan.windows(&WALLS, width, 0.75, dressing);
    if plan.dice.chance(0.65) {
        let (width, name) = (plan.dice.between(1.2, 1.6), kind("cabinet", "cabinet"));
        let piece = storage::cabinet(name, vec3(width, 0.85, 0.45), 3, &mut plan.dice);
        if plan
            .stand(&FurnitureSet::from_piece(piece), &WALLS)
            .is_some()
        {
            plan.camera_targets.push(plan.scene.things.len() - 1);
        }
    }
    plan.maybe_stand(0.3, super::shared::dresser);
    plan.maybe_stand(0.3, storage::bookshelf);
    if plan
        .maybe_stand(0.45, |dice| parts::piece("fireplace", dice))
        .is_some()
    {
        plan.camera_targets.push(plan.scene.things.len() - 1);
    }
    plan.maybe_stand(0.2, low_stool);
    plan.plant(0.6);
    plan.pictures(3);
    plan.maybe_hang(0.2, 1.25, |dice| walls::mirror(0.6, 0.9, dice));
    plan.maybe_hang(0.2, 1.45, storage::wall_shelf);
    plan
}

/// Places the table, its chairs, and the lamp above it.
fn table(plan: &mut FloorPlan) {
    let name = kind("dining table", "table");
    let middle = vec3(plan.size.x / 2.0, 0.0, plan.size.z / 2.0)
        + vec3(
            plan.dice.between(-0.4, 0.4),
            0.0,
            plan.dice.between(-0.4, 0.4),
        );
    let angle = if plan.dice.chance(0.5) {
        0.0
    } else {
        std::f32::consts::FRAC_PI_2
    };
    let round = plan.dice.chance(0.3);
    let (piece, length, depth) = if round {
        (tables::round(name, 0.6, 0.75, &mut plan.dice), 1.2, 1.2)
    } else {
        let length = plan.dice.between(1.4, 1.8);
        (
            tables::table(name, vec3(length, 0.75, 0.9), &mut plan.dice),
            length,
            0.9,
        )
    };
    plan.rug(0.4, middle, [length + 1.2, depth + 1.3], angle);
    plan.focus_on_next();
    let pose = at(
        at(middle, angle).to_room(vec3(0.0, 0.0, -depth / 2.0)),
        angle,
    );
    plan.add(piece, pose);
    // The chairs belong to the table: they are added without a check, and the floor under them is reserved.
    let around = at(middle, angle);
    plan.reserve_floor(
        &at(around.to_room(vec3(0.0, 0.0, -depth / 2.0 - 0.5)), angle),
        vec3(length + 0.9, 0.0, depth + 1.0),
        0.0,
    );
    chairs(plan, &around, [length, depth], round);
    let centre = plan
        .dice
        .pick(&["bowl of fruit", "vase", "vase:2", "candle"]);
    plan.add_part(&pose, centre, vec3(0.0, 0.75, depth / 2.0 - 0.1));
    let lamp = plan.dice.pick(&["chandelier", "ceiling lamp:2"]);
    let ceiling = vec3(middle.x, plan.size.y, middle.z);
    plan.add_part(&at(ceiling, 0.0), lamp, Vec3::ZERO);
}

/// Two to six chairs of one kind around a table, whose sizes are its length and depth.
fn chairs(plan: &mut FloorPlan, around: &Pose, [length, depth]: [f32; 2], round: bool) {
    let mut paint = Paint::random(&USUAL, &mut plan.dice);
    if plan.dice.chance(0.4) {
        paint = Paint::random(&["brown"], &mut plan.dice);
    }
    let style = plan.dice.below(2);
    let surface = if paint.name == "brown" {
        Surface::wood(paint, 1)
    } else {
        Surface::paint(paint)
    };
    let seat = |plan: &mut FloorPlan, place: Vec3, turned: f32| {
        plan.focus_on_next();
        let piece = seats::chair_of(kind("dining chair", "chair"), paint, &surface, style);
        plan.add_relative(around, piece, place, turned);
    };
    let out = depth / 2.0 + 0.3;
    let columns: &[f32] = if round { &[0.0] } else { &[-0.36, 0.36] };
    for x in columns {
        seat(plan, vec3(*x, 0.0, -out), 0.0);
        seat(plan, vec3(*x, 0.0, out), std::f32::consts::PI);
    }
    if round || plan.dice.chance(0.4) {
        let side = length / 2.0 + 0.3;
        seat(plan, vec3(-side, 0.0, 0.0), std::f32::consts::FRAC_PI_2);
        seat(plan, vec3(side, 0.0, 0.0), -std::f32::consts::FRAC_PI_2);
    }
}
