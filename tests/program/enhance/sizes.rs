//! Sizes: fixed ones, multiples, tiles, and images that are made smaller.

use std::num::NonZeroUsize;

use darkqa_eval::enhance::{Enhancer, Tiling};
use darkqa_eval::types::Rgb;

use super::{image, loaded, stated};
use crate::support::onnx::Size::Known;
use crate::support::onnx::{self, Type};
use crate::support::table::check_rows;

#[test]
fn a_model_of_a_fixed_size_is_fed_and_read_by_resizing() {
    let (_folder, mut enhancer) = loaded(&onnx::fixed(16, 24));
    // Multiples are tried for a model of any size alone, and nothing else is said.
    let tried = |enhancer: &Enhancer| enhancer.describe().contains("tried first, then 4");
    assert!(!tried(&enhancer), "{}", enhancer.describe());
    assert!(tried(&loaded(&onnx::identity()).1));
    let same = image(16, 24);
    assert_eq!(enhancer.enhance(&same).unwrap(), same);
    let flat = Rgb::new(30, 17, [9, 120, 250].repeat(30 * 17)).unwrap();
    assert_eq!(enhancer.enhance(&flat).unwrap(), flat);
}

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
    assert!(message.contains("multiple = 8"), "{message}");
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
            let same = whole
                .samples()
                .iter()
                .zip(in_parts.samples())
                .filter(|(a, b)| a == b);
            assert!(
                same.count() * 10 > whole.samples().len() * 9,
                "{sidecar} {side}"
            );
            if !sidecar.contains("multiple") {
                assert_eq!(in_parts, whole, "{sidecar} {side}");
            }
        }
        let message = enhancer
            .with_tiling(tiles(4))
            .enhance(&image)
            .unwrap_err()
            .to_string();
        assert!(message.contains("--tile"), "{message}");
    });
    check_rows([onnx::mean_added(), onnx::blurred()], |graph| {
        // Of the mean every pixel is part; of the blur more than is stated here.
        let (_folder, enhancer) = stated(&graph, "tile = \"exact:0\"");
        let message = enhancer
            .with_tiling(tiles(40))
            .enhance(&image)
            .unwrap_err()
            .to_string();
        assert!(message.contains("at their seams"), "{message}");
    });
    let (_folder, enhancer) = stated(&onnx::mean_added(), "tile = \"none\"");
    let message = enhancer
        .with_tiling(tiles(40))
        .enhance(&image)
        .unwrap_err()
        .to_string();
    assert!(message.contains("needs the whole image"), "{message}");
}

#[test]
fn a_fixed_size_is_a_tile_where_tiles_are_exact() {
    let shape = [Known(1), Known(3), Known(32), Known(40)];
    let (_folder, mut exact) = stated(&onnx::shaped(Type::Float, &shape), "tile = \"exact:3\"");
    let large = image(70, 90);
    assert_eq!(exact.enhance(&large).unwrap(), large);
    // Smaller than a tile: resized.
    let flat = Rgb::new(20, 17, [9, 120, 250].repeat(20 * 17)).unwrap();
    assert_eq!(exact.enhance(&flat).unwrap(), flat);
}

#[test]
fn large_images_may_be_enhanced_in_a_smaller_size() {
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
