use std::io::Cursor;

use tiff::encoder::colortype::{Gray8, Gray16, RGB16};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder};
use tiff::tags::Tag;

use super::*;

const WIDTH: usize = 5;
const HEIGHT: usize = 3;

/// Samples over the whole range; in some both bytes differ.
fn samples() -> Vec<u16> {
    (0..WIDTH * HEIGHT).map(|i| (i * 4321) as u16 + 7).collect()
}

fn pgm(header: &str, samples: &[u16]) -> Vec<u8> {
    let bytes = samples.iter().flat_map(|sample| sample.to_be_bytes());
    header.bytes().chain(bytes).collect()
}

fn png(color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, WIDTH as u32, HEIGHT as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == png::ColorType::Indexed {
        encoder.set_palette(vec![1, 2, 3]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

fn tiff(compression: Compression, tags: &[(Tag, &str)]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression);
    let mut image = encoder.new_image::<Gray16>(WIDTH as u32, HEIGHT as u32).unwrap();
    for (tag, text) in tags {
        image.encoder().write_tag(*tag, *text).unwrap();
    }
    image.write_data(&samples()).unwrap();
    file.into_inner()
}

fn decoded(name: &str, bytes: &[u8]) -> Result<Decoded, String> {
    decode(Path::new(name), bytes, 1000)
}

fn problem(name: &str, bytes: &[u8]) -> String {
    decoded(name, bytes).map(|_| ()).unwrap_err()
}

#[test]
fn all_forms_give_the_same_samples() {
    let big = samples().iter().flat_map(|s| s.to_be_bytes()).collect::<Vec<u8>>();
    let files = [
        ("a.png", png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &big)),
        ("a.tif", tiff(Compression::Uncompressed, &[])),
        ("a.tif", tiff(Compression::Lzw, &[])),
        ("a.tiff", tiff(Compression::Deflate(DeflateLevel::default()), &[])),
        ("a.pgm", pgm("P5\n5 3\n65535\n", &samples())),
        // Comments and other white space are allowed before the last number.
        ("a.pgm", pgm("P5 # by hand\n# again\n5\t3\r\n65535 ", &samples())),
        // The name of the file does not matter.
        ("a.txt", pgm("P5 5 3 65535 ", &samples())),
    ];
    for (name, bytes) in files {
        let found = decoded(name, &bytes).unwrap();
        assert_eq!((found.width, found.height), (WIDTH, HEIGHT), "{name}");
        assert_eq!(found.samples, samples(), "{name}");
    }
}

#[test]
fn tiff_metadata_is_read() {
    let tags = [(Tag::Make, "ACME"), (Tag::Model, "Night 3"), (Tag::DateTime, "2026:01:02 03:04:05")];
    let found = decoded("a.tif", &tiff(Compression::Uncompressed, &tags)).unwrap();
    assert_eq!(found.camera.as_deref(), Some("ACME Night 3"));
    assert_eq!(found.taken.as_deref(), Some("2026:01:02 03:04:05"));
    let found = decoded("a.tif", &tiff(Compression::Lzw, &[(Tag::Model, "ACME 3")])).unwrap();
    assert_eq!(found.camera.as_deref(), Some("ACME 3"));
}

#[test]
fn developed_images_are_refused() {
    let rgb_png = png(png::ColorType::Rgb, png::BitDepth::Sixteen, &[9; 6 * 15]);
    let grey_png = png(png::ColorType::Grayscale, png::BitDepth::Eight, &[9; 15]);
    let palette = png(png::ColorType::Indexed, png::BitDepth::Eight, &[0; 15]);
    let mut rgb_tiff = Cursor::new(Vec::new());
    TiffEncoder::new(&mut rgb_tiff).unwrap().write_image::<RGB16>(5, 3, &[9; 45]).unwrap();
    let mut grey_tiff = Cursor::new(Vec::new());
    TiffEncoder::new(&mut grey_tiff).unwrap().write_image::<Gray8>(5, 3, &[9; 15]).unwrap();
    for (what, bytes) in [
        ("an RGB PNG of 16 bits", rgb_png),
        ("a grey PNG of 8 bits", grey_png),
        ("a palette PNG of 8 bits", palette),
        ("an RGB TIFF of 16 bits", rgb_tiff.into_inner()),
        ("a grey TIFF of 8 bits", grey_tiff.into_inner()),
        ("a PGM of 8 bits", pgm("P5 5 3 255 ", &[1; 8])),
        ("a PPM of three channels", pgm("P6 5 3 65535 ", &samples())),
        ("a JPEG file", vec![0xFF, 0xD8, 0xFF, 0xE0]),
    ] {
        let problem = problem("a.png", &bytes);
        for part in [what, "a developed image holds no sensor noise", "dcraw -D -4 -T -t 0"] {
            assert!(problem.contains(part), "{what}: {problem}");
        }
    }
}

#[test]
fn raw_files_are_refused_with_advice() {
    let dng_version = (Tag::Unknown(50706), "1.4");
    let dng = tiff(Compression::Uncompressed, &[dng_version]);
    for (name, bytes, kind) in [
        ("a.dng", b"II*\0".to_vec(), "a DNG file"),
        ("a.NEF", b"MM\0*".to_vec(), "a NEF file"),
        ("a.tif", dng, "a DNG file"),
        ("a", b"II*\0\x10\0\0\0CR\x02\0".to_vec(), "a CR2 file"),
        ("a", b"\0\0\0\x18ftypcrx \0".to_vec(), "a CR3 file"),
        ("a", b"FUJIFILMCCD-RAW 0201".to_vec(), "a RAF file"),
    ] {
        let problem = problem(name, &bytes);
        for part in [kind, "dcraw -D -4 -T -t 0", "rawpy's `raw_image_visible`"] {
            assert!(problem.contains(part), "{name}: {problem}");
        }
    }
}

#[test]
fn broken_files_are_refused() {
    let whole = tiff(Compression::Uncompressed, &[]);
    let lzw = tiff(Compression::Lzw, &[]);
    let big = samples().iter().flat_map(|s| s.to_be_bytes()).collect::<Vec<u8>>();
    let png = png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &big);
    for (name, bytes, part) in [
        ("empty", Vec::new(), "the file is empty"),
        ("a.txt", b"hello".to_vec(), "not a mosaic"),
        ("a.png", png[..png.len() / 2].to_vec(), "not a whole PNG"),
        ("a.tif", whole[..whole.len() / 2].to_vec(), "not a whole TIFF"),
        ("a.tif", lzw[..9].to_vec(), "not a whole TIFF"),
        ("a.pgm", pgm("P5 5 3 65535 ", &samples()[1..]), "the file ends early: 28 bytes of samples, 30 expected"),
        ("a.pgm", pgm("P5 5 3 65535 ", &[samples(), samples()].concat()), "more than one image"),
        ("a.pgm", pgm("P5 5 3 4095 ", &samples()), "is above the maximum 4095"),
        ("a.pgm", pgm("P5 5 3 70000 ", &samples()), "the maximum 70000 is above 65535"),
        ("a.pgm", pgm("P5 0 3 65535 ", &[]), "0 × 3 pixels are not an image"),
        ("a.pgm", b"P5 5".to_vec(), "no width in its header"),
        ("a.pgm", b"P5 5 x ".to_vec(), "no height in its header"),
        ("a.pgm", b"P5 # no end".to_vec(), "no width in its header"),
        ("a.pgm", b"P2 5 3 65535 1 2 3".to_vec(), "a PGM of text (P2)"),
        ("a.pgm", b"P4 5 3 ".to_vec(), "not a binary PGM"),
        ("a.pgm", pgm("P5 50 30 65535 ", &samples()), "50 × 30 pixels are more than the 1000"),
        ("a.pgm", b"P5 99999999999 3 65535 ".to_vec(), "no width in its header"),
    ] {
        let problem = problem(name, &bytes);
        assert!(problem.contains(part), "{name}: {problem}");
    }
}

