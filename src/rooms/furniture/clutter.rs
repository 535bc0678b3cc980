//! Plants and small things.

use glam::{Vec3, vec3};

use super::super::dice::Dice;
use super::super::mesh::{Mesh, cos_sin};
use super::super::paint::{ALL, Paint};
use super::super::scene::{Piece, kind};
use super::super::surface::Surface;

/// A plant in its pot, with its height in metres.
pub(in super::super) fn plant(height: f32, dice: &mut Dice) -> Piece {
    let pot = Surface::paint(Paint::of(
        &["white", "brown", "black", "grey", "orange"],
        dice,
    ));
    let radius = height * 0.13 + 0.03;
    let foot = vec3(0.0, 0.0, radius + 0.1 * height);
    let pot_height = height * 0.28;
    let mut mesh = Mesh::default();
    mesh.lathe(
        foot,
        &[
            (0.0, 0.0),
            (radius * 0.75, 0.0),
            (radius, pot_height),
            (radius * 0.88, pot_height),
            (radius * 0.85, pot_height * 0.85),
        ],
        &pot,
    );
    let soil = Surface::plain([58, 42, 32]);
    mesh.lathe(
        foot + vec3(0.0, pot_height * 0.86, 0.0),
        &[(0.0, 0.0), (radius * 0.86, 0.0)],
        &soil,
    );
    let greens = [[58, 112, 50], [44, 96, 52], [86, 132, 58]];
    let leaves = 16 + dice.below(10);
    let stem = foot + vec3(0.0, pot_height * 0.8, 0.0);
    for i in 0..leaves {
        let green = Surface::plain(dice.pick(&greens));
        let angle = 2.4 * i as f32 + dice.between(-0.2, 0.2);
        let rise = (i as f32 + 0.5) / leaves as f32;
        leaf(
            &mut mesh,
            stem,
            angle,
            height * (0.25 + 0.47 * rise),
            height * dice.between(0.2, 0.3) * (1.25 - rise * 0.7),
            height,
            &green,
        );
    }
    Piece::new(kind("potted plant", "plant"), mesh, "")
}

/// Adds a leaf on a bent stem: it rises by `rise`, reaches out by `reach`, and hangs down at its end.
fn leaf(
    mesh: &mut Mesh,
    stem: Vec3,
    angle: f32,
    rise: f32,
    reach: f32,
    height: f32,
    green: &Surface,
) {
    let out = cos_sin(angle);
    let (forward, aside) = (vec3(out.x, 0.0, out.y), vec3(-out.y, 0.0, out.x));
    let spine = |share: f32| {
        let bent = share * share;
        stem + forward * (reach * share)
            + Vec3::Y * (rise * (1.0 - (1.0 - share) * (1.0 - share)) - 0.35 * reach * bent)
    };
    let rows: Vec<Vec<Vec3>> = (0..=7)
        .map(|i| {
            let share = i as f32 / 7.0;
            let blade = ((share - 0.3) / 0.7).clamp(0.0, 1.0);
            let half =
                height * (0.006 + 0.075 * 4.0 * blade * (1.0 - blade) * (1.15 - blade * 0.4));
            let middle = spine(share);
            let fold = Vec3::Y * (half * 0.35);
            vec![
                middle - aside * half + fold,
                middle,
                middle + aside * half + fold,
            ]
        })
        .collect();
    mesh.grid(&rows, green);
}

/// A stack of two to four lying books.
pub(in super::super) fn books(dice: &mut Dice) -> Piece {
    let mut mesh = Mesh::default();
    let mut y = 0.0;
    for _ in 0..2 + dice.below(3) {
        let thick = dice.between(0.02, 0.04);
        let size = vec3(dice.between(0.17, 0.24), thick, dice.between(0.13, 0.17));
        let paint = Paint::of(&ALL, dice);
        let foot = vec3(dice.between(-0.01, 0.01), y, 0.1);
        mesh.slab(foot, size, &Surface::paint(paint));
        y += thick;
    }
    Piece::new(kind("book", "objects"), mesh, "")
}

