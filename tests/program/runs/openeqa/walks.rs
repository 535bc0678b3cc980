//! Frames of a walk: sampled as upstream does, taken by one camera, shared among tasks.

use std::fs;

use image::RgbImage;
use serde_json::Value;

use super::{images, sent};
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::{House, flags};
use crate::support::run::{called, model_args, records, words};

#[test]
fn broken_frame_removes_only_walk() {
    let house = House::new();
    house.0.file("walks/hm3d-v0/000-a/00002-rgb.png", "no image");
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    let called = house.call(&words("--model script:a.jsonl --levels L0 --out run"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN 1 of 2 walks cannot be shown (hm3d-v0/000-a); unanswered questions: 2; the first problem:
        walks/hm3d-v0/000-a/00002-rgb.png: not an image: PNG, JPEG, WebP, TIFF, BMP or OpenEXR expected
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
     WARN a trial failed: L0: hm3d-v0/000-a: walks/hm3d-v0/000-a/00002-rgb.png: not an image: PNG, JPEG, WebP,
        TIFF, BMP or OpenEXR expected
    ");
    let failed = records(&house.0.path("run"));
    let failed: Vec<&Value> = failed.iter().filter(|record| !record["failure"].is_null()).collect();
    assert_eq!(failed.len(), 2);
    assert!(failed.iter().all(|record| record["failure"]["kind"] == "image"), "{failed:?}");
}

#[test]
fn walk_has_one_camera() {
    let house = House::new();
    let model = MockEndpoint::start([Answer::text("x")]);
    let base = model.base_url();
    let requests = |out: &str, flags: &str| -> Vec<Value> {
        let before = model.requests().len();
        let line = format!("--limit 1 --concurrency 1 --out {out} {flags}");
        let called = house.call(&model_args(&base, &line));
        assert_eq!(called.code, Some(0), "{called:?}");
        sent(&model).split_off(before)
    };
    let all = requests("a", "--levels L0,L2,L4");
    assert_eq!(all.len(), 3);
    let means: Vec<Vec<f64>> = all
        .iter()
        .map(|request| {
            let mean = |image: &RgbImage| {
                let sum: f64 = image.as_raw().iter().map(|code| f64::from(*code)).sum();
                sum / image.as_raw().len() as f64
            };
            images(request).iter().map(mean).collect()
        })
        .collect();
    assert_eq!(means[0], [100.0, 140.0, 180.0]);
    // Darker at each level, and lighter frames stay lighter: they are the same ones.
    for at in 0..3 {
        assert!(means[0][at] > means[1][at] && means[1][at] > means[2][at], "{means:?}");
    }
    // The same in any order and by another run; other noise by another state of the camera or after the scaling.
    assert_eq!(requests("b", "--levels L2")[0], all[1]);
    assert_ne!(requests("c", "--levels L2 --sensor frame")[0], all[1]);
    assert_ne!(requests("d", "--levels L2 --degrade resized")[0], all[1]);
    // A level more in the same run asks for that level alone.
    assert_eq!(requests("b", "--levels L2,L4"), [all[2].clone()]);
}

#[test]
fn single_frame_is_repeated() {
    let house = House::new();
    fs::remove_file(house.0.path("walks/scannet-v0/001-b/00001-rgb.png")).unwrap();
    let mock = MockEndpoint::start([Answer::text("an answer")]);
    let called = house.call(&model_args(&mock.base_url(), "--levels L0,L2 --splits scannet-v0 --out run"));
    assert_eq!(called.code, Some(0), "{called:?}");
    for request in sent(&mock) {
        let parts = request["messages"][0]["content"].as_array().unwrap();
        let images = parts.iter().filter(|part| part["type"] == "image_url");
        assert_eq!(images.count(), 3, "as upstream samples one frame three times");
    }
}

#[test]
fn array_task_asks_own_walks() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}");
    let args = flags(&words("--model script:a.jsonl --levels L0 --out run"));
    let mut command = house.0.command(&args);
    command.envs([("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_TASK_MIN", "0"), ("SLURM_ARRAY_TASK_COUNT", "2")]);
    let called = called(&mut command);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN task 2 of a Slurm array of 2: this process does shard 2/2; --shard none does everything
     WARN 1 of 1 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example); --num-frames 2 shows each once at most, and
        costs less
    ");
    let records = records(&house.0.path("run/shard-2-of-2"));
    let questions: Vec<&Value> = records.iter().map(|record| &record["question"]).collect();
    assert_eq!(questions, ["q3"]);
}
