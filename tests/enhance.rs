//! Stage 3 through its own door: models made by hand, on the ONNX Runtime that is found or installed.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use darkqa_eval::enhance::{Enhancer, Install, ModelFile, Runtime, RuntimeSearch, Tiling};
use darkqa_eval::internals::rooms::Rooms;
use darkqa_eval::internals::synthesis::{Negative, expose};
use darkqa_eval::synthesis::{NoiseKey, Synthesis};
use darkqa_eval::types::{Rgb, Severity};
use support::onnx::Size::{Known, Named};
use support::onnx::{self, Graph, Type};
use tempfile::TempDir;

fn runtime() -> Runtime {
    support::forbid_telemetry();
    let search = RuntimeSearch {
        library: std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from),
        install: Install::Allowed,
    };
    search.open().unwrap()
}

fn open(path: &Path) -> darkqa_eval::Result<Enhancer> {
    Enhancer::open(ModelFile::read(path)?, &runtime(), NonZeroUsize::new(1))
}

/// A model in a folder of its own, loaded.
fn loaded(graph: &Graph) -> (TempDir, Enhancer) {
    let folder = tempfile::tempdir().unwrap();
    let enhancer = open(&graph.write(folder.path(), "model.onnx")).unwrap();
    (folder, enhancer)
}

/// What is wrong with a model.
fn fault(graph: &Graph) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = graph.write(folder.path(), "model.onnx");
    let message = open(&path).err().unwrap().to_string();
    assert!(
        message.starts_with(&path.display().to_string()),
        "{message}"
    );
    message
}

/// An image with all 256 bytes in it, where it is large enough.
fn image(height: usize, width: usize) -> Rgb {
    let samples = (0..height * width * 3).map(|i| (i * 37 % 256) as u8);
    Rgb::new(height, width, samples.collect()).unwrap()
}

/// An image with a function on each byte.
fn map(image: &Rgb, with: impl Fn(f64) -> f64) -> Rgb {
    let samples = image
        .samples()
        .iter()
        .map(|byte| (with(f64::from(*byte) / 255.0).clamp(0.0, 1.0) * 255.0).round() as u8);
    Rgb::new(image.height(), image.width(), samples.collect()).unwrap()
}

#[test]
fn an_identity_gives_every_byte_back_at_any_size() {
    let (_folder, mut enhancer) = loaded(&onnx::identity());
    for (height, width) in [(16, 16), (7, 31), (1, 1), (16, 16)] {
        let image = image(height, width);
        assert_eq!(enhancer.enhance(&image).unwrap(), image);
    }
}

#[test]
fn gain_and_gamma_are_computed_and_held_in_range() {
    let image = image(12, 20);
    let (_folder, mut gain) = loaded(&onnx::gain(2.2));
    assert_eq!(gain.enhance(&image).unwrap(), map(&image, |x| 2.2 * x));
    let (_folder, mut gamma) = loaded(&onnx::gamma(0.45));
    assert_eq!(
        gamma.enhance(&image).unwrap(),
        map(&image, |x| x.powf(0.45))
    );
}

#[test]
fn of_zero_dces_three_outputs_the_second_is_the_image() {
    let image = image(8, 8);
    for names in [
        ["enhance_image_1", "enhance_image", "r"],
        ["101", "102", "103"],
    ] {
        let (_folder, mut enhancer) = loaded(&onnx::three_outputs(names));
        assert_eq!(enhancer.enhance(&image).unwrap(), map(&image, |x| 2.0 * x));
    }
}

#[test]
fn a_sidecar_says_which_output_it_is() {
    let graph = onnx::two_outputs();
    assert!(fault(&graph).contains("several outputs"));
    let folder = tempfile::tempdir().unwrap();
    let path = graph.write(folder.path(), "model.onnx");
    let sidecar = folder.path().join("model.onnx.toml");
    let image = image(8, 8);
    for text in ["output = 1", "output = \"18\""] {
        std::fs::write(&sidecar, text).unwrap();
        let mended = open(&path).unwrap().enhance(&image).unwrap();
        assert_eq!(mended, map(&image, |x| 2.0 * x));
    }
    std::fs::write(&sidecar, "output = 1\nlayout_in = \"nhwc\"").unwrap();
    let message = open(&path).err().unwrap().to_string();
    assert!(message.contains("layout_in"), "{message}");
}

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
fn subnormal_weights_count_as_zero() {
    let image = image(4, 4);
    // 1e-39 · 1e38 = 0.1, if the weight is not flushed.
    let (_folder, mut subnormal) = loaded(&onnx::weight(1e-39));
    assert_eq!(subnormal.enhance(&image).unwrap(), image);
    let (_folder, mut normal) = loaded(&onnx::weight(2e-38));
    assert_eq!(normal.enhance(&image).unwrap(), map(&image, |x| x + 2.0));
}

