use image::{GrayImage, ImageFormat, RgbImage, RgbaImage};

use super::*;

fn image_file(bytes: Vec<u8>, place: impl Into<String>) -> ImageFile {
    ImageFile::new(bytes, place.into(), DecodeRule::default())
}

fn png(image: &DynamicImage) -> ImageFile {
    let mut bytes = Vec::new();
    image.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
    image_file(bytes, "test.png")
}

#[test]
fn grey_and_opaque_alpha_become_rgb() {
    let grey = png(&GrayImage::from_raw(2, 1, vec![7, 9]).unwrap().into());
    assert_eq!(grey.decode().unwrap().samples(), [7, 7, 7, 9, 9, 9]);
    let opaque = png(&RgbaImage::from_raw(1, 1, vec![1, 2, 3, 255]).unwrap().into());
    assert_eq!(opaque.decode().unwrap().samples(), [1, 2, 3]);
}

#[test]
fn sixteen_bits_become_the_nearest_eight() {
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(3, 1, vec![0, 32_896, 65_535]).unwrap();
    assert_eq!(png(&deep.into()).decode().unwrap().samples(), [0, 0, 0, 128, 128, 128, 255, 255, 255]);
}

#[test]
fn unsupported_images_are_refused_by_name() {
    let transparent = png(&RgbaImage::from_raw(1, 1, vec![1, 2, 3, 9]).unwrap().into());
    assert!(transparent.decode().unwrap_err().to_string().contains("transparent"));
    let text = image_file(b"no image".to_vec(), "a.png");
    assert!(text.check().unwrap_err().to_string().starts_with("a.png: not an image"));
}

#[test]
fn empty_file_is_called_empty() {
    let error = image_file(Vec::new(), "a.png").check().unwrap_err();
    assert_eq!(error.to_string(), "a.png: the file is empty (0 bytes)");
}

#[test]
fn a_truncated_file_is_named() {
    let mut picture = png(&GrayImage::new(64, 64).into());
    picture.bytes.truncate(picture.bytes.len() / 2);
    let error = picture.decode().unwrap_err().to_string();
    assert!(error.starts_with("test.png: not a whole image"), "{error}");
    assert!(error.contains("at byte"), "{error}");
}

#[test]
fn the_pixel_limit_can_be_changed() {
    let mut picture = png(&GrayImage::new(64, 64).into());
    picture.decode().unwrap();
    picture.rule.max_pixels = 4095;
    let error = picture.decode().unwrap_err().to_string();
    assert!(error.contains("64 × 64 pixels") && error.contains("--decode max-pixels"), "{error}");
}

/// The error for bytes that are not a complete image; one line that begins with the file name.
fn decoding_error(bytes: Vec<u8>) -> String {
    let place = "a.png";
    let error = image_file(bytes, place).decode().unwrap_err();
    let error = error.to_string();
    assert!(error.starts_with("a.png: "), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    error
}

#[test]
fn a_corrupt_png_is_named() {
    let image = RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8, y as u8, (x * y) as u8]));
    let bytes = png(&image.into()).bytes().to_vec();
    let data = bytes.windows(4).position(|four| four == b"IDAT").unwrap() + 4;
    let end = bytes.len() - 12;
    for at in [data, data + 40, end - 5] {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x10;
        assert!(decoding_error(flipped).contains("not a "), "data at {at}");
    }
    for at in end - 4..end {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1;
        assert!(decoding_error(flipped).contains("checksum"), "checksum at {at}");
    }
    for length in [data + 9, end - 4, end, end + 4, end + 8, end + 11] {
        let cut = decoding_error(bytes[..length].to_vec());
        assert!(cut.contains("not a whole image"), "{length}: {cut}");
    }
    assert!(image_file(bytes, "").decode().is_ok());
}

fn jpeg(color: jpeg_encoder::ColorType, channels: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let samples: Vec<u8> = (0..32 * 32 * channels).map(|i| (i * 7) as u8).collect();
    jpeg_encoder::Encoder::new(&mut bytes, 90).encode(&samples, 32, 32, color).unwrap();
    bytes
}

