//! Runs that give no image: sizes that no trial mends, memory, time, and files that are too new.

use std::time::{Duration, Instant};

use darkqa_base::types::Rgb;
use darkqa_enhance::TimeLimit;

use super::{fault, image, loaded, open};
use crate::support::onnx;
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

#[test]
fn unfixable_size_names_no_multiple() {
    let rows = [
        (onnx::doubled(), "enlarges by 2"),
        (onnx::halved(), "24 × 20 for one of 48 × 40"),
        (onnx::of_much_memory(), "free"),
    ];
    check_rows(rows, |(graph, part)| {
        let (_folder, mut enhancer) = loaded(&graph);
        let message = enhancer.enhance(&image(40, 48)).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
        assert!(!message.contains("multiple ="), "{message}");
    });
}

#[test]
fn slow_image_fails_alone() {
    let (_folder, enhancer) = loaded(&onnx::endless_if_bright());
    let limit = TimeLimit::new(Duration::from_millis(300));
    let mut enhancer = enhancer.with_time_limit(limit);
    let (dark, bright) = (Rgb::new(4, 4, vec![50; 48]).unwrap(), Rgb::new(4, 4, vec![200; 48]).unwrap());
    assert_eq!(enhancer.enhance(&dark).unwrap(), dark);
    for _ in 0..2 {
        let start = Instant::now();
        let message = enhancer.enhance(&bright).unwrap_err().to_string();
        assert!(message.contains("longer than 0.3 s"), "{message}");
        assert!(start.elapsed() < Duration::from_mins(1), "{:?}", start.elapsed());
    }
    // The session serves again, and the count begins again.
    assert_eq!(enhancer.enhance(&dark).unwrap(), dark);
    for _ in 0..3 {
        let message = enhancer.enhance(&bright).unwrap_err().to_string();
        assert!(message.contains("longer than"), "{message}");
    }
    let message = enhancer.enhance(&dark).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: is no longer run, because 3 images in a row exceeded the limit of time or memory
        (--llie-options timeout, max-memory)
    ");
    assert_eq!(enhancer.sizes().too_long, 5);
}

#[test]
fn slow_padded_image_counts_as_slow() {
    let (_folder, enhancer) = loaded(&onnx::endless_if_bright_from(&[32, 32]));
    let limit = TimeLimit::new(Duration::from_millis(300));
    let mut enhancer = enhancer.with_time_limit(limit);
    let small = Rgb::new(4, 4, vec![200; 48]).unwrap();
    let message = enhancer.enhance(&small).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: took longer than [TIME] for an image; allow more with --llie-options timeout=SECONDS (0: no
        limit)
    ");
    assert_eq!(enhancer.sizes().too_long, 1);
}

#[test]
fn fixed_size_without_memory_names_export() {
    let (_folder, mut enhancer) = loaded(&onnx::of_size(&onnx::of_much_memory(), 1, [40, 48]));
    let message = enhancer.enhance(&image(40, 48)).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: ran out of memory on an image of 48 × 40: [MEMORY] were needed at once, [MEMORY] are free;
        export it for a smaller size, or with dynamic_axes
    ");
}

#[cfg(target_os = "linux")]
#[test]
fn memory_hungry_image_fails_alone() {
    let (_folder, enhancer) = loaded(&onnx::endless_if_bright());
    let mut enhancer = enhancer.with_memory_limit("0.01".parse().unwrap());
    let [dark, bright] = [50, 200].map(|value| Rgb::new(4, 4, vec![value; 48]).unwrap());
    // It ends before anybody looks.
    assert_eq!(enhancer.enhance(&dark).unwrap(), dark);
    for _ in 0..3 {
        let message = enhancer.enhance(&bright).unwrap_err().to_string();
        assert!(message.contains("more than 0.01 GB"), "{message}");
        assert!(message.contains("--llie-options max-memory"), "{message}");
    }
    let message = enhancer.enhance(&dark).unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&message), @"
    [TMP]/model.onnx: is no longer run, because 3 images in a row exceeded the limit of time or memory
        (--llie-options timeout, max-memory)
    ");
    assert_eq!(enhancer.sizes().too_long, 0);
}

#[test]
fn too_new_model_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new.onnx");
    for (versions, part) in [((99, 13), "IR version 99"), ((8, 999), "operator set 999")] {
        let bytes = onnx::identity().model_of(versions.0, versions.1);
        std::fs::write(&path, bytes).unwrap();
        let message = open(&path).err().unwrap().to_string();
        assert!(message.contains(part) && message.contains("--llie-options ort-lib"), "{message}");
    }
    insta::assert_snapshot!(redacted(&fault(&onnx::no_image())), @r#"
    [TMP]/model.onnx: gives "curves" (float32 [1, 24, height, width]), 24 channels, but an image has 3; if they
        are the curves of Zero-DCE, add to model.onnx.toml next to it: `image = "curves(input, curves[0:3],
        curves[3:6], curves[6:9], curves[9:12], curves[12:15], curves[15:18], curves[18:21], curves[21:24])"`
    "#);
}
