//! Sidecars of models with further inputs, with other channels, and with expressions.

use std::num::NonZeroUsize;

use darkqa_base::types::Rgb;
use darkqa_enhance::{Enhancer, ModelFile, Tiling};

use super::{fault, image, map, open, runtime, stated};
use crate::support::onnx::{self, Graph, Size, Type};
use crate::support::run::{Bench, words};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

const ANY: Size = Size::Named("any");

/// The error of a model with a sidecar.
fn fault_of(graph: &Graph, sidecar: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("model.onnx.toml"), sidecar).unwrap();
    let path = graph.write(folder.path(), "model.onnx");
    open(&path).err().unwrap().to_string()
}

/// The image that a model with a sidecar makes.
fn enhanced(graph: &Graph, sidecar: &str, image: &Rgb) -> Rgb {
    let (_folder, mut enhancer) = stated(graph, sidecar);
    enhancer.enhance(image).unwrap()
}

/// An image with a function on each pixel in 0..1.
fn map_pixels(image: &Rgb, with: impl Fn([f64; 3]) -> [f64; 3]) -> Rgb {
    let pixels = image.samples().chunks_exact(3);
    let samples = pixels.flat_map(|pixel| {
        let pixel = with([0, 1, 2].map(|channel| f64::from(pixel[channel]) / 255.0));
        pixel.map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8)
    });
    Rgb::new(image.height(), image.width(), samples.collect()).unwrap()
}

/// Asserts that no sample is more than one code off.
fn assert_near(found: &Rgb, expected: &Rgb) {
    let most = found.samples().iter().zip(expected.samples()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most <= Some(1), "{most:?} codes");
}

#[test]
fn numbers_of_each_type_are_given() {
    let image = image(12, 20);
    let rows = [
        (Type::Int, &[Size::Known(1)][..], "3", 3.0),
        (Type::Int, &[], "2.0", 2.0),
        (Type::Long, &[ANY], "2", 2.0),
        (Type::Byte, &[Size::Known(1), Size::Known(1)], "2", 2.0),
        (Type::Double, &[], "0.5", 0.5),
        (Type::Half, &[Size::Known(1)], "0.5", 0.5),
        (Type::Float, &[Size::Known(1), Size::Known(1), Size::Known(1), Size::Known(1)], "0.5", 0.5),
        (Type::Bool, &[Size::Known(1)], "true", 1.0),
        (Type::Bool, &[], "false", 0.0),
    ];
    check_rows(rows, |(element, shape, value, factor)| {
        let graph = onnx::times_input(element, shape);
        let found = enhanced(&graph, &format!("[extra]\nfactor = {value}"), &image);
        assert_eq!(found, map(&image, |x| factor * x));
    });
}

#[test]
fn unsuitable_number_names_its_type() {
    let one = [Size::Known(1)];
    let rows = [
        (Type::Int, "3.5", "3.5 does not fit its type int32"),
        (Type::Int, "true", "true does not fit its type int32"),
        (Type::Byte, "256", "256 does not fit its type uint8"),
        (Type::Bool, "1", "1 does not fit its type bool"),
        (Type::Half, "1e6", "1000000.0 does not fit its type float16"),
        (Type::Float, "{ map = 2 }", "it takes a single number: `factor = NUMBER`"),
    ];
    check_rows(rows, |(element, value, part)| {
        let graph = onnx::times_input(element, &one);
        let message = fault_of(&graph, &format!("[extra]\nfactor = {value}"));
        assert!(message.contains(part), "{message}");
    });
}

#[test]
fn single_number_does_not_fill_vector() {
    let graph = onnx::times_input(Type::Float, &[Size::Known(1), Size::Known(3)]);
    let message = fault_of(&graph, "[extra]\nfactor = 0.5");
    assert!(message.contains("it takes a list of 3 numbers: `factor = ["), "{message}");
}

