//! The image of one run of a model, from which all its inputs are made: [`FedImage`], [`DarkImage`].

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::conventions::Padding;
use crate::planes::Planes;
use crate::sizing::TileWindow;
use darkqa_ground::types::{Digest, Rgb};

/// A whole dark image. Noise that a model takes depends on its digest, which is computed once at most.
pub(crate) struct DarkImage<'a> {
    pub(super) rgb: &'a Rgb,
    digest: OnceCell<Digest>,
}

impl<'a> DarkImage<'a> {
    pub(crate) fn new(rgb: &'a Rgb) -> Self {
        Self {
            rgb,
            digest: OnceCell::new(),
        }
    }
}

/// The image of one run of a model.
pub(crate) enum FedImage<'a> {
    /// A window of a dark image, padded beyond the image's edges.
    Window {
        dark: &'a DarkImage<'a>,
        window: TileWindow,
        pad: Padding,
    },
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

    /// Row and column of its first pixel in the whole image.
    pub(super) fn origin(&self) -> [usize; 2] {
        match self {
            Self::Window { window, .. } => [window.top, window.left],
            Self::Whole(_) => [0, 0],
        }
    }

    /// Whether it contains the whole dark image.
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

    /// Its samples in 0..1, red, green and blue.
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
                    let place = row
                        .zip(column)
                        .map(|(row, column)| 3 * (row * dark.width() + column));
                    let byte = place.map_or(0, |place| dark.samples()[place + channel]);
                    samples.push(f32::from(byte) / 255.0);
                }
            }
        }
        Cow::Owned(Planes {
            height,
            width,
            samples,
        })
    }

    /// Digest of the whole dark image: its size and its pixels.
    pub(super) fn digest(&self) -> Digest {
        let of = |size: [usize; 2], bytes: &[u8]| {
            let size = size.map(|side| (side as u64).to_le_bytes());
            Digest::from_parts([&size[0][..], &size[1], bytes])
        };
        match self {
            Self::Window { dark, .. } => *dark.digest.get_or_init(|| {
                let size = [dark.rgb.height(), dark.rgb.width()];
                of(size, dark.rgb.samples())
            }),
            Self::Whole(planes) => {
                let bytes: Vec<u8> = planes
                    .samples
                    .iter()
                    .flat_map(|x| x.to_le_bytes())
                    .collect();
                of([planes.height, planes.width], &bytes)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_padded_and_knows_its_place() {
        let rgb = Rgb::new(1, 3, vec![0, 51, 102, 51, 51, 51, 255, 0, 0]).unwrap();
        let dark = DarkImage::new(&rgb);
        let window = |left, right| TileWindow {
            left,
            top: 0,
            right,
            bottom: 2,
        };
        let fed = |left, right| FedImage::Window {
            dark: &dark,
            window: window(left, right),
            pad: Padding::Reflect,
        };
        let planes = fed(1, 5).planes().into_owned();
        assert_eq!((planes.height, planes.width), (2, 4));
        assert_eq!(
            planes.samples[..8],
            [0.2, 1.0, 0.2, 0.0, 0.2, 1.0, 0.2, 0.0]
        );
        assert_eq!(fed(1, 5).origin(), [0, 1]);
        assert!(fed(0, 3).is_whole() && fed(0, 5).is_whole());
        assert!(!fed(1, 5).is_whole() && !fed(0, 2).is_whole());
        assert_eq!(fed(0, 2).digest(), fed(1, 5).digest());
        let other = Rgb::new(3, 1, rgb.samples().to_vec()).unwrap();
        let other = DarkImage::new(&other);
        let other = FedImage::Window {
            dark: &other,
            window: window(0, 1),
            pad: Padding::Reflect,
        };
        assert_ne!(fed(0, 2).digest(), other.digest());
    }
}