pub(in super::super) fn vase(dice: &mut Dice) -> Piece {
    let paint = Paint::of(&ALL, dice);
    let mut mesh = Mesh::default();
    let height = dice.between(0.18, 0.28);
    mesh.vessel(
        vec3(0.0, 0.0, 0.08),
        &[
            (0.001, 0.0),
            (0.04, 0.0),
            (0.065, height * 0.35),
            (0.05, height * 0.65),
            (0.022, height * 0.82),
            (0.034, height),
        ],
        1.0,
        &Surface::gloss(paint),
    );
    Piece::new(kind("vase", "objects"), mesh, paint.name)
}

/// A bowl of fruit.
pub(in super::super) fn fruit(dice: &mut Dice) -> Piece {
    let mut mesh = Mesh::default();
    let foot = vec3(0.0, 0.0, 0.13);
    let bowl = Surface::gloss(Paint::of(&["white", "blue", "brown"], dice));
    mesh.vessel(
        foot,
        &[
            (0.001, 0.0),
            (0.05, 0.0),
            (0.1, 0.03),
            (0.13, 0.08),
            (0.12, 0.08),
            (0.001, 0.03),
        ],
        1.0,
        &bowl,
    );
    for i in 0..5 {
        let out = cos_sin(1.3 * i as f32);
        let paint = Paint::of(&["red", "orange", "yellow", "green"], dice);
        let reach = if i == 0 { 0.0 } else { 0.062 };
        mesh.ball(
            foot + vec3(
                out.x * reach,
                if i == 0 { 0.11 } else { 0.075 },
                out.y * reach,
            ),
            Vec3::splat(0.038),
            &Surface::gloss(paint),
        );
    }
    Piece::new(kind("bowl of fruit", "objects"), mesh, "")
}

pub(in super::super) fn mug(dice: &mut Dice) -> Piece {
    let paint = Paint::of(&ALL, dice);
    let mut mesh = Mesh::default();
    mesh.lathe(
        vec3(0.0, 0.0, 0.05),
        &[
            (0.0, 0.0),
            (0.04, 0.0),
            (0.042, 0.095),
            (0.036, 0.095),
            (0.034, 0.02),
        ],
        &Surface::gloss(paint),
    );
    mesh.rod(
        vec3(0.042, 0.02, 0.05),
        vec3(0.066, 0.05, 0.05),
        0.007,
        &Surface::gloss(paint),
    );
    mesh.rod(
        vec3(0.066, 0.05, 0.05),
        vec3(0.042, 0.08, 0.05),
        0.007,
        &Surface::gloss(paint),
    );
    Piece::new(kind("mug", "objects"), mesh, paint.name)
}

pub(in super::super) fn bottle(dice: &mut Dice) -> Piece {
    let paint = Paint::of(
        &["white", "green", "blue", "pink", "orange", "purple"],
        dice,
    );
    let mut mesh = Mesh::default();
    mesh.vessel(
        vec3(0.0, 0.0, 0.04),
        &[
            (0.001, 0.0),
            (0.033, 0.0),
            (0.034, 0.13),
            (0.014, 0.17),
            (0.014, 0.21),
            (0.001, 0.21),
        ],
        1.0,
        &Surface::gloss(paint),
    );
    Piece::new(kind("bottle", "objects"), mesh, paint.name)
}

/// A basket on the floor.
pub(in super::super) fn basket() -> Piece {
    let mut mesh = Mesh::default();
    let wicker = Surface::wood(Paint::nameless([176, 136, 88]), 0);
    mesh.lathe(
        vec3(0.0, 0.0, 0.2),
        &[
            (0.0, 0.0),
            (0.16, 0.0),
            (0.2, 0.34),
            (0.185, 0.34),
            (0.15, 0.04),
        ],
        &wicker,
    );
    Piece::new(kind("basket", "objects"), mesh, "")
}

pub(in super::super) fn keyboard() -> Piece {
    let mut mesh = Mesh::default();
    mesh.cushion(
        0.2,
        [0.0, 0.02],
        [0.0, 0.14],
        0.006,
        &Surface::plain([52, 52, 56]),
    );
    for row in 0..4 {
        for key in 0..12 {
            let foot = vec3((key as f32 - 5.5) * 0.031, 0.02, 0.022 + row as f32 * 0.032);
            mesh.slab(
                foot,
                vec3(0.025, 0.006, 0.025),
                &Surface::plain([28, 28, 30]),
            );
        }
    }
    Piece::new(kind("keyboard", "objects"), mesh, "")
}