#[test]
fn map_and_expression_have_images_size() {
    let image = image(12, 20);
    let graph = onnx::times_plane("factor");
    let found = enhanced(&graph, "[extra]\nfactor = { map = 0.5 }", &image);
    assert_eq!(found, map(&image, |x| 0.5 * x));
    let found = enhanced(&graph, "[extra]\nfactor = { from = \"1 - max(image)\" }", &image);
    let expected = map_pixels(&image, |pixel| {
        let light = pixel.into_iter().fold(0.0, f64::max);
        pixel.map(|x| x * (1.0 - light))
    });
    assert_near(&found, &expected);
    let message = fault_of(&graph, "[extra]\nfactor = 0.5");
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "factor" (float32 [1, 1, height, width]); model.onnx.toml or the preset sets it to
        0.5, but it has the image's size; `factor = { map = 0.5 }` gives every pixel this number
    "#);
    let message = fault_of(&graph, "[extra]\nfactor = { from = \"image\" }");
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "factor" (float32 [1, 1, height, width]); model.onnx.toml or the preset sets it to
        from image, but this has three channels, and it takes one; wrap the expression in mean(…) or max(…)
    "#);
    let message = fault_of(&graph, "[extra]\nfactor = { from = \"output\" }");
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx.toml: extra.factor.from = "output" names `output`, which is unknown; the names are `image`;
        all keys: https://github.com/darkqa-eval/darkqa-eval/blob/main/src/docs/enhancers.md
    "#);
}

#[test]
fn noise_ignores_tiles_and_threads() {
    let image = image(40, 60);
    let graph = onnx::plus_noise();
    let noise = |std: f64, seed: u64| {
        format!("tile = \"exact:2\"\n[extra]\nz = {{ noise = \"normal\", std = {std}, seed = {seed} }}")
    };
    assert_eq!(enhanced(&graph, &noise(0.0, 0), &image), image);
    let (folder, mut whole) = stated(&graph, &noise(0.1, 0));
    let first = whole.enhance(&image).unwrap();
    assert_eq!(whole.enhance(&image).unwrap(), first);
    let path = folder.path().join("model.onnx");
    let threads = NonZeroUsize::new(2);
    let file = ModelFile::read(&path).unwrap();
    let mut tiled =
        Enhancer::open(file, &runtime(), threads).unwrap().with_tiling(Tiling::Side(NonZeroUsize::new(16).unwrap()));
    assert_eq!(tiled.enhance(&image).unwrap(), first);
    let differing = |other: &Rgb| other.samples().iter().zip(first.samples()).filter(|(a, b)| a != b).count();
    for other in [enhanced(&graph, &noise(0.1, 1), &image), image.clone()] {
        assert!(differing(&other) > image.samples().len() / 2);
    }
}

#[test]
fn noise_of_other_size_is_untiled() {
    let image = image(40, 60);
    let sidecar = "tile = \"exact:2\"\n[extra]\nz = { noise = \"normal\", std = 0, divide = 8 }";
    let (_folder, enhancer) = stated(&onnx::plus_mean_of_noise(), sidecar);
    let mut enhancer = enhancer.with_tiling(Tiling::Whole);
    assert_eq!(enhancer.enhance(&image).unwrap(), image);
    let mut enhancer = enhancer.with_tiling(Tiling::Side(NonZeroUsize::new(32).unwrap()));
    let message = enhancer.enhance(&image).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes noise of the image's size divided by 8 ("z"), which cannot be cut into tiles; leave
        out --llie-options tile, or enhance images of a size that the model takes
    "#);
}

#[test]
fn model_of_luma_keeps_chroma() {
    let image = image(12, 20);
    let graph = onnx::luma_gain(1.5);
    let message = fault(&graph);
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: takes "input" (float32 [1, 1, height, width]), an image of one channel; if that is the luma,
        add to model.onnx.toml next to it: `channels = "y"`
    "#);
    let expected = map_pixels(&image, |[red, green, blue]| {
        let luma = 0.299 * red + 0.587 * green + 0.114 * blue;
        [red, green, blue].map(|x| x + 0.5 * luma)
    });
    assert_near(&enhanced(&graph, "channels = \"y\"", &image), &expected);
    let ranges = "channels = \"y\"\nrange_in = \"0..255\"\nrange_out = \"0..255\"";
    assert_near(&enhanced(&graph, ranges, &image), &expected);
    // Tiles have the same dark image under them.
    let (_folder, enhancer) = stated(&graph, "channels = \"y\"\ntile = \"exact:0\"");
    let side = NonZeroUsize::new(8).unwrap();
    let mut tiled = enhancer.with_tiling(Tiling::Side(side));
    assert_near(&tiled.enhance(&image).unwrap(), &expected);
}

