//! Does a better picture mean better answers: the numbers of a simulation whose truth is known, and those of a run.

use std::fs;

use crate::support::made::record;
use crate::support::run::{Bench, records, words};
use darkqa_base::types::{Condition, Digest, ImageFacts, ImageFidelity, Record};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;
use darkqa_score::photographs::FidelityFindings;
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Beta, Distribution as _, Normal};
use serde_json::Value;

/// Fidelity findings of made replies: `clusters` frames with `questions` each. The right-rate of a frame is drawn with
/// an intraclass correlation of 0.2, and the PSNR of its image follows the rate with a slope.
fn findings(random: &mut StdRng, [clusters, questions]: [usize; 2], slope: f64) -> FidelityFindings {
    let condition: Condition = "L3-ev".parse().unwrap();
    let (rates, noise) = (Beta::new(2.4, 1.6).unwrap(), Normal::new(0.0, 1.0).unwrap());
    let (mut records, mut measured) = (Vec::new(), Vec::new());
    for frame in 0..clusters {
        let rate: f64 = rates.sample(random);
        let image = Digest::from_bytes(format!("image {frame}").as_bytes());
        for question in 0..questions {
            let name = (frame * questions + question, frame);
            let mut reply: Record = record("m", &condition, name, random.random_bool(rate));
            reply.detail.image = Some(facts(image));
            records.push(reply);
        }
        measured.push(ImageFidelity {
            frame: records[records.len() - 1].detail.frame.clone().into(),
            condition: condition.clone().into(),
            image,
            psnr: Some(20.0 + slope * (rate - 0.6) + noise.sample(random)),
            ssim: None,
        });
    }
    let trials = records.iter().cloned().collect();
    let found = Findings::new(&trials, &FrameTies::default(), [], &measured);
    found.fidelity.unwrap()
}

fn facts(digest: Digest) -> ImageFacts {
    ImageFacts {
        digest,
        bytes: 1,
        width: 1,
        height: 1,
        format: "png".to_owned(),
        orientation: None,
        exposure: None,
        pair: None,
    }
}

/// How often the interval of the AUC leaves out ½, in percent.
fn rejected(seed: u64, times: usize, sizes: [usize; 2], slope: f64) -> f64 {
    let mut random = StdRng::seed_from_u64(seed);
    let found = (0..times).filter(|_| {
        let auc = findings(&mut random, sizes, slope).within[0];
        auc.is_some_and(|auc| auc.estimate.low > 0.5 || auc.estimate.high < 0.5)
    });
    100.0 * found.count() as f64 / times as f64
}

#[test]
fn useless_fidelity_is_rarely_predictive() {
    for sizes in [[12, 8], [25, 8], [52, 20]] {
        let rate = rejected(1, 400, sizes, 0.0);
        assert!((1.5..=8.0).contains(&rate), "{sizes:?}: {rate} %");
    }
    // Fidelity that follows the rate of the frame is found.
    assert!(rejected(2, 60, [52, 20], 8.0) > 90.0);
}

#[test]
fn equal_dark_images_keep_own_fidelity() {
    let condition: Condition = "L5-ev".parse().unwrap();
    let black = Digest::from_bytes(b"black");
    let (mut records, mut measured) = (Vec::new(), Vec::new());
    for (frame, psnr) in [(0, 10.0), (1, 30.0)] {
        let mut reply: Record = record("m", &condition, (frame, frame), true);
        reply.detail.image = Some(facts(black));
        measured.push(ImageFidelity {
            frame: reply.detail.frame.clone().into(),
            condition: condition.clone().into(),
            image: black,
            psnr: Some(psnr),
            ssim: None,
        });
        records.push(reply);
    }
    for _ in 0..2 {
        measured.reverse();
        let trials = records.iter().cloned().collect();
        let found = Findings::new(&trials, &FrameTies::default(), [], &measured);
        let row = &found.fidelity.unwrap().conditions[0];
        assert_eq!((row.images, row.means[0]), (2, Some(20.0)));
    }
}

#[test]
fn run_reports_image_fidelity() {
    let bench = Bench::new();
    bench.rooms("frames", 8, "160x120");
    let run = |variant: &str| {
        let line = format!("--model random --data frames --out run --levels L0,L1,L5 --variant {variant}");
        bench.complete(&words(&line))
    };
    run("ev");
    let lines = |name: &str| -> Vec<Value> {
        let text = fs::read_to_string(bench.path("run").join(name)).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let stored = lines("fidelity.jsonl");
    let records = records(&bench.path("run"));
    let dark = records.iter().filter(|record| record["condition"] != "L0");
    for record in dark {
        let image = stored.iter().find(|line| line["image"] == record["image"]["digest"]);
        let image = image.unwrap_or_else(|| panic!("{record}"));
        assert_eq!(image["condition"], record["condition"]);
        assert_eq!(image["frame"], record["frame"]);
        let lighter = stored.iter().find(|other| other["frame"] == image["frame"] && other["condition"] == "L1-ev");
        let psnr = |line: &Value| line["psnr"].as_f64().unwrap();
        let is_darker = record["level"] == "L5";
        assert_eq!(psnr(image) < psnr(lighter.unwrap()), is_darker, "{image}");
    }
    assert!(stored.iter().all(|line| line["condition"] != "L0"));
    let table = fs::read_to_string(bench.path("run/fidelity.csv")).unwrap();
    assert!(table.starts_with("condition,level,variant,enhancer,images,psnr,ssim,n,accuracy,psnr_auc"));
    assert_eq!(table.lines().count(), 3, "{table}");
    the_page_draws_the_numbers_of_the_file(&bench, &table);
    // Images that were measured are not measured again; a new condition is added.
    run("both");
    let after = lines("fidelity.jsonl");
    assert_eq!(after.len(), 2 * stored.len());
    assert_eq!(after[..stored.len()], stored);
}

/// The figure of the page has a point for each row of the file, with its numbers; a run without dark images has no such
/// section.
fn the_page_draws_the_numbers_of_the_file(bench: &Bench, table: &str) {
    let page = |run: &str| fs::read_to_string(bench.path(run).join("report.html")).unwrap();
    let drawn = page("run");
    let (_, figure) = drawn.split_once(r#"id="figure-fidelity""#).unwrap();
    for (panel, column) in [("SSIM of the images", 6), ("share of right answers", 8)] {
        let (_, panel) = figure.split_once(&format!(">{panel}</p>")).unwrap();
        let (panel, _) = panel.split_once("</svg>").unwrap();
        let titles = panel.split("<title>").skip(1).map(|title| title.split_once("</title>").unwrap().0);
        let drawn: Vec<f64> = titles.map(|percent| percent.parse().unwrap()).collect();
        let filed: Vec<f64> =
            table.lines().skip(1).map(|row| row.split(',').nth(column).unwrap().parse().unwrap()).collect();
        assert_eq!(drawn.len(), filed.len());
        for (drawn, filed) in drawn.iter().zip(&filed) {
            // One decimal of a percentage is drawn.
            assert!((drawn - 100.0 * filed).abs() < 0.051, "{drawn} {filed}");
        }
    }
    let line = "--model random --data frames --out light --levels L0";
    bench.complete(&words(line));
    assert!(!page("light").contains(r#"id="fidelity""#));
}
