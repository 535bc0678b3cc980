use std::fs;

use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray16;
use tiff::tags::Tag;

use super::*;

fn pgm(folder: &Path, name: &str, [width, height]: [usize; 2], maximum: u16) -> std::path::PathBuf {
    let path = folder.join(name);
    let header = format!("P5 {width} {height} {maximum} ");
    let samples = (0..width * height).flat_map(|site| ((site % 256) as u16).to_be_bytes());
    fs::write(&path, header.bytes().chain(samples).collect::<Vec<u8>>()).unwrap();
    path
}

fn options(crop: Option<&str>) -> ReadOptions {
    ReadOptions { cfa: Cfa::Rggb, crop: crop.map(|crop| crop.parse().unwrap()), most_pixels: 1_000_000 }
}

#[test]
fn frames_are_cropped_and_must_match_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let first = pgm(folder.path(), "first.pgm", [301, 300], 4095);
    let reader = FrameReader::open(&first, options(None)).unwrap();
    let layout = reader.layout;
    assert_eq!((layout.width, layout.height), (300, 300));
    assert!(reader.omission_note().unwrap().contains("301 × 300"));
    let frame = reader.read(&first).unwrap();
    assert_eq!(frame.samples.len(), 300 * 300);
    // The second row starts at site 301.
    assert_eq!(frame.samples[300], 301 % 256);
    for (size, maximum, part) in
        [([300, 300], 4095, "300 × 300 sites, but"), ([301, 300], 1023, "a PGM with the maximum 1023, but")]
    {
        let other = pgm(folder.path(), "other.pgm", size, maximum);
        let error = reader.read(&other).unwrap_err().to_string();
        assert!(error.contains("other.pgm") && error.contains("first.pgm"), "{error}");
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn crops_must_keep_the_pattern_and_fit() {
    let folder = tempfile::tempdir().unwrap();
    let first = pgm(folder.path(), "first.pgm", [300, 310], 4095);
    let reader = FrameReader::open(&first, options(Some("4,6,256,260"))).unwrap();
    assert_eq!(reader.omission_note(), None);
    let frame = reader.read(&first).unwrap();
    assert_eq!(frame.samples.len(), 256 * 260);
    assert_eq!(frame.samples[0], (6 * 300 + 4) % 256);
    assert_eq!(frame.samples[256], (7 * 300 + 4) % 256);
    for (crop, part) in [
        ("4,6,300,260", "--crop reaches beyond the frame of 300 × 310"),
        ("5,6,256,260", "--crop X,Y,WIDTH,HEIGHT: all four must be even"),
        ("0,0,256,254", "256 × 254 sites are too few for row noise"),
        ("18446744073709551615,0,256,256", "--crop reaches beyond"),
    ] {
        let error = FrameReader::open(&first, options(Some(crop))).unwrap_err().to_string();
        assert!(error.contains("first.pgm") && error.contains(part), "{crop}: {error}");
    }
    for wrong in ["1,2,3", "1,2,3,-4", "a", "1,2,3,4,5"] {
        assert!(wrong.parse::<Crop>().is_err(), "{wrong}");
    }
}

#[test]
fn frames_of_another_camera_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [first, same, none, other] =
        [("first.tif", Some("A 1")), ("same.tif", Some("A 1")), ("none.tif", None), ("other.tif", Some("B 2"))].map(
            |(name, model)| {
                let path = folder.path().join(name);
                let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
                let mut image = encoder.new_image::<Gray16>(256, 256).unwrap();
                if let Some(model) = model {
                    image.encoder().write_tag(Tag::Model, model).unwrap();
                }
                image.write_data(&vec![512; 256 * 256]).unwrap();
                path
            },
        );
    let reader = FrameReader::open(&first, options(None)).unwrap();
    assert_eq!(reader.camera(), Some("A 1"));
    reader.read(&same).unwrap();
    // A file without a camera name matches any camera.
    reader.read(&none).unwrap();
    let error = reader.read(&other).unwrap_err().to_string();
    assert!(error.contains("other.tif: taken by B 2, but"), "{error}");
    assert!(error.contains("first.tif by A 1"), "{error}");
}

#[test]
fn patterns_name_their_first_four_sites() {
    for (cfa, planes) in [
        (Cfa::Rggb, [0, 1, 2, 3]),
        (Cfa::Bggr, [3, 2, 1, 0]),
        (Cfa::Grbg, [1, 0, 3, 2]),
        (Cfa::Gbrg, [2, 3, 0, 1]),
        (Cfa::Mono, [0; 4]),
    ] {
        let found = [[0, 0], [0, 1], [1, 0], [1, 1]];
        let found = found.map(|[row, parity]| cfa.plane(row, parity));
        assert_eq!(found, planes, "{cfa}");
        // The colours by name: both greens are on a diagonal.
        let letters: String = found.iter().map(|plane| &cfa.plane_names()[*plane][..1]).collect();
        if cfa != Cfa::Mono {
            assert_eq!(letters, cfa.to_string());
        }
    }
}

#[test]
fn tiles_cover_a_plane() {
    let layout = Layout { cfa: Cfa::Rggb, height: 514, width: 300 };
    assert_eq!(layout.plane_size(), [257, 150]);
    assert_eq!(layout.plane_rows(), 1028);
    let covered: usize = (0..TILES).map(|tile| Layout::tile(150, tile).len()).sum();
    assert_eq!(covered, 150);
    assert_eq!([0, 513].map(|row| layout.tile_row(row)), [0, 7]);
    // Row 64 of the plane is the last of the third tile: 2 · 257 / 8 = 64.25.
    assert_eq!([127, 128].map(|row| layout.tile_row(row)), [1, 2]);
}