#[test]
fn external_data_is_loaded_from_beside_the_model() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("gain.bin"), 2.0_f32.to_le_bytes()).unwrap();
    let path = onnx::external_gain("gain.bin").write(folder.path(), "model.onnx");
    let image = image(8, 8);
    let mended = open(&path).unwrap().enhance(&image).unwrap();
    assert_eq!(mended, map(&image, |x| 2.0 * x));
}

#[test]
fn every_layout_and_type_gives_every_byte_back() {
    let image = image(12, 20);
    let any = [Named("height"), Named("width")];
    let three = Known(3);
    for shape in [
        vec![Known(1), three, any[0], any[1]],
        vec![Named("batch"), three, any[0], any[1]],
        vec![Known(1), any[0], any[1], three],
        vec![three, any[0], any[1]],
        vec![any[0], any[1], three],
        vec![Known(1), three, Known(12), any[1]],
    ] {
        for element in [Type::Float, Type::Half, Type::Byte] {
            let (_folder, mut enhancer) = loaded(&onnx::shaped(element, &shape));
            assert_eq!(
                enhancer.enhance(&image).unwrap(),
                image,
                "{}",
                enhancer.describe()
            );
        }
    }
}

#[test]
fn other_conventions_are_refused_by_name() {
    let any = [Named("height"), Named("width")];
    for (graph, part) in [
        (
            onnx::shaped(Type::Float, &[Known(1), Known(1), any[0], any[1]]),
            "not an image of three",
        ),
        (
            onnx::shaped(Type::Long, &[Known(1), Known(3), any[0], any[1]]),
            "i64",
        ),
        (
            onnx::shaped(Type::Float, &[Named("n"), Named("c"), any[0], any[1]]),
            "layout_in",
        ),
        (onnx::no_image(), "no output that is an image"),
        (onnx::two_inputs(), "exposure = 0.5"),
    ] {
        let message = fault(&graph).to_lowercase();
        assert!(message.contains(part), "{message}");
    }
}

/// A model with a sidecar.
fn stated(graph: &Graph, sidecar: &str) -> (TempDir, Enhancer) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("model.onnx.toml"), sidecar).unwrap();
    let enhancer = open(&graph.write(folder.path(), "model.onnx")).unwrap();
    (folder, enhancer)
}

#[test]
fn a_sidecar_says_what_a_graph_cannot() {
    let image = image(12, 20);
    for (graph, sidecar) in [
        (
            onnx::identity(),
            "range_in = \"0..255\"\nrange_out = \"0..255\"",
        ),
        (
            onnx::identity(),
            "range_in = \"-1..1\"\nrange_out = \"-1..1\"\ncolor = \"bgr\"",
        ),
        (onnx::ranged(0.0, 255.0), "range_out = \"0..255\""),
        (onnx::ranged(-1.0, 1.0), "range_out = \"-1..1\""),
        (
            onnx::ranged(0.5, 1.0),
            "mean = [0.5, 0.5, 0.5]\nstd = [0.5, 0.5, 0.5]",
        ),
        (onnx::two_inputs(), "[extra]\nexposure = 1"),
    ] {
        let (_folder, mut enhancer) = stated(&graph, sidecar);
        assert_eq!(enhancer.enhance(&image).unwrap(), image, "{sidecar}");
        assert!(
            enhancer.describe().contains("sidecar"),
            "{}",
            enhancer.describe()
        );
    }
    let (_folder, mut truncated) = stated(&onnx::gain(0.5), "rounding = \"truncate\"");
    let half: Vec<u8> = image.samples().iter().map(|byte| byte / 2).collect();
    assert_eq!(truncated.enhance(&image).unwrap().samples(), half);
}

