//! Open questions about walks in parts that are stopped, killed, and gone on with in other numbers.

use std::collections::BTreeMap;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

use image::{Rgb, RgbImage};
use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, assert_same_products, records, words};
use crate::support::snapshot::each;

/// Requests that are in flight at once.
const IN_FLIGHT: usize = 2;

/// Nine walks of two frames, with two questions about each.
fn with_walks() -> Bench {
    let bench = Bench::new();
    let mut questions = Vec::new();
    for walk in 0..9_u8 {
        let name = format!("hm3d-v0/{walk:03}-house");
        for frame in 0..2_u8 {
            let picture = RgbImage::from_pixel(48, 32, Rgb([60 + 10 * walk + frame; 3]));
            let path = bench.path(&format!("walks/{name}/{frame:05}-rgb.png"));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            picture.save(path).unwrap();
        }
        for question in 0..2 {
            questions.push(json!({
                "question_id": format!("q{walk}-{question}"), "question": format!("Where is thing {question} of house {walk}?"),
                "answer": "On the table", "category": "object localization", "episode_history": name,
            }));
        }
    }
    bench.file("questions.json", json!(questions).to_string());
    bench
}

/// The same answer or mark to the same request, after a while.
fn endpoint() -> MockEndpoint {
    MockEndpoint::answering(|request| {
        std::thread::sleep(Duration::from_millis(40));
        let length = request.to_string().len();
        let is_mark = request["model"] == "j";
        Answer::text(&if is_mark { (1 + length % 5).to_string() } else { format!("an answer of {} words", length % 3) })
    })
}

fn flags(mock: &MockEndpoint, more: &str) -> String {
    format!(
        "openeqa --questions questions.json --frames walks --num-frames 2 --image-size native --model m --judge j --base-url {} \
         --levels L0,L3 --concurrency {IN_FLIGHT} {more}",
        mock.base_url()
    )
}

/// Trials by key.
fn asked(run: &std::path::Path) -> BTreeMap<String, Value> {
    records(run).into_iter().map(|record| (record["key"].to_string(), record["reply"].clone())).collect()
}