#[test]
fn outputs_compose_image_by_name() {
    let image = image(12, 20);
    let graph = onnx::light_and_reflectance();
    let light = |pixel: [f64; 3]| pixel.into_iter().fold(1e-3, f64::max);
    let expected = map_pixels(&image, |pixel| pixel.map(|x| light(pixel).powf(0.2) * x / light(pixel)));
    let composed = "image = \"L ^ 0.2 * R\"";
    assert_near(&enhanced(&graph, composed, &image), &expected);
    let preset = |name: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = graph.write(folder.path(), "model.onnx");
        let mut enhancer = open(format!("{name}:{}", path.display()).as_ref()).unwrap();
        enhancer.enhance(&image).unwrap()
    };
    let truncated = format!("{composed}\nrounding = \"truncate\"");
    assert_eq!(preset("pairlie"), enhanced(&graph, &truncated, &image));
    assert_ne!(preset("pairlie"), preset("pairlie-lol"));
    let message = fault_of(&graph, "image = \"L * Q\"");
    insta::assert_snapshot!(redacted(&message), @r#"
    [TMP]/model.onnx: image = "L * Q" names `Q`, which is unknown; the names are `L`, `R`, `input`; outputs: "L"
        (float32 [1, 1, height, width]), "R" (float32 [1, 3, height, width])
    "#);
}

#[test]
fn inputs_and_outputs_are_expressions() {
    let image = image(12, 20);
    let rows = [
        (onnx::identity(), "input = \"1 - image\""),
        (onnx::identity(), "image = \"1 - output\""),
        (onnx::ranged(-1.0, 1.0), "range_out = \"-1..1\"\nimage = \"1 - output\""),
        (onnx::gain(2.0), "image = \"1 - (2 * output - 3 * input)\""),
    ];
    check_rows(rows, |(graph, sidecar)| {
        let expected = map(&image, |x| 1.0 - x);
        assert_near(&enhanced(&graph, sidecar, &image), &expected);
        let (_folder, enhancer) = stated(&graph, sidecar);
        let described = enhancer.describe();
        assert!(described.contains("1 - "), "{described}");
    });
    let swapped = enhanced(&onnx::blue_first(), "color_out = \"bgr\"", &image);
    assert_near(&swapped, &map(&image, |x| x.powf(0.4)));
}

#[test]
fn what_is_not_finite_is_error() {
    let rows = [("input = \"image / 0\"", "values that are not finite"), ("image = \"output / 0\"", "not numbers")];
    check_rows(rows, |(sidecar, part)| {
        let (_folder, mut enhancer) = stated(&onnx::identity(), sidecar);
        let message = enhancer.enhance(&image(12, 20)).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    });
}

#[test]
fn missing_sidecar_lines_are_named() {
    let one = [Size::Known(1)];
    let rows = [
        (onnx::times_input(Type::Int, &one), "`factor = NUMBER` (as in the model's code)"),
        (onnx::times_input(Type::Bool, &one), "`factor = true` or `factor = false`"),
        (onnx::two_inputs(), "`exposure = 0.2` (as in preset pairlie)"),
        (onnx::times_plane("ratio"), "`ratio = { map = 5.0 }`"),
        (onnx::plus_noise(), "`z = { noise = \"normal\", std = NUMBER, seed = 0 }`"),
        (onnx::times_plane("attention"), "`attention = { from = \"1 - max(image)\" }`"),
        (onnx::luma_gain(2.0), "`channels = \"y\"`"),
    ];
    check_rows(rows, |(graph, part)| {
        let message = fault(&graph);
        assert!(message.contains(part), "{message}");
    });
    // Presets are named only if they know such a list of outputs.
    let message = fault(&onnx::two_outputs());
    assert!(message.contains("darkir, sci, zero-dce++") && !message.contains("ruas"), "{message}");
}

#[test]
fn sidecar_that_contradicts_itself_is_refused() {
    let rows = [
        ("output = \"output\"\nimage = \"output\"", "delete `output`"),
        ("channels = \"y\"", "delete that line"),
        ("[extra]\ngamma = 1", "not an input besides the image"),
    ];
    check_rows(rows, |(sidecar, part)| {
        let message = fault_of(&onnx::identity(), sidecar);
        assert!(message.contains(part), "{message}");
    });
}

#[test]
fn command_takes_what_sidecar_composes() {
    let bench = Bench::new();
    onnx::light_and_reflectance().write(&bench.path(""), "pair.onnx");
    bench.file("pair.onnx.toml", "image = \"L ^ 0.2 * R\"");
    bench.complete(&words("rooms --out rooms --frames 1 --size 96x64"));
    let called = bench.call(&words("enhance pair.onnx rooms --out made --llie-anyway"));
    assert_eq!(called.code, Some(0), "{called:?}");
    let described = bench.call(&words("enhance pair.onnx --describe"));
    for part in ["L ^ 0.2 * R", "\"L\" (float32", "\"R\" (float32"] {
        assert!(described.stdout.contains(part), "{described:?}");
    }
}
