//! The command `enhance`.

use std::process::Command;

use super::{image, map};
use crate::support::onnx;
use crate::support::run::{Bench, PROGRAM, words};
use crate::support::snapshot::{lines_with, redacted};
use crate::support::table::check_rows;

#[test]
fn the_command_enhances_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let model = onnx::gain(0.5).write(folder.path(), "gain.onnx");
    std::fs::create_dir(at("dark")).unwrap();
    let dark = image(20, 30);
    for name in ["dark/a.png", "dark/b.png", "c.png"] {
        image::save_buffer(at(name), dark.samples(), 30, 20, image::ExtendedColorType::Rgb8).unwrap();
    }
    std::fs::write(at("dark/b.png"), "no image").unwrap();
    let call = |args: &[&str]| {
        let mut command = Command::new(PROGRAM);
        let output = command.current_dir(folder.path()).arg("enhance").arg(&model).args(args);
        let output = output.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
    };
    let (code, out, err) = call(&["dark", "c.png", "--out", "mended", "--llie-anyway"]);
    let (made, latency) = out.split_once('\n').unwrap();
    assert_eq!((code, made), (1, "mended: 2 made by gain because of --allow bad-enhancer, 1 failed"), "{err}");
    assert!(
        latency.starts_with("latency: 30 × 20: ") && latency.contains(" ms per image (median of 1 image;"),
        "{out}"
    );
    let json = std::fs::read_to_string(at("mended/c.json")).unwrap();
    insta::assert_snapshot!(lines_with(&json, "warning"), @"");
    insta::assert_snapshot!(redacted(&err), @r#"
     WARN gain: on 6 of 6 dark frames its images are not brighter than the dark frames (mean brightness -9.6 of
        255). If its images should be this dim, add to gain.onnx.toml next to it: `range_in = "0..1"` and
        `range_out = "0..1"`. With 0..1 with the mean and std of CLIP in and -1..1 out (black becomes 21 of 255,
        white 258) they are plausible; if the model's code uses these, add to gain.onnx.toml next to it: `mean =
        [0.48145467, 0.4578275, 0.40821072]` and `std = [0.26862955, 0.2613026, 0.2757771]` and `range_out =
        "-1..1"`
    ERROR dark/b.png: not an image: PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected
    "#);
    check_rows(["mended/a.png", "mended/c.png"], |name| {
        let enhanced = image::open(at(name)).unwrap().into_rgb8().into_raw();
        assert_eq!(enhanced, map(&dark, |x| 0.5 * x).samples(), "{name}");
    });
    let (_, out, _) = call(&["c.png", "--out", "mended", "--llie-anyway"]);
    insta::assert_snapshot!(redacted(&out), @"mended: 0 made by gain, 1 left as they were (--force makes them again)");
    // What another model made, or the same with other settings, is never taken for the image.
    std::fs::write(at("gain.onnx.toml"), "color_out = \"bgr\"\n").unwrap();
    let (code, out, err) = call(&["c.png", "--out", "mended", "--llie-anyway"]);
    assert_eq!((code, out.as_str()), (1, "mended: 0 made by gain, 1 failed\n"), "{err}");
    insta::assert_snapshot!(redacted(&err), @r#"
     WARN gain: on 3 of 3 dark frames its images are not brighter than the dark frames (mean brightness -9.6 of
        255). If its images should be this dim, add to gain.onnx.toml next to it: `range_in = "0..1"` and
        `range_out = "0..1"`
    ERROR mended/c.png: made from another image or with other settings (enhancer: model with its sidecar); --force
        overwrites it, another --out keeps both
    "#);
    std::fs::remove_file(at("gain.onnx.toml")).unwrap();
    // An image of an earlier version has no JSON file: it is the same if its pixels are.
    std::fs::remove_file(at("mended/c.json")).unwrap();
    let (code, out, _) = call(&["c.png", "--out", "mended", "--llie-anyway"]);
    assert!(code == 0 && out.contains("1 left as they were"), "{out}");
    assert!(at("mended/c.json").is_file());
    let (code, out, _) = call(&["--describe"]);
    assert!(code == 0 && out.contains("NCHW") && out.contains("default, cannot be checked"), "{out}");
    let rows = [&["--out", "x"][..], &["c.png"], &["c.png", "--describe"], &["c.png", "--out", "x", "--tile", "0"]];
    check_rows(rows, |args| {
        let (code, _, err) = call(args);
        assert_eq!((code, err.lines().count()), (2, 1), "{err}");
    });
}

#[test]
fn images_in_subfolders_are_reported() {
    let bench = Bench::new();
    for name in ["a.png", "sub/b.png", ".hidden/c.png"] {
        let path = bench.path("photos").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::RgbImage::new(8, 8).save(path).unwrap();
    }
    let called = bench.call(&words("synthesize photos --out dark --levels L1 --variant ev"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN photos: the images of 1 folder in it are not read: photos/sub; name such a folder, too, to read them
    ");
}