/// A stranger's list of questions may name any folder, and a walk may be a link.
#[cfg(unix)]
#[test]
fn walks_outside_the_folder_are_not_sent() {
    let bench = with_walks();
    let mock = endpoint();
    fs::rename(bench.path("walks/hm3d-v0/000-house"), bench.path("private")).unwrap();
    let walks = bench.path("walks/hm3d-v0");
    std::os::unix::fs::symlink(bench.path("private"), walks.join("link")).unwrap();
    fs::create_dir(walks.join("frame")).unwrap();
    let frame = "00000-rgb.png";
    std::os::unix::fs::symlink(bench.path("private").join(frame), walks.join("frame").join(frame)).unwrap();
    let absolute = bench.path("private").display().to_string();
    let ask = |walk: &str, more: &str| {
        let question = json!([{"question_id": "q", "question": "Where?", "answer": "there", "category": "c", "episode_history": walk}]);
        bench.file("questions.json", question.to_string());
        bench.call(&words(&flags(&mock, more)))
    };
    let refusals = each(["../private", "hm3d-v0/../../private", "absolute", "hm3d-v0/link", "hm3d-v0/frame"], |walk| {
        let walk = if *walk == "absolute" { &absolute } else { *walk };
        ask(walk, "--out run").messages()
    });
    insta::assert_snapshot!(refusals, @r#"
    ../private
      exit code: 2
      error: --frames: no walk can be shown: episode_history: "../private" lies outside walks/, the folder of the
          data; --data-root [TMP] allows the folder that it names; DIR/EPISODE_HISTORY/*-rgb.png expected
    hm3d-v0/../../private
      exit code: 2
      error: --frames: no walk can be shown: episode_history: "hm3d-v0/../../private" lies outside walks/, the
          folder of the data; --data-root [TMP] allows the folder that it names; DIR/EPISODE_HISTORY/*-rgb.png
          expected
    absolute
      exit code: 2
      error: --frames: no walk can be shown: episode_history: "[TMP]/private" lies outside walks/, the folder of the
          data; --data-root [TMP] allows the folder that it names; DIR/EPISODE_HISTORY/*-rgb.png expected
    hm3d-v0/link
      exit code: 2
      error: --frames: no walk can be shown: episode_history: "hm3d-v0/link" lies outside walks/, the folder of the
          data; --data-root [TMP] allows the folder that it names; DIR/EPISODE_HISTORY/*-rgb.png expected
    hm3d-v0/frame
      exit code: 2
      error: --frames: no walk can be shown: walks/hm3d-v0/frame/00000-rgb.png: leads out of walks, the folder of
          the data; --data-root [TMP]/private allows the folder that it leads to; DIR/EPISODE_HISTORY/*-rgb.png
          expected
    "#);
    assert!(mock.requests().is_empty());
    let allowed = ask("hm3d-v0/link", "--out run --data-root private");
    assert_eq!(allowed.code, Some(0), "{allowed:?}");
    assert!(!mock.requests().is_empty());
    let shown = bench.call(&words("show run q --condition L3-noise"));
    assert_eq!(shown.code, Some(0), "{shown:?}");
}

#[test]
fn killed_shard_resumes_in_other_numbers() {
    let bench = with_walks();
    let mock = endpoint();
    bench.complete(&words(&flags(&mock, "--out whole")));
    let whole = mock.requests().len();
    assert_eq!(whole, records(&bench.path("whole")).len());
    // No part of the seven ends but the first two; the third is killed.
    let part = |part: &str| flags(&mock, &format!("--out parts --shard {part}"));
    for done in ["1/7", "2/7"] {
        bench.complete(&words(&part(done)));
    }
    let third = part("3/7");
    let mut child = bench.spawn(&words(&third), Stdio::null());
    let path = bench.path("parts/shard-3-of-7/records.jsonl");
    let stored = || fs::read_to_string(&path).unwrap_or_default();
    wait_until(|| stored().lines().count() >= 2);
    signal(&child, "-9");
    child.wait().unwrap();
    // Two of five, then all three of three.
    for next in ["2/5", "4/5", "1/3", "2/3", "3/3"] {
        bench.complete(&words(&part(next)));
    }
    let all = mock.requests().len() - whole;
    assert!(
        (whole..=whole + IN_FLIGHT).contains(&all),
        "{all} requests for {whole}: only what was in flight at the kill is asked again"
    );
    let merged = bench.call(&words("merge parts --out merged"));
    assert_eq!(merged.code, Some(0), "{merged:?}");
    // The killed part is not named: the others have all that it was to ask.
    assert_eq!(merged.stderr, "");
    let reported = bench.call(&words("report parts --out reported"));
    assert_eq!(reported.stderr, "");
    assert_same_products(&bench.path("reported"), &bench.path("merged"));
    assert_eq!(asked(&bench.path("whole")), asked(&bench.path("merged")));
    let compared = assert_same_products(&bench.path("whole"), &bench.path("merged"));
    assert!(compared > 5, "{compared}");
    // The merged run is whole: nothing is left to ask.
    bench.complete(&words(&flags(&mock, "--out merged")));
    assert_eq!(mock.requests().len() - whole, all);
}

#[test]
fn model_is_added_to_shards() {
    let bench = Bench::new();
    let mock = MockEndpoint::start([Answer::text("B")]);
    let flags = |models: &str, more: &str| format!("{models} --base-url {} --levels L0,L2 {more}", mock.base_url());
    bench.complete(&words(&flags("--model a --model b", "--out whole")));
    let whole = mock.requests().len();
    bench.complete(&words(&format!("plan {}", flags("--model a", "--out run"))));
    for models in ["--model a", "--model b"] {
        for part in ["1/3", "2/3", "3/3"] {
            let part = format!("--out run --shard {part}");
            bench.complete(&words(&flags(models, &part)));
        }
    }
    assert_eq!(mock.requests().len(), 2 * whole, "what a run has is not asked again");
    bench.complete(&words("merge run --out merged"));
    assert_eq!(asked(&bench.path("whole")), asked(&bench.path("merged")));
    assert_same_products(&bench.path("whole"), &bench.path("merged"));
}
