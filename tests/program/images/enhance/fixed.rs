//! Models of one size, stated by their graph or frozen by tracing: filled, cut, resized or refused.

use darkqa_base::types::Rgb;
use darkqa_base::types::SizeLog;
use darkqa_enhance::Fitting;

use super::{image, loaded, open, stated};
use crate::support::onnx;
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

/// Number of samples that differ between two images of one size, in rows and columns before these.
fn differing(one: &Rgb, other: &Rgb, [rows, columns]: [usize; 2]) -> usize {
    let width = 3 * one.width();
    let lines = one.samples().chunks(width).zip(other.samples().chunks(width));
    lines.take(rows).flat_map(|(a, b)| a[..3 * columns].iter().zip(&b[..3 * columns])).filter(|(a, b)| a != b).count()
}

#[test]
fn fixed_size_local_model_is_tiled() {
    // Equal, smaller, larger, and each side for itself.
    let rows = [[64, 80], [50, 60], [150, 170], [50, 200], [130, 70]];
    check_rows(rows, |[height, width]| {
        let image = image(height, width);
        let (_folder, mut free) = loaded(&onnx::blurred());
        let expected = free.enhance(&image).unwrap();
        let fixed = onnx::of_size(&onnx::blurred(), 1, [64, 80]);
        for sidecar in ["", "tile = \"exact:2\""] {
            let (_folder, mut fixed) = stated(&fixed, sidecar);
            let enhanced = fixed.enhance(&image).unwrap();
            // The blur sees 2 pixels: within 2 of a filled edge it sees the fill.
            let exact = |side: usize, fixed: usize| if side < fixed { side - 2 } else { side };
            let part = [exact(height, 64), exact(width, 80)];
            assert_eq!(differing(&enhanced, &expected, part), 0, "{sidecar}");
            let log = fixed.sizes();
            let is_tiled = height > 64 || width > 80;
            let is_padded = height < 64 || width < 80;
            let counts = (usize::from(is_padded), usize::from(is_tiled));
            assert_eq!((log.padded, log.tiled), counts, "{}", log.summary());
        }
    });
}

#[test]
fn reach_is_measured_and_is_context() {
    let fixed = onnx::of_size(&onnx::blurred(), 1, [64, 80]);
    let (_folder, mut enhancer) = loaded(&fixed);
    enhancer.enhance(&image(64, 80)).unwrap();
    assert_eq!(enhancer.sizes().reach, None);
    enhancer.enhance(&image(64, 81)).unwrap();
    let log = enhancer.sizes();
    assert_eq!((log.reach, log.context), (Some(2), Some(8)));
    assert_eq!((log.tile, log.fixed), (Some([80, 64]), Some([Some(80), Some(64)])));
    let expected = "2 images: 1 as they are, 1 in tiles of 80 × 64 with 8 px context (no difference at seams)";
    assert_eq!(log.summary(), expected);
}

#[test]
fn fixed_size_global_model_needs_resize() {
    let fixed = onnx::of_size(&onnx::mean_added(), 1, [48, 48]);
    check_rows(["", "tile = \"none\"", "tile = \"exact:8\""], |sidecar| {
        let (_folder, mut enhancer) = stated(&fixed, sidecar);
        let same = image(48, 48);
        enhancer.enhance(&same).unwrap();
        let message = enhancer.enhance(&image(60, 100)).unwrap_err().to_string();
        for part in ["48 × 48", "100 × 60", "dynamic_axes", "--llie-options resize"] {
            assert!(message.contains(part), "{message}");
        }
        let mut enhancer = enhancer.with_fitting(Fitting::Resize);
        let flat = Rgb::new(30, 17, [9, 60, 100].repeat(30 * 17)).unwrap();
        let doubled: Vec<u8> = flat.samples().iter().map(|code| 2 * code).collect();
        assert_eq!(enhancer.enhance(&flat).unwrap().samples(), doubled);
        assert_eq!(enhancer.sizes().resized, 1);
    });
    // Smaller in both sides: nothing is cut, but the fill would change the mean.
    for sidecar in ["", "tile = \"none\""] {
        let (_folder, mut enhancer) = stated(&fixed, sidecar);
        assert!(enhancer.enhance(&image(40, 40)).is_err(), "{sidecar}");
    }
}

#[test]
fn stated_multiple_is_always_padded() {
    let fixed = onnx::of_size(&onnx::mean_added(), 1, [48, 64]);
    let (_folder, mut enhancer) = stated(&fixed, "multiple = 16\ntile = \"none\"");
    let flat = Rgb::new(40, 50, vec![100; 3 * 2000]).unwrap();
    assert_eq!(enhancer.enhance(&flat).unwrap().samples(), [200; 6000]);
    assert!(enhancer.enhance(&image(30, 50)).is_err());
}

#[test]
fn traced_size_counts_as_fixed() {
    let (_folder, mut found) = loaded(&onnx::traced());
    let (_folder, mut told) = stated(&onnx::traced(), "fixed = [64, 48]\ntile = \"exact:2\"");
    for image in [image(120, 160), image(48, 64), image(30, 20)] {
        assert_eq!(found.enhance(&image).unwrap(), image);
        assert_eq!(told.enhance(&image).unwrap(), image);
    }
    let fixed = |log: &SizeLog| log.fixed;
    assert_eq!(fixed(found.sizes()), Some([Some(64), Some(48)]));
    assert_eq!(told.sizes().context, Some(2));
    let (_folder, mut wrong) = stated(&onnx::traced(), "fixed = [64, 40]");
    let message = wrong.enhance(&image(40, 64)).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: failed on an image of 64 × 40 ([ONNX RUNTIME]); its graph or model.onnx.toml fixes the size
        64 × 40
    ");
}

#[test]
fn batch_gets_image_several_times() {
    let batch = onnx::of_size(&onnx::blurred(), 3, [24, 32]);
    let (_folder, mut enhancer) = loaded(&batch);
    let described = enhancer.describe();
    assert!(described.contains("repeated 3 times"), "{described}");
    let (_folder, mut single) = loaded(&onnx::blurred());
    let image = image(24, 32);
    assert_eq!(enhancer.enhance(&image).unwrap(), single.enhance(&image).unwrap());
}

#[test]
fn wrong_sidecar_size_limits_memory() {
    let rows = [
        ("fixed = [65536, 65536]", "at most 100000000"),
        ("multiple = 65536", "at most 1024"),
        ("multiple = 20000", "at most 1024"),
    ];
    check_rows(rows, |(sidecar, bound)| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("model.onnx.toml"), sidecar).unwrap();
        let model = onnx::identity().write(folder.path(), "model.onnx");
        let message = open(&model).err().unwrap().to_string();
        assert!(message.contains(bound), "{message}");
        assert!(message.contains("model.onnx.toml"), "{message}");
    });
}