#[test]
fn a_range_that_nobody_stated_is_checked() {
    for (graph, likely) in [
        (onnx::ranged(0.0, 255.0), "range_out = \"0..255\""),
        (onnx::ranged(-1.0, 1.0), "range_out = \"-1..1\""),
    ] {
        let (_folder, mut enhancer) = loaded(&graph);
        let message = enhancer.enhance(&image(12, 20)).unwrap_err().to_string();
        assert!(message.contains(likely), "{message}");
    }
}

#[test]
fn sides_are_filled_up_to_multiples() {
    let image = image(13, 30);
    // Found by trying, and stated in every way.
    let (_folder, mut found) = loaded(&onnx::of_eights());
    assert_eq!(found.enhance(&image).unwrap(), image);
    for pad in ["reflect", "zero", "replicate", "crop"] {
        let sidecar = format!("multiple = 8\npad = \"{pad}\"");
        let (_folder, mut enhancer) = stated(&onnx::of_eights(), &sidecar);
        assert_eq!(enhancer.enhance(&image).unwrap(), image, "{pad}");
    }
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
    for sidecar in ["", "tile = \"exact:2\"", "tile = \"exact:2\"\nmultiple = 4"] {
        let (_folder, enhancer) = stated(&onnx::blurred(), sidecar);
        for side in [80, 100, 1000] {
            let (_folder, enhancer) = stated(&onnx::blurred(), sidecar);
            let mended = enhancer.with_tiling(tiles(side)).enhance(&image).unwrap();
            // A padded image is blurred with what it is padded with.
            let same = whole
                .samples()
                .iter()
                .zip(mended.samples())
                .filter(|(a, b)| a == b);
            assert!(
                same.count() * 10 > whole.samples().len() * 9,
                "{sidecar} {side}"
            );
            if !sidecar.contains("multiple") {
                assert_eq!(mended, whole, "{sidecar} {side}");
            }
        }
        let message = enhancer
            .with_tiling(tiles(4))
            .enhance(&image)
            .unwrap_err()
            .to_string();
        assert!(message.contains("--tile"), "{message}");
    }
    for graph in [onnx::mean_added(), onnx::blurred()] {
        // Of the mean every pixel is part; of the blur more than is stated here.
        let (_folder, enhancer) = stated(&graph, "tile = \"exact:0\"");
        let message = enhancer
            .with_tiling(tiles(40))
            .enhance(&image)
            .unwrap_err()
            .to_string();
        assert!(message.contains("at their seams"), "{message}");
    }
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

#[test]
fn the_command_enhances_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = onnx::gain(2.0).write(folder.path(), "gain.onnx");
    std::fs::create_dir(at("dark")).unwrap();
    let dark = image(20, 30);
    for name in ["dark/a.png", "dark/b.png", "c.png"] {
        image::save_buffer(
            at(name),
            dark.samples(),
            30,
            20,
            image::ExtendedColorType::Rgb8,
        )
        .unwrap();
    }
    std::fs::write(at("dark/b.png"), "no image").unwrap();
    let call = |words: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("darkqa-eval").unwrap();
        let output = command
            .current_dir(folder.path())
            .arg("enhance")
            .arg(&model)
            .args(words);
        let output = output.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (
            output.status.code().unwrap(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    let (code, out, err) = call(&["dark", "c.png", "--out", "mended"]);
    assert_eq!(
        (code, out.as_str()),
        (1, "mended: 2 made by gain, 1 failed\n"),
        "{err}"
    );
    assert!(err.contains("b.png"), "{err}");
    for name in ["mended/a.png", "mended/c.png"] {
        let made = image::open(at(name)).unwrap().into_rgb8().into_raw();
        assert_eq!(made, map(&dark, |x| 2.0 * x).samples(), "{name}");
    }
    let (_, out, _) = call(&["c.png", "--out", "mended"]);
    assert!(out.contains("1 kept as they were"), "{out}");
    let (code, out, _) = call(&["--describe"]);
    assert!(
        code == 0 && out.contains("NCHW") && out.contains("usual"),
        "{out}"
    );
    for words in [
        &["--out", "x"][..],
        &["c.png"],
        &["c.png", "--describe"],
        &["c.png", "--out", "x", "--tile", "0"],
    ] {
        let (code, _, err) = call(words);
        assert_eq!((code, err.lines().count()), (2, 1), "{err}");
    }
}

#[test]
fn a_preset_says_what_its_authors_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = onnx::two_outputs().write(folder.path(), "model.onnx");
    let image = image(8, 8);
    let said = |preset: &str| PathBuf::from(format!("{preset}:{}", path.display()));
    let mended = open(&said("zero-dce")).unwrap().enhance(&image).unwrap();
    assert_eq!(mended, map(&image, |x| 2.0 * x));
    let described = open(&said("sci")).unwrap().describe();
    assert!(
        described.contains("preset sci") && described.contains("truncate"),
        "{described}"
    );
    let digests =
        ["sci", "zero-dce"].map(|preset| ModelFile::read(&said(preset)).unwrap().digest());
    assert_ne!(digests[0], digests[1]);
    let message = open(&said("nonesuch")).err().unwrap().to_string();
    assert!(message.contains("is not a preset"), "{message}");
}

#[test]
fn what_goes_wrong_while_running_is_an_error() {
    let (_folder, mut halved) = loaded(&onnx::halved());
    let message = halved.enhance(&image(8, 8)).unwrap_err().to_string();
    assert!(message.contains("[1, 3, 4, 4]"), "{message}");
    let (_folder, mut broken) = loaded(&onnx::not_a_number());
    let message = broken.enhance(&image(8, 8)).unwrap_err().to_string();
    assert!(message.contains("not numbers"), "{message}");
    // An image without a black pixel divides well, on the same session.
    let gray = Rgb::new(2, 2, vec![100; 12]).unwrap();
    assert_eq!(broken.enhance(&gray).unwrap().samples(), [255; 12]);
}

#[test]
fn a_graph_that_the_runtime_refuses_is_an_error() {
    let graph = Graph::new().node("NoSuchOperator", &["input"], "output");
    assert!(fault(&graph).contains("NoSuchOperator"));
    let mut bytes = onnx::gain(2.0).model();
    bytes.truncate(bytes.len() / 2);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.onnx");
    std::fs::write(&path, bytes).unwrap();
    assert!(open(&path).is_err());
}

#[test]
fn the_name_is_that_of_the_file() {
    let (folder, enhancer) = loaded(&onnx::identity());
    let file = ModelFile::read(&folder.path().join("model.onnx")).unwrap();
    assert_eq!(enhancer.name().as_str(), "model");
    assert_eq!(enhancer.name(), file.name());
}

#[test]
fn threads_and_enhancers_do_not_disturb_each_other() {
    let image = image(9, 14);
    std::thread::scope(|scope| {
        for factor in [1.0_f32, 2.0, 3.0, 4.0] {
            let image = &image;
            scope.spawn(move || {
                let (_folder, mut enhancer) = loaded(&onnx::gain(factor));
                for _ in 0..5 {
                    let mended = enhancer.enhance(image).unwrap();
                    assert_eq!(mended, map(image, |x| f64::from(factor) * x));
                }
            });
        }
    });
}

#[test]
fn the_callers_arithmetic_keeps_its_subnormal_numbers() {
    let (_folder, mut enhancer) = loaded(&onnx::identity());
    enhancer.enhance(&image(4, 4)).unwrap();
    let half = std::hint::black_box(f32::MIN_POSITIVE) / std::hint::black_box(2.0);
    assert!(half.is_subnormal());
}

#[test]
fn the_runtime_is_opened_once() {
    let first = runtime();
    assert_eq!(first.path(), runtime().path());
    assert!(first.version().starts_with("1."));
    let folder = tempfile::tempdir().unwrap();
    let other = RuntimeSearch {
        library: Some(folder.path().join("other.so")),
        install: Install::Offline,
    };
    let message = other.open().err().unwrap().to_string();
    assert!(message.contains("this process has loaded"), "{message}");
}

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models/gray-gain.onnx")
}

