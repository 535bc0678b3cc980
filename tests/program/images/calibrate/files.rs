//! Files and folders that cannot be used: each is named.

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use super::sensor::{Form, Sensor, Shots, WHITE};
use super::{Bench, check_rows, measured, refused, write};
use crate::support::snapshot::redacted;

const SIDE: usize = 256;

static SMALL: LazyLock<Shots> = LazyLock::new(|| {
    let sensor = Sensor::new("nikon-d850", 1.0, SIDE, 9);
    Shots::take(&sensor, 2, 1)
});

/// A recording in the folder `cam` with one changed file.
fn recording(change: impl FnOnce(&Bench)) -> Bench {
    let bench = Bench::new();
    write(&bench, "cam", &SMALL);
    change(&bench);
    bench
}

fn file(bench: &Bench, name: &str) -> PathBuf {
    bench.path(&format!("cam/iso800/{name}"))
}

/// A change of the recording.
type Change = fn(&Bench);

/// The message with which each changed recording is refused.
fn refusals(changes: Vec<(&str, Change)>) -> String {
    let messages = changes.into_iter().map(|(name, change)| {
        let message = refused(&recording(change), &format!("cam --white {WHITE}"));
        format!("{name}: {}\n", redacted(&message))
    });
    messages.collect()
}