/// They are not called developed, and the error names the limit.
#[test]
fn damaged_and_large_pngs_have_their_own_errors() {
    let big: Vec<u8> = samples().iter().flat_map(|s| s.to_be_bytes()).collect();
    let small = png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &big);
    let mut large = Vec::new();
    let mut encoder = png::Encoder::new(&mut large, 10_001, 10_000);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, &[]).unwrap();
    drop(writer);
    for (bytes, most_pixels, part) in [
        (&small[..30], 15, "not a readable PNG"),
        (&small[..], 14, "5 × 3 pixels are more than the 14 that are read; raise --decode max-pixels"),
        (&large, 100_000_000, "10001 × 10000 pixels are more than the 100000000 that are read; raise"),
        // It is within the limit now, but has no samples.
        (&large, 200_000_000, "not a whole PNG"),
    ] {
        let problem = decode(Path::new("a.png"), bytes, most_pixels);
        let problem = problem.map(|_| ()).unwrap_err();
        assert!(problem.contains(part), "{part}: {problem}");
        assert!(!problem.contains("developed"), "{problem}");
    }
}

/// Every truncated file is an error, and no changed byte of a header causes a panic.
#[test]
fn truncated_and_changed_files_do_not_panic() {
    let big = samples().iter().flat_map(|s| s.to_be_bytes()).collect::<Vec<u8>>();
    for (name, bytes) in [
        ("a.pgm", pgm("P5\n5 3\n65535\n", &samples())),
        ("a.tif", tiff(Compression::Uncompressed, &[(Tag::Model, "m")])),
        ("a.tif", tiff(Compression::Lzw, &[])),
        ("a.png", png(png::ColorType::Grayscale, png::BitDepth::Sixteen, &big)),
    ] {
        for end in 0..bytes.len() {
            // A TIFF may end with bytes that no tag refers to.
            if let Ok(found) = decoded(name, &bytes[..end]) {
                assert_eq!(found.samples, samples(), "{name}, cut at {end}");
            }
        }
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut changed = bytes.clone();
                changed[at] = value;
                let _ = decoded(name, &changed);
            }
        }
    }
}
