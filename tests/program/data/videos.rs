//! `import video`: frames that ffmpeg decodes, with the colours that the video states.
//!
//! Most tests use a program `ffmpeg` of their own, so that each combination of colours is tested everywhere. Tests of
//! ffmpeg itself are skipped where it is not installed.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::Command;

use super::recordings::frames;
use crate::support::run::{Bench, Called, words};
use crate::support::snapshot::{on_one_line, redacted};
use crate::support::tools::{has_ffmpeg, skip};
use darkqa_pictures::decode_rule::ColourRule;
use darkqa_pictures::{DecodeRule, ImageFile};

/// A program `ffmpeg` that writes four images, half a second apart, as ffmpeg does.
fn with_ffmpeg(bench: &Bench, end: &str) {
    let script = format!(
        r#"echo "$@" >> {calls}
echo 'ffmpeg version 5.1.6 Copyright' >&2
echo '  Duration: 00:00:02.00, start: 0.000000, bitrate: 9 kb/s' >&2
echo '  Stream #0:0: Video: h264 (High), yuv420p, 4x2, 2 fps' >&2
case "$*" in *image2pipe*) ;; *) exit 1;; esac
echo '[Parsed_showinfo_1 @ 0x1] config in time_base: 1/10, frame_rate: 1/1' >&2
for i in 0 1 2 3; do
  echo "[Parsed_showinfo_1 @ 0x1] n: $i pts: $((10 * i + 5)) pts_time:$i.5 duration: 1" >&2
  printf 'P6\n4 2\n255\nabcdefghijklmnopqrstuvw%s' $i
done
{end}"#,
        calls = bench.path("calls").display()
    );
    bench.program("ffmpeg", &script);
}

fn import_video(bench: &Bench, line: &str) -> Called {
    bench.call_with_programs(&[&["import", "video", "drive.mp4"], &words(line)[..]].concat())
}

