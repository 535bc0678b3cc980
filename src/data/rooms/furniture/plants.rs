//! Plants.

use glam::{Vec3, vec3};

use super::super::mesh::{Mesh, cos_sin};
use super::super::seeded_rng::SeededRng;
use crate::mesh::{Piece, kind};
use crate::pattern::{Paint, Surface};

/// A plant in its pot, with its height in metres.
pub(crate) fn plant(height: f32, rng: &mut SeededRng) -> Piece {
    let pot = Surface::paint(Paint::random(&["brown", "black", "grey", "orange", "blue"], rng));
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
        1.0,
        &pot,
    );
    let soil = Surface::plain([58, 42, 32]);
    mesh.lathe(foot + vec3(0.0, pot_height * 0.86, 0.0), &[(0.0, 0.0), (radius * 0.86, 0.0)], 1.0, &soil);
    let greens = [[58, 112, 50], [44, 96, 52], [86, 132, 58]];
    let leaves = 16 + rng.below(10);
    let stem = foot + vec3(0.0, pot_height * 0.8, 0.0);
    for i in 0..leaves {
        let green = Surface::plain(rng.pick(&greens));
        let angle = 2.4 * i as f32 + rng.between(-0.2, 0.2);
        let rise = (i as f32 + 0.5) / leaves as f32;
        add_leaf(
            &mut mesh,
            stem,
            angle,
            height * (0.25 + 0.47 * rise),
            height * rng.between(0.2, 0.3) * (1.25 - rise * 0.7),
            height,
            &green,
        );
    }
    Piece::new(kind("potted plant", "plant"), mesh, "")
}

/// Adds a leaf on a bent stem: it rises by `rise`, reaches out by `reach`, and hangs down at its end.
fn add_leaf(mesh: &mut Mesh, stem: Vec3, angle: f32, rise: f32, reach: f32, height: f32, green: &Surface) {
    let out = cos_sin(angle);
    let (forward, aside) = (vec3(out.x, 0.0, out.y), vec3(-out.y, 0.0, out.x));
    let rows: Vec<Vec<Vec3>> = (0..=7)
        .map(|i| {
            let share = i as f32 / 7.0;
            let blade = ((share - 0.3) / 0.7).clamp(0.0, 1.0);
            let half = height * (0.006 + 0.075 * 4.0 * blade * (1.0 - blade) * (1.15 - blade * 0.4));
            let bent = share * share;
            let middle = stem
                + forward * (reach * share)
                + Vec3::Y * (rise * (1.0 - (1.0 - share) * (1.0 - share)) - 0.35 * reach * bent);
            let fold = Vec3::Y * (half * 0.35);
            vec![middle - aside * half + fold, middle, middle + aside * half + fold]
        })
        .collect();
    mesh.grid(&rows, green);
}
