use super::*;
use crate::conventions::{Channels, Padding};
use crate::inputs::{DegradedImage, FedImage, InputEncoding, Tensor, TensorData};
use darkqa_base::types::Rgb;

const ENCODING: InputEncoding = InputEncoding {
    layout: TensorLayout::Nchw,
    element: ElementType::Float32,
    channels: Channels::Rgb,
    input: None,
    color: ChannelOrder::Rgb,
    range: ValueRange::Unit,
    mean: [0.0; 3],
    std: [1.0; 3],
    pad: Padding::Reflect,
};
fn decoding() -> OutputDecoding {
    OutputDecoding {
        layout: None,
        preferred: TensorLayout::Nchw,
        channels: vec![3],
        slice: None,
        mean_and_std: None,
        color: ChannelOrder::Rgb,
        range: ValueRange::Unit,
        certainty: Certainty::Known,
        rounding: Rounding::Round,
    }
}

fn image(height: usize, width: usize) -> Rgb {
    let samples = (0..height * width * 3).map(|i| (i * 37 % 256) as u8);
    Rgb::new(height, width, samples.collect()).unwrap()
}

fn whole(image: &Rgb) -> TileWindow {
    TileWindow::whole([image.height(), image.width()])
}

fn near(a: &TensorData, b: &TensorData) -> bool {
    match (a, b) {
        (TensorData::Float32(a), TensorData::Float32(b)) => a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4),
        (a, b) => a == b,
    }
}

/// Encodes a window of an image.
fn encode(encoding: &InputEncoding, image: &Rgb, window: TileWindow) -> Tensor {
    let dark = DegradedImage::new(image);
    let fed = FedImage::Window { dark: &dark, window, pad: encoding.pad };
    encoding.tensor(&fed).unwrap()
}

