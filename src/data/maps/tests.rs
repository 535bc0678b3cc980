use std::fs;

use ndarray::array;
use png::{BitDepth, ColorType};
use proptest::prelude::*;

use super::*;

/// A PNG file of this height and width with these packed rows.
fn png_file([height, width]: [u32; 2], color: ColorType, bits: BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(color);
    encoder.set_depth(bits);
    if color == ColorType::Indexed {
        encoder.set_palette(vec![200; 3 << (bits as u8)]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

/// A `.npy` file of version 1 as `numpy.save` writes it.
fn npy_file(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}   \n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn deep(size: [u32; 2], values: &[u16]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    png_file(size, ColorType::Grayscale, BitDepth::Sixteen, &data)
}

fn temporary_file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn depth(name: &str, bytes: &[u8], scale: Option<f64>, size: Size) -> Result<Array2<u32>> {
    let (_folder, path) = temporary_file(name, bytes);
    let maps = MapPaths { depth: Some(DepthFile::new(path, scale).unwrap()), ..MapPaths::default() };
    maps.read()?.depth(size).map(Option::unwrap)
}

fn semantic(path: &Path, size: Size) -> Result<Array2<u16>> {
    let maps = MapPaths { semantic: Some(path.to_owned()), ..MapPaths::default() };
    maps.read()?.semantic(size).map(Option::unwrap)
}

fn segments(path: &Path, size: Size) -> Result<Array2<u32>> {
    let maps = MapPaths { segments: Some(path.to_owned()), ..MapPaths::default() };
    maps.read()?.segments(size).map(Option::unwrap)
}

#[test]
fn depth_is_rounded_half_to_even() {
    let png = deep([2, 3], &[0, 1, 3, 5, 7, 65_535]);
    let read = depth("d.png", &png, Some(0.0005), (2, 3)).unwrap();
    assert_eq!(read, array![[0, 0, 2], [2, 4, 32_768]]);
    let metres =
        [0.0005, 0.0015, 0.0025, 1.2344, 1000.0, 0.0, -0.0, -3.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324];
    let npy = npy_file("<f8", "(3, 4)", &metres.map(f64::to_le_bytes).concat());
    let read = depth("d.NPY", &npy, None, (3, 4)).unwrap();
    assert_eq!(read, array![[0, 2, 2, 1234], [1_000_000, 0, 0, 0], [0, 0, 0, 0]]);
    let npy = npy_file("<f4", "(1, 2)", &[2.5_f32, f32::NAN].map(f32::to_le_bytes).concat());
    let read = depth("d.npy", &npy, Some(1.0), (1, 2)).unwrap();
    assert_eq!(read, array![[2500, 0]]);
}

#[test]
fn too_large_depth_is_refused() {
    let error = depth("d.png", &deep([1, 1], &[2500]), Some(1.0), (1, 1)).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("d.png: a depth of 2500 m"), "{error}");
    for metres in [1000.001, 5e6, f64::MAX] {
        let npy = npy_file("<f8", "(1, 1)", &f64::to_le_bytes(metres));
        assert!(depth("d.npy", &npy, None, (1, 1)).is_err(), "{metres}");
    }
}

#[test]
fn invalid_depth_scale_is_refused() {
    for (name, scale) in [
        ("d.png", None),
        ("d.png", Some(0.0)),
        ("d.png", Some(-0.001)),
        ("d.png", Some(f64::NAN)),
        ("d.png", Some(f64::INFINITY)),
        ("d.npy", Some(0.001)),
    ] {
        let problem = DepthFile::new(name.into(), scale).unwrap_err();
        assert!(problem.starts_with("depth_scale is "), "{problem}");
    }
}

fn shallow(color: ColorType) -> Vec<u8> {
    png_file([1, 2], color, BitDepth::Eight, &[7, 255])
}

#[test]
fn semantic_maps_are_read_in_every_format() {
    for (bytes, expected) in [
        (shallow(ColorType::Grayscale), array![[7, 255]]),
        (shallow(ColorType::Indexed), array![[7, 255]]),
        (deep([1, 2], &[7, 40_000]), array![[7, 40_000]]),
    ] {
        let (_folder, path) = temporary_file("s.png", &bytes);
        assert_eq!(semantic(&path, (1, 2)).unwrap(), expected);
    }
    let colour = png_file([1, 1], ColorType::Rgb, BitDepth::Eight, &[1, 2, 3]);
    let (_folder, path) = temporary_file("s.png", &colour);
    let error = semantic(&path, (1, 1)).unwrap_err().to_string();
    assert!(error.contains("s.png: an RGB PNG of 8 bits"), "{error}");
}

#[test]
fn segment_maps_are_read_in_every_format() {
    let (_folder, path) = temporary_file("o.png", &deep([1, 2], &[0, 65_535]));
    assert_eq!(segments(&path, (1, 2)).unwrap(), array![[0, 65_535]]);
    let ids = [0_i64, 4_294_967_295].map(i64::to_le_bytes).concat();
    let (_folder, path) = temporary_file("o.npy", &npy_file("<i8", "(2, 1)", &ids));
    assert_eq!(segments(&path, (2, 1)).unwrap(), array![[0], [u32::MAX]]);
    for id in [-1_i64, 4_294_967_296] {
        let (_folder, path) = temporary_file("o.npy", &npy_file("<i8", "(1, 1)", &id.to_le_bytes()));
        let error = segments(&path, (1, 1)).unwrap_err().to_string();
        assert!(error.contains(&format!("o.npy: {id} is not the id")), "{error}");
    }
}

#[test]
fn map_size_error_names_both_sizes() {
    let message = "1 × 2 pixels (height × width), but its image has 2 × 1";
    let (_folder, png) = temporary_file("m.png", &deep([1, 2], &[1, 2]));
    let (_folder, npy) = temporary_file("m.npy", &npy_file("|u1", "(1, 2)", &[1, 2]));
    let units = deep([1, 2], &[1, 2]);
    for error in [
        depth("m.png", &units, Some(0.001), (2, 1)).unwrap_err(),
        semantic(&png, (2, 1)).unwrap_err(),
        segments(&png, (2, 1)).unwrap_err(),
        segments(&npy, (2, 1)).unwrap_err(),
    ] {
        let error = error.to_string();
        assert!(error.contains(message) && error.contains("m."), "{error}");
    }
}

#[test]
fn truncated_map_is_an_error() {
    let mut noise = 1_u32;
    let values: Vec<u16> = std::iter::repeat_with(|| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (noise >> 16) as u16
    })
    .take(32 * 32)
    .collect();
    let bytes = deep([32, 32], &values);
    let (_folder, path) = temporary_file("o.png", &bytes[..bytes.len() / 2]);
    let error = segments(&path, (32, 32)).unwrap_err().to_string();
    assert!(error.contains("o.png: not a whole PNG"), "{error}");
}

proptest! {
    #[test]
    fn millimetres_are_the_nearest(depth in -10.0..MAX_DEPTH_MM) {
        let rounded = f64::from(millimetres(depth, 1.0).unwrap());
        prop_assert!((rounded - depth.max(0.0)).abs() <= 0.5);
    }
}