#[test]
fn unusable_files_are_named() {
    let rows: Vec<(&str, Change)> = vec![
        ("truncated", |bench| {
            let path = file(bench, "flat-1/01.pgm");
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        }),
        ("foreign", |bench| {
            fs::write(file(bench, "bias/notes.txt"), "shutter closed").unwrap();
        }),
        ("raw", |bench| {
            fs::rename(file(bench, "bias/01.pgm"), file(bench, "bias/01.dng")).unwrap();
        }),
        ("developed", |bench| {
            let image = image::RgbImage::new(SIDE as u32, SIDE as u32);
            fs::remove_file(file(bench, "bias/00.pgm")).unwrap();
            image.save(file(bench, "bias/00.png")).unwrap();
        }),
        ("mixed", |bench| {
            fs::remove_file(file(bench, "flat-2/01.pgm")).unwrap();
            let bytes = Form::Png.encode(&SMALL.flats[2][1], SIDE);
            fs::write(file(bench, "flat-2/01.png"), bytes).unwrap();
        }),
        ("sizes", |bench| {
            let frame = &SMALL.flats[2][1][..SIDE * (SIDE - 2)];
            let header = format!("P5 {SIDE} {} 65535 ", SIDE - 2);
            let samples = frame.iter().flat_map(|sample| sample.to_be_bytes());
            let bytes: Vec<u8> = header.bytes().chain(samples).collect();
            fs::write(file(bench, "flat-2/01.pgm"), bytes).unwrap();
        }),
        ("few", |bench| {
            fs::remove_dir_all(file(bench, "flat-3")).unwrap();
            fs::remove_dir_all(file(bench, "flat-4")).unwrap();
            fs::remove_file(file(bench, "flat-0/01.pgm")).unwrap();
        }),
    ];
    insta::assert_snapshot!(refusals(rows), @"
    truncated: error: cam/iso800/flat-1/01.pgm: not a whole PGM: the file ends early: 65527 bytes of samples, 131072 expected
    foreign: error: cam/iso800/bias/notes.txt: not a mosaic: a 16-bit PNG, a TIFF or a binary PGM expected; export the
        mosaic, for example as TIFF with `dcraw -D -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's
        `raw_image_visible` as 16-bit PNG
    raw: error: cam/iso800/bias/01.dng: a DNG file, the RAW format of a camera, is not read; export the mosaic, for
        example as TIFF with `dcraw -D -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's `raw_image_visible` as
        16-bit PNG
    developed: error: cam/iso800/bias/00.png: an RGB PNG of 8 bits; 16-bit grey expected, whose samples are the values
        themselves: a developed image holds no sensor noise; export the mosaic, for example as TIFF with `dcraw -D
        -4 -T -t 0 FILE` (`-t 0`: not turned), or rawpy's `raw_image_visible` as 16-bit PNG
    mixed: error: cam/iso800/flat-2/01.png: a 16-bit PNG, but cam/iso800/bias/00.pgm is a PGM with the maximum 65535; all
        frames must be exported in one way
    sizes: error: cam/iso800/flat-2/01.pgm: 256 × 254 sites, but cam/iso800/bias/00.pgm has 256 × 256; all frames must
        have one size
    few: error: cam/iso800: 2 bias frames and 2 exposures with a pair of flats; at least 2 and 3 are needed, 10 bias
        frames and 5 exposures of 2 pairs are better
    ");
}

/// Copies have no noise between them, whatever they are used for.
#[test]
fn copies_are_refused() {
    let rows: Vec<(&str, Change)> = vec![
        ("twice", |bench| {
            fs::copy(file(bench, "bias/00.pgm"), file(bench, "bias/01.pgm")).unwrap();
        }),
        ("twice in flats", |bench| {
            fs::copy(file(bench, "flat-1/00.pgm"), file(bench, "flat-2/01.pgm")).unwrap();
        }),
        ("bias frames as dark frames", |bench| {
            fs::create_dir(file(bench, "dark-3")).unwrap();
            for name in ["00.pgm", "01.pgm"] {
                let from = file(bench, &format!("bias/{name}"));
                fs::copy(from, file(bench, &format!("dark-3/{name}"))).unwrap();
            }
        }),
    ];
    insta::assert_snapshot!(refusals(rows), @"
    twice: error: cam/iso800/bias/01.pgm: the same frame as cam/iso800/bias/00.pgm; copies have no noise between them,
        use each frame once
    twice in flats: error: cam/iso800/flat-2/01.pgm: the same frame as cam/iso800/flat-1/00.pgm; copies have no noise between
        them, use each frame once
    bias frames as dark frames: error: cam/iso800/dark-3/00.pgm: the same frame as cam/iso800/bias/00.pgm; copies have no noise between them,
        use each frame once
    ");
}

#[test]
fn white_must_be_known() {
    let frame = |bench: &Bench, name: &str, frame: &[u16]| {
        let path = file(bench, name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, Form::Pgm.encode(frame, SIDE)).unwrap();
    };
    let bench = recording(|_| ());
    let message = refused(&bench, "cam");
    insta::assert_snapshot!(
        redacted(&message),
        @"error: cam: the code of white is not known: state it with --white, or add overexposed frames in SETTING/white/"
    );
    let mut white = vec![WHITE; SIDE * SIDE];
    white[..SIDE * SIDE * 2 / 3].fill(WHITE - 9);
    frame(&bench, "white/0.pgm", &white);
    let message = refused(&bench, "cam");
    insta::assert_snapshot!(redacted(&message), @"
    error: cam/iso800/white/0.pgm: 33.3 % of the samples are at the greatest code, 16383, and a frame in white/
        needs 50 %: overexpose it more, or state the code of white with --white
    ");
    frame(&bench, "white/0.pgm", &vec![WHITE; SIDE * SIDE]);
    frame(&bench, "white/1.pgm", &vec![WHITE - 1; SIDE * SIDE]);
    let message = refused(&bench, "cam");
    insta::assert_snapshot!(redacted(&message), @"
    error: cam/iso800/white/1.pgm: white is 16382, but 16383 in cam/iso800/white/0.pgm: state one code of white
        with --white
    ");
    let message = refused(&bench, "cam --white 400");
    insta::assert_snapshot!(
        redacted(&message),
        @"error: iso800: bias frames of 512 ADU are not below white, 400; see --white and the folders white/"
    );
    let message = refused(&bench, &format!("cam --white {WHITE} --black 20000"));
    insta::assert_snapshot!(redacted(&message), @"error: --black: the black level 20000 is not below white, 16383");
}

/// A code of white that the flats speak against is refused or named; overexposed frames may be equal.
#[test]
fn white_is_held_against_the_codes() {
    let warnings = |bench: &Bench, white: u16| -> Vec<String> {
        let found = measured(bench, &format!("cam --white {white}"));
        found["warnings"].as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned()).collect()
    };
    let bench = recording(|_| ());
    let message = refused(&bench, "cam --white 5000");
    insta::assert_snapshot!(redacted(&message), @"
    error: cam/iso800/flat-4/00.pgm and cam/iso800/flat-4/01.pgm: code 10474 is above white, 5000: state the
        greatest code of the sensor with --white, or see the frames in white/
    ");
    assert_eq!(warnings(&bench, WHITE), [""; 0]);
    let far = warnings(&bench, 65535);
    assert!(
        far.iter().any(|line| line.contains("the greatest code of the flats, ")
            && line.contains(" % of white, 65535: is white right?")),
        "{far:?}"
    );
    // The brightest exposure is overexposed: its frames are equal.
    let bench = recording(|bench| {
        for name in ["00.pgm", "01.pgm"] {
            let white = Form::Pgm.encode(&vec![WHITE; SIDE * SIDE], SIDE);
            fs::write(file(bench, &format!("flat-4/{name}")), white).unwrap();
        }
    });
    let left_out = warnings(&bench, WHITE);
    assert!(left_out.len() == 1 && left_out[0].ends_with("of a colour are at white, 16383; left out"), "{left_out:?}");
    let low = warnings(&bench, 20000);
    assert!(low.iter().any(|line| line.contains("is clipped at 16383, far below white, 20000")), "{low:?}");
}

#[test]
fn wrong_flags_are_named() {
    let bench = recording(|_| ());
    check_rows(
        [
            ("nowhere", "nowhere"),
            ("cam --white 70000", "--white"),
            ("cam --cfa RGB", "possible values: RGGB, BGGR, GRBG, GBRG, mono"),
            ("cam --crop 1,2,3", "--crop"),
            ("cam --white 9999 --crop 0,0,100,100", "100 × 100 sites are too few"),
            ("cam --white 9999 --max-pixels 100", "raise --decode max-pixels"),
            ("cam --out camera.svg", "--out: camera.svg does not end in .toml"),
            ("cam --out mycam", "--out: mycam does not end in .toml"),
            ("cam --out out/my.cam", "--out: out/my.cam does not end in .toml"),
        ],
        |(line, part)| {
            let message = refused(&bench, line);
            assert!(message.contains(part), "{line}: {message}");
        },
    );
}

/// The same frames, found by their folders and by a list.
#[test]
fn a_list_of_frames_replaces_folders() {
    let bench = recording(|_| ());
    let line = format!("cam --white {WHITE}");
    let by_folder = measured(&bench, &line);
    let mut list = "file,setting,kind,exposure\n".to_owned();
    for kind in ["bias", "flat-0", "flat-1", "flat-2", "flat-3", "flat-4"] {
        for index in 0..2 {
            let (kind_word, exposure) = kind.split_once('-').unwrap_or((kind, ""));
            let file = format!("iso800/{kind}/{index:02}.pgm");
            let line = [file.as_str(), "iso800", kind_word, exposure].join(",");
            list += &line;
            list.push('\n');
        }
    }
    bench.file("cam/frames.csv", list);
    assert_eq!(measured(&bench, &line), by_folder);
    // The control: a list that leaves out an exposure leaves it out.
    let short = fs::read_to_string(bench.path("cam/frames.csv")).unwrap();
    let short: Vec<&str> = short.lines().filter(|line| !line.contains("flat-4")).collect();
    bench.file("cam/frames.csv", short.join("\n"));
    let found = measured(&bench, &line);
    assert_eq!(found["settings"][0]["frames"]["exposures"], 4);
}
