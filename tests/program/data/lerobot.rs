//! `import lerobot`: frames of LeRobot data sets that the tests write. Tests of videos need ffmpeg and are skipped
//! without it.

use std::fs;

use serde_json::{Value, json};

use super::recordings::frames;
use crate::support::image_files::png;
use crate::support::lerobot::{FRONT, Set, WRIST, grey, picture, task};
use crate::support::run::{Bench, Called, words};
use crate::support::tools::has_ffmpeg;

/// A folder with this set in `set`.
fn with_set(set: &Set) -> Bench {
    let bench = Bench::new();
    set.write(&bench.path("set"));
    bench
}

fn import(bench: &Bench, line: &str) -> Called {
    bench.call(&[&["import", "lerobot", "set"], &words(line)[..]].concat())
}

/// Import of one camera into `out`.
fn import_front(bench: &Bench, line: &str) -> Called {
    import(bench, &format!("--camera {FRONT} --out out {line}"))
}

/// Episode and frame of each line.
fn places(bench: &Bench) -> Vec<[u64; 2]> {
    frames(bench).iter().map(|line| ["episode", "frame_index"].map(|key| line[key].as_u64().unwrap())).collect()
}

/// Changes `info.json`.
fn change_info(bench: &Bench, set: &Set, change: impl FnOnce(&mut Value)) {
    let mut info = set.info();
    change(&mut info);
    bench.file("set/meta/info.json", info.to_string());
}

const ALL: [[u64; 2]; 7] = [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2], [1, 3]];

