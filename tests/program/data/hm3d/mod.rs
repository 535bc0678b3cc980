//! `import script habitat`: the script renders a stand-in for HM3D with a stand-in for habitat-sim (`habitat_sim.py`),
//! and what it renders is imported and asked about. habitat-sim itself is in no test.

mod house;

use std::fs;

use serde_json::Value;

use crate::support::snapshot::redacted;
use house::{ANNOTATED, House, PLAIN};

const BED: &str = "00800-aaaaAAAA111";
const SECOND: &str = "00801-bbbbBBBB222";
const UNANNOTATED: &str = "00802-ccccCCCC333";

/// Three scenes, one of them without annotation, and a walk through each, written by other versions of attrs and NumPy.
fn house() -> House {
    let house = House::new();
    house.scene(BED);
    house.scene(SECOND);
    house.scene(UNANNOTATED);
    fs::remove_file(house.path("HM3D/val/00802-ccccCCCC333/ccccCCCC333.semantic.txt")).unwrap();
    house
}

fn walks(house: &House) {
    house.walk("000-hm3d-aaaaAAAA111", 41, "attrs21");
    house.walk("001-hm3d-bbbbBBBB222", 21, "attrs22");
    house.walk("002-hm3d-ccccCCCC333", 1, "protocol2");
    house.walk("003-hm3d-ddddDDDD444", 1, "attrs21");
}

fn names(list: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    list.as_array().unwrap().iter().map(|entry| (text(&entry["name"]), text(&entry["why"]))).collect()
}

#[test]
fn walks_become_frames_and_questions() {
    let house = house();
    walks(&house);
    let said = house.render(ANNOTATED, "renders", &["--walks", "states"], 0);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    00800-aaaaAAAA111: 3 frames (1 of 3 scenes)
    00801-bbbbBBBB222: 2 frames (2 of 3 scenes)
    00802-ccccCCCC333: skipped: no .semantic.txt
    renders: 5 frames of 2 scenes; 2 skipped, 0 refused
    ");
    let record = house.json("renders/scenes.json");
    let skipped = names(&record["skipped"]);
    let skipped: Vec<&str> = skipped.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(skipped, ["003-hm3d-ddddDDDD444", UNANNOTATED]);

    house.import("renders", "frames");
    let lines = house.lines("frames/frames.jsonl");
    let frames: Vec<String> =
        lines.iter().map(|line| format!("{} {} {}", line["scene"], line["frame"], line["t"])).collect();
    let expected = [(BED, "00000", 0.0), (BED, "00020", 2.0), (BED, "00040", 4.0)];
    let more = [(SECOND, "00000", 0.0), (SECOND, "00020", 2.0)];
    let expected: Vec<String> =
        expected.iter().chain(&more).map(|(scene, frame, time)| format!("{scene:?} {frame:?} {time:?}")).collect();
    assert_eq!(frames, expected);
    // The camera is at the place of the first state, 1.25 m above it, and looks along -z with 90 degrees of view.
    let pose: Vec<f64> = serde_json::from_value(lines[0]["pose"].clone()).unwrap();
    let expected = [1., 0., 0., 3.2, 0., 1., 0., 1.25, 0., 0., 1., 2.5, 0., 0., 0., 1.];
    assert!(pose.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6));
    assert!((lines[0]["intrinsics"]["fx"].as_f64().unwrap() - 32.0).abs() < 1e-9);

    let carried = &house.json("frames/dataset.json")["renders"];
    assert_eq!(carried, &record);
    assert_eq!(carried["mode"], "walks");
    assert_eq!(carried["rate_guessed"], 10.0);
    let bed = &carried["scenes"][0];
    assert_eq!((&bed["scene"], &bed["frames"]), (&BED.into(), &3.into()));
    assert_eq!(bed["settings"]["habitat_sim"], "0.3.3");
    assert_eq!(bed["walks"][0]["name"], "000-hm3d-aaaaAAAA111");
    assert_eq!(bed["walks"][0]["states"], 41);
    assert!(house.questions("frames") > 0);
}

