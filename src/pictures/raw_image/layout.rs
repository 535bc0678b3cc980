//! Arrangement of the samples in a raw image: [`Layout`].

/// Arrangement of the samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) channels: usize,
    pub(super) depth: Depth,
    pub(super) order: Order,
}

/// Bit depth of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    Eight,
    Sixteen,
}

/// Meaning of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Indices of the red, green and blue channels.
    Channels([usize; 3]),
    /// One channel behind a Bayer mosaic, with row and column (0 or 1) of the first red site.
    Mosaic([usize; 2]),
}

impl Depth {
    /// Size of a sample, in bytes.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Eight => 1,
            Self::Sixteen => 2,
        }
    }
}

impl Layout {
    /// The layout of an encoding, by its name in ROS or Foxglove. `8UC3` and `8UC4` have the channel order of OpenCV
    /// (BGR).
    ///
    /// # Errors
    /// If the encoding is unknown, or its numbers are not colours.
    pub(super) fn from_encoding(encoding: &str) -> Result<Self, String> {
        let (rgb, bgr) = (Order::Channels([0, 1, 2]), Order::Channels([2, 1, 0]));
        let (name, depth) = match encoding {
            "8UC1" => ("mono", Depth::Eight),
            "8UC3" => ("bgr", Depth::Eight),
            "8UC4" => ("bgra", Depth::Eight),
            _ => match (encoding.strip_suffix("16"), encoding.strip_suffix('8')) {
                (Some(name), _) => (name, Depth::Sixteen),
                (None, Some(name)) => (name, Depth::Eight),
                (None, None) => (encoding, Depth::Eight),
            },
        };
        let (channels, order) = match name {
            "mono" => (1, Order::Channels([0; 3])),
            "rgb" => (3, rgb),
            "bgr" => (3, bgr),
            "rgba" => (4, rgb),
            "bgra" => (4, bgr),
            "bayer_rggb" => (1, Order::Mosaic([0, 0])),
            "bayer_grbg" => (1, Order::Mosaic([0, 1])),
            "bayer_gbrg" => (1, Order::Mosaic([1, 0])),
            "bayer_bggr" => (1, Order::Mosaic([1, 1])),
            "16UC1" | "32FC1" => {
                return Err(format!("encoding {encoding:?} is depth or another measure, not an image"));
            }
            _ => {
                return Err(format!(
                    "unknown encoding {encoding:?}; rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8 or the same with 16, uyvy, yuyv, nv12, nv21, nv16, nv61 or nv24 expected"
                ));
            }
        };
        Ok(Self { channels, depth, order })
    }
}
