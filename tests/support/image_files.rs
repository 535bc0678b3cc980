//! Image files with what cameras and editors write beside the pixels.

use std::io::Cursor;

use image::{ImageFormat, RgbImage};

/// A PNG file of an image.
pub fn png(image: &RgbImage) -> Vec<u8> {
    encoded(image, ImageFormat::Png)
}

/// A file of an image in a format.
pub fn encoded(image: &RgbImage, format: ImageFormat) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    image.write_to(&mut file, format).unwrap();
    file.into_inner()
}

/// A JPEG file of an image, nearly lossless.
pub fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut file = Vec::new();
    let (width, height) = (image.width() as u16, image.height() as u16);
    let mut encoder = jpeg_encoder::Encoder::new(&mut file, 100);
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_4_4);
    encoder.encode(image, width, height, jpeg_encoder::ColorType::Rgb).unwrap();
    file
}

/// EXIF data with an orientation, little-endian, or big-endian for odd values.
pub fn exif(orientation: u16) -> Vec<u8> {
    let big = orientation % 2 == 1;
    let short = |n: u16| {
        if big { n.to_be_bytes() } else { n.to_le_bytes() }
    };
    let long = |n: u32| {
        if big { n.to_be_bytes() } else { n.to_le_bytes() }
    };
    let mut data = if big { b"MM".to_vec() } else { b"II".to_vec() };
    data.extend(short(42));
    data.extend(long(8));
    // Two entries: the width of the image (tag 256), which is of no interest, and the orientation (tag 274).
    data.extend(short(2));
    for (tag, value) in [(256, 7), (274, orientation)] {
        data.extend([short(tag), short(3)].concat());
        data.extend(long(1));
        data.extend([short(value), short(0)].concat());
    }
    data.extend(long(0));
    data
}

/// The checksum of the kind and the data of a PNG chunk.
pub fn checksum(body: &[u8]) -> [u8; 4] {
    let mut sum = flate2::Crc::new();
    sum.update(body);
    sum.sum().to_be_bytes()
}

/// The bytes of a PNG chunk.
pub fn chunk(kind: [u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [&kind[..], data].concat();
    let length = (data.len() as u32).to_be_bytes();
    [&length[..], &body, &checksum(&body)].concat()
}

/// A PNG file with further chunks behind its header.
pub fn with_chunks(png: &[u8], chunks: &[Vec<u8>]) -> Vec<u8> {
    // The signature and IHDR with its 13 bytes.
    let (header, rest) = png.split_at(8 + 25);
    [header, &chunks.concat(), rest].concat()
}

/// A JPEG file with a further application segment behind its start.
pub fn with_segment(jpeg: &[u8], marker: u8, data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u16 + 2).to_be_bytes();
    let (start, rest) = jpeg.split_at(2);
    [start, &[0xFF, marker], &length, data, rest].concat()
}

/// A PNG file that states an orientation.
pub fn turned_png(image: &RgbImage, orientation: u16) -> Vec<u8> {
    with_chunks(&png(image), &[chunk(*b"eXIf", &exif(orientation))])
}

/// A JPEG file that states an orientation.
pub fn turned_jpeg(jpeg: &[u8], orientation: u16) -> Vec<u8> {
    let data = [b"Exif\0\0", &exif(orientation)[..]].concat();
    with_segment(jpeg, 0xE1, &data)
}

/// A JPEG file that states a camera's aperture and exposure time (fractions) and sensitivity.
pub fn exposed_jpeg(jpeg: &[u8], aperture: [u32; 2], time: [u32; 2], sensitivity: u16) -> Vec<u8> {
    let entry = |tag: u16, kind: u16, value: u32| {
        [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &1_u32.to_be_bytes(), &value.to_be_bytes()].concat()
    };
    let (settings, values) = (26, 68);
    let fractions: Vec<u8> = [time, aperture].concat().iter().flat_map(|number| number.to_be_bytes()).collect();
    let data = [
        &b"Exif\0\0MM\0*"[..],
        &8_u32.to_be_bytes(),
        &1_u16.to_be_bytes(),
        &entry(0x8769, 4, settings),
        &[0; 4],
        &3_u16.to_be_bytes(),
        &entry(0x829A, 5, values),
        &entry(0x829D, 5, values + 8),
        &entry(0x8827, 3, u32::from(sensitivity) << 16),
        &[0; 4],
        &fractions,
    ]
    .concat();
    with_segment(jpeg, 0xE1, &data)
}