#[test]
fn covering_places_become_frames_and_questions() {
    let house = house();
    house.render(ANNOTATED, "renders", &["--cover"], 0);
    let record = house.json("renders/scenes.json");
    let scene = &record["scenes"][0];
    let cover = &scene["cover"];
    // Two areas of one height are one floor; the small island is not visited.
    assert_eq!(cover["floors"], 2, "{cover}");
    assert!(cover["places"].as_u64().unwrap() > 3, "{cover}");
    assert!(cover["farthest_sample_m"].as_f64().unwrap() <= 1.5);
    let (samples, free) = (cover["samples"].as_u64(), cover["free"].as_u64());
    assert!(samples == Some(4000) && free < samples, "{cover}");
    let views = 4 * cover["places"].as_u64().unwrap();
    let left_out = scene["left_out"].as_object().unwrap();
    let dropped: u64 = left_out.values().filter_map(Value::as_u64).sum();
    assert_eq!(scene["frames"].as_u64().unwrap() + dropped, views);

    house.import("renders", "frames");
    let lines = house.lines("frames/frames.jsonl");
    assert!(lines.iter().all(|line| line.get("t").is_none()));
    // Upstairs there is nothing to see.
    assert!(dropped > 0);
    for step in house.lines(&format!("renders/{BED}/trajectory.jsonl")) {
        let place = |i: usize| step["pose"][i].as_f64().unwrap();
        assert!((2.0..=5.0).contains(&place(3)) && (place(7) - 1.5).abs() < 1e-6, "{step}");
    }
    assert_eq!(house.json("frames/dataset.json")["renders"], record);
    assert!(house.questions("frames") > 0);
}

#[test]
fn seed_decides_the_bytes() {
    let house = house();
    for (out, seed) in [("a", "3"), ("b", "3"), ("c", "4")] {
        let flags = ["--cover", "--seed", seed, "--scenes", "aaaaAAAA111"];
        house.render(ANNOTATED, out, &flags, 0);
    }
    assert_eq!(house.files("a"), house.files("b"));
    assert!(house.files("a").len() > 10);
    let trajectory = format!("{BED}/trajectory.jsonl");
    assert_ne!(house.files("a")[&trajectory], house.files("c")[&trajectory]);
}

#[test]
fn rendered_scenes_are_not_repeated() {
    let house = house();
    walks(&house);
    let flags = ["--walks", "states"];
    house.render(ANNOTATED, "renders", &flags, 0);
    let before = house.files("renders");
    assert_eq!(house.opened(), ["aaaaAAAA111.basis.glb", "bbbbBBBB222.basis.glb"]);
    let said = house.render(ANNOTATED, "renders", &flags, 0);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    00800-aaaaAAAA111: done already
    00801-bbbbBBBB222: done already
    00802-ccccCCCC333: skipped: no .semantic.txt
    renders: 5 frames of 2 scenes; 2 skipped, 0 refused
    ");
    assert_eq!(house.opened().len(), 2);
    assert_eq!(house.files("renders"), before);

    // A scene that was stopped half way lies in partial/, and is begun again.
    fs::remove_dir_all(house.path("renders").join(SECOND)).unwrap();
    fs::create_dir_all(house.path("renders/partial").join(SECOND).join("rgb")).unwrap();
    house.render(ANNOTATED, "renders", &flags, 0);
    assert_eq!(house.opened().len(), 3);
    assert_eq!(house.files("renders"), before);

    let said = house.render(ANNOTATED, "renders", &["--walks", "states", "--every", "1"], 1);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    hm3d_frames.py: renders/00800-aaaaAAAA111 was rendered with another every_s: take another --out
    ");
    fs::create_dir(house.path("renders").join(UNANNOTATED)).unwrap();
    let said = house.render(ANNOTATED, "renders", &flags, 1);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    hm3d_frames.py: renders/00802-ccccCCCC333 exists, but has no done.json: remove it, or take another --out
    ");
}

