//! sRGB → RAW: the inverse of a camera's image processing ([`unprocess`], Brooks et al. 2019).

use rayon::prelude::*;

use super::bayer::{Bayer, Plane};
use super::camera::CameraState;
use super::{colour, curve};
use crate::types::Rgb;

/// The RAW image, without noise, of which a camera in this state would have made `clean`.
///
/// An odd height or width is made even by repeating the last row or column.
#[must_use]
pub fn unprocess(clean: &Rgb, state: &CameraState) -> Bayer {
    let (height, width) = (clean.height(), clean.width());
    let linear = linear_light();
    let mut raw = Bayer::covering(height, width);
    raw.rows_mut().enumerate().for_each(|(row, line)| {
        let pixels = clean.samples()[row.min(height - 1) * width * 3..]
            .as_chunks::<3>()
            .0;
        for (column, sample) in line.iter_mut().enumerate() {
            let pixel = pixels[column.min(width - 1)].map(|code| linear[usize::from(code)]);
            let camera = colour::apply(&state.rgb_to_camera, pixel);
            *sample = behind_filter(camera, Plane::at(row, column), state) as f32;
        }
    });
    raw
}

/// The scene light of each 8-bit code: inverse tone curve, then gamma expansion.
fn linear_light() -> [f64; 256] {
    std::array::from_fn(|code| curve::gamma_expand(curve::inverse_smoothstep(code as f64 / 255.0)))
}

/// What a site sees of a colour in camera space: white balance and brightness undone, clipped to [0, 1].
///
/// Highlights are preserved: from a grey of 0.9 to 1 the gains fade to 1, so that white stays white (Brooks et al. 2019,
/// `safe_invert_gains`).
fn behind_filter(camera: [f64; 3], plane: Plane, state: &CameraState) -> f64 {
    let (channel, balance) = match plane {
        Plane::R => (camera[0], state.red_gain),
        Plane::Gr | Plane::Gb => (camera[1], 1.0),
        Plane::B => (camera[2], state.blue_gain),
    };
    let inverse_gain = 1.0 / (balance * state.rgb_gain);
    let grey = (camera[0] + camera[1] + camera[2]) / 3.0;
    let highlight = (grey - 0.9).max(0.0) / 0.1;
    let mask = highlight * highlight;
    let gain = (mask + (1.0 - mask) * inverse_gain).max(inverse_gain);
    (channel * gain).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::camera::tests::median;
    use super::*;

    fn flat(code: u8, height: usize, width: usize) -> Bayer {
        let clean = Rgb::new(height, width, vec![code; height * width * 3]).unwrap();
        unprocess(&clean, &median())
    }

    #[test]
    fn grey_is_divided_by_the_gains_of_its_plane() {
        let raw = flat(128, 4, 4);
        let light = linear_light()[128];
        for row in 0..4 {
            for column in 0..4 {
                let gain = match Plane::at(row, column) {
                    Plane::R => 2.15 * 1.25,
                    Plane::Gr | Plane::Gb => 1.25,
                    Plane::B => 1.7 * 1.25,
                };
                let sample = f64::from(raw.row(row)[column]);
                assert!((sample - light / gain).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn white_is_preserved() {
        for row in 0..2 {
            for sample in flat(255, 2, 2).row(row) {
                assert!((sample - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_last_row_and_column_of_an_odd_image_are_repeated() {
        let samples: Vec<u8> = (0..27).map(|i| i * 9).collect();
        let odd = Rgb::new(3, 3, samples.clone()).unwrap();
        let pixel =
            |row: usize, column: usize| &samples[(row.min(2) * 3 + column.min(2)) * 3..][..3];
        let padded = (0..16).flat_map(|i| pixel(i / 4, i % 4).to_vec()).collect();
        let even = Rgb::new(4, 4, padded).unwrap();
        assert_eq!(unprocess(&odd, &median()), unprocess(&even, &median()));
    }
}
