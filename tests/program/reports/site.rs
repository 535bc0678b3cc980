//! `site`: a leaderboard and the pages of many runs.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use crate::support::house::House;
use crate::support::run::{Bench, files, words};
use crate::support::snapshot::redacted;
use serde_json::Value;

/// The rows of a CSV file, each by the names of its columns.
fn rows(bench: &Bench, path: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(bench.path(path)).unwrap();
    let names = reader.headers().unwrap().clone();
    reader
        .records()
        .map(|row| {
            let row = row.unwrap();
            names.iter().zip(row.iter()).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
        })
        .collect()
}

fn find<'r>(rows: &'r [BTreeMap<String, String>], cells: &[(&str, &str)]) -> &'r BTreeMap<String, String> {
    let is_it = |row: &&BTreeMap<String, String>| cells.iter().all(|(name, cell)| row[*name] == *cell);
    rows.iter().find(is_it).unwrap_or_else(|| panic!("{cells:?}: {rows:?}"))
}

/// Two scripts for these questions: one is right as long as it is not too dark, one never.
fn scripts(bench: &Bench) {
    let set = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    let good = set
        .lines()
        .map(|line| {
            let question: Value = serde_json::from_str(line).unwrap();
            let dark = serde_json::json!({"question": question["id"], "condition": "L5-noise", "reply": "A"});
            format!("{dark}\n")
        })
        .collect::<String>()
        + "{\"default\": \"C\"}\n";
    bench.file("good.jsonl", good);
    bench.file("bad.jsonl", "{\"default\": \"A\"}\n");
}

/// Questions about twelve pictures, so that there are enough clusters for a verdict.
fn many(bench: &Bench) {
    let mut lines = String::new();
    for frame in 0..12_u8 {
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([90 + frame, 60, 30]));
        picture.save(bench.path(&format!("p{frame}.png"))).unwrap();
        for number in 0..4 {
            let question = serde_json::json!({
                "id": format!("q{frame}-{number}"), "image": format!("p{frame}.png"), "family": "color",
                "question": format!("What color is it, {number}?"),
                "choices": ["red", "blue", "brown"], "answer": "brown",
            });
            let _ = writeln!(lines, "{question}");
        }
    }
    bench.file("set.jsonl", lines);
}

/// Two runs of the same questions, a good model and a bad one, and their site.
fn two_runs() -> Bench {
    let bench = Bench::new();
    many(&bench);
    scripts(&bench);
    let asked = "--data set.jsonl --levels L0,L3,L5 --llie lift";
    let good = "--model script:good.jsonl --blind-model script:good.jsonl";
    bench.complete(&words(&format!("{good} {asked} --out one")));
    let bad = "--model script:bad.jsonl --model random";
    bench.complete(&words(&format!("{bad} {asked} --out two")));
    bench.complete(&words("site one two --out site"));
    bench
}

/// Checks numbers of a row against those of a line of a run's file: pairs of names of columns.
fn assert_equal(row: &BTreeMap<String, String>, own: &BTreeMap<String, String>, pairs: &[(&str, &str)]) {
    for (name, other) in pairs {
        let numbers = [&row[*name], &own[*other]].map(|text| text.parse::<f64>().unwrap());
        assert!((numbers[0] - numbers[1]).abs() < 1e-12, "{name}: {row:?} {own:?}");
    }
}