/// `DARKQA_BLESS=1 cargo test --test enhance` writes the file anew.
#[test]
fn the_shipped_enhancer_is_what_the_writer_makes() {
    let made = onnx::gray_gain().model();
    if std::env::var_os("DARKQA_BLESS").is_some_and(|value| value == "1") {
        std::fs::write(shipped(), &made).unwrap();
    }
    assert!(
        std::fs::read(shipped()).unwrap() == made,
        "models/gray-gain.onnx differs; write it anew with DARKQA_BLESS=1"
    );
}

#[test]
fn the_shipped_enhancer_exposes_for_gray() {
    let mut enhancer = open(&shipped()).unwrap();
    let light = |byte: f64| {
        let x = byte / 255.0;
        if x < 0.04045 {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055_f64).powf(2.4)
        }
    };
    let mean = |image: &Rgb| {
        let sum: f64 = image.samples().iter().map(|b| light(f64::from(*b))).sum();
        sum / image.samples().len() as f64
    };
    // Six stops below middle gray.
    let dark = Rgb::new(6, 8, (0..144).map(|i| 5 + (i % 9) as u8).collect()).unwrap();
    assert!((mean(&enhancer.enhance(&dark).unwrap()) - 0.18).abs() < 0.004);
    // A bright image is not darkened, and a black one is not lifted.
    for byte in [0, 200] {
        let flat = Rgb::new(6, 8, vec![byte; 144]).unwrap();
        assert_eq!(enhancer.enhance(&flat).unwrap(), flat);
    }
}