/// The image as a person sees it, by the meaning of the eight values (TIFF 6.0, section 8): the side of the image at
/// which the first row stands, then the side at which the first column stands.
pub fn seen(stored: &RgbImage, orientation: u16) -> RgbImage {
    let (width, height) = stored.dimensions();
    let (last_x, last_y) = (width - 1, height - 1);
    match orientation {
        1 => stored.clone(),
        // Top, right.
        2 => RgbImage::from_fn(width, height, |x, y| *stored.get_pixel(last_x - x, y)),
        // Bottom, right.
        3 => RgbImage::from_fn(width, height, |x, y| *stored.get_pixel(last_x - x, last_y - y)),
        // Bottom, left.
        4 => RgbImage::from_fn(width, height, |x, y| *stored.get_pixel(x, last_y - y)),
        // Left, top.
        5 => RgbImage::from_fn(height, width, |x, y| *stored.get_pixel(y, x)),
        // Right, top.
        6 => RgbImage::from_fn(height, width, |x, y| *stored.get_pixel(y, last_y - x)),
        // Right, bottom.
        7 => RgbImage::from_fn(height, width, |x, y| *stored.get_pixel(last_x - y, last_y - x)),
        // Left, bottom.
        8 => RgbImage::from_fn(height, width, |x, y| *stored.get_pixel(last_x - y, x)),
        _ => unreachable!("eight values"),
    }
}

/// A chunk of a WebP file.
pub fn riff(kind: [u8; 4], data: &[u8]) -> Vec<u8> {
    let mut chunk = [&kind[..], &(data.len() as u32).to_le_bytes(), data].concat();
    chunk.resize(chunk.len().next_multiple_of(2), 0);
    chunk
}

/// A WebP file with these chunks.
pub fn webp_of(chunks: &[Vec<u8>]) -> Vec<u8> {
    let chunks = chunks.concat();
    let size = (chunks.len() as u32 + 4).to_le_bytes();
    [&b"RIFF"[..], &size, b"WEBP", &chunks].concat()
}

/// The chunk with the flags and the size of an extended WebP file.
pub fn extended([width, height]: [u32; 2], flags: u8) -> Vec<u8> {
    let side = |side: u32| (side - 1).to_le_bytes()[..3].to_vec();
    let data = [&[flags, 0, 0, 0][..], &side(width), &side(height)].concat();
    riff(*b"VP8X", &data)
}

/// The chunk of the samples of a lossless WebP file.
pub fn webp_samples(image: &RgbImage) -> Vec<u8> {
    encoded(image, ImageFormat::WebP)[12..].to_vec()
}

/// A lossless WebP file that states an orientation.
pub fn turned_webp(image: &RgbImage, orientation: u16) -> Vec<u8> {
    let (width, height) = image.dimensions();
    webp_of(&[extended([width, height], 0x08), webp_samples(image), riff(*b"EXIF", &exif(orientation))])
}

/// A lossless WebP animation.
pub fn animated_webp(frames: &[RgbImage]) -> Vec<u8> {
    let (width, height) = frames[0].dimensions();
    let side = |side: u32| (side - 1).to_le_bytes()[..3].to_vec();
    let mut chunks = vec![extended([width, height], 0x02), riff(*b"ANIM", &[255, 255, 255, 255, 0, 0])];
    for frame in frames {
        // The place, the size, 40 ms, no blending.
        let head = [&[0; 6][..], &side(width), &side(height), &[40, 0, 0, 2]].concat();
        chunks.push(riff(*b"ANMF", &[head, webp_samples(frame)].concat()));
    }
    webp_of(&chunks)
}

/// The PNG chunk of an ICC profile.
pub fn profile_chunk(profile: &[u8]) -> Vec<u8> {
    packed_chunk(*b"iCCP", b"a name\0\0", profile)
}

/// A chunk that holds data packed by zlib behind a head.
pub fn packed_chunk(kind: [u8; 4], head: &[u8], data: &[u8]) -> Vec<u8> {
    let mut packed = head.to_vec();
    let mut deflate = flate2::write::ZlibEncoder::new(&mut packed, flate2::Compression::fast());
    std::io::Write::write_all(&mut deflate, data).unwrap();
    deflate.finish().unwrap();
    chunk(kind, &packed)
}

/// A PNG file with an ICC profile.
pub fn png_with_profile(image: &RgbImage, profile: &[u8]) -> Vec<u8> {
    with_chunks(&png(image), &[profile_chunk(profile)])
}

/// A JPEG file with an ICC profile in two parts, the second part first.
pub fn jpeg_with_profile(jpeg: &[u8], profile: &[u8]) -> Vec<u8> {
    let (first, second) = profile.split_at(profile.len() / 2);
    let part = |number: u8, data: &[u8]| [b"ICC_PROFILE\0", &[number, 2][..], data].concat();
    let file = with_segment(jpeg, 0xE2, &part(1, first));
    with_segment(&file, 0xE2, &part(2, second))
}

/// A lossless WebP file with an ICC profile.
pub fn webp_with_profile(image: &RgbImage, profile: &[u8]) -> Vec<u8> {
    let (width, height) = image.dimensions();
    webp_of(&[extended([width, height], 0x20), riff(*b"ICCP", profile), webp_samples(image)])
}
