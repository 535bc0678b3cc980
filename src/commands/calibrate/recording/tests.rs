use std::fs;

use super::*;

/// Creates a folder with empty files of these names.
fn folder(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }
    folder
}

/// Files of a setting with 2 bias frames and 3 exposures of one pair.
fn least(setting: &str) -> Vec<String> {
    let bias = (0..2).map(|i| format!("{setting}/bias/{i}.png"));
    let flats = (1..4).flat_map(|e| (0..2).map(move |i| format!("{setting}/flat-{e}/{i}.png")));
    bias.chain(flats).collect()
}

fn opened(files: &[String]) -> (tempfile::TempDir, Result<Recording>) {
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let folder = folder(&files);
    let recording = Recording::open(folder.path());
    (folder, recording)
}

#[test]
fn settings_are_ordered_by_number() {
    let files = ["iso800", "iso1600", "iso100", "low"].map(least).concat();
    let (_folder, recording) = opened(&files);
    let recording = recording.unwrap();
    let names = recording.settings.iter().map(|setting| &*setting.name);
    assert_eq!(names.collect::<Vec<_>>(), ["iso100", "iso800", "iso1600", "low"]);
    let numbers: Vec<_> = recording.settings.iter().map(SettingFiles::number).collect();
    assert_eq!(numbers, [Some(100.0), Some(800.0), Some(1600.0), None]);
    assert_eq!(recording.notes, [""; 0]);
    assert!(recording.first().ends_with("iso100/bias/0.png"));
}

/// The number of a camera model before it is ignored.
#[test]
fn the_last_number_of_a_name_counts() {
    for (name, number) in [
        ("a7s2-iso800", Some(800.0)),
        ("ISO1600", Some(1600.0)),
        ("gain1.5x", Some(1.5)),
        ("µ..5", Some(5.0)),
        ("5D4.iso100", Some(100.0)),
        ("é", None),
        ("1.2.3", None),
    ] {
        let setting = SettingFiles { name: name.to_owned(), ..SettingFiles::default() };
        assert_eq!(setting.number(), number, "{name}");
    }
    let files = ["a7s2-iso800", "a7s2-iso1600", "a7s2-iso100"].map(least);
    let (_folder, recording) = opened(&files.concat());
    let recording = recording.unwrap();
    let names = recording.settings.iter().map(|setting| &*setting.name);
    assert_eq!(names.collect::<Vec<_>>(), ["a7s2-iso100", "a7s2-iso800", "a7s2-iso1600"]);
}

/// Frames are paired in the order of recording, with or without leading zeros.
#[test]
fn frames_are_ordered_by_number() {
    let mut files = least("iso100");
    files.extend((2..12).map(|frame| format!("iso100/flat-2/{frame}.png")));
    files.extend((0..2).map(|frame| format!("iso100/flat-10/{frame}.png")));
    let (_folder, recording) = opened(&files);
    let exposures = &recording.unwrap().settings[0].exposures;
    let names: Vec<&str> = exposures.iter().map(|exposure| &*exposure.name).collect();
    assert_eq!(names, ["1", "2", "3", "10"]);
    let frames: Vec<_> =
        exposures[1].flats.iter().map(|path| path.file_stem()).map(|stem| stem.unwrap().to_str().unwrap()).collect();
    let taken: Vec<String> = (0..12).map(|frame| frame.to_string()).collect();
    assert_eq!(frames, taken);
}