#[test]
fn cameras_are_listed_without_a_folder() {
    let bench = with_set(&Set::default());
    insta::assert_snapshot!(import(&bench, ""), @"
    exit code: 0
    stdout:
    observation.images.depth  image  not read: depth  7 frames, 10.0 Hz, [TIME]
    observation.images.front  image  32×16            7 frames, 10.0 Hz, [TIME]
    observation.images.wrist  image  32×16            7 frames, 10.0 Hz, [TIME]
    5 further features without images
    LeRobot v3.0: 2 episodes, 2 tasks
    ");
    assert!(!bench.path("out").exists());
}

#[test]
fn a_camera_is_chosen() {
    let bench = with_set(&Set::default());
    insta::assert_snapshot!(import(&bench, "--out out"), @"
    exit code: 2
    stderr:
    error: --camera: several cameras have images; choose one or more of observation.images.front,
        observation.images.wrist
    ");
    insta::assert_snapshot!(import(&bench, "--topic top --out out"), @r#"
    exit code: 2
    stderr:
    error: --camera: no camera "top"; cameras with images: observation.images.front, observation.images.wrist
    "#);
    insta::assert_snapshot!(import(&bench, "--camera observation.images.depth --out out"), @"
    exit code: 2
    stderr:
    error: --camera: observation.images.depth has depth, which is not read; cameras with images:
        observation.images.front, observation.images.wrist
    ");
    assert!(!bench.path("out").exists());
}

#[test]
fn images_keep_bytes_episodes_and_tasks() {
    for version in ["v3.0", "v2.1", "v2.0"] {
        let set = Set { version, ..Set::default() };
        let bench = with_set(&set);
        let called =
            import(&bench, "--camera observation.images.front --camera observation.images.wrist --every 0 --out out")
                .ended(0);
        assert!(called.stdout.starts_with("out: 14 frames of 2 scenes (one episode each)\n"), "{called:?}");
        let lines = frames(&bench);
        assert_eq!(lines.len(), 14);
        for line in lines {
            let [episode, frame] = ["episode", "frame_index"].map(|key| line[key].as_u64().unwrap() as u32);
            let camera = line["topic"].as_str().unwrap();
            let file = fs::read(bench.path("out").join(line["rgb"].as_str().unwrap())).unwrap();
            assert_eq!(file, png(&picture(camera, episode, frame)), "{line}");
            assert_eq!(line["scene"], format!("set-{episode:04}"));
            assert_eq!(line["frame"], format!("{camera}-{frame:06}"));
            assert_eq!(line["task"], task(episode));
            assert_eq!(line["fps"], 10.0);
            let time = line["t"].as_f64().unwrap();
            assert!((time - f64::from(frame) / 10.0).abs() < 1e-6, "{line}");
        }
        let info: Value = serde_json::from_slice(&fs::read(bench.path("out/dataset.json")).unwrap()).unwrap();
        assert_eq!(info["topics"], json!([FRONT, WRIST]));
        assert_eq!(info["codebase_version"], version);
    }
}

#[test]
fn unnamed_index_of_pandas_has_the_tasks() {
    let set = Set { task_column: "__index_level_0__", ..Set::default() };
    let bench = with_set(&set);
    import_front(&bench, "").ended(0);
    assert_eq!(frames(&bench)[1]["task"], task(1));
}

#[test]
fn frames_without_tasks_are_taken() {
    let bench = with_set(&Set::default());
    fs::remove_file(bench.path("set/meta/tasks.parquet")).unwrap();
    let called = import_front(&bench, "").ended(1);
    assert!(called.stderr.contains("set/meta/tasks.parquet: no such file; the frames have no task"), "{called:?}");
    assert_eq!(frames(&bench)[0].get("task"), None);
}

#[test]
fn flags_choose_frames_in_each_episode() {
    let bench = with_set(&Set::default());
    let all: &[[u64; 2]] = &ALL;
    for (line, expected) in [
        ("", &[[0, 0], [1, 0]][..]),
        ("--every 0", all),
        ("--every 0.2", &[[0, 0], [0, 2], [1, 0], [1, 2]]),
        ("--at 0.1,0.3", &[[0, 1], [1, 1], [1, 3]]),
        ("--max-frames 1", &[[0, 0], [1, 0]]),
        // The frames differ by 10 codes, and the first of an episode is always taken.
        ("--changed 15", &[[0, 0], [0, 2], [1, 0], [1, 2]]),
        ("--changed 5", all),
    ] {
        import_front(&bench, &format!("--force {line}")).ended(0);
        assert_eq!(places(&bench), expected, "{line}");
    }
}

#[test]
fn frames_of_joined_videos_are_those_of_the_rows() {
    if !has_ffmpeg() {
        return;
    }
    for version in ["v3.0", "v2.1"] {
        let set = Set { version, videos: true, ..Set::default() };
        let bench = with_set(&set);
        for (line, expected) in [
            ("--every 0", &ALL[..]),
            ("--every 0.2", &[[0, 0], [0, 2], [1, 0], [1, 2]]),
            ("--at 0.2", &[[0, 2], [1, 2]]),
            ("--changed 15", &[[0, 0], [0, 2], [1, 0], [1, 2]]),
        ] {
            import_front(&bench, &format!("--force {line}")).ended(0);
            assert_eq!(places(&bench), expected, "{version} {line}");
            for line in frames(&bench) {
                let [episode, frame] = ["episode", "frame_index"].map(|key| line[key].as_u64().unwrap() as u32);
                let path = bench.path("out").join(line["rgb"].as_str().unwrap());
                let found = image::open(path).unwrap().into_rgb8()[(16, 8)].0[1];
                let expected = grey(FRONT, episode, frame);
                assert!(found.abs_diff(expected) <= 3, "{found}, not {expected}: {line}");
            }
        }
    }
}

#[test]
fn a_slower_camera_gives_its_own_frames() {
    if !has_ffmpeg() {
        return;
    }
    let set = Set { lengths: vec![4, 4], videos: true, wrist_fps: 5, ..Set::default() };
    let bench = with_set(&set);
    import(&bench, &format!("--camera {WRIST} --every 0 --out out")).ended(0);
    assert_eq!(places(&bench), [[0, 0], [0, 2], [1, 0], [1, 2]]);
    let last = &frames(&bench)[3];
    let path = bench.path("out").join(last["rgb"].as_str().unwrap());
    let found = image::open(path).unwrap().into_rgb8()[(16, 8)].0[1];
    assert!(found.abs_diff(grey(WRIST, 1, 2)) <= 3, "{found}");
}

#[test]
fn missing_and_cut_videos_are_named() {
    if !has_ffmpeg() {
        return;
    }
    let set = Set { version: "v2.1", videos: true, ..Set::default() };
    let bench = with_set(&set);
    let video = |episode: u32| bench.path(&format!("set/videos/chunk-000/{FRONT}/episode_{episode:06}.mp4"));
    // The second episode gets the video of the first, which is one frame shorter.
    fs::copy(video(0), video(1)).unwrap();
    let called = import_front(&bench, "--every 0").ended(1);
    assert!(
        called.stderr.contains("no frame at 0.300 s, of episode 1; 1 frame of observation.images.front left out"),
        "{called:?}"
    );
    assert_eq!(places(&bench), ALL[..6]);
    fs::remove_file(video(0)).unwrap();
    let called = import_front(&bench, "--every 0 --force").ended(1);
    assert!(
        called.stderr.contains("no such file")
            && called.stderr.contains("3 frames of observation.images.front left out"),
        "{called:?}"
    );
    assert_eq!(places(&bench), ALL[3..6]);
    fs::remove_file(video(1)).unwrap();
    import_front(&bench, "--every 0 --force").ended(2);
}

#[test]
fn unknown_versions_are_refused_with_a_remedy() {
    let set = Set::default();
    let bench = with_set(&set);
    for version in ["v1.6", "v4.0"] {
        change_info(&bench, &set, |info| {
            info["codebase_version"] = json!(version);
        });
        let refused = import_front(&bench, "").ended(2);
        let remedy = if version == "v1.6" {
            "python -m lerobot.datasets.v2.convert_dataset_v1_to_v2 --repo-id USER/NAME"
        } else {
            "hf download USER/NAME --repo-type dataset --revision v3.0"
        };
        assert!(
            refused.stderr.contains(version)
                && refused.stderr.contains("v2.0, v2.1 or v3.0 expected")
                && refused.stderr.contains(remedy),
            "{refused:?}"
        );
    }
    // Minor versions keep the layout.
    change_info(&bench, &set, |info| {
        info["codebase_version"] = json!("v3.1");
    });
    import_front(&bench, "").ended(0);
    bench.file("old/meta_data/info.json", "{\"codebase_version\": \"v1.6\"}");
    let refused = bench.call(&["import", "lerobot", "old"]).ended(2);
    assert!(refused.stderr.contains("convert_dataset_v1_to_v2"), "{refused:?}");
    insta::assert_snapshot!(bench.call(&["import", "lerobot", "."]), @"
    exit code: 2
    stderr:
    error: .: no meta/info.json in this folder: not a LeRobot data set; name the folder that has meta, data and
        videos
    ");
}

#[test]
fn a_set_without_episodes_is_refused() {
    for version in ["v3.0", "v2.1"] {
        let set = Set { version, lengths: Vec::new(), ..Set::default() };
        let bench = with_set(&set);
        for line in ["", "--camera observation.images.front --out out"] {
            let refused = import(&bench, line).ended(2);
            assert!(refused.stderr.contains("the set has no episodes"), "{refused:?}");
        }
        if version == "v3.0" {
            fs::remove_dir_all(bench.path("set/meta/episodes")).unwrap();
            let refused = import(&bench, "").ended(2);
            assert!(refused.stderr.contains("has no episodes"), "{refused:?}");
        }
    }
}

#[test]
fn a_damaged_data_file_leaves_the_others() {
    let set = Set { version: "v2.1", ..Set::default() };
    let bench = with_set(&set);
    let path = bench.path("set/data/chunk-000/episode_000000.parquet");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() - 9]).unwrap();
    let called = import_front(&bench, "--every 0").ended(1);
    assert!(called.stderr.contains("episode_000000.parquet: not a whole Parquet file"), "{called:?}");
    assert_eq!(places(&bench), ALL[3..]);
    fs::write(&path, "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n").unwrap();
    let called = import_front(&bench, "--every 0 --force").ended(1);
    assert!(called.stderr.contains("git lfs pull"), "{called:?}");
}

#[test]
fn rows_that_contradict_meta_are_named() {
    let set = Set { version: "v2.1", ..Set::default() };
    let bench = with_set(&set);
    bench.file(
        "set/meta/episodes.jsonl",
        "{\"episode_index\": 0, \"length\": 5}\n{\"episode_index\": 1, \"length\": 4}\n",
    );
    let called = import_front(&bench, "--every 0").ended(1);
    assert!(called.stderr.contains("episode 0: 3 frames, but meta states 5"), "{called:?}");
    assert_eq!(places(&bench), ALL);
}

#[test]
fn episodes_without_rows_are_named() {
    let bench = with_set(&Set::default());
    let short = with_set(&Set { lengths: vec![3], ..Set::default() });
    let data = "set/data/chunk-000/file-000.parquet";
    fs::copy(short.path(data), bench.path(data)).unwrap();
    let called = import_front(&bench, "--every 0").ended(1);
    assert!(called.stderr.contains("episode 1: 0 frames, but meta states 4"), "{called:?}");
    assert_eq!(places(&bench), ALL[..3]);
    // The other way round: rows of an episode that meta does not have.
    fs::copy(with_set(&Set::default()).path(data), short.path(data)).unwrap();
    let called = import_front(&short, "--every 0").ended(1);
    assert!(called.stderr.contains("4 rows of no episode that meta has in this file, left out"), "{called:?}");
    assert_eq!(places(&short), ALL[..3]);
}

#[test]
fn times_after_an_episode_are_named() {
    let bench = with_set(&Set::default());
    let called = import_front(&bench, "--at 0.1,0.3").ended(0);
    assert!(called.stderr.contains("--at: no frame at one of its times in 1 episode"), "{called:?}");
    let called = import_front(&bench, "--at 0.2 --force").ended(0);
    assert!(!called.stderr.contains("--at"), "{called:?}");
}

#[test]
fn paths_lead_to_no_file_outside() {
    let set = Set::default();
    let bench = with_set(&set);
    fs::copy(bench.path("set/data/chunk-000/file-000.parquet"), bench.path("secret.parquet")).unwrap();
    let absolute = bench.path("secret.parquet").display().to_string();
    for path in ["../secret.parquet", "data/../../secret.parquet", &absolute] {
        change_info(&bench, &set, |info| info["data_path"] = json!(path));
        let refused = import_front(&bench, "").ended(2);
        assert!(refused.stderr.contains("lies outside set/, the folder of the data"), "{refused:?}");
        assert!(!bench.path("out").exists());
    }
    // The remedy in the message.
    import_front(&bench, "--data-root .").ended(0);
    assert_eq!(places(&bench).len(), 2);
}

#[test]
fn camera_names_lead_to_no_video_outside() {
    let set = Set { videos: true, ..Set::default() };
    if !has_ffmpeg() {
        return;
    }
    let bench = with_set(&set);
    fs::copy(bench.path(&format!("set/videos/{FRONT}/chunk-000/file-000.mp4")), bench.path("secret.mp4")).unwrap();
    change_info(&bench, &set, |info| {
        info["video_path"] = json!("videos/{video_key}/../../../secret.mp4");
    });
    let refused = import_front(&bench, "").ended(2);
    assert!(refused.stderr.contains("lies outside"), "{refused:?}");
    assert!(!bench.path("out").exists());
}

#[cfg(unix)]
#[test]
fn links_lead_to_no_file_outside() {
    use std::os::unix::fs::symlink;

    let bench = with_set(&Set::default());
    let data = bench.path("set/data/chunk-000/file-000.parquet");
    fs::rename(&data, bench.path("secret.parquet")).unwrap();
    symlink(bench.path("secret.parquet"), &data).unwrap();
    let refused = import_front(&bench, "").ended(2);
    assert!(refused.stderr.contains("lies outside"), "{refused:?}");
    // A folder of meta.
    fs::remove_file(&data).unwrap();
    fs::rename(bench.path("secret.parquet"), &data).unwrap();
    let episodes = bench.path("set/meta/episodes");
    fs::rename(&episodes, bench.path("secret")).unwrap();
    symlink(bench.path("secret"), &episodes).unwrap();
    let refused = import_front(&bench, "").ended(2);
    assert!(refused.stderr.contains("lies outside"), "{refused:?}");
    // A link inside the folder.
    fs::remove_file(&episodes).unwrap();
    fs::rename(bench.path("secret"), bench.path("set/meta/real")).unwrap();
    symlink("real", &episodes).unwrap();
    import_front(&bench, "").ended(0);
}

/// A hub's cache has links from a snapshot to the files in `blobs`.
#[cfg(unix)]
#[test]
fn cached_repository_is_read() {
    use std::os::unix::fs::symlink;

    let bench = with_set(&Set::default());
    let cache = "datasets--user--cups";
    for (number, path) in crate::support::run::files(&bench.path("set")).iter().enumerate() {
        let name = path.strip_prefix(bench.path("set")).unwrap();
        let blob = bench.file(&format!("{cache}/blobs/{number}"), fs::read(path).unwrap());
        let link = bench.path(&format!("{cache}/snapshots/abc")).join(name);
        fs::create_dir_all(link.parent().unwrap()).unwrap();
        symlink(blob, link).unwrap();
    }
    bench.file(&format!("{cache}/refs/main"), "abc");
    for folder in [cache.to_owned(), format!("{cache}/snapshots/abc")] {
        let words = ["import", "lerobot", &folder, "--camera", FRONT, "--out", "out", "--force"];
        bench.call(&words).ended(0);
        assert_eq!(frames(&bench)[0]["scene"], "cups-0000");
    }
}

/// ffmpeg reads playlists, which name other files, whatever the ending of their name.
#[test]
fn a_playlist_in_place_of_a_video_is_not_followed() {
    if !has_ffmpeg() {
        return;
    }
    let set = Set { videos: true, ..Set::default() };
    let bench = with_set(&set);
    let video = bench.path(&format!("set/videos/{FRONT}/chunk-000/file-000.mp4"));
    fs::rename(&video, bench.path("secret.mp4")).unwrap();
    let playlist = "ffconcat version 1.0\nfile 'secret.mp4'\n";
    fs::write(&video, playlist).unwrap();
    fs::copy(bench.path("secret.mp4"), video.with_file_name("secret.mp4")).unwrap();
    // The playlist works for a video that the user names.
    let name = format!("set/videos/{FRONT}/chunk-000/file-000.mp4");
    bench.call(&["import", "video", &name, "--out", "named"]).ended(0);
    let refused = import_front(&bench, "").ended(2);
    assert!(refused.stderr.contains("ffmpeg finds no video in it"), "{refused:?}");
}

/// A program `ffmpeg` that cannot decode AV1, with the words of a version.
#[cfg(unix)]
#[test]
fn a_missing_decoder_is_named_with_its_remedy() {
    let lines = [
        ("Decoder (codec av1) not found for input stream #0:0", 1),
        ("[dec:av1 @ 0x1] Decoding requested, but no decoder found for: av1", 1),
        ("[av1 @ 0x1] Your platform doesn't suppport hardware accelerated AV1 decoding.", 0),
    ];
    for (line, code) in lines {
        let set = Set { version: "v2.1", ..Set::default() };
        let bench = with_set(&set);
        change_info(&bench, &set, |info| {
            info["features"][FRONT]["dtype"] = json!("video");
        });
        for episode in 0..2 {
            let name = format!("set/videos/chunk-000/{FRONT}/episode_{episode:06}.mp4");
            bench.file(&name, "x");
        }
        let script = format!(
            "echo 'ffmpeg version 5.1.6 Copyright' >&2\necho '  Stream #0:0: Video: av1 (Main) (av01 / 0x31307661), yuv420p' >&2\necho \"{line}\" >&2\nexit {code}"
        );
        bench.program("ffmpeg", &script);
        let video = format!("set/videos/chunk-000/{FRONT}/episode_000000.mp4");
        let calls: [&[&str]; 2] = [
            &["import", "lerobot", "set", "--camera", FRONT, "--out", "out"],
            &["import", "video", &video, "--out", "out"],
        ];
        for words in calls {
            let refused = bench.call_with_programs(words).ended(2);
            assert!(
                refused.stderr.starts_with("error: ffmpeg: the installed one has no decoder for av1")
                    && refused.stderr.contains("apt install ffmpeg"),
                "{line}: {refused:?}"
            );
        }
    }
}

#[test]
fn data_flag_names_the_import() {
    let set = Set::default();
    let bench = with_set(&set);
    let check = |line: &str| {
        let called = bench.call(&[&["check", "--model", "random", "--data", "set"], &words(line)[..]].concat());
        format!("{}{}", called.stdout, called.stderr)
    };
    for line in ["--ask home", ""] {
        let text = check(line);
        assert!(text.contains("darkqa-eval import lerobot set"), "{line}: {text}");
    }
    change_info(&bench, &set, |info| *info = json!({"fps": 10}));
    for line in ["--ask home", ""] {
        let text = check(line);
        assert!(!text.contains("lerobot"), "{line}: {text}");
    }
}

#[test]
fn frames_are_asked_by_episode() {
    let bench = with_set(&Set::default());
    import_front(&bench, "--every 0").ended(0);
    assert!(bench.path("out/classes.json").exists());
    let line = "--model random --data out --ask home --levels L0,L3 --out run";
    bench.call(&words(line)).ended(0);
    let text = fs::read_to_string(bench.path("run/records.jsonl")).unwrap();
    assert!(text.contains("set-0001/000003"), "{text}");
}
