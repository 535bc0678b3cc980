//! Pseudo-random functions of a position: [`hash`] and [`value_noise`].

use glam::Vec3;

/// Maps three integers to a pseudo-random number from 0 to 1.
pub(super) fn hash(x: i32, y: i32, z: i32) -> f32 {
    let mut bits = (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    bits ^= bits >> 15;
    (bits >> 8) as f32 / (1_u32 << 24) as f32
}

/// Value noise from 0 to 1: random values at integer lattice points, interpolated smoothly.
pub(super) fn value_noise(position: Vec3) -> f32 {
    let cell = position.floor();
    let share = position - cell;
    let share = share * share * (Vec3::splat(3.0) - 2.0 * share);
    let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
    let sheets = [0, 1].map(|k| {
        let rows = [0, 1].map(|j| {
            let corners = [0, 1].map(|i| hash(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k)));
            mix(corners, share.x)
        });
        mix(rows, share.y)
    });
    mix(sheets, share.z)
}

/// Interpolates linearly between two values.
fn mix([a, b]: [f32; 2], share: f32) -> f32 {
    a + (b - a) * share
}
