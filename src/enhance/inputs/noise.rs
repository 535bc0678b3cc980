//! Noise as an input of a model: [`normal_noise`].

use super::fed_image::FedImage;
use crate::conventions::NoiseStatement;
use darkqa_base::types::FrameId;
use darkqa_light::{Component, NoiseKey, Site};

/// Normally distributed noise for the input `name`, in planar order, of the image's size divided by `divide`.
///
/// Each number is a function of the seed, the whole degraded image, the input's name, and its channel, row and column
/// in the noise field of the whole image. So the noise does not depend on threads, and a tile gets the corresponding
/// part of the field.
pub(super) fn normal_noise(statement: &NoiseStatement, name: &str, channels: usize, fed: &FedImage<'_>) -> Vec<f32> {
    let frame = FrameId(format!("{} {name}", fed.digest()));
    let stream = NoiseKey::new(statement.seed, &frame).stream(Component::ModelInput);
    let [height, width] = fed.size().map(|side| side.div_ceil(statement.divide));
    let [top, left] = fed.origin();
    let mut samples = vec![0.0; channels * height * width];
    for row in 0..height {
        for column in 0..width {
            let mut words = stream.at(Site::new(top + row, left + column));
            for channel in 0..channels {
                let value = statement.std * words.normal();
                samples[(channel * height + row) * width + column] = value as f32;
            }
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::Padding;
    use crate::inputs::fed_image::DarkImage;
    use crate::sizing::TileWindow;
    use darkqa_base::types::Rgb;

    const NOISE: NoiseStatement = NoiseStatement { std: 0.5, seed: 3, divide: 1 };

    fn draw(statement: &NoiseStatement, name: &str, rgb: &Rgb, window: TileWindow) -> Vec<f32> {
        let dark = DarkImage::new(rgb);
        let fed = FedImage::Window { dark: &dark, window, pad: Padding::Reflect };
        normal_noise(statement, name, 2, &fed)
    }

    fn window(left: usize, right: usize) -> TileWindow {
        TileWindow { left, top: 0, right, bottom: 40 }
    }

    #[test]
    fn noise_of_a_tile_is_part_of_the_whole_field() {
        let rgb = Rgb::black(40, 60);
        let whole = draw(&NOISE, "z", &rgb, window(0, 60));
        let part = draw(&NOISE, "z", &rgb, window(10, 30));
        for (line, whole) in part.chunks_exact(20).zip(whole.chunks_exact(60)) {
            assert_eq!(line, &whole[10..30]);
        }
    }

    #[test]
    fn noise_depends_on_seed_name_and_image() {
        let rgb = Rgb::black(40, 60);
        let first = draw(&NOISE, "z", &rgb, window(0, 60));
        assert_eq!(first, draw(&NOISE, "z", &rgb, window(0, 60)));
        let seeded = NoiseStatement { seed: 4, ..NOISE };
        let mut other = Rgb::black(40, 60);
        other.samples_mut()[7] = 1;
        for different in [
            draw(&seeded, "z", &rgb, window(0, 60)),
            draw(&NOISE, "y", &rgb, window(0, 60)),
            draw(&NOISE, "z", &other, window(0, 60)),
        ] {
            let equal = first.iter().zip(&different).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
            assert!(equal < 10);
        }
        assert_ne!(first[..2400], first[2400..]);
    }

    #[test]
    fn noise_has_the_stated_size_and_deviation() {
        let rgb = Rgb::black(40, 60);
        let divided = NoiseStatement { divide: 8, ..NOISE };
        assert_eq!(draw(&divided, "z", &rgb, window(0, 60)).len(), 2 * 5 * 8);
        let none = NoiseStatement { std: 0.0, ..NOISE };
        let none = draw(&none, "z", &rgb, window(0, 60));
        assert!(none.iter().all(|x| x.abs() == 0.0));
        let numbers = draw(&NOISE, "z", &rgb, window(0, 60));
        let n = numbers.len() as f32;
        let mean = numbers.iter().sum::<f32>() / n;
        let variance = numbers.iter().map(|x| x * x).sum::<f32>() / n;
        // Bounds are five standard errors for 4800 numbers.
        assert!(mean.abs() < 5.0 * 0.5 / n.sqrt(), "{mean}");
        assert!((variance - 0.25).abs() < 5.0 * 0.25 * (2.0 / n).sqrt(), "{variance}");
    }
}