#[test]
fn site_numbers_match_run_files() {
    let bench = two_runs();
    let board = rows(&bench, "site/leaderboard.csv");
    assert_eq!(board.len(), 3);
    for row in &board {
        let model = &*row["model"];
        let file = |name: &str| rows(&bench, &format!("{}/{name}.csv", row["run"]));
        let all = [("model", model), ("family", "all")];
        let of = |more: &[(&'static str, &'static str)]| [&all[..], more].concat();
        let summary = file("summary");
        let strict = [("enhancer", ""), ("mode", "strict"), ("view", "image"), ("level", "L0")];
        let pairs = [("l0", "value"), ("l0_low", "low"), ("l0_high", "high"), ("n", "n")];
        assert_equal(row, find(&summary, &of(&strict)), &pairs);
        let curves = file("thresholds");
        let curve = find(&curves, &of(&[("variant", "noise"), ("enhancer", "")]));
        let pairs = [("area", "area"), ("area_low", "area_low"), ("area_high", "area_high")];
        assert_equal(row, curve, &pairs);
        assert_eq!(row["threshold_ev"], curve["threshold_ev"]);
        let comparisons = file("comparisons");
        let drop = find(&comparisons, &of(&[("kind", "level"), ("condition", "L5-noise")]));
        let pairs = [("change", "difference"), ("change_low", "low"), ("change_high", "high")];
        assert_equal(row, drop, &pairs);
        assert_eq!(row["change_shown"], drop["shown"]);
        let condition = format!("{}-noise+{}", row["best_level"], row["best_enhancer"]);
        let gain = [&all[..], &[("kind", "enhancer"), ("condition", &*condition)]].concat();
        let pairs = [("gain", "difference"), ("gain_low", "low"), ("gain_high", "high")];
        assert_equal(row, find(&comparisons, &gain), &pairs);
        let health = file("health");
        let own = || health.iter().filter(|line| line["model"] == model);
        let sum = |name: &str| -> usize { own().map(|line| line[name].parse::<usize>().unwrap()).sum() };
        assert_eq!(row["replies"], sum("replies").to_string());
        assert_eq!(row["unread"], (sum("replies") - sum("read")).to_string());
    }
}

