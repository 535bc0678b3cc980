//! `calibrate` from the outside, on recordings of a simulated sensor whose noise is known.

mod files;
mod lamp;
mod measure;
mod sensor;
mod traps;

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use crate::support::run::{Bench, words};
use crate::support::table::check_rows;
use sensor::{Form, Sensor, Shots, WHITE};
use serde_json::Value;
use tiff::encoder::{Compression, DeflateLevel};

/// Recordings of the default size by gain: 10 bias frames and 5 exposures of 2 pairs, 512 × 512 sites.
static RECORDED: LazyLock<Vec<(Sensor, Shots)>> = LazyLock::new(|| {
    let gains = [0.0939, 0.7513, 6.0106];
    let recorded = gains.map(|gain| {
        let sensor = Sensor::new("sony-a7s2", gain, 512, 1);
        let shots = Shots::take(&sensor, 10, 2);
        (sensor, shots)
    });
    recorded.into()
});

/// The numbers of a recording in a folder, as JSON.
fn measured(bench: &Bench, line: &str) -> Value {
    let mut args = words("calibrate");
    args.extend(words(line));
    args.extend(words("--out camera.toml --json"));
    serde_json::from_str(&bench.complete(&args)).unwrap()
}

fn number(value: &Value, path: &str) -> f64 {
    let found = value.pointer(path);
    let found = found.and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no number at {path} in {value:#}"))
}

/// The known numbers of a sensor, each with the largest error that is allowed for.
fn truths(sensor: &Sensor) -> [(&'static str, f64, f64); 4] {
    let state = &sensor.state;
    [
        ("gain", state.system_gain, 0.005 * state.system_gain),
        ("read_scale", state.read_scale, 0.007 * state.read_scale),
        ("read_shape", state.read_shape, 0.006),
        ("row_deviation", state.row_deviation, 0.06 * state.row_deviation),
    ]
}

#[test]
fn a_known_sensor_comes_back() {
    let bench = Bench::new();
    for (index, (_, shots)) in RECORDED.iter().enumerate() {
        let folder = bench.path(&format!("camera/iso{}", 100 << (3 * index)));
        shots.write(&folder, Form::Pgm);
    }
    let white = vec![WHITE; 512 * 512];
    let path = bench.path("camera/iso100/white/0.pgm");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, Form::Pgm.encode(&white, 512)).unwrap();
    let found = measured(&bench, "camera");
    assert_eq!(found["warnings"], Value::Array(Vec::new()), "{found:#}");
    assert_eq!((&found["black"], &found["white"]), (&512.into(), &WHITE.into()));
    for (index, (sensor, _)) in RECORDED.iter().enumerate() {
        let setting = &found["settings"][index];
        for (name, truth, allowed) in truths(sensor) {
            let value = number(setting, &format!("/{name}/value"));
            let error = number(setting, &format!("/{name}/error"));
            assert!((value - truth).abs() < allowed, "{name}: {value}, {truth}");
            // The standard error says how far it may be off: one in a thousand is further than 5 of them.
            assert!((value - truth).abs() < 5.0 * error, "{name}: {value} ± {error}, {truth}");
            assert!(error < allowed, "{name}: ± {error}");
        }
        // Row noise shifts whole frames a little: 512 rows of ten frames.
        let allowed = 6.0 * sensor.state.row_deviation / (10.0 * 256.0_f64).sqrt() + 0.02;
        for (plane, truth) in sensor.state.bias.iter().enumerate() {
            let value = number(setting, &format!("/bias/{plane}/value"));
            assert!((value - truth).abs() < allowed, "bias {plane}: {value}, {truth}");
        }
    }
    // The medians of the preset are on its lines, so that the lines come back, too.
    for (path, truth) in [
        ("/read_scale/slope", 0.4621),
        ("/read_scale/intercept", 0.5657),
        ("/row_deviation/slope", 0.5275),
        ("/row_deviation/intercept", -0.5917),
    ] {
        let value = number(&found, path);
        assert!((value - truth).abs() < 0.03, "{path}: {value}");
    }
    camera_is_used(&bench);
}

/// The camera file in a folder is read by `--noise camera`, and its noise is that of the sensor.
fn camera_is_used(bench: &Bench) {
    let text = fs::read_to_string(bench.path("camera.toml")).unwrap();
    for part in [
        "name = \"camera\"\nadu-range = 15871.0",
        "ratio = [100.0, 300.0]",
        "# Fitted to 3 settings.",
        "# iso100: 10 bias frames, 10 pairs of flats at 5 exposures; K 0.09",
        "BLAKE3",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!text.contains("first-gain") && text.matches("\ngain = ").count() == 4);
    assert!(fs::read_to_string(bench.path("camera.svg")).unwrap().starts_with("<svg"));
    let image = image::RgbImage::from_pixel(32, 32, image::Rgb([90, 60, 30]));
    image.save(bench.path("a.png")).unwrap();
    let made = "synthesize a.png --levels L1 --variant noise --gain 0.8 --fixed";
    bench.complete(&words(&format!("{made} --camera camera.toml --out own")));
    bench.complete(&words(&format!("{made} --out sony")));
    let state = |folder: &str| -> Value {
        let sidecar = fs::read(bench.path(&format!("{folder}/a_L1-noise.json"))).unwrap();
        let sidecar: Value = serde_json::from_slice(&sidecar).unwrap();
        sidecar["sensor"]["state"].clone()
    };
    let (own, sony) = (state("own"), state("sony"));
    // Near the lines of the preset, with the shape of the setting whose K is nearest: 0.7513.
    for (path, allowed) in [("/read_scale", 0.02), ("/row_deviation", 0.05), ("/read_shape", 0.006)] {
        let (own, sony) = (number(&own, path), number(&sony, path));
        assert!((own - sony).abs() < allowed && (own - sony).abs() > 0.0, "{path}: {own}, {sony}");
    }
}

/// The frames in other files, and on other numbers of threads, are the same frames.
#[test]
fn forms_and_threads_change_nothing() {
    let bench = Bench::new();
    let (_, shots) = &RECORDED[1];
    let shots = Shots {
        bias: shots.bias[..3].to_vec(),
        flats: shots.flats.iter().map(|frames| frames[..2].to_vec()).collect(),
        side: shots.side,
    };
    let forms = [
        Form::Pgm,
        Form::Png,
        Form::Tiff(Compression::Uncompressed),
        Form::Tiff(Compression::Lzw),
        Form::Tiff(Compression::Deflate(DeflateLevel::default())),
    ];
    let mut all = Vec::new();
    for (index, form) in forms.into_iter().enumerate() {
        let name = format!("r{index}");
        shots.write(&bench.path(&format!("{name}/iso800")), form);
        let threads: &[usize] = if index == 0 { &[1, 3] } else { &[1] };
        for threads in threads {
            let line = format!("{name} --white {WHITE} --name x --threads {threads}");
            let mut found = measured(&bench, &line);
            // The digest is of the files.
            found["frames_digest"] = Value::Null;
            all.push(found);
        }
    }
    assert!(all.windows(2).all(|two| two[0] == two[1]));
    // One pair of bias frames has no error; the third frame counts for the offsets.
    let setting = &all[0]["settings"][0];
    assert_eq!(setting["read_scale"]["error"], Value::Null);
    assert_eq!(setting["frames"]["bias"], 3);
    assert!(setting["gain"]["error"].as_f64().unwrap() > 0.0);
    assert_eq!(all[0]["read_scale"]["slope_from"], "preset");
    // The control: other frames are another camera.
    let (_, other) = &RECORDED[2];
    other.write(&bench.path("other/iso800"), Form::Pgm);
    let found = measured(&bench, &format!("other --white {WHITE} --name x"));
    assert_ne!(found["settings"], all[0]["settings"]);
}

#[test]
fn the_table_and_the_flags() {
    let bench = Bench::new();
    let (sensor, shots) = &RECORDED[1];
    shots.write(&bench.path("night cam/iso800"), Form::Pgm);
    let call = |line: &str| {
        let mut args = vec!["calibrate", "night cam", "--out", "camera.toml"];
        args.extend(words(line));
        bench.call(&args)
    };
    let table = call(&format!("--white {WHITE}"));
    assert_eq!(table.code, Some(0), "{table:?}");
    check_rows(
        [
            "night cam: 30 frames of 512 × 512 sites, black 513, white 16383",
            "λ by PPCC",
            "bias R / G1 / G2 / B ADU",
            "iso800",
            "fewer than 3 settings count: the slope is that of sony-a7s2",
            "checks: nothing to report",
            "camera.toml: the camera, for --noise camera; camera.svg: its fits",
        ],
        |part| assert!(table.stdout.contains(part), "{part}: {}", table.stdout),
    );
    let text = fs::read(bench.path("camera.toml")).unwrap();
    assert_eq!(call(&format!("--white {WHITE}")).stdout, table.stdout);
    assert_eq!(fs::read(bench.path("camera.toml")).unwrap(), text);
    // Green is first in each row of GRBG: its planes are named otherwise, and the numbers stay.
    let json = |line: &str| -> Value {
        let called = call(&format!("--json --white {WHITE} {line}"));
        assert_eq!(called.code, Some(0), "{called:?}");
        serde_json::from_str(&called.stdout).unwrap()
    };
    let plain = json("");
    let moved = json("--cfa GRBG --black 500 --name mine --crop 0,0,512,256");
    assert_eq!((&moved["name"], &moved["black"]), (&"mine".into(), &500.into()));
    assert_eq!(moved["size"], serde_json::json!([512, 256]));
    let offset = |found: &Value, plane: usize| number(found, &format!("/settings/0/offsets/{plane}/value"));
    for (plane, other) in [(0, 1), (1, 0), (2, 3), (3, 2)] {
        let difference = offset(&plain, plane) - offset(&moved, other);
        assert!(difference.abs() < 0.1, "{plane}: {difference}");
    }
    assert!((number(&moved, "/adu_range") - f64::from(WHITE - 500)).abs() < 1e-9);
    // Without filters, planes are one, and their offsets are noise of single sites.
    let mono = json("--cfa mono");
    assert_eq!(mono["settings"][0]["offsets"].as_array().unwrap().len(), 1);
    let gain = number(&mono, "/settings/0/gain/value");
    assert!((gain / sensor.state.system_gain - 1.0).abs() < 0.005, "{gain}");
    let text = fs::read_to_string(bench.path("camera.toml")).unwrap();
    let bias = text.lines().find(|line| line.starts_with("bias = ")).unwrap();
    let values: Vec<&str> = bias.trim_matches(|c: char| !c.is_ascii_digit() && c != '-').split(", ").collect();
    assert!(values.len() == 4 && values.iter().all(|value| *value == values[0]), "{bias}");
}

/// The one line of a call that is refused.
fn refused(bench: &Bench, line: &str) -> String {
    let mut args = vec!["calibrate"];
    args.extend(words(line));
    if !line.contains("--out") {
        args.extend(["--out", "camera.toml"]);
    }
    let called = bench.call(&args);
    assert_eq!(called.code, Some(2), "{line}: {called:?}");
    assert_eq!(called.stderr.trim_end().lines().count(), 1, "{line}: {}", called.stderr);
    assert!(!bench.path("camera.toml").exists(), "{line}: a file was left");
    called.stderr
}

/// Writes a setting and returns where.
fn write(bench: &Bench, name: &str, shots: &Shots) -> String {
    let folder = Path::new(name).join("iso800");
    shots.write(&bench.path(folder.to_str().unwrap()), Form::Pgm);
    name.to_owned()
}