fn lift() -> Enhancer {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/lift.onnx");
    assert!(std::fs::metadata(&path).unwrap().len() <= 100_000);
    open(&path).unwrap()
}

/// The mean square of the difference of two images, as a ratio to the brightest in dB.
fn psnr(a: &Rgb, b: &Rgb) -> f64 {
    let squares = a.samples().iter().zip(b.samples());
    let sum: f64 = squares
        .map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2))
        .sum();
    10.0 * (255.0_f64.powi(2) * a.samples().len() as f64 / sum.max(1e-9)).log10()
}

#[test]
fn the_trained_enhancer_brings_a_room_back() {
    let mut enhancer = lift();
    let rooms = Rooms {
        frames: 6,
        seed: 3003,
        size: [240, 180],
    };
    for (id, room) in rooms.all() {
        let lit = room.frame().unwrap().rgb.clone();
        let (mut negative, key) = (None, NoiseKey::new(0, &id));
        for level in Severity::LADDER {
            let film = negative
                .get_or_insert_with(|| Negative::new(&lit, &key, &Synthesis::default(), level));
            for (dark, gain) in [(expose(&lit, level), 12.0), (film.develop(level), 8.0)] {
                let (before, after) = (
                    psnr(&dark, &lit),
                    psnr(&enhancer.enhance(&dark).unwrap(), &lit),
                );
                assert!(
                    after - before > gain,
                    "{id} {level:?}: {before} dB, then {after} dB"
                );
            }
        }
        // What is lit stays nearly as it is.
        let same = psnr(&enhancer.enhance(&lit).unwrap(), &lit);
        assert!(same > 24.0, "{id}: {same} dB");
    }
}

/// What is flat stays flat, what is empty stays empty, and no edge comes up where there was none.
#[test]
fn the_trained_enhancer_invents_nothing() {
    let mut enhancer = lift();
    for color in [
        [0, 0, 0],
        [3, 3, 3],
        [20, 16, 12],
        [90, 110, 130],
        [255, 255, 255],
    ] {
        let flat = Rgb::new(64, 96, color.repeat(64 * 96)).unwrap();
        let made = enhancer.enhance(&flat).unwrap();
        let (pixels, _) = made.samples().as_chunks::<3>();
        // Away from the rim, where convolutions see the end of the image.
        let inner = (24..40).flat_map(|y| &pixels[y * 96 + 24..y * 96 + 72]);
        for channel in 0..3 {
            let codes: Vec<u8> = inner.clone().map(|pixel| pixel[channel]).collect();
            let spread = codes.iter().max().unwrap() - codes.iter().min().unwrap();
            assert!(spread <= 8, "{color:?}: {spread} codes apart");
        }
    }
    // One edge in, one edge out.
    let halves: Vec<u8> = (0..64 * 96)
        .flat_map(|i| if i % 96 < 48 { [8, 8, 8] } else { [24, 20, 16] })
        .collect();
    let made = enhancer
        .enhance(&Rgb::new(64, 96, halves).unwrap())
        .unwrap();
    let row = &made.samples()[32 * 96 * 3..33 * 96 * 3];
    let steps: Vec<u8> = (24..71)
        .map(|x| row[x * 3].abs_diff(row[x * 3 + 3]))
        .collect();
    let edge = 47 - 24;
    assert!(steps[edge] > 40, "{steps:?}");
    let away = steps
        .iter()
        .enumerate()
        .filter(|(x, _)| x.abs_diff(edge) > 6);
    assert!(away.clone().all(|(_, step)| *step <= 8), "{steps:?}");
}