/// A CMYK JPEG of one colour, 32 × 32 pixels.
fn cmyk_jpeg(color: jpeg_encoder::ColorType, inks: [u8; 4], profile: Option<&[u8]>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 100);
    if let Some(profile) = profile {
        encoder.add_icc_profile(profile).unwrap();
    }
    encoder.encode(&inks.repeat(32 * 32), 32, 32, color).unwrap();
    bytes
}

/// Asserts that all pixels are within 3 codes of `expected`.
fn assert_near(file: &ImageFile, expected: [u8; 3]) {
    let rgb = file.decode().unwrap();
    assert_eq!((rgb.width(), rgb.height()), (32, 32));
    for pixel in rgb.samples().as_chunks::<3>().0 {
        let is_near = pixel.iter().zip(expected).all(|(found, code)| found.abs_diff(code) <= 3);
        assert!(is_near, "{pixel:?}, not {expected:?}");
    }
}

#[test]
fn inks_become_rgb_with_a_note() {
    use jpeg_encoder::ColorType::{Cmyk, CmykAsYcck};
    // The encoder takes 255 for full ink, and writes Adobe's marker.
    for color in [Cmyk, CmykAsYcck] {
        for (inks, expected) in
            [([0, 0, 0, 0], [255, 255, 255]), ([255, 0, 0, 0], [0, 255, 255]), ([40, 90, 200, 60], [164, 126, 42])]
        {
            let file = image_file(cmyk_jpeg(color, inks, None), "a.jpg");
            assert_near(&file, expected);
            assert_eq!(file.check().unwrap(), (32, 32));
            let note = file.note().colour.unwrap();
            assert_eq!(note.from, "CMYK without a profile");
            assert_ne!(file.digest(), Digest::from_bytes(file.bytes()));
        }
    }
}

#[test]
fn inks_without_the_adobe_marker_are_not_inverted() {
    let mut bytes = cmyk_jpeg(jpeg_encoder::ColorType::Cmyk, [0, 0, 0, 255], None);
    let marker = bytes.windows(5).position(|five| five == b"Adobe").unwrap();
    bytes[marker] = b'a';
    // Inverted black is full cyan, magenta and yellow, which is black too; the second image tells them apart.
    assert_near(&image_file(bytes, "a.jpg"), [0, 0, 0]);
    let mut bytes = cmyk_jpeg(jpeg_encoder::ColorType::Cmyk, [255, 255, 255, 255], None);
    bytes[marker] = b'a';
    assert_near(&image_file(bytes, "a.jpg"), [255, 255, 255]);
}

#[test]
fn a_broken_cmyk_profile_is_named_and_can_be_ignored() {
    let file = cmyk_jpeg(jpeg_encoder::ColorType::Cmyk, [0; 4], Some(b"no profile"));
    let problem = decoding_error(file.clone());
    assert!(problem.contains("ICC profile") && problem.contains("--decode colour=ignore"), "{problem}");
    let mut file = image_file(file, "a.jpg");
    file.rule.colour = ColourRule::Ignore;
    assert_near(&file, [255, 255, 255]);
}

#[test]
fn grey_and_rgb_files_have_no_inks() {
    for (color, channels) in [(jpeg_encoder::ColorType::Rgb, 3), (jpeg_encoder::ColorType::Luma, 1)] {
        let (bytes, place) = (jpeg(color, channels), String::new());
        let file = image_file(bytes, place);
        assert!(file.decode().is_ok() && file.note().colour.is_none());
    }
}

#[test]
fn a_truncated_jpeg_is_named() {
    let bytes = jpeg(jpeg_encoder::ColorType::Rgb, 3);
    for length in [bytes.len() / 2, bytes.len() - 40, bytes.len() - 2] {
        let cut = decoding_error(bytes[..length].to_vec());
        assert!(cut.contains("not a "), "{length}: {cut}");
    }
}

#[test]
fn a_decompression_bomb_is_refused() {
    let mut bomb = png(&GrayImage::new(1, 1).into()).bytes().to_vec();
    bomb[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    assert!(image_file(bomb, "").check().is_err());
}
