//! Furnishing of offices.

use glam::vec3;

use super::super::furniture::{FurnitureSet, parts, seats, storage, walls};
use super::super::openings::WindowDressing;
use super::super::plan::FloorPlan;
use super::super::scene::kind;
use super::super::seeded_rng::SeededRng;
use super::super::shell::{Flooring, WALLS, Wall};
use super::shared::{dresser, low_stool};

pub(super) fn furnish(mut rng: SeededRng) -> FloorPlan {
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