#[test]
fn site_ranks_models_and_links_pages() {
    let bench = two_runs();
    let board = rows(&bench, "site/leaderboard.csv");
    // The better one is first, the reference has no rank.
    let rank = |model: &str| {
        let row = find(&board, &[("model", model)]);
        [row["rank_first"].clone(), row["rank_last"].clone()]
    };
    assert_eq!(rank("script:good.jsonl"), ["1", "1"]);
    assert_eq!(rank("script:bad.jsonl"), ["2", "2"]);
    assert_eq!(rank("random"), ["", ""]);
    // What is below the words alone is there: the model in the dark against itself without images.
    let good = find(&board, &[("model", "script:good.jsonl")]);
    assert_eq!(good["below_blind"], "L5");
    for run in ["one", "two"] {
        let page = fs::read(bench.path(&format!("site/runs/{run}.html"))).unwrap();
        let own = fs::read(bench.path(&format!("{run}/report.html"))).unwrap();
        assert!(page == own, "{run}");
    }
    let data = fs::read(bench.path("site/data.json")).unwrap();
    let data: Value = serde_json::from_slice(&data).unwrap();
    assert_eq!(data["schema"], "darkqa.site/1");
    assert_eq!(data["groups"][0]["rows"].as_array().unwrap().len(), 3);
    let ranking = data["groups"][0]["ranking"].as_str().unwrap();
    insta::assert_snapshot!(redacted(ranking), @"
    Ranks are by mean accuracy over the dark levels (L3, L5), on the 48 items that both models answered at all
        levels from L0 (12 frames), corrected by Holm over 1 pair.
    ");
    // A column for each level, darkest last; the better model is never right at L5.
    let index = fs::read(bench.path("site/index.html")).unwrap();
    let text = String::from_utf8_lossy(&index);
    let heads: Vec<&str> =
        text.split("<th scope=\"col\"").skip(1).map(|head| &head[..head.find("</th>").unwrap()]).collect();
    let at = |name: &str| heads.iter().position(|head| head.ends_with(&format!(">{name}"))).unwrap();
    assert_eq!([at("L0 in %"), at("L3 in %"), at("L5 in %"), at("area in %")], [3, 4, 5, 6]);
    let good = text.split("<tr data-words=\"script:good.jsonl one\">").nth(1).unwrap();
    let cells: Vec<&str> = good.split("data-key=\"").skip(1).map(|cell| &cell[..cell.find('"').unwrap()]).collect();
    assert_eq!(cells[3..6], ["1", "1", "0"], "{cells:?}");
    // The model leads to the page of its run, each of its accuracies to the items there.
    let links: Vec<&str> = good[..good.find("</tr>").unwrap()]
        .split("href=\"")
        .skip(1)
        .map(|link| &link[..link.find('"').unwrap()])
        .collect();
    let items = "runs/one.html#model=script%3Agood%2Ejsonl&amp;light=";
    let links: Vec<String> = links.iter().map(|link| link.replace("&#x2f;", "/")).collect();
    let expected = [
        "runs/one.html",
        &format!("{items}untouched&amp;level=L0"),
        &format!("{items}with%20noise&amp;level=L3"),
        &format!("{items}with%20noise&amp;level=L5"),
    ];
    assert_eq!(links, expected);
    // A site is made again byte for byte.
    bench.complete(&words("site one two --out site"));
    assert!(fs::read(bench.path("site/index.html")).unwrap() == index);
}

#[test]
fn tables_share_only_equal_settings() {
    let bench = Bench::with_questions(6);
    scripts(&bench);
    let run = |out: &str, more: &str| {
        let line = format!("--model script:good.jsonl --data set.jsonl --levels L0,L5 --out {out} {more}");
        bench.complete(&words(&line));
    };
    run("one", "");
    run("same", "--model script:bad.jsonl");
    run("seed", "--seed 1");
    let set = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    let fewer: Vec<&str> = set.lines().take(4).collect();
    bench.file(
        "set.jsonl",
        fewer.join(
            "
",
        ) + "
",
    );
    run("fewer", "");
    let said = bench.complete(&words("site one same seed fewer --out site"));
    insta::assert_snapshot!(redacted(&said), @"site: site/index.html (runs: 4, tables: 3)");
    let data = fs::read(bench.path("site/data.json")).unwrap();
    let data: Value = serde_json::from_slice(&data).unwrap();
    let differs = |group: usize| data["groups"][group]["differs"]["lines"].to_string();
    assert!(data["groups"][0].get("differs").is_none());
    insta::assert_snapshot!(redacted(&differs(1)), @r#"["--seed is 0 in table 1 and 1 in this one","6 of 12 images differ"]"#);
    insta::assert_snapshot!(redacted(&differs(2)), @r#"["questions is 63dc5e4e… in table 1 and f46cbe54… in this one"]"#);
    // The same model in two runs stands twice, and neither is better.
    let board = rows(&bench, "site/leaderboard.csv");
    let twice: Vec<_> = board.iter().filter(|row| row["group"] == "1" && row["model"] == "script:good.jsonl").collect();
    assert_eq!(twice.len(), 2);
    assert_eq!(twice[0]["rank_first"], twice[1]["rank_first"]);
}

#[test]
fn foreign_text_is_escaped() {
    let bench = Bench::with_questions(3);
    let evil = "<img src=x onerror=alert(1)>.jsonl";
    bench.file(evil, "{\"default\": \"A\"}\n");
    let model = format!("script:{evil}");
    let out = "a\"b'<i>";
    let line = ["--model", &model, "--data", "set.jsonl", "--levels", "L0,L5", "--out", out];
    bench.complete(&line);
    // A version and a date of anybody's.
    let manifest = bench.path(out).join("manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version));
    fs::write(&manifest, text.replace(&version, "\"version\": \"</script><script>alert(2)</script>\"")).unwrap();
    bench.complete(&["site", out, "--out", "site"]);
    let index = fs::read_to_string(bench.path("site/index.html")).unwrap();
    assert!(index.contains("&lt;img src=x onerror=alert(1)&gt;"), "{index}");
    for markup in ["<img", "<i>", "<script>alert", "javascript:"] {
        assert!(!index.contains(markup), "{markup}");
    }
    // One script, its own; nothing is asked for from elsewhere.
    assert_eq!(index.matches("<script").count(), 1);
    for outside in ["http://", "https://", "url(", "@import", "src="] {
        let own = index.replace("onerror", "").replace("img src=x", "");
        assert!(!own.contains(outside), "{outside}");
    }
    for path in files(&bench.path("site")) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)), "{name}");
    }
}

