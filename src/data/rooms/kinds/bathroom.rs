//! Furnishing of bathrooms.

use glam::vec3;

use super::super::furniture::{FurnitureSet, bath, parts, storage, textiles, walls};
use super::super::openings::WindowDressing;
use super::super::plan::FloorPlan;
use super::super::seeded_rng::SeededRng;
use super::super::shell::{Flooring, WALLS};
use super::shared::low_stool;

pub(super) fn furnish(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(2.6, 3.3), 2.5, rng.between(2.8, 3.6));
    let mut plan = FloorPlan::new(size, Flooring::Tiles, true, rng);
    let door = plan.rng.pick(&WALLS);
    plan.add_door(&[door]);
    let tub = plan.rng.chance(0.65);
    if tub {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(bath::bathtub(&mut plan.rng));
        plan.place_in_corner(&set, &WALLS);
    }
    if !tub || plan.rng.chance(0.5) {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(parts::piece(["shower", "shower:2"][plan.rng.below(2)], &mut plan.rng));
        plan.place_in_corner(&set, &WALLS);
    }
    if plan.rng.chance(0.92) {
        plan.focus_on_next();
        let set = FurnitureSet::from_piece(parts::piece("toilet", &mut plan.rng));
        if let Some(pose) = plan.place_at_wall(&set, &WALLS) {
            plan.add_part(&pose, "toilet paper", vec3(0.42, 0.72, -0.01));
        }
    }
    if plan.rng.chance(0.85) {
        let set = if plan.rng.chance(0.7) {
            bath::vanity(&mut plan.rng)
        } else {
            FurnitureSet::from_piece(parts::piece("sink", &mut plan.rng))
        };
        plan.focus_on_next();
        if let Some(pose) = plan.place_at_wall(&set, &WALLS)
            && plan.rng.chance(0.6)
        {
            let width = plan.rng.between(0.45, 0.65);
            let piece = walls::mirror(width, 0.7, &mut plan.rng);
            plan.hang_above(&pose, piece, 1.22);
        }
    }
    let dressing = plan.rng.pick(&[WindowDressing::Blinds, WindowDressing::Bare, WindowDressing::Curtains]);
    plan.add_window(&WALLS, 0.75, 1.25, dressing);
    for _ in 0..2 {
        plan.maybe_hang(0.7, 1.35, textiles::towel);
    }
    plan.maybe_place_at_wall(0.4, low_stool);
    plan.maybe_place_at_wall(0.35, |rng| parts::piece("laundry basket", rng));
    if plan.rng.chance(0.3) {
        plan.maybe_place_plant(1.0);
    }
    plan.maybe_hang(0.35, 1.45, storage::wall_shelf);
    let middle = vec3(size.x / 2.0, 0.0, size.z / 2.0);
    plan.maybe_add_rug(0.5, middle, [0.9, 0.6], 0.0);
    plan.add_ceiling_lamp();
    plan
}