#[test]
fn state_archive_is_read_unpacked() {
    let house = house();
    walks(&house);
    house.render(ANNOTATED, "from-folder", &["--walks", "states"], 0);
    house.archive("states.tgz", "hm3d-v0/README");
    let said = house.render(ANNOTATED, "from-archive", &["--walks", "states.tgz"], 0);
    insta::assert_snapshot!(redacted(&said), @"
    states.tgz: md5 [DIGEST], not OpenEQA's archive v0 ([DIGEST])
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    00800-aaaaAAAA111: 3 frames (1 of 3 scenes)
    00801-bbbbBBBB222: 2 frames (2 of 3 scenes)
    00802-ccccCCCC333: skipped: no .semantic.txt
    from-archive: 5 frames of 2 scenes; 2 skipped, 0 refused
    ");
    let (mut a, mut b) = (house.files("from-folder"), house.files("from-archive"));
    a.remove("scenes.json");
    b.remove("scenes.json");
    assert_eq!(a, b);

    house.archive("evil.tgz", "hm3d-v0/../../outside.pkl");
    let said = house.render(ANNOTATED, "evil", &["--walks", "evil.tgz"], 1);
    insta::assert_snapshot!(redacted(&said), @"
    evil.tgz: md5 [DIGEST], not OpenEQA's archive v0 ([DIGEST])
    hm3d_frames.py: evil.tgz: the member 'hm3d-v0/../../outside.pkl' is a link or leads out of the archive;
        nothing was rendered
    ");
    fs::write(house.path("cut.tgz"), &fs::read(house.path("states.tgz")).unwrap()[..900]).unwrap();
    let said = house.render(ANNOTATED, "cut", &["--walks", "cut.tgz"], 1);
    insta::assert_snapshot!(redacted(&said), @"
    cut.tgz: md5 [DIGEST], not OpenEQA's archive v0 ([DIGEST])
    hm3d_frames.py: cut.tgz: neither a folder nor a whole archive of tar: Compressed file ended before the
        end-of-stream marker was reached
    ");
}

#[test]
fn pickle_with_calls_is_refused() {
    let house = house();
    house.walk("000-hm3d-aaaaAAAA111", 3, "evil");
    house.walk("001-hm3d-bbbbBBBB222", 3, "attrs22");
    let said = house.render(ANNOTATED, "renders", &["--walks", "states"], 1);
    let refused = names(&house.json("renders/scenes.json")["refused"]);
    assert_eq!(refused.len(), 1, "{said}");
    let (name, why) = &refused[0];
    assert!(name == BED && why.contains("000-hm3d-aaaaAAAA111/00002.pkl"), "{why}");
    insta::assert_snapshot!(
        redacted(why),
        @"000-hm3d-aaaaAAAA111/00002.pkl: it names posix.system, which no agent state needs; nothing of it was run"
    );
    assert!(!house.path("states/hm3d-v0/000-hm3d-aaaaAAAA111/was-run").exists());
    // Read without care, the same pickle runs.
    house.unpickle("states/hm3d-v0/000-hm3d-aaaaAAAA111/00002.pkl");
    assert!(house.path("states/hm3d-v0/000-hm3d-aaaaAAAA111/was-run").exists());
    assert!(house.path("renders").join(SECOND).join("done.json").exists());

    fs::write(house.path("states/hm3d-v0/001-hm3d-bbbbBBBB222/00001.pkl"), "no pickle").unwrap();
    let said = house.render(ANNOTATED, "other", &["--walks", "states"], 1);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    00800-aaaaAAAA111: refused: 000-hm3d-aaaaAAAA111/00002.pkl: it names posix.system, which no agent state needs;
        nothing of it was run
    00801-bbbbBBBB222: refused: 001-hm3d-bbbbBBBB222/00001.pkl: not the state of an agent: KeyError: 110
    00802-ccccCCCC333: skipped: no .semantic.txt
    hm3d_frames.py: no scene was rendered; other/scenes.json says why of each
    ");
}

#[test]
fn scene_without_semantics_names_remedy() {
    let house = house();
    walks(&house);
    let said = house.render(PLAIN, "renders", &["--walks", "states"], 1);
    insta::assert_snapshot!(redacted(&said), @"
    the rate of walks is not stored: times are those of 10 states a second
    003-hm3d-ddddDDDD444: skipped: no folder NNNNN-ddddDDDD444 in --hm3d
    00800-aaaaAAAA111: refused: every semantic number of its first 3 frames is 0; habitat-sim writes 0 everywhere
        if the scene is not in the scene_dataset_config that it opens, or has no annotation there: set --config to
        hm3d_annotated_basis.scene_dataset_config.json of the HM3D in which --hm3d lies
    00801-bbbbBBBB222: refused: every semantic number of its first 2 frames is 0; habitat-sim writes 0 everywhere
        if the scene is not in the scene_dataset_config that it opens, or has no annotation there: set --config to
        hm3d_annotated_basis.scene_dataset_config.json of the HM3D in which --hm3d lies
    00802-ccccCCCC333: skipped: no .semantic.txt
    hm3d_frames.py: no scene was rendered; renders/scenes.json says why of each
    ");
    assert!(!house.path("renders").join(BED).exists());
    let said = house.render(PLAIN, "cover", &["--cover", "--scenes", BED], 1);
    insta::assert_snapshot!(redacted(&said), @"
    00800-aaaaAAAA111: refused: every semantic number of its first 8 frames is 0; habitat-sim writes 0 everywhere
        if the scene is not in the scene_dataset_config that it opens, or has no annotation there: set --config to
        hm3d_annotated_basis.scene_dataset_config.json of the HM3D in which --hm3d lies
    hm3d_frames.py: no scene was rendered; cover/scenes.json says why of each
    ");
}

#[test]
fn wrong_calls_say_what_is_expected() {
    let house = house();
    walks(&house);
    for (flags, says) in [
        (&["--cover", "--every", "2"][..], "--every goes with --walks"),
        (&["--walks", "states", "--height", "1"], "--height goes with --cover"),
        (&["--cover", "--size", "64"], "WIDTHxHEIGHT expected"),
        (&["--cover", "--hfov", "180"], "--hfov above 0 and below 180"),
        (&["--cover", "--walks", "states"], "not allowed with"),
    ] {
        let said = house.render(ANNOTATED, "out", flags, 2);
        assert!(said.contains(says), "{flags:?}: {said}");
    }
    for (flags, says) in [
        (&["--cover", "--scenes", "eeee"][..], "--scenes: no eeee in --hm3d"),
        (&["--walks", "nowhere"], "nowhere: no .pkl in it"),
    ] {
        let said = house.render(ANNOTATED, "out", flags, 1);
        assert!(said.contains(says), "{flags:?}: {said}");
    }
    let said = house.render("nowhere.json", "out", &["--cover"], 1);
    insta::assert_snapshot!(redacted(&said), @"hm3d_frames.py: --config HM3D/nowhere.json: no such file");
    fs::write(house.path("HM3D/val").join(BED).join("aaaaAAAA111.basis.glb"), ISLANDS).unwrap();
    let said = house.render(ANNOTATED, "out", &["--cover", "--scenes", BED], 1);
    insta::assert_snapshot!(redacted(&said), @"
    00800-aaaaAAAA111: refused: it has no navigation mesh (.basis.navmesh), which --cover needs
    hm3d_frames.py: no scene was rendered; out/scenes.json says why of each
    ");
}

#[test]
fn script_rules_hold_individually() {
    let house = House::new();
    house.check(include_str!("check_rules.py"));
}

/// A scene without a navigation mesh.
const ISLANDS: &str = r#"{"room": [0, 0, 0, 6, 2.6, 5], "boxes": [], "islands": []}"#;

#[test]
fn only_kind_habitat_has_script() {
    let house = House::new();
    let said = house.program(&["import", "nyu", "--script"], 2);
    insta::assert_snapshot!(redacted(&said), @"error: KIND: only the kind habitat has a script, not nyu");
    let said = house.program(&["import", "script", "habitat", "--every", "2"], 2);
    insta::assert_snapshot!(
        redacted(&said),
        @"error: unexpected argument '--every' found; tip: to pass '--every' as a value, use '-- --every'"
    );
    let said = house.program(&["import", "habitat"], 2);
    insta::assert_snapshot!(redacted(&said), @"error: the following required arguments were not provided: --src <DIR> --out <DIR>");
}
