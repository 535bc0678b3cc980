//! The arrangement of samples in a raw image: [`Layout`].

/// Arrangement of the samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) channels: usize,
    pub(super) depth: Depth,
    pub(super) order: Order,
}

/// Size of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    Eight,
    Sixteen,
}

/// Meaning of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// The channels that are red, green and blue.
    Channels([usize; 3]),
    /// One channel under a mosaic of filters; row and column (0 or 1) of the first red site.
    Mosaic([usize; 2]),
}

impl Depth {
    /// Bytes of a sample.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Eight => 1,
            Self::Sixteen => 2,
        }
    }
}

impl Layout {
    /// The layout of an encoding by its name in ROS or Foxglove. `8UC3` and `8UC4` have the order of OpenCV.
    ///
    /// # Errors
    /// If the encoding is unknown, or has numbers that are not colours.
    pub(super) fn named(encoding: &str) -> Result<Self, String> {
        let grey = (1, Order::Channels([0; 3]));
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
            "mono" => grey,
            "rgb" => (3, rgb),
            "bgr" => (3, bgr),
            "rgba" => (4, rgb),
            "bgra" => (4, bgr),
            "bayer_rggb" => (1, Order::Mosaic([0, 0])),
            "bayer_grbg" => (1, Order::Mosaic([0, 1])),
            "bayer_gbrg" => (1, Order::Mosaic([1, 0])),
            "bayer_bggr" => (1, Order::Mosaic([1, 1])),
            "16UC1" | "32FC1" => {
                return Err(format!(
                    "encoding {encoding:?} is depth or another measure, not an image"
                ));
            }
            _ => {
                return Err(format!(
                    "unknown encoding {encoding:?}; rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8 or the same with 16 expected"
                ));
            }
        };
        Ok(Self {
            channels,
            depth,
            order,
        })
    }
}
