//! Furnishing of kitchens and dining rooms.

use glam::{Vec3, vec3};

use super::super::mesh::cos_sin;
use super::shared::{dresser, low_stool};
use crate::furniture::fixtures::{COUNTER, Style, base_cabinets, wall_cabinets};
use crate::furniture::seats::{self, ChairBack};
use crate::furniture::{FurnitureSet, parts, storage, walls};
use crate::mesh::{Pose, kind};
use crate::openings::WindowDressing;
use crate::pattern::{COMMON_COLORS, Paint, Surface};
use crate::plan::{FloorPlan, Flooring, WALLS, Wall};
use crate::seeded_rng::SeededRng;

pub(super) fn furnish_kitchen(mut rng: SeededRng) -> FloorPlan {
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
    let table = seats::round(kind("table", "table"), 0.42, 0.75, &mut plan.rng);
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

pub(super) fn furnish_dining_room(mut rng: SeededRng) -> FloorPlan {
    let size = vec3(rng.between(4.0, 4.9), 2.65, rng.between(4.0, 4.9));
    let flooring = rng.pick(&[Flooring::Wood, Flooring::Wood, Flooring::Tiles]);
    let mut plan = FloorPlan::new(size, flooring, false, rng);
    add_table(&mut plan);
    plan.add_door(&WALLS);
    let width = plan.rng.between(1.2, 1.8);
    let dressing = if plan.rng.chance(0.7) { WindowDressing::Curtains } else { WindowDressing::Bare };
    plan.add_windows(&WALLS, width, 0.75, dressing);
    if plan.rng.chance(0.65) {
        let (width, name) = (plan.rng.between(1.2, 1.6), kind("cabinet", "cabinet"));
        let piece = storage::cabinet(name, vec3(width, 0.85, 0.45), 3, &mut plan.rng);
        if plan.place_at_wall(&FurnitureSet::from_piece(piece), &WALLS).is_some() {
            plan.camera_targets.push(plan.scene.things.len() - 1);
        }
    }
    plan.maybe_place_at_wall(0.3, dresser);
    plan.maybe_place_at_wall(0.3, storage::bookshelf);
    if plan.maybe_place_at_wall(0.45, |rng| parts::piece("fireplace", rng)).is_some() {
        plan.camera_targets.push(plan.scene.things.len() - 1);
    }
    plan.maybe_place_at_wall(0.2, low_stool);
    plan.maybe_place_plant(0.6);
    plan.hang_pictures(3);
    plan.maybe_hang(0.2, 1.25, |rng| walls::mirror(0.6, 0.9, rng));
    plan.maybe_hang(0.2, 1.45, storage::wall_shelf);
    plan
}

/// Places the table, its chairs, and the lamp above it.
fn add_table(plan: &mut FloorPlan) {
    let name = kind("dining table", "table");
    let middle = vec3(plan.size.x / 2.0, 0.0, plan.size.z / 2.0)
        + vec3(plan.rng.between(-0.4, 0.4), 0.0, plan.rng.between(-0.4, 0.4));
    let angle = if plan.rng.chance(0.5) { 0.0 } else { std::f32::consts::FRAC_PI_2 };
    let round = plan.rng.chance(0.3);
    let (piece, length, depth) = if round {
        (seats::round(name, 0.6, 0.75, &mut plan.rng), 1.2, 1.2)
    } else {
        let length = plan.rng.between(1.4, 1.8);
        (seats::table(name, vec3(length, 0.75, 0.9), &mut plan.rng), length, 0.9)
    };
    plan.maybe_add_rug(0.4, middle, [length + 1.2, depth + 1.3], angle);
    plan.focus_on_next();
    let pose = Pose::new(Pose::new(middle, angle).to_room(vec3(0.0, 0.0, -depth / 2.0)), angle);
    plan.add(piece, pose);
    // The chairs are added without checking for free space, so the floor around the table is reserved for them.
    let around = Pose::new(middle, angle);
    plan.reserve_floor(
        &Pose::new(around.to_room(vec3(0.0, 0.0, -depth / 2.0 - 0.5)), angle),
        vec3(length + 0.9, 0.0, depth + 1.0),
        0.0,
    );
    add_chairs(plan, &around, [length, depth], round);
    let decoration = plan.rng.pick(&["bowl of fruit", "vase", "vase:2", "candle"]);
    plan.add_part(&pose, decoration, vec3(0.0, 0.75, depth / 2.0 - 0.1));
    let lamp = plan.rng.pick(&["chandelier", "ceiling lamp:2"]);
    let ceiling = vec3(middle.x, plan.size.y, middle.z);
    plan.add_part(&Pose::new(ceiling, 0.0), lamp, Vec3::ZERO);
}

/// Places two to six chairs of one kind around a table of this length and depth.
fn add_chairs(plan: &mut FloorPlan, around: &Pose, [length, depth]: [f32; 2], round: bool) {
    let mut paint = Paint::random(&COMMON_COLORS, &mut plan.rng);
    if plan.rng.chance(0.4) {
        paint = Paint::random(&["brown"], &mut plan.rng);
    }
    let back = plan.rng.pick(&[ChairBack::Slats, ChairBack::Closed]);
    let surface = if paint.name == "brown" { Surface::wood(paint, 1) } else { Surface::paint(paint) };
    let add_chair = |plan: &mut FloorPlan, position: Vec3, angle: f32| {
        plan.focus_on_next();
        let piece = seats::chair_with_back(kind("dining chair", "chair"), paint, &surface, back);
        plan.add_relative(around, piece, position, angle);
    };
    let out = depth / 2.0 + 0.3;
    let columns: &[f32] = if round { &[0.0] } else { &[-0.36, 0.36] };
    for x in columns {
        add_chair(plan, vec3(*x, 0.0, -out), 0.0);
        add_chair(plan, vec3(*x, 0.0, out), std::f32::consts::PI);
    }
    if round || plan.rng.chance(0.4) {
        let side = length / 2.0 + 0.3;
        add_chair(plan, vec3(-side, 0.0, 0.0), std::f32::consts::FRAC_PI_2);
        add_chair(plan, vec3(side, 0.0, 0.0), -std::f32::consts::FRAC_PI_2);
    }
}
