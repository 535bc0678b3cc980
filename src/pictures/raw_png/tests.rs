use proptest::prelude::*;

use super::super::decode_rule::MAX_PIXELS;
use super::*;

/// A PNG file with these packed rows.
fn png([height, width]: [u32; 2], color: ColorType, bits: BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(bits);
    if color == ColorType::Indexed {
        // All colours are the same, so that a decoder that replaces indices by colours fails the test.
        encoder.set_palette(vec![200; 3 << (bits as u8)]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

fn read(bytes: &[u8], forms: &[SampleForm]) -> Result<Vec<u16>, String> {
    RawPng::open(bytes, forms, MAX_PIXELS)?.samples(|sample| sample)
}

#[test]
fn palette_indices_stay_indices() {
    for (bits, data, expected) in [
        (BitDepth::Eight, vec![0, 7, 255, 1, 2, 3], [0, 7, 255, 1, 2, 3]),
        (BitDepth::Four, vec![0x07, 0xf0, 0x12, 0x30], [0, 7, 15, 1, 2, 3]),
        (BitDepth::Two, vec![0b00_01_11_00, 0b01_10_11_00], [0, 1, 3, 1, 2, 3]),
        (BitDepth::One, vec![0b0110_0000, 0b1010_0000], [0, 1, 1, 1, 0, 1]),
    ] {
        let bytes = png([2, 3], ColorType::Indexed, bits, &data);
        assert_eq!(read(&bytes, &[SampleForm::Palette]).unwrap(), expected, "{bits:?}");
    }
}

#[test]
fn grey_samples_are_not_scaled() {
    let shallow = png([1, 2], ColorType::Grayscale, BitDepth::Eight, &[40, 255]);
    assert_eq!(read(&shallow, &[SampleForm::Grey8]).unwrap(), [40, 255]);
    let deep = png([2, 1], ColorType::Grayscale, BitDepth::Sixteen, &[1, 2, 255, 255]);
    let opened = RawPng::open(&deep, &[SampleForm::Grey16], 2).unwrap();
    assert_eq!(opened.size, (2, 1));
    assert_eq!(opened.samples(|sample| sample).unwrap(), [258, 65_535]);
}

#[test]
fn other_forms_are_refused_by_name() {
    let (all, deep) = ([SampleForm::Grey8, SampleForm::Grey16, SampleForm::Palette], [SampleForm::Grey16]);
    for (color, bits, size, forms, expected) in [
        (ColorType::Rgb, BitDepth::Eight, 3, &all[..], "an RGB PNG of 8 bits; 8-bit grey or 16-bit grey or palette"),
        (ColorType::Rgba, BitDepth::Sixteen, 8, &all, "an RGBA PNG of 16 bits"),
        (ColorType::GrayscaleAlpha, BitDepth::Eight, 2, &all, "a grey-and-alpha PNG"),
        (ColorType::Grayscale, BitDepth::Four, 1, &all, "a grey PNG of 4 bits"),
        (ColorType::Grayscale, BitDepth::Eight, 1, &deep, "a grey PNG of 8 bits; 16-bit grey expected"),
        (ColorType::Indexed, BitDepth::Eight, 1, &deep, "a palette PNG of 8 bits; 16-bit grey expected"),
    ] {
        let problem = read(&png([1, 1], color, bits, &vec![0; size]), forms).unwrap_err();
        assert!(problem.contains(expected), "{problem}");
    }
    let problem = read(b"\xff\xd8\xff\xe0", &deep).unwrap_err();
    assert!(problem.starts_with("not a readable PNG"), "{problem}");
}

#[test]
fn a_bomb_is_refused_before_it_is_decompressed() {
    let mut bytes = png([1, 1], ColorType::Grayscale, BitDepth::Sixteen, &[0, 0]);
    bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    seal(&mut bytes);
    let problem = read(&bytes, &[SampleForm::Grey16]).unwrap_err();
    assert!(problem.starts_with("65536 × 65536 pixels are more"), "{problem}");
}

#[test]
fn each_cause_of_a_refusal_has_its_own_error() {
    let deep = png([2, 1], ColorType::Grayscale, BitDepth::Sixteen, &[0; 4]);
    let grey_16 = [SampleForm::Grey16];
    assert!(RawPng::open(&deep, &grey_16, 2).is_ok_and(|png| png.size == (2, 1)));
    assert!(matches!(RawPng::open(&deep[..30], &grey_16, 2), Err(RawPngError::Broken(_))));
    assert!(matches!(RawPng::open(&deep, &grey_16, 1), Err(RawPngError::TooLarge(_))));
    assert!(matches!(RawPng::open(&deep, &[SampleForm::Grey8], 2), Err(RawPngError::OtherForm(_))));
}

/// Updates the checksum of the header after its content was changed.
fn seal(bytes: &mut [u8]) {
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

proptest! {
    #[test]
    fn no_bytes_panic(at in 16_usize..90, value in any::<u8>(), end in 33_usize..100) {
        let mut bytes = png([3, 5], ColorType::Indexed, BitDepth::Two, &[0x1b; 6]);
        if let Some(byte) = bytes.get_mut(at) {
            *byte = value;
        }
        seal(&mut bytes);
        bytes.truncate(end);
        let _ = read(&bytes, &[SampleForm::Grey8, SampleForm::Grey16, SampleForm::Palette]);
    }
}
