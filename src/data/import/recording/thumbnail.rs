//! Small grey copy of a frame, to compare frames: [`Thumbnail`].

use crate::types::Rgb;

/// Blocks along each side.
const SIDE: usize = 16;

/// Mean grey codes of 16 × 16 blocks; grey is the mean of the three channels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Thumbnail(Vec<f64>);

impl Thumbnail {
    /// Makes the thumbnail of an image.
    pub(crate) fn new(image: &Rgb) -> Self {
        let mut blocks = vec![(0_u64, 0_u64); SIDE * SIDE];
        for (y, row) in image.samples().chunks_exact(image.width() * 3).enumerate() {
            let line = &mut blocks[y * SIDE / image.height() * SIDE..][..SIDE];
            for (x, pixel) in row.chunks_exact(3).enumerate() {
                let (sum, count) = &mut line[x * SIDE / image.width()];
                *sum += pixel.iter().map(|code| u64::from(*code)).sum::<u64>();
                *count += 3;
            }
        }
        // An image smaller than the grid has empty blocks, the same ones in every frame.
        Self(blocks.into_iter().filter(|(_, count)| *count > 0).map(|(sum, count)| sum as f64 / count as f64).collect())
    }

    /// Mean absolute difference of the blocks, in 8-bit codes. Frames of other sizes may have fewer blocks; only the
    /// blocks that both have are compared.
    pub(crate) fn difference(&self, other: &Self) -> f64 {
        let count = self.0.len().min(other.0.len()).max(1);
        self.0.iter().zip(&other.0).map(|(a, b)| (a - b).abs()).sum::<f64>() / count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(code: u8) -> Thumbnail {
        Thumbnail::new(&Rgb::new(20, 33, vec![code; 20 * 33 * 3]).unwrap())
    }

    #[test]
    fn the_difference_is_in_codes() {
        assert!((flat(10).difference(&flat(17)) - 7.0).abs() < 1e-9);
        let mut half = vec![0; 32 * 32 * 3];
        half[..16 * 32 * 3].fill(200);
        let half = Thumbnail::new(&Rgb::new(32, 32, half).unwrap());
        let black = Thumbnail::new(&Rgb::black(32, 32));
        assert!((half.difference(&black) - 100.0).abs() < 1e-9);
    }
}
