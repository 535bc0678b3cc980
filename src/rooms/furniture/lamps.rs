//! Lamps with their light sources.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::Mesh;
use super::super::paint::{Paint, rgb};
use super::super::scene::{LightSource, Piece, kind};
use super::super::surface::{Pattern, Surface, SurfaceFinish};

/// The colour of warm light, as a camera that is white-balanced for daylight sees it.
const WARM: Vec3 = Vec3::new(1.0, 0.94, 0.85);

fn shade() -> Surface {
    Surface {
        color: rgb([255, 238, 206]),
        pattern: Pattern::Plain,
        finish: SurfaceFinish::Glow(1.3),
    }
}

fn bulb(middle: Vec3, radius: f32, strength: f32) -> LightSource {
    LightSource::Bulb {
        middle,
        radius,
        radiance: WARM * strength,
    }
}

fn metal(dice: &mut Dice) -> Surface {
    Surface::gloss(Paint::of(&["black", "grey", "white", "brown"], dice))
}

/// A floor lamp with its shade.
pub(in super::super) fn floor_lamp(dice: &mut Dice) -> Piece {
    let frame = metal(dice);
    let height = dice.between(1.45, 1.65);
    let foot = vec3(0.0, 0.0, 0.2);
    let mut mesh = Mesh::default();
    mesh.lathe(foot, &[(0.0, 0.03), (0.15, 0.02), (0.15, 0.0)], &frame);
    mesh.rod(foot, foot + vec3(0.0, height - 0.1, 0.0), 0.014, &frame);
    let low = foot + vec3(0.0, height - 0.32, 0.0);
    mesh.lathe(low, &[(0.2, 0.0), (0.13, 0.32)], &shade());
    let mut piece = Piece::new(kind("floor lamp", "lighting"), mesh, "");
    piece.light = Some(bulb(low + vec3(0.0, 0.18, 0.0), 0.07, 36.0));
    piece
}

/// A table lamp with its shade.
pub(in super::super) fn table_lamp(dice: &mut Dice) -> Piece {
    let paint = Paint::of(
        &["blue", "white", "red", "green", "black", "brown", "grey"],
        dice,
    );
    let body = Surface::gloss(paint);
    let foot = vec3(0.0, 0.0, 0.14);
    let mut mesh = Mesh::default();
    mesh.vessel(
        foot,
        &[
            (0.001, 0.0),
            (0.07, 0.0),
            (0.075, 0.02),
            (0.04, 0.05),
            (0.085, 0.12),
            (0.07, 0.2),
            (0.015, 0.26),
            (0.012, 0.32),
        ],
        1.0,
        &body,
    );
    let low = foot + vec3(0.0, 0.29, 0.0);
    mesh.lathe(low, &[(0.14, 0.0), (0.085, 0.2)], &shade());
    let mut piece = Piece::new(kind("table lamp", "lighting"), mesh, "");
    piece.light = Some(bulb(low + vec3(0.0, 0.1, 0.0), 0.05, 24.0));
    piece
}

/// A lamp for a desk: an arm with a cone at its end.
pub(in super::super) fn desk_lamp(dice: &mut Dice) -> Piece {
    let frame = Surface::gloss(Paint::of(&["black", "red", "blue", "white", "green"], dice));
    let foot = vec3(0.0, 0.0, 0.1);
    let (elbow, end) = (vec3(-0.1, 0.3, 0.06), vec3(0.08, 0.46, 0.14));
    let mut mesh = Mesh::default();
    mesh.lathe(foot, &[(0.0, 0.03), (0.08, 0.025), (0.085, 0.0)], &frame);
    mesh.rod(foot, elbow, 0.01, &frame);
    mesh.rod(elbow, end, 0.01, &frame);
    mesh.cone(
        end + vec3(0.0, 0.03, 0.0),
        end + vec3(0.05, -0.1, 0.03),
        [0.03, 0.085],
        &frame,
    );
    let glow = end + vec3(0.05, -0.098, 0.03);
    mesh.ball(glow, Vec3::splat(0.045), &shade());
    let mut piece = Piece::new(kind("desk lamp", "lighting"), mesh, "");
    piece.light = Some(bulb(glow - vec3(0.0, 0.05, 0.0), 0.04, 22.0));
    piece
}

/// A lamp below the ceiling, which is at y = 0: a bowl of glass.
pub(in super::super) fn ceiling_lamp() -> Piece {
    let mut mesh = Mesh::default();
    mesh.lathe(
        vec3(0.0, -0.03, 0.0),
        &[(0.2, 0.0), (0.2, 0.03)],
        &Surface::steel(),
    );
    mesh.vessel(
        vec3(0.0, -0.13, 0.0),
        &[(0.001, 0.0), (0.1, 0.015), (0.17, 0.06), (0.19, 0.1)],
        1.0,
        &shade(),
    );
    let mut piece = Piece::new(kind("ceiling lamp", "lighting"), mesh, "");
    piece.light = Some(bulb(vec3(0.0, -0.2, 0.0), 0.16, 24.0));
    piece
}

/// A lamp that hangs `drop` metres below the ceiling, which is at y = 0.
pub(in super::super) fn pendant(drop: f32, dice: &mut Dice) -> Piece {
    let frame = Surface::plain([30, 30, 32]);
    let paint = Paint::of(&["black", "white", "red", "yellow", "blue", "green"], dice);
    let mut mesh = Mesh::default();
    mesh.rod(Vec3::ZERO, vec3(0.0, -drop + 0.2, 0.0), 0.006, &frame);
    mesh.vessel(
        vec3(0.0, -drop, 0.0),
        &[(0.22, 0.0), (0.19, 0.08), (0.1, 0.17), (0.03, 0.22)],
        1.0,
        &Surface::gloss(paint),
    );
    mesh.ball(vec3(0.0, -drop + 0.04, 0.0), Vec3::splat(0.06), &shade());
    let mut piece = Piece::new(kind("ceiling lamp", "lighting"), mesh, "");
    piece.light = Some(bulb(vec3(0.0, -drop - 0.01, 0.0), 0.12, 28.0));
    piece
}

/// A lamp with several shades that hangs `drop` metres below the ceiling, which is at y = 0.
pub(in super::super) fn chandelier(drop: f32) -> Piece {
    let frame = Surface::gloss(Paint::nameless([120, 96, 52]));
    let mut mesh = Mesh::default();
    mesh.rod(Vec3::ZERO, vec3(0.0, -drop, 0.0), 0.01, &frame);
    mesh.ball(vec3(0.0, -drop, 0.0), vec3(0.05, 0.07, 0.05), &frame);
    for i in 0..5 {
        let out = super::super::mesh::cos_sin(std::f32::consts::TAU * i as f32 / 5.0);
        let end = vec3(out.x * 0.3, -drop + 0.03, out.y * 0.3);
        mesh.rod(vec3(0.0, -drop - 0.02, 0.0), end, 0.009, &frame);
        mesh.lathe(end, &[(0.05, 0.0), (0.075, 0.12)], &shade());
    }
    let mut piece = Piece::new(kind("chandelier", "lighting"), mesh, "");
    piece.light = Some(bulb(vec3(0.0, -drop + 0.12, 0.0), 0.14, 30.0));
    piece
}