#[test]
fn frames_of_video_come_from_ffmpeg() {
    let bench = Bench::new();
    bench.file("drive.mp4", b"x");
    with_ffmpeg(&bench, "exit 0");
    let described = import_video(&bench, "").ended(0);
    assert_eq!(described.stdout, "h264 (High), yuv420p, 4x2, 2 fps; 2 s\n");
    let called = import_video(&bench, "--every 1 --stretch 2 --out out").ended(0);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    out: 4 frames of 2 scenes ([TIME] each)
    video: h264 (High), yuv420p, 4x2, 2 fps; one every [TIME]
    ");
    assert_eq!(frames(&bench)[3]["t"], 3.5);
    let image = image::open(bench.path("out/scenes/drive-0001/rgb/000003.png")).unwrap().into_rgb8();
    assert_eq!((image.dimensions(), image[(0, 0)].0, image[(3, 1)].0), ((4, 2), *b"abc", *b"vw3"));
    let calls = fs::read_to_string(bench.path("calls")).unwrap();
    insta::assert_snapshot!(redacted(&calls), @"
    -nostdin -nostats -protocol_whitelist file,pipe -i file:drive.mp4
    -nostdin -nostats -protocol_whitelist file,pipe -i file:drive.mp4
    -nostdin -nostats -protocol_whitelist file,pipe -i file:drive.mp4 -map 0:v:0 -vf
        select='isnan(prev_selected_t)+gt(floor((t-start_t)/1+1e-7),floor((prev_selected_t-start_t)/1+1e-7))',showinfo
        -fps_mode passthrough -pix_fmt rgb24 -c:v ppm -f image2pipe -
    ");
}

#[test]
fn a_broken_video_gives_its_frames() {
    let bench = Bench::new();
    bench.file("drive.mp4", b"x");
    with_ffmpeg(&bench, "echo 'moov atom not found' >&2; exit 1");
    let called = import_video(&bench, "--every 0 --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mp4: ffmpeg: it ends with an error; Stream #0:0: Video: h264 (High), yuv420p, 4x2, 2 fps; moov
        atom not found; frames up to there are kept
    ");
    assert_eq!(frames(&bench).len(), 4);
}

#[test]
fn damage_that_ffmpeg_reports_is_named() {
    let bench = Bench::new();
    bench.file("drive.mp4", b"x");
    with_ffmpeg(&bench, "echo 'error while decoding MB 3 5' >&2; exit 0");
    let called = import_video(&bench, "--every 0 --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mp4: ffmpeg reports a problem: error while decoding MB 3 5; its frames are kept
    ");
    assert_eq!(frames(&bench).len(), 4);
}

#[test]
fn without_ffmpeg_the_remedy_is_named() {
    let bench = Bench::new();
    bench.file("drive.mp4", b"x");
    let mut command = bench.command(&["import", "video", "drive.mp4", "--out", "out"]);
    let called = crate::support::run::called(command.env("PATH", bench.path("empty"))).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: ffmpeg: not found on PATH; videos are decoded by it: install it (apt install ffmpeg, brew install
        ffmpeg), or give the folder of extracted images to --data
    ");
}

/// The pixels of each frame of [`with_colours`]: three colours, and white.
const PIXELS: [[u8; 3]; 4] = [[128; 3], [200, 100, 50], [60; 3], [255; 3]];

/// A program `ffmpeg` that writes one frame of [`PIXELS`] for each of these colours (`matrix primaries transfer`), in 8
/// or 16 bits as asked for. It states the colours as ffmpeg does, unless the text is empty.
fn with_colours(bench: &Bench, colours: &[&str]) {
    let bytes = |samples: &[u8], times: usize| -> String {
        samples.iter().map(|sample| format!("\\{sample:03o}").repeat(times)).collect()
    };
    let samples = PIXELS.as_flattened();
    let lines: String = colours
        .iter()
        .enumerate()
        .map(|(number, colours)| {
            let words: Vec<&str> = colours.split(' ').collect();
            let stated = match words[..] {
                [matrix, primaries, transfer] => format!(
                    "echo '[Parsed_showinfo_1 @ 0x1] color_range:tv color_space:{matrix} color_primaries:{primaries} color_trc:{transfer}' >&2"
                ),
                _ => String::new(),
            };
            format!(
                "echo '[Parsed_showinfo_1 @ 0x1] n: {number} pts: {number} pts_time:1' >&2\n{stated}\nimage\n"
            )
        })
        .collect();
    let script = format!(
        r#"echo 'ffmpeg version 5.1.6 Copyright' >&2
echo '  Stream #0:0: Video: hevc (Main 10), yuv420p10le(tv, {stream}), 4x1, 1 fps' >&2
case "$*" in
  *rgb24*) image() {{ printf 'P6\n4 1\n255\n{eight}'; }};;
  *rgb48be*) image() {{ printf 'P6\n4 1\n65535\n{sixteen}'; }};;
  *) exit 1;;
esac
echo '[Parsed_showinfo_1 @ 0x1] config in time_base: 1/1, frame_rate: 1/1' >&2
{lines}"#,
        stream = colours[0].replace(' ', "/"),
        eight = bytes(samples, 1),
        sixteen = bytes(samples, 2),
    );
    bench.program("ffmpeg", &script);
    bench.file("drive.mp4", b"x");
}

/// The pixels of the first imported frame.
fn first_frame(bench: &Bench) -> Vec<[u8; 3]> {
    let path = bench.path("out").join(frames(bench)[0]["rgb"].as_str().unwrap());
    let image = image::open(path).unwrap().into_rgb8();
    image.pixels().map(|pixel| pixel.0).collect()
}

fn assert_near(found: &[[u8; 3]], expected: &[[u8; 3]]) {
    let pairs = found.as_flattened().iter().zip(expected.as_flattened());
    let is_near = found.len() == expected.len() && pairs.map(|(a, b)| a.abs_diff(*b)).max() <= Some(1);
    assert!(is_near, "{found:?}, not {expected:?}");
}

