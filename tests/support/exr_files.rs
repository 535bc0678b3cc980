//! OpenEXR files.

use std::io::Cursor;

use exr::meta::attribute::{Chromaticities, IntegerBounds};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, ImageAttributes, Layer, LayerAttributes,
    SpecificChannels, Vec2, WritableImage as _,
};

/// The bytes of an image, whose type is long.
macro_rules! written {
    ($image:expr) => {{
        let mut file = Cursor::new(Vec::new());
        $image.write().to_buffered(&mut file).unwrap();
        file.into_inner()
    }};
}

/// A file of 32-bit floats, red, green and blue of each pixel.
pub fn exr([width, height]: [usize; 2], light: &[f32]) -> Vec<u8> {
    with_primaries([width, height], light, None)
}

/// The same in a compression.
pub fn compressed([width, height]: [usize; 2], light: &[f32], by: Compression) -> Vec<u8> {
    let channel = |place: usize| FlatSamples::F32(light.iter().skip(place).step_by(3).copied().collect());
    let channels =
        ["R", "G", "B"].into_iter().zip([0, 1, 2].map(channel)).map(|(name, samples)| AnyChannel::new(name, samples));
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding { compression: by, ..Encoding::UNCOMPRESSED },
        AnyChannels::sort(channels.collect()),
    );
    written!(&Image::from_layer(layer))
}

/// The same with primaries: x and y of red, green, blue and white.
pub fn with_primaries([width, height]: [usize; 2], light: &[f32], primaries: Option<[[f32; 2]; 4]>) -> Vec<u8> {
    let light = light.to_vec();
    let pixel = move |at: Vec2<usize>| {
        let samples = &light[3 * (at.y() * width + at.x())..];
        (samples[0], samples[1], samples[2])
    };
    let mut image = Image::from_channels((width, height), SpecificChannels::rgb(pixel));
    let pair = |[x, y]: [f32; 2]| Vec2(x, y);
    image.attributes.chromaticities = primaries.map(|[red, green, blue, white]| Chromaticities {
        red: pair(red),
        green: pair(green),
        blue: pair(blue),
        white: pair(white),
    });
    written!(&image)
}

/// A file of one layer with these channels.
pub fn with_channels([width, height]: [usize; 2], channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples));
    let layer = Layer::new(
        (width, height),
        LayerAttributes::default(),
        Encoding::UNCOMPRESSED,
        AnyChannels::sort(channels.collect()),
    );
    written!(&Image::from_layer(layer))
}

/// A file of two layers of grey in RGB.
pub fn with_two_layers(size: [usize; 2], light: [f32; 2]) -> Vec<u8> {
    let [one, other] = light.map(|light| {
        let samples = || FlatSamples::F32(vec![light; size[0] * size[1]]);
        let channels = ["R", "G", "B"].map(|name| AnyChannel::new(name, samples()));
        Layer::new(
            (size[0], size[1]),
            LayerAttributes::named(format!("{light}").as_str()),
            Encoding::UNCOMPRESSED,
            AnyChannels::sort(channels.into_iter().collect()),
        )
    });
    let window = IntegerBounds::from_dimensions((size[0], size[1]));
    written!(&Image::from_layers(ImageAttributes::new(window), vec![one, other]))
}

/// A file of light whose data window is smaller than its display window.
pub fn cropped(size: [usize; 2], window: [usize; 2]) -> Vec<u8> {
    let pixel = |_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32);
    let mut image = Image::from_channels((size[0], size[1]), SpecificChannels::rgb(pixel));
    image.attributes.display_window = IntegerBounds::from_dimensions((window[0], window[1]));
    written!(&image)
}
