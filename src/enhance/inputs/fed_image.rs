//! Image of one run of a model, from which all inputs are computed: [`FedImage`], [`DarkImage`].

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::conventions::Padding;
use crate::planes::Planes;
use crate::sizing::TileWindow;
use darkqa_base::types::{Digest, Rgb};

/// A whole degraded image. Noise inputs depend on its digest, which is computed at most once.
pub(crate) struct DarkImage<'a> {
    pub(super) rgb: &'a Rgb,
    digest: OnceCell<Digest>,
}

impl<'a> DarkImage<'a> {
    pub(crate) fn new(rgb: &'a Rgb) -> Self {
        Self { rgb, digest: OnceCell::new() }
    }
}

/// Image that is fed to a model in one run.
pub(crate) enum FedImage<'a> {
    /// A window of a degraded image, padded beyond the image's edges.
    Window { dark: &'a DarkImage<'a>, window: TileWindow, pad: Padding },
    /// A whole image of floats.
    Whole(&'a Planes),
}

impl FedImage<'_> {
    /// Height and width in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        match self {
            Self::Window { window, .. } => window.size(),
            Self::Whole(planes) => [planes.height, planes.width],
        }
    }

    /// Row and column of the first pixel within the whole image.
    pub(super) fn origin(&self) -> [usize; 2] {
        match self {
            Self::Window { window, .. } => [window.top, window.left],
            Self::Whole(_) => [0, 0],
        }
    }

    /// True if the whole degraded image is included.
    pub(super) fn is_whole(&self) -> bool {
        match self {
            Self::Window { dark, window, .. } => {
                [window.top, window.left] == [0, 0]
                    && window.bottom >= dark.rgb.height()
                    && window.right >= dark.rgb.width()
            }
            Self::Whole(_) => true,
        }
    }

    /// The image as red, green and blue planes in 0..1.
    pub(crate) fn planes(&self) -> Cow<'_, Planes> {
        let (dark, window, pad) = match self {
            Self::Whole(planes) => return Cow::Borrowed(planes),
            Self::Window { dark, window, pad } => (dark.rgb, window, *pad),
        };
        let [height, width] = window.size();
        let mut samples = Vec::with_capacity(3 * height * width);
        for channel in 0..3 {
            for row in (window.top..window.bottom).map(|at| pad.source(at, dark.height())) {
                for column in (window.left..window.right).map(|at| pad.source(at, dark.width())) {
                    let byte = match (row, column) {
                        (Some(row), Some(column)) => dark.samples()[3 * (row * dark.width() + column) + channel],
                        _ => 0,
                    };
                    samples.push(f32::from(byte) / 255.0);
                }
            }
        }
        Cow::Owned(Planes { height, width, samples })
    }

    /// Digest of the size and pixels of the whole degraded image.
    pub(super) fn digest(&self) -> Digest {
        match self {
            Self::Window { dark, .. } => *dark.digest.get_or_init(|| {
                let size = [dark.rgb.height(), dark.rgb.width()];
                image_digest(size, dark.rgb.samples())
            }),
            Self::Whole(planes) => {
                let bytes: Vec<u8> = planes.samples.iter().flat_map(|x| x.to_le_bytes()).collect();
                image_digest([planes.height, planes.width], &bytes)
            }
        }
    }
}

/// Digest of the height and width of an image and the bytes of its samples.
fn image_digest(size: [usize; 2], bytes: &[u8]) -> Digest {
    let [height, width] = size.map(|side| (side as u64).to_le_bytes());
    Digest::from_parts([&height[..], &width, bytes])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window with two rows of an image.
    fn columns<'a>(dark: &'a DarkImage<'a>, left: usize, right: usize) -> FedImage<'a> {
        FedImage::Window { dark, window: TileWindow { left, top: 0, right, bottom: 2 }, pad: Padding::Reflect }
    }

    #[test]
    fn window_has_padding_origin_and_digest() {
        let rgb = Rgb::new(1, 3, vec![0, 51, 102, 51, 51, 51, 255, 0, 0]).unwrap();
        let dark = DarkImage::new(&rgb);
        let padded = columns(&dark, 1, 5);
        let planes = padded.planes().into_owned();
        assert_eq!((planes.height, planes.width), (2, 4));
        assert_eq!(planes.samples[..8], [0.2, 1.0, 0.2, 0.0, 0.2, 1.0, 0.2, 0.0]);
        assert_eq!(padded.origin(), [0, 1]);
        let part = columns(&dark, 0, 2);
        assert!(columns(&dark, 0, 3).is_whole() && columns(&dark, 0, 5).is_whole());
        assert!(!padded.is_whole() && !part.is_whole());
        assert_eq!(part.digest(), padded.digest());
        let transposed = Rgb::new(3, 1, rgb.samples().to_vec()).unwrap();
        let transposed = DarkImage::new(&transposed);
        assert_ne!(part.digest(), columns(&transposed, 0, 1).digest());
    }
}