#[test]
fn codes_of_sdr_video_are_kept() {
    for colours in [
        "bt709 bt709 bt709",
        "smpte170m smpte170m smpte170m",
        "bt470bg bt470bg smpte170m",
        "smpte170m smpte170m bt709",
        "smpte240m smpte240m smpte240m",
        "unknown unknown unknown",
        "bt709 unknown unknown",
        "bt470bg bt470bg gamma22",
        "gbr bt709 iec61966-2-1",
        "bt709 bt709 iec61966-2-4",
        "bt709 bt709 bt2020-10",
        // A version of ffmpeg that does not state colours.
        "",
    ] {
        let bench = Bench::new();
        with_colours(&bench, &[colours, colours]);
        let called = import_video(&bench, "--every 0 --out out").ended(0);
        assert_eq!((frames(&bench).len(), &*called.stderr), (2, ""), "{colours}");
        assert!(!called.stdout.contains("colours"), "{called:?}");
        assert_eq!(first_frame(&bench), PIXELS, "{colours}");
        let info = fs::read_to_string(bench.path("out/dataset.json")).unwrap();
        assert!(!info.contains("colours"), "{info}");
    }
}

/// The expected codes are computed with NumPy by the formulas of BT.2100, BT.2020 and IEC 61966-2-1.
#[test]
fn other_colours_of_video_are_converted() {
    for (colours, expected, name) in [
        ("bt2020nc bt2020 arib-std-b67", [[137; 3], [255, 69, 27], [57; 3], [255; 3]], "HLG (HDR), BT.2020"),
        ("bt2020nc bt2020 smpte2084", [[181; 3], [255, 0, 0], [39; 3], [255; 3]], "PQ (HDR), BT.2020"),
        ("unknown unknown smpte2084", [[181; 3], [255, 0, 0], [39; 3], [255; 3]], "PQ (HDR), BT.2020"),
        ("bt2020nc bt2020 bt2020-10", [[128; 3], [241, 76, 29], [60; 3], [255; 3]], "BT.2020"),
        ("bt2020nc bt2020 bt709", [[128; 3], [241, 76, 29], [60; 3], [255; 3]], "BT.2020"),
        ("bt709 smpte432 bt709", [[128; 3], [215, 93, 31], [60; 3], [255; 3]], "Display P3"),
        ("bt470bg bt470bg gamma28", [[106; 3], [189, 76, 26], [36; 3], [255; 3]], "gamma 2.8"),
    ] {
        let bench = Bench::new();
        with_colours(&bench, &[colours, colours]);
        let called = import_video(&bench, "--every 0 --out out").ended(0);
        assert_near(&first_frame(&bench), &expected);
        assert_eq!(frames(&bench).len(), 2);
        let said = format!("colours: {name}, converted to sRGB\n");
        assert!(called.stdout.ends_with(&said), "{called:?}");
        let is_hdr = name.contains("HDR");
        assert_eq!(called.stderr.contains("becomes white"), is_hdr, "{called:?}");
        let info = fs::read_to_string(bench.path("out/dataset.json")).unwrap();
        assert!(info.contains(&format!("{name}, converted to sRGB")), "{info}");
    }
}

#[test]
fn hdr_video_says_what_is_clipped() {
    let bench = Bench::new();
    with_colours(&bench, &["bt2020nc bt2020 arib-std-b67"]);
    let called = import_video(&bench, "--every 0 --out out").ended(0);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    out: 1 frame of 1 scene ([TIME] each)
    video: hevc (Main 10), yuv420p10le(tv, bt2020nc/bt2020/arib-std-b67), 4x1, 1 fps; every frame
    colours: HLG (HDR), BT.2020, converted to sRGB
    stderr:
     WARN drive.mp4: the video is HLG (HDR), BT.2020: converted to sRGB, where light above 203 cd/m² becomes white
        (50.0 % of the pixels)
    ");
}

#[test]
fn colours_that_cannot_be_converted_are_refused() {
    let bench = Bench::new();
    let refused = |colours: &str| {
        with_colours(&bench, &[colours]);
        let called = import_video(&bench, "--every 0 --out out").ended(2);
        assert!(!bench.path("out").exists(), "{colours}");
        called.messages()
    };
    for (colours, expected) in [
        ("bt2020nc bt2020 unknown", "setparams=color_trc=arib-std-b67"),
        ("ycgco bt709 bt709", "zscale=matrix=709"),
        ("bt709 bt709 log100", "zscale=transfer=709"),
        ("bt709 bt709 smpte428", "convert the video to BT.709 first"),
        ("bt709 bt709 vlog", "transfer vlog"),
        // This version of ffmpeg states the colours of the stream alone.
        ("bt2020nc/bt2020/smpte2084", "version 4.3 or later"),
    ] {
        let messages = refused(colours);
        assert!(on_one_line(&messages).contains(expected), "{messages}");
    }
}