#[test]
fn unreadable_and_foreign_folders_are_refused() {
    let bench = Bench::with_questions(3);
    let line = "--model random --data set.jsonl --levels L0,L5 --out";
    for run in ["one", "broken", "older"] {
        bench.complete(&words(&format!("{line} {run}")));
    }
    bench.file("broken/records.jsonl", "{\"no\": \"record\"}\n");
    let manifest = fs::read_to_string(bench.path("older/manifest.json")).unwrap();
    bench.file("older/manifest.json", manifest.replace("darkqa.run/2", "darkqa.run/1"));
    for (runs, expected) in [
        ("one broken", "broken/records.jsonl, line 1"),
        ("one older", "older/manifest.json: this run was made by an earlier version"),
        ("one nowhere", "nowhere: no run in this folder"),
        ("one one", "one is named twice"),
    ] {
        let refused = bench.call(&words(&format!("site {runs} --out site")));
        assert_eq!(refused.code, Some(2), "{runs}: {refused:?}");
        assert!(refused.stderr.contains(expected), "{runs}: {refused:?}");
        assert!(!bench.path("site").exists(), "{runs}");
    }
    bench.file("mine/notes.txt", "mine");
    let refused = bench.call(&words("site one --out mine"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: mine: the folder is not empty and holds no site; name another --out
    ");
    assert_eq!(files(&bench.path("mine")).len(), 1);
    // A page of a run that is no longer named is not deleted, and said.
    bench.complete(&words(&format!("{line} two --seed 1")));
    bench.complete(&words("site one two --out site"));
    let said = bench.complete(&words("site one --out site"));
    insta::assert_snapshot!(redacted(&said), @"
    runs/two.html: this page belongs to no run of this site; it can be deleted
    site: site/index.html (runs: 1, tables: 1)
    ");
    assert!(bench.path("site/runs/two.html").exists());
}

#[cfg(unix)]
#[test]
fn no_page_is_written_through_link() {
    let bench = Bench::with_questions(3);
    bench.complete(&words("--model random --data set.jsonl --levels L0,L5 --out one"));
    bench.complete(&words("site one --out site"));
    fs::remove_dir_all(bench.path("site/runs")).unwrap();
    fs::create_dir(bench.path("elsewhere")).unwrap();
    std::os::unix::fs::symlink(bench.path("elsewhere"), bench.path("site/runs")).unwrap();
    let refused = bench.call(&words("site one --out site"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: site/runs: a link; its folder would be written to. Delete the link, or name another --out
    ");
    assert!(files(&bench.path("elsewhere")).is_empty());
}

#[test]
fn open_questions_have_own_table() {
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    for out in ["one", "two"] {
        let line = format!("--model script:a.jsonl --judge script:j.jsonl --levels L0,L3 --out {out}");
        assert_eq!(house.call(&words(&line)).code, Some(0));
    }
    let bench = &house.0;
    bench.complete(&words("--model random --data rooms:frames=2,size=96x64 --levels L0,L3 --out closed"));
    bench.complete(&words("--model random --data rooms:frames=2,size=96x64 --ask home --levels L0,L3 --out own"));
    bench.complete(&words("--blind-model random --data rooms:frames=2,size=96x64 --levels L0,L3 --out blind"));
    bench.complete(&words("--model random --data rooms:frames=2,size=96x64 --light dark --out dark"));
    let said = bench.complete(&words("site one two closed own blind dark --out site"));
    insta::assert_snapshot!(redacted(&said), @"
    own: in no table: nobody knows the true answers to its questions
    blind: in no table: no model was shown an image
    site: site/index.html (runs: 6, tables: 3)
    ");
    let board = rows(bench, "site/openeqa.csv");
    let cells: Vec<_> = rows(bench, "one/summary.csv");
    let mut compared = 0;
    for row in board.iter().filter(|row| row["run"] == "one") {
        let variant = match (&*row["level"], &*row["light"]) {
            ("L0", _) => "none",
            (_, "with noise") => "noise",
            _ => "ev",
        };
        let own = find(&cells, &[("level", &row["level"]), ("variant", variant), ("enhancer", ""), ("group", "all")]);
        for (name, other) in [("score", "value"), ("low", "low"), ("high", "high"), ("n", "n")] {
            assert_eq!(row[name], own[other].trim_end_matches(".0"), "{name}");
        }
        compared += 1;
    }
    assert!(compared > 1);
    let index = fs::read_to_string(bench.path("site/index.html")).unwrap();
    let index = index.replace("&#x2f;", "/");
    assert!(index.contains("These rows are not ranked"));
    assert!(index.contains("runs/own.html"));
}
