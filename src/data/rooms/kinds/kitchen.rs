//! Furnishing of kitchens.

use glam::{Vec3, vec3};

use super::super::furniture::kitchen::{COUNTER, Style, base_cabinets, wall_cabinets};
use super::super::furniture::{FurnitureSet, parts, seats, tables};
use super::super::mesh::cos_sin;
use super::super::openings::WindowDressing;
use super::super::paint::{COMMON_COLORS, Paint};
use super::super::plan::FloorPlan;
use super::super::scene::{Pose, kind};
use super::super::seeded_rng::SeededRng;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::low_stool;

pub(super) fn furnish(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(3.6, 4.6), 2.6, rng.between(3.4, 4.4));
    let flooring = rng.pick(&[Flooring::Tiles, Flooring::Tiles, Flooring::Wood]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    let wall = plan.rng.pick(&WALLS);
    let style = Style::new(&mut plan.rng);
    add_kitchen_row(&mut plan, wall, &style);
    let [left, right] = wall.neighbours();
    plan.add_door(&[wall.opposite()]);
    let dressing = plan.rng.pick(&[WindowDressing::Bare, WindowDressing::Blinds, WindowDressing::Curtains]);
    plan.add_windows(&[left, right, wall.opposite()], 1.2, 1.05, dressing);
    add_eating_area(&mut plan, wall);
    plan.maybe_place_plant(0.3);
    plan.hang_pictures(2);
    plan.add_ceiling_lamp();
    plan
}

/// Places the refrigerator, counters, stove and sink along a wall.
fn add_kitchen_row(plan: &mut FloorPlan, wall: Wall, style: &Style) {
    let span = plan.wall_length(wall);
    let has_fridge = plan.rng.chance(0.8);
    let taken = if has_fridge { 0.78 } else { 0.0 };
    let rest = (span - 0.2 - taken - 0.64).min(2.9);
    let (first, second) = (rest * 0.38, rest * 0.62);
    let has_sink = plan.rng.chance(0.8);
    let mut from = 0.06;
    let mut next_middle = |width: f32| {
        let middle = from + width / 2.0;
        from += width + 0.045;
        middle
    };
    if has_fridge {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(style.appliance("refrigerator", &mut plan.rng));
        plan.try_place_at_wall(set, wall, next_middle(0.74));
    }
    let cabinets = base_cabinets(first - 0.05, false, style, &mut plan.rng);
    if let Some(pose) = plan.try_place_at_wall(cabinets, wall, next_middle(first - 0.05)) {
        if plan.rng.chance(0.6) {
            let piece = style.appliance("microwave", &mut plan.rng);
            plan.add_relative(&pose, piece, vec3(0.0, COUNTER, 0.1), 0.0);
        }
        plan.hang_above(&pose, wall_cabinets(first - 0.05, style), 1.48);
    }
    plan.focus_on_next();
    let stove = style.appliance("stove", &mut plan.rng);
    if let Some(pose) = plan.try_place_at_wall(FurnitureSet::from_piece(stove), wall, next_middle(0.63)) {
        let hood = parts::piece("range hood", &mut plan.rng);
        plan.hang_above(&pose, hood, 1.6);
    }
    plan.focus_on_next();
    let cabinets = base_cabinets(second - 0.05, has_sink, style, &mut plan.rng);
    if let Some(pose) = plan.try_place_at_wall(cabinets, wall, next_middle(second - 0.05)) {
        plan.hang_above(&pose, wall_cabinets(second - 0.05, style), 1.48);
    }
}

/// Places a table with chairs or stools, and a lamp above it, in most kitchens.
fn add_eating_area(plan: &mut FloorPlan, wall: Wall) {
    if plan.rng.chance(0.3) {
        return;
    }
    let before = plan.wall_pose(wall, plan.wall_length(wall) / 2.0, 0.0);
    let side = plan.rng.between(-0.6, 0.6);
    let far = plan.rng.between(2.2, 2.5);
    let place = before.to_room(vec3(side, 0.0, far));
    let table = tables::round(kind("table", "table"), 0.42, 0.75, &mut plan.rng);
    let Some(pose) = plan.place_away_from_walls(FurnitureSet::from_piece(table), place, 0.0) else {
        return;
    };
    plan.camera_targets.push(plan.scene.things.len() - 1);
    let paint = Paint::random(&COMMON_COLORS, &mut plan.rng);
    let has_stools = plan.rng.chance(0.4);
    let start = plan.rng.between(0.0, 6.0);
    for i in 0..=plan.rng.below(3) {
        let angle = start + i as f32 * 2.2;
        let out = cos_sin(angle);
        let piece = if has_stools {
            low_stool(&mut plan.rng)
        } else {
            seats::chair(kind("chair", "chair"), paint, &mut plan.rng)
        };
        // Each seat faces the table: a rotation about y by `angle` turns its front, z, to (sin, cos) in x and z.
        let back = vec3(place.x, 0.0, place.z) - vec3(out.y, 0.0, out.x) * 0.85;
        let set = FurnitureSet::from_piece(piece);
        plan.place_away_from_walls(set, back + vec3(out.y, 0.0, out.x) * 0.2, angle);
    }
    if plan.rng.chance(0.5) {
        let top = vec3(0.0, 0.75, 0.3);
        plan.add_part(&pose, "bowl of fruit", top);
    }
    if plan.rng.chance(0.5) {
        let ceiling = vec3(place.x, plan.size.y, place.z);
        plan.add_part(&Pose::new(ceiling, 0.0), "ceiling lamp:2", Vec3::ZERO);
    }
}