fn floats(input: &Tensor) -> &[f32] {
    match &input.data {
        TensorData::Float32(values) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn decoding_inverts_encoding_in_every_convention() {
    let image = image(11, 24);
    for layout in TensorLayout::ALL {
        for (element, range) in [
            (ElementType::Float32, ValueRange::Unit),
            (ElementType::Float32, ValueRange::Bytes),
            (ElementType::Float32, ValueRange::Signed),
            (ElementType::Float16, ValueRange::Unit),
            (ElementType::Uint8, ValueRange::Bytes),
        ] {
            for color in [ChannelOrder::Rgb, ChannelOrder::Bgr] {
                let encoding = InputEncoding { layout, element: element.clone(), color, range, ..ENCODING };
                let input = encode(&encoding, &image, whole(&image));
                let decoding = OutputDecoding { preferred: layout, color, range, ..decoding() };
                let samples = match &input.data {
                    TensorData::Float32(values) => TensorSamples::Float32(values),
                    TensorData::Float16(values) => TensorSamples::Float16(values),
                    TensorData::Uint8(values) => TensorSamples::Uint8(values),
                    other => panic!("{other:?}"),
                };
                let dims: Vec<i64> = input.dims.iter().map(|dim| i64::try_from(*dim).unwrap()).collect();
                assert_eq!(decoding.layout(&dims, [11, 24]), Some((layout, 3)));
                let bytes = decoding.bytes(samples, layout, [11, 24], whole(&image)).unwrap();
                assert_eq!(bytes, image.samples(), "{layout} {element} {range} {color}");
                let part = TileWindow { left: 3, top: 2, right: 7, bottom: 3 };
                let bytes = decoding.bytes(samples, layout, [11, 24], part).unwrap();
                assert_eq!(bytes, image.samples()[(2 * 24 + 3) * 3..][..12]);
                // Planes of floats are encoded and decoded in the same way.
                for (window, expected) in [(part, &bytes[..]), (whole(&image), image.samples())] {
                    let planes = decoding.planes(samples, layout, 3, [11, 24], window, Certainty::Known).unwrap();
                    assert_eq!(planes.to_rgb(Rounding::Round).unwrap().samples(), expected);
                }
                if element != ElementType::Float16 {
                    let planes = Planes::from_rgb(&image);
                    let fed = encoding.tensor(&FedImage::Whole(&planes)).unwrap();
                    assert!(near(&fed.data, &input.data) && fed.dims == input.dims);
                }
            }
        }
    }
}

#[test]
fn mean_and_deviation_follow_the_models_channel_order() {
    let image = Rgb::new(1, 1, vec![255, 0, 51]).unwrap();
    let encoding = InputEncoding { mean: [0.5, 0.25, 0.0], std: [0.5, 0.25, 0.1], ..ENCODING };
    let input = encode(&encoding, &image, whole(&image));
    assert_eq!(floats(&input), [1.0, -1.0, 2.0]);
    let blue_first = InputEncoding { color: ChannelOrder::Bgr, ..encoding };
    let input = encode(&blue_first, &image, whole(&image));
    assert_eq!(floats(&input), [(0.2 - 0.5) / 0.5, -1.0, 10.0]);
}

#[test]
fn pixels_beyond_the_image_are_padded() {
    let image = Rgb::new(1, 3, vec![1, 1, 1, 2, 2, 2, 3, 3, 3]).unwrap();
    let wide = TileWindow { right: 8, bottom: 2, ..whole(&image) };
    for (pad, row, below) in [
        (Padding::Reflect, [1, 2, 3, 2, 1, 2, 3, 2], 1),
        (Padding::Replicate, [1, 2, 3, 3, 3, 3, 3, 3], 1),
        (Padding::Zero, [1, 2, 3, 0, 0, 0, 0, 0], 0),
    ] {
        let encoding = InputEncoding { pad, element: ElementType::Uint8, range: ValueRange::Bytes, ..ENCODING };
        let TensorData::Uint8(bytes) = encode(&encoding, &image, wide).data else {
            panic!("no bytes");
        };
        assert_eq!(bytes[..8], row, "{pad}");
        assert_eq!(bytes[8], below, "{pad}");
    }
}

#[test]
fn samples_are_clamped_and_rounded() {
    let values = [-0.1, 1.1, 0.5, f32::INFINITY, 1.4 / 255.0, 1.6 / 255.0];
    let part = TileWindow { left: 0, top: 0, right: 2, bottom: 1 };
    // The third value is 0.5 · 255 = 127.5.
    for (rounding, expected) in
        [(Rounding::Round, [0, 128, 1, 255, 255, 2]), (Rounding::Truncate, [0, 127, 1, 255, 255, 1])]
    {
        let decoding = OutputDecoding { rounding, ..decoding() };
        let samples = TensorSamples::Float32(&values);
        let bytes = decoding.bytes(samples, TensorLayout::Nchw, [1, 2], part).unwrap();
        assert_eq!(bytes, expected);
    }
    for i in 0..=u16::MAX {
        let code = f32::from(i) / 257.0;
        assert_eq!(round_to_u8(code), code.round() as u8);
    }
    assert_eq!((round_to_u8(0.499_999_97), round_to_u8(254.5)), (0, 255));
}

#[test]
fn values_outside_an_assumed_range_are_refused() {
    for (values, range, expected) in [
        ([0.0, 200.0], ValueRange::Unit, ValueRange::Bytes),
        ([-0.9, 0.3], ValueRange::Unit, ValueRange::Signed),
        ([0.0, 0.9], ValueRange::Bytes, ValueRange::Unit),
    ] {
        let Err(InvalidValues::OutOfRange { likely, .. }) = check_values(&values, range, Certainty::Assumed) else {
            panic!("{values:?} passes");
        };
        assert_eq!(likely, expected, "{values:?}");
    }
    // A model that does not clamp overshoots a little, or rarely a lot.
    let mut rare = vec![0.5; 1000];
    rare[0] = -3.0;
    rare[1] = 40.0;
    for values in [&[-0.1, 1.4][..], &rare] {
        assert_eq!(check_values(values, ValueRange::Unit, Certainty::Assumed), Ok(()));
    }
}

#[test]
fn only_nan_is_refused_in_a_known_range() {
    for (values, expected) in [([0.0, 200.0], Ok(())), ([0.0, f32::NAN], Err(InvalidValues::NanOutput))] {
        assert_eq!(check_values(&values, ValueRange::Unit, Certainty::Known), expected);
    }
}

fn assert_near(values: &[f32], expected: [f32; 2]) {
    assert_eq!(values.len(), 2);
    for (value, expected) in values.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-6, "{values:?}");
    }
}

#[test]
fn luma_of_an_expression_is_encoded_in_its_range() {
    let image = Rgb::new(1, 2, vec![255, 0, 51, 51, 51, 51]).unwrap();
    let luma = InputEncoding { channels: Channels::Y, range: ValueRange::Signed, ..ENCODING };
    let input = encode(&luma, &image, whole(&image));
    assert_eq!(input.dims, [1, 1, 1, 2]);
    assert_near(floats(&input), [2.0 * (0.299 + 0.114 * 0.2) - 1.0, -0.6]);
    // The expression is evaluated on the image in 0..1, before luma and range.
    let squared = InputEncoding { input: "image ^ 2".parse().ok(), ..luma };
    let input = encode(&squared, &image, whole(&image));
    assert_near(floats(&input), [2.0 * (0.299 + 0.114 * 0.04) - 1.0, -0.92]);
    let infinite = InputEncoding { input: "image / 0".parse().ok(), ..ENCODING };
    let planes = Planes::from_rgb(&image);
    assert_eq!(infinite.tensor(&FedImage::Whole(&planes)), None);
}