#[test]
fn odd_flats_and_unknown_names_are_noted() {
    let mut files = least("iso100");
    files.extend(
        [
            "iso100/flat-2/2.png",
            "iso100/flats/0.png",
            "iso100/notes.txt",
            "iso100/dark-1/0.png",
            "iso100/dark-9/0.png",
            "iso100/dark-9/1.png",
            "iso100/.hidden",
            "readme.md",
            ".hidden",
        ]
        .map(str::to_owned),
    );
    let (_folder, recording) = opened(&files);
    let recording = recording.unwrap();
    for part in [
        "readme.md: no folder of a setting",
        "flats: none of bias/, flat-NAME/",
        "notes.txt: none of",
        "flat-2/2.png: without a partner",
        "dark-1/0.png: at least 2 dark frames",
        "dark frames of 9, an exposure without flats",
    ] {
        assert!(recording.notes.iter().any(|note| note.contains(part)), "{part}");
    }
    assert_eq!(recording.notes.len(), 6, "{:?}", recording.notes);
    let exposures = &recording.settings[0].exposures;
    assert_eq!(exposures.len(), 3);
    assert!(exposures.iter().all(|exposure| exposure.flats.len() == 2));
    assert!(exposures.iter().all(|exposure| exposure.dark.is_empty()));
}

/// The fewest files of a setting, except those with `part` in their names.
fn least_without(part: &str) -> Vec<String> {
    let mut files = least("iso100");
    files.retain(|file| !file.contains(part));
    files
}

#[test]
fn too_few_frames_are_refused() {
    for (files, part) in [
        (least_without("bias/0"), "1 bias frames and 3 exposures"),
        (least_without("flat-2/1"), "2 bias frames and 2 exposures"),
        (vec!["a.png".to_owned()], "no folder of a setting in it"),
        (vec!["iso100/a.png".to_owned()], "no frames of a setting"),
    ] {
        let (_folder, recording) = opened(&files);
        let error = recording.unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    assert!(Recording::open(Path::new("nowhere")).is_err());
}

const LIST: &str = "file,setting,kind,exposure
b0,100,bias,
b1,100,bias,
f0, 100, flat, short
f1,100,flat,short
f2,100,flat,middle
f3,100,flat,middle
f4,100,flat,long
f5,100,flat,long
d0,100,dark,long
d1,100,dark,long
w0,100,white,
";

#[test]
fn frames_can_be_listed() {
    let folder = folder(&["b0", "b1", "f0", "f1", "f2", "f3", "f4", "f5", "d0", "d1", "w0"]);
    let list = folder.path().join("frames.csv");
    fs::write(&list, LIST).unwrap();
    let recording = Recording::open(folder.path()).unwrap();
    let [setting] = &recording.settings[..] else {
        panic!("{recording:?}");
    };
    assert_eq!((setting.bias.len(), setting.white.len()), (2, 1));
    assert_eq!(setting.exposures[2].name, "long");
    assert_eq!(setting.exposures[2].dark.len(), 2);
    for (from, to, part) in [
        ("b1,100,bias", "b9,100,bias", "line 3: "),
        ("b1,100,bias", "b1,100,biass", "line 3: "),
        ("b1,100,bias", "b1,100,biass", "kind (bias, flat, dark or white)"),
        ("f1,100,flat,short", "f1,100,flat,", "line 5: a flat or dark frame needs"),
        ("file,", "files,", "columns file, setting, kind"),
        (LIST, "", "no frames in the list"),
    ] {
        fs::write(&list, LIST.replacen(from, to, 1)).unwrap();
        let error = Recording::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("frames.csv") && error.contains(part), "{error}");
    }
}

#[test]
fn numbers_are_compared_by_value() {
    let sorted = [
        "1.tif",
        "2.tif",
        "03.tif",
        "10.tif",
        "12.tif",
        "a",
        "a1",
        "a1b",
        "a1b2",
        "a1b10",
        "a007",
        "a7",
        "a8",
        "b",
        // Longer than any number of a type.
        "b99999999999999999999999999999999999998",
        "b99999999999999999999999999999999999999",
        "é2",
        "é10",
    ];
    let mut mixed = sorted;
    mixed.reverse();
    mixed.sort_by(|a, b| by_numbers(a, b));
    assert_eq!(mixed, sorted);
    // The control: the order of texts is another one.
    mixed.sort_unstable();
    assert_ne!(mixed, sorted);
}
