//! Graphs: what each computes, and those that are refused.

use std::num::NonZeroUsize;

use darkqa_base::types::Rgb;
use darkqa_enhance::{Enhancer, ModelFile};

use super::{fault, image, loaded, map, open, runtime, stated};
use crate::support::onnx::Size::{Known, Named};
use crate::support::onnx::{self, Graph, Type};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

#[test]
fn identity_returns_every_byte() {
    let (_folder, mut enhancer) = loaded(&onnx::identity());
    check_rows([(16, 16), (7, 31), (1, 1), (16, 16)], |(height, width)| {
        let image = image(height, width);
        assert_eq!(enhancer.enhance(&image).unwrap(), image);
    });
}

#[test]
fn gain_and_gamma_stay_in_range() {
    let image = image(12, 20);
    let (_folder, mut gain) = loaded(&onnx::gain(2.2));
    assert_eq!(gain.enhance(&image).unwrap(), map(&image, |x| 2.2 * x));
    let (_folder, mut gamma) = loaded(&onnx::gamma(0.45));
    assert_eq!(gamma.enhance(&image).unwrap(), map(&image, |x| x.powf(0.45)));
}

#[test]
fn second_zero_dce_output_is_image() {
    let image = image(8, 8);
    let rows = [["enhance_image_1", "enhance_image", "r"], ["101", "102", "103"]];
    check_rows(rows, |names| {
        let (_folder, mut enhancer) = loaded(&onnx::three_outputs(names));
        assert_eq!(enhancer.enhance(&image).unwrap(), map(&image, |x| 2.0 * x));
    });
}

#[test]
fn subnormal_weights_count_as_zero() {
    let image = image(4, 4);
    // 1e-39 · 1e38 = 0.1, if the weight is not flushed.
    let (_folder, mut subnormal) = loaded(&onnx::weight(1e-39));
    assert_eq!(subnormal.enhance(&image).unwrap(), image);
    let (_folder, mut normal) = loaded(&onnx::weight(2e-38));
    assert_eq!(normal.enhance(&image).unwrap(), map(&image, |x| x + 2.0));
}

#[test]
fn products_of_computed_matrices_give_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = onnx::product_over_pixels().write(folder.path(), "model.onnx");
    let image = image(240, 320);
    let on = |threads| {
        let file = ModelFile::read(&path).unwrap();
        let mut enhancer = Enhancer::open(file, &runtime(), NonZeroUsize::new(threads)).unwrap();
        (enhancer.enhance(&image).unwrap(), enhancer.describe())
    };
    let (one, described) = on(1);
    assert_eq!(one, on(2).0);
    assert_eq!(one, on(4).0);
    let line = "threads per image  1 ";
    assert!(described.contains(line), "{described}");
    let described = loaded(&onnx::gain(2.0)).1.describe();
    assert!(!described.contains("threads per image"), "{described}");
}

#[test]
fn external_data_beside_model_loads() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("gain.bin"), 2.0_f32.to_le_bytes()).unwrap();
    let path = onnx::external_gain("gain.bin").write(folder.path(), "model.onnx");
    let image = image(8, 8);
    let enhanced = open(&path).unwrap().enhance(&image).unwrap();
    assert_eq!(enhanced, map(&image, |x| 2.0 * x));
}

#[test]
fn weights_beside_external_data_stay_subnormal() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("huge.bin"), 1e38_f32.to_le_bytes()).unwrap();
    let path = onnx::weight_times_external(1e-39, "huge.bin").write(folder.path(), "model.onnx");
    let described = open(&path).unwrap().describe();
    assert!(described.contains("subnormal weights  0 "), "{described}");
}

#[test]
fn every_layout_returns_every_byte() {
    let image = image(12, 20);
    let any = [Named("height"), Named("width")];
    let three = Known(3);
    let rows = [
        vec![Known(1), three, any[0], any[1]],
        vec![Named("batch"), three, any[0], any[1]],
        vec![Known(1), any[0], any[1], three],
        vec![three, any[0], any[1]],
        vec![any[0], any[1], three],
        vec![Known(1), three, Known(12), any[1]],
    ];
    check_rows(rows, |shape| {
        for element in [Type::Float, Type::Half, Type::Byte] {
            let (_folder, mut enhancer) = loaded(&onnx::shaped(element, &shape));
            assert_eq!(enhancer.enhance(&image).unwrap(), image, "{}", enhancer.describe());
        }
    });
}

#[test]
fn other_conventions_are_refused_by_name() {
    let any = [Named("height"), Named("width")];
    let rows = [
        (onnx::shaped(Type::Float, &[Known(1), Known(1), any[0], any[1]]), "channels = \"y\""),
        (onnx::shaped(Type::Long, &[Known(1), Known(3), any[0], any[1]]), "int64"),
        (onnx::shaped(Type::Float, &[Named("n"), Named("c"), any[0], any[1]]), "layout_in"),
        (onnx::no_image(), "24 channels, but an image has 3"),
        (onnx::two_inputs(), "exposure = 0.2"),
    ];
    check_rows(rows, |(graph, part)| {
        let message = fault(&graph).to_lowercase();
        assert!(message.contains(part), "{message}");
    });
}

