//! Sizes: fixed ones, multiples, tiles, and images that are made smaller.

use std::num::NonZeroUsize;

use darkqa_base::types::Rgb;
use darkqa_enhance::Tiling;

use super::{image, loaded, stated};
use crate::support::onnx;
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

#[test]
fn sides_are_filled_up_to_multiples() {
    let image = image(13, 30);
    // Found by trying, and stated in every way.
    let (_folder, mut found) = loaded(&onnx::of_eights());
    assert_eq!(found.enhance(&image).unwrap(), image);
    check_rows(["reflect", "zero", "replicate", "crop"], |pad| {
        let sidecar = format!("multiple = 8\npad = \"{pad}\"");
        let (_folder, mut enhancer) = stated(&onnx::of_eights(), &sidecar);
        assert_eq!(enhancer.enhance(&image).unwrap(), image, "{pad}");
    });
    let (_folder, mut wrong) = stated(&onnx::of_eights(), "multiple = 2");
    let message = wrong.enhance(&image).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: failed on an image of 30 × 14 ([ONNX RUNTIME]); `multiple = 2` in model.onnx.toml or the
        preset does not fit: it takes only sides that are multiples of 8 pixels (found by trial), so other images
        are padded; to confirm, add to model.onnx.toml next to it: `multiple = 8`
    ");
}

#[test]
fn stated_row_and_column_are_padded() {
    // The mean of the whole, black fill included, shows how much was filled.
    let sidecar = "multiple = 16\npad = \"zero\"\npad_always = true";
    let (_folder, mut always) = stated(&onnx::mean_added(), sidecar);
    let gray = Rgb::new(16, 16, vec![100; 3 * 256]).unwrap();
    // 32 × 32 pixels, a quarter of them gray.
    assert_eq!(always.enhance(&gray).unwrap().samples(), [125; 3 * 256]);
    let (_folder, mut never) = stated(&onnx::mean_added(), "multiple = 16\npad = \"zero\"");
    assert_eq!(never.enhance(&gray).unwrap().samples(), [200; 3 * 256]);
}

#[test]
fn smallest_multiple_is_found_by_trial() {
    check_rows([4, 12, 20, 48, 96], |multiple| {
        let (_folder, mut found) = loaded(&onnx::of_multiples(multiple));
        let images = [image(110, 250), image(96, 192), image(31, 97)];
        for image in &images {
            assert_eq!(found.enhance(image).unwrap(), *image);
        }
        assert_eq!(found.sizes().multiple, Some(multiple as usize));
        assert!(found.sizes().padded > 0, "{:?}", found.sizes());
    });
}

#[test]
fn tiles_are_exact_or_refused() {
    let image = image(90, 150);
    let tiles = |side| Tiling::Side(NonZeroUsize::new(side).unwrap());
    let (_folder, mut blurred) = loaded(&onnx::blurred());
    let whole = blurred.enhance(&image).unwrap();
    let rows = ["", "tile = \"exact:2\"", "tile = \"exact:2\"\nmultiple = 4"];
    check_rows(rows, |sidecar| {
        let (_folder, enhancer) = stated(&onnx::blurred(), sidecar);
        for side in [80, 100, 1000] {
            let (_folder, enhancer) = stated(&onnx::blurred(), sidecar);
            let in_parts = enhancer.with_tiling(tiles(side)).enhance(&image).unwrap();
            // A padded image is blurred with what it is padded with.
            let same = whole.samples().iter().zip(in_parts.samples()).filter(|(a, b)| a == b);
            assert!(same.count() * 10 > whole.samples().len() * 9, "{sidecar} {side}");
            if !sidecar.contains("multiple") {
                assert_eq!(in_parts, whole, "{sidecar} {side}");
            }
        }
        let message = enhancer.with_tiling(tiles(4)).enhance(&image).unwrap_err().to_string();
        assert!(message.contains("--llie-options tile"), "{message}");
    });
    check_rows([onnx::mean_added(), onnx::blurred()], |graph| {
        // Of the mean every pixel is part; of the blur more than is stated here.
        let (_folder, enhancer) = stated(&graph, "tile = \"exact:0\"");
        let message = enhancer.with_tiling(tiles(40)).enhance(&image).unwrap_err().to_string();
        assert!(message.contains("at their seams"), "{message}");
    });
    let (_folder, enhancer) = stated(&onnx::mean_added(), "tile = \"none\"");
    let message = enhancer.with_tiling(tiles(40)).enhance(&image).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @r#"
    --llie-options tile: 40 is not possible: model needs the whole image (tile = "none" in its .onnx.toml file or
        preset)
    "#);
}

#[test]
fn large_images_enhance_at_smaller_size() {
    let (_folder, enhancer) = stated(&onnx::of_eights(), "multiple = 8");
    let mut enhancer = enhancer.with_max_side(NonZeroUsize::new(40));
    // 100 × 64 as 40 × 24: multiples of eight.
    let flat = Rgb::new(64, 100, [9, 120, 250].repeat(6400)).unwrap();
    assert_eq!(enhancer.enhance(&flat).unwrap(), flat);
    let textured = image(64, 100);
    assert_ne!(enhancer.enhance(&textured).unwrap(), textured);
    let small = image(24, 40);
    assert_eq!(enhancer.enhance(&small).unwrap(), small);
}