#[test]
fn colours_may_not_change_within_a_video() {
    let bench = Bench::new();
    let colours = ["unknown unknown unknown", "bt709 bt709 bt709", "bt2020nc bt2020 smpte2084"];
    with_colours(&bench, &colours);
    let called = import_video(&bench, "--every 0 --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mp4: ffmpeg: the colours change at [TIME]: sRGB codes, then PQ (HDR), BT.2020; ffmpeg version
        5.1.6 Copyright; Stream #0:0: Video: hevc (Main 10), yuv420p10le(tv, unknown/unknown/unknown), 4x1, 1 fps;
        frames up to there are kept
    ");
    // From untagged to BT.709, the handling is the same.
    assert_eq!(frames(&bench).len(), 2);
}

#[test]
fn dolby_vision_without_a_base_layer_is_refused() {
    let bench = Bench::new();
    with_colours(&bench, &["unknown unknown unknown"]);
    let script = fs::read_to_string(bench.path("bin/ffmpeg")).unwrap();
    let record = "echo '      DOVI configuration record: version: 1.0, profile: 5, level: 6, rpu flag: 1, el flag: 0, bl flag: 1, compatibility id: 0' >&2\ncase";
    bench.file("bin/ffmpeg", script.replacen("case", record, 1));
    let called = import_video(&bench, "--every 0 --out out").ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: drive.mp4: the pictures are only for displays with Dolby Vision; export the video for other displays
        (HDR10, HLG or SDR) first
    ");
    // The base layer of profile 8.4 is HLG.
    let other = record.replace("compatibility id: 0", "compatibility id: 4");
    bench.file("bin/ffmpeg", script.replacen("case", &other, 1));
    import_video(&bench, "--every 0 --out out").ended(0);
}

/// Runs ffmpeg in the bench.
fn ffmpeg(bench: &Bench, line: &str) {
    let done = Command::new("ffmpeg")
        .current_dir(bench.path("."))
        .args(["-v", "error", "-y"])
        .args(line.split_whitespace())
        .output()
        .unwrap();
    assert!(done.status.success(), "{line}: {}", String::from_utf8_lossy(&done.stderr));
}

/// Mean code of an image that is read as a file of a data set.
fn mean_of_file(path: &Path) -> Result<f64, String> {
    let rule = DecodeRule { colour: ColourRule::Clip, ..DecodeRule::default() };
    let file = ImageFile::open(path, rule).unwrap();
    let image = file.decode().map_err(|e| e.to_string())?;
    let sum: u64 = image.samples().iter().map(|code| u64::from(*code)).sum();
    Ok(sum as f64 / image.samples().len() as f64)
}

/// A frame by `import video`, as the PNG and as the JPEG that the same ffmpeg makes, has one brightness; or the PNG,
/// which ffmpeg 5.1 writes without the transfer of HDR, is refused.
#[test]
fn a_frame_has_one_brightness_on_all_routes() {
    if !has_ffmpeg() {
        return;
    }
    for (name, colours, range, codec) in [
        ("untagged.mkv", "unknown unknown unknown", "tv", "yuv420p -c:v ffv1"),
        ("709.mkv", "bt709 bt709 bt709", "tv", "yuv420p -c:v ffv1"),
        ("full.mkv", "bt709 bt709 bt709", "pc", "yuv444p -c:v ffv1"),
        ("601.mkv", "smpte170m smpte170m smpte170m", "tv", "yuv420p -c:v ffv1"),
        ("pal.mov", "bt470bg bt470bg bt709", "tv", "yuv422p10le -c:v prores_ks"),
        ("709.mov", "bt709 bt709 bt709", "tv", "yuv422p10le -c:v prores_ks"),
        ("2020.mkv", "bt2020nc bt2020 bt2020-10", "tv", "yuv420p10le -c:v ffv1"),
        ("hlg.mkv", "bt2020nc bt2020 arib-std-b67", "tv", "yuv420p10le -c:v ffv1"),
        ("pq.mov", "bt2020nc bt2020 smpte2084", "tv", "yuv422p10le -c:v prores_ks"),
    ] {
        let bench = Bench::new();
        let words: Vec<&str> = colours.split(' ').collect();
        let [matrix, primaries, transfer] = words[..] else { panic!("{colours}") };
        let tags =
            format!("-colorspace {matrix} -color_primaries {primaries} -color_trc {transfer} -color_range {range}");
        let tagged =
            format!("setparams=colorspace={matrix}:color_primaries={primaries}:color_trc={transfer}:range={range}");
        ffmpeg(
            &bench,
            &format!("-f lavfi -i testsrc=size=64x48:rate=2:duration=1 -vf {tagged} -pix_fmt {codec} {tags} {name}"),
        );
        let called = bench.call(&["import", "video", name, "--every", "0", "--out", "out"]).ended(0);
        assert_eq!(
            called.stderr.contains("becomes white"),
            transfer.contains('2') && transfer != "bt2020-10" || transfer.starts_with("arib"),
            "{called:?}"
        );
        let imported = bench.path("out").join(frames(&bench)[0]["rgb"].as_str().unwrap());
        let imported = mean_of_file(&imported).unwrap();
        ffmpeg(&bench, &format!("-i {name} -frames:v 1 frame.png"));
        match mean_of_file(&bench.path("frame.png")) {
            Ok(mean) => assert!((mean - imported).abs() <= 1.0, "{name}: {mean}, not {imported}"),
            Err(problem) => {
                assert!(problem.contains("may be HDR") && called.stderr.contains("HDR"), "{name}: {problem}");
            }
        }
        if primaries != "bt2020" {
            ffmpeg(&bench, &format!("-i {name} -frames:v 1 -q:v 1 frame.jpg"));
            let mean = mean_of_file(&bench.path("frame.jpg")).unwrap();
            assert!((mean - imported).abs() <= 1.5, "{name}: {mean}, not {imported}");
        }
    }
}

/// The commands in messages about colours give a video that is imported.
#[test]
fn remedies_for_colours_help() {
    if !has_ffmpeg() {
        return;
    }
    for (colours, expected) in [
        ("bt2020nc bt2020 unknown", "setparams=color_trc"),
        ("ycgco bt709 bt709", "zscale=matrix=709"),
        ("bt709 bt709 log100", "zscale=transfer=709"),
    ] {
        let bench = Bench::new();
        let words: Vec<&str> = colours.split(' ').collect();
        let [matrix, primaries, transfer] = words[..] else { panic!("{colours}") };
        let tags = format!("-colorspace {matrix} -color_primaries {primaries} -color_trc {transfer} -color_range tv");
        let tagged = format!("setparams=colorspace={matrix}:color_primaries={primaries}:color_trc={transfer}:range=tv");
        let line = format!(
            "-f lavfi -i color=gray:size=64x48:duration=1 -vf format=yuv420p,{tagged} {tags} -c:v ffv1 drive.mkv"
        );
        ffmpeg(&bench, &line);
        let import = ["import", "video", "drive.mkv", "--every", "0", "--out", "out"];
        let refused = bench.call(&import).ended(2);
        let (_, command) = refused.stderr.split_once("ffmpeg -i ").unwrap();
        assert!(command.contains(expected), "{refused:?}");
        let filters = Command::new("ffmpeg").arg("-filters").output().unwrap();
        if expected.contains("zscale") && !String::from_utf8_lossy(&filters.stdout).contains("zscale") {
            skip("this ffmpeg has no zscale");
            continue;
        }
        ffmpeg(&bench, &format!("-i {command}"));
        let import = ["import", "video", "converted.mkv", "--every", "0", "--out", "out"];
        bench.call(&import).ended(0);
    }
}