#[test]
fn runtime_failure_is_an_error() {
    let (_folder, mut halved) = loaded(&onnx::halved());
    let message = halved.enhance(&image(8, 8)).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: gave an image of 4 × 4 for one of 8 × 8, but both must have the same size: its convolutions
        cut off the edges; export it with padding that keeps the size. The multiples 4, 8, 12, 14, 16, 20, 24, 28,
        32, 40, 48, 56, 64, 96, 112, 128 fail, too
    ");
    let (_folder, mut broken) = loaded(&onnx::not_a_number());
    let message = broken.enhance(&image(8, 8)).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: gave values that are not numbers (NaN) for an image of 8 × 8; check its weights, and
        divisions by zero in its graph and in `image` of model.onnx.toml
    ");
    // An image without a black pixel divides well, on the same session.
    let gray = Rgb::new(2, 2, vec![100; 12]).unwrap();
    assert_eq!(broken.enhance(&gray).unwrap().samples(), [255; 12]);
}

#[test]
fn graph_that_runtime_refuses_is_error() {
    let graph = Graph::new().node("NoSuchOperator", &["input"], "output");
    insta::assert_snapshot!(redacted(&fault(&graph)), @r#"
    [TMP]/model.onnx: has an operator that is not part of ONNX; export it with standard operators only (This is an
        invalid model. In Node, ("", NoSuchOperator, "", -1) : ("input": tensor(float),) -> ("output",) , Error No
        Op registered for NoSuchOperator with domain_version of 13)
    "#);
    let mut bytes = onnx::gain(2.0).model();
    bytes.truncate(bytes.len() / 2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.onnx");
    std::fs::write(&path, bytes).unwrap();
    assert!(open(&path).is_err());
}

#[test]
fn name_is_that_of_file() {
    let (folder, enhancer) = loaded(&onnx::identity());
    let file = ModelFile::read(&folder.path().join("model.onnx")).unwrap();
    assert_eq!(enhancer.name().as_str(), "model");
    assert_eq!(enhancer.name(), file.name());
}

#[test]
fn doubles_and_integers_are_read() {
    let image = image(9, 14);
    let (_folder, mut enhancer) = stated(&onnx::cast(Type::Double), "range_out = \"0..255\"");
    assert_eq!(enhancer.enhance(&image).unwrap(), image);
    check_rows([Type::Int, Type::Long], |element| {
        let (_folder, mut enhancer) = loaded(&onnx::cast(element));
        let result = enhancer.enhance(&image).unwrap();
        let pairs = result.samples().iter().zip(image.samples());
        assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 1));
    });
}

#[test]
fn channels_of_an_output_are_selected() {
    let image = image(9, 14);
    let message = fault(&onnx::seven_channels());
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: gives "x" (float32 [1, 7, height, width]), 7 channels, but an image has 3; add to
        model.onnx.toml next to it those that are the image (from 0, end excluded): `output = "x[4:7]"`
    "#);
    for sidecar in ["output = \"x[4:7]\"", "image = \"x[4:7] * 1\"", "output = \"x[0:3]\""] {
        assert!(message.contains("`output = \"x[4:7]\"`"), "{message}");
        let (_folder, mut enhancer) = stated(&onnx::seven_channels(), sidecar);
        assert_eq!(enhancer.enhance(&image).unwrap(), image, "{sidecar}");
    }
}

#[test]
fn vector_is_given_as_list() {
    let message = fault(&onnx::times_vector());
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "alpha" (float32 [3]) in addition to the image, and its value is unknown; add to
        model.onnx.toml next to it, below `[extra]`: `alpha = [NUMBER, NUMBER, NUMBER]` (as in the model's code);
        if it is computed from the image, as a histogram is, export the model with that computation
    "#);
    let image = image(9, 14);
    let (_folder, mut enhancer) = stated(&onnx::times_vector(), "[extra]\nalpha = [1, 0, 1]");
    let expected: Vec<u8> =
        image.samples().iter().enumerate().map(|(i, byte)| if i % 3 == 1 { 0 } else { *byte }).collect();
    assert_eq!(enhancer.enhance(&image).unwrap().samples(), expected);
}

#[test]
fn tiles_start_where_blocks_do() {
    let image = image(40, 90);
    let (_whole, mut whole) = loaded(&onnx::pooled(40, 90));
    let (_tiled, mut tiled) = loaded(&onnx::pooled(40, 62));
    assert_eq!(tiled.enhance(&image).unwrap(), whole.enhance(&image).unwrap());
}

#[test]
fn halves_of_six_channels_are_named() {
    let message = fault(&onnx::six_channels());
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: gives "x" (float32 [1, 6, height, width]), 6 channels, but an image has 3; add to
        model.onnx.toml next to it the half that is the image: `output = "x[0:3]"` or `output = "x[3:6]"`
    "#);
}

#[test]
fn number_named_output_is_no_image() {
    let (_folder, mut enhancer) = loaded(&onnx::loss_beside());
    let image = image(12, 8);
    assert_eq!(enhancer.enhance(&image).unwrap(), image);
}

#[test]
fn input_of_another_size_is_named() {
    let message = fault(&onnx::with_embedding());
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "text" (float32 [1, 77, 512]) in addition to the image, a tensor of a fixed size that
        is not the image's; export the model with its values as constants
    "#);
}
