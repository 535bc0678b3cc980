//! `import mcap` with odd recordings: broken first images, YUV, video, constant time stamps, other formats.

use std::fs;

use super::recordings::{frames, import, names, with_recording};
use crate::support::image_files::encoded;
use crate::support::recording::{Cdr, Records, SIZE, camera_info, compressed, image, picture};
use crate::support::run::Bench;

/// A JPEG file of [`picture`].
fn jpeg(number: u8) -> Vec<u8> {
    encoded(&picture(number, SIZE), image::ImageFormat::Jpeg)
}

const RAW: &str = "sensor_msgs/msg/Image";
const COMPRESSED: &str = "sensor_msgs/msg/CompressedImage";

/// A recording with JPEG images on `/front/compressed`, of which the one at `broken` has these bytes, and on
/// `/rear/compressed`.
fn two_cameras(broken: u8, bytes: &[u8]) -> Bench {
    let mut records = Records::default();
    records.topic(1, "/front/compressed", COMPRESSED, "cdr", "");
    records.topic(2, "/rear/compressed", COMPRESSED, "cdr", "");
    for number in 0..3 {
        let at = f64::from(number);
        let file = jpeg(number);
        let front = if number == broken { bytes } else { &file };
        records.message(1, at, &compressed(at, "jpeg", front));
        records.message(2, at, &compressed(at, "jpeg", &file));
    }
    with_recording(records.file())
}

#[test]
fn broken_first_image_hides_no_camera() {
    let cut = &jpeg(0)[..400];
    for (broken, bytes, listed) in [
        (0, &b""[..], "; the first cannot be read: an empty image (format \"jpeg\")"),
        (0, cut, "; the first cannot be read: not a readable image"),
        // Controls: a later image, and none.
        (1, b"", " 3 messages, 1.0 Hz, 2.0 s\n"),
        (9, b"", " 3 messages, 1.0 Hz, 2.0 s\n"),
    ] {
        let bench = two_cameras(broken, bytes);
        let called = import(&bench, "").ended(0);
        let line = called.stdout.split_inclusive('\n').next().unwrap();
        assert!(line.starts_with("/front/compressed") && line.contains(listed), "{line}");
        assert!(line.contains("96×64 jpeg"), "{line}");
        // No camera is chosen silently.
        let both = import(&bench, "--out out").ended(2);
        assert!(both.stderr.contains("/front/compressed, /rear/compressed"), "{both:?}");
        let is_broken = broken < 3;
        let taken = import(&bench, "--topic /front/compressed --every 0 --out out").ended(i32::from(is_broken));
        assert_eq!(frames(&bench).len(), 3 - usize::from(is_broken));
        assert_eq!(taken.stdout.contains("1 failed"), is_broken, "{taken:?}");
    }
}

/// A `sensor_msgs/Image` of no rows.
fn empty_image(at: f64) -> Vec<u8> {
    let mut message = Cdr::new(at);
    message.u32(0);
    message.u32(0);
    message.text("rgb8");
    message.u8(0);
    message.u32(0);
    message.bytes(&[]);
    message.done()
}

#[test]
fn camera_without_any_image_is_named() {
    let mut records = Records::default();
    records.topic(1, "/front", RAW, "cdr", "");
    records.topic(2, "/rear", RAW, "cdr", "");
    for at in [0.0, 1.0] {
        records.message(1, at, &empty_image(at));
        records.message(2, at, &image(at, "mono8", [2, 2], &[9; 4], 0));
    }
    let bench = with_recording(records.file());
    let called = import(&bench, "--every 0 --out out").ended(0);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN /front is not read: 0 × 0 pixels; 1 to 100000000 pixels expected; only /rear is imported (--topic /rear
        leaves out this warning)
    ");
    let named = import(&bench, "--topic /rear --out out --force").ended(0);
    assert_eq!(named.stderr, "");
}

#[test]
fn empty_image_gives_its_place_to_the_next() {
    let bench = two_cameras(0, b"");
    for line in ["--max-frames 1", "--every 30", "--at 0"] {
        let line = format!("--topic /front/compressed {line} --out out --force");
        let called = import(&bench, &line).ended(1);
        assert!(called.stdout.contains("1 failed"), "{called:?}");
        assert_eq!(names(&bench), ["drive-0000/000001"], "{line}");
    }
}

/// The bytes of an image in YUY2 and in NV12, in which every pixel has this colour.
fn yuv([luma, u, v]: [u8; 3]) -> [(&'static str, Vec<u8>); 2] {
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let planes = [vec![luma; pixels], [u, v].repeat(pixels / 4)].concat();
    [("yuv422_yuy2", [luma, u, luma, v].repeat(pixels / 2)), ("nv12", planes)]
}

#[test]
fn yuv_is_converted_with_a_note() {
    // Red, (255, 0, 0), in limited range of BT.601.
    for (encoding, data) in yuv([81, 90, 240]) {
        let mut records = Records::default();
        records.topic(1, "/c", RAW, "cdr", "");
        records.message(1, 0.0, &image(0.0, encoding, SIZE, &data, 0));
        let bench = with_recording(records.file());
        let called = import(&bench, "--out out").ended(0);
        let note = "YUV, converted to RGB by BT.601 in limited range, as cv_bridge does (the messages state no matrix): 1 frame\n";
        assert!(called.stdout.contains(note), "{called:?}");
        let path = bench.path("out").join(frames(&bench)[0]["rgb"].as_str().unwrap());
        let red = image::open(path).unwrap().into_rgb8();
        assert!(red.pixels().all(|pixel| pixel.0[0] > 250 && pixel.0[1].max(pixel.0[2]) < 4), "{:?}", red[(0, 0)]);
    }
    // Control: no note without YUV.
    let bench = two_cameras(9, b"");
    let called = import(&bench, "--topic /rear/compressed --out out").ended(0);
    assert!(!called.stdout.contains("YUV") && called.stderr.is_empty(), "{called:?}");
}

#[test]
fn colour_lost_by_compression_is_named() {
    for (format, is_lost) in [
        ("yuv422_yuy2; jpeg compressed mono8", true),
        ("bgr8; jpeg compressed mono8", true),
        ("mono8; jpeg compressed mono8", false),
        ("yuv422_yuy2; jpeg compressed bgr8", false),
        ("jpeg", false),
    ] {
        let mut records = Records::default();
        records.topic(1, "/c/image_raw/compressed", COMPRESSED, "cdr", "");
        records.message(1, 0.0, &compressed(0.0, format, &jpeg(1)));
        let called = import(&with_recording(records.file()), "--out out").ended(0);
        let expected = " WARN drive: /c/image_raw/compressed: 1 image grey, although the camera has colour: the compression dropped it; record /c/image_raw for questions about colours\n";
        assert_eq!(called.stderr, if is_lost { expected } else { "" }, "{format}");
    }
}

#[test]
fn video_in_messages_names_its_commands() {
    let mut records = Records::default();
    records.topic(1, "/c/compressed", COMPRESSED, "cdr", "");
    for i in 0..5 {
        let at = f64::from(i) * 0.5;
        records.message(1, at, &compressed(at, "h264", b"\0\0\0\x01\x67\x42\xc0"));
    }
    let bench = with_recording(records.file());
    insta::assert_snapshot!(import(&bench, "").ended(2).messages(), @r#"
    exit code: 2
    error: drive.mcap: no topic with images: /c/compressed (sensor_msgs/CompressedImage) is not read: H.264 video
        (format "h264"), not images
    /c/compressed: make a video of its messages, with their mean rate:
      pip install mcap-ros2-support
      python3 -c 'import sys; from mcap.reader import make_reader as r; from mcap_ros2.decoder import
        DecoderFactory as D; [sys.stdout.buffer.write(bytes(m[3].data)) for f in sys.argv[2:] for m in r(open(f,
        "rb"), decoder_factories=[D()]).iter_decoded_messages([sys.argv[1]])]' /c/compressed drive.mcap >
        video.raw
      ffmpeg -r 2.000 -i video.raw -c copy video.mp4
      darkqa-eval import video video.mp4 --every 2 --out frames
    "#);
    let named = import(&bench, "--topic /c/compressed --out out").ended(2);
    insta::assert_snapshot!(named.messages(), @r#"
    exit code: 2
    ERROR drive: /c/compressed at [TIME]: H.264 video (format "h264"), not images; `darkqa-eval import mcap`
        without --out prints the commands that make a video file of it
    error: drive.mcap: no frame of it could be taken
    "#);

    let mut records = Records::default();
    records.topic(1, "/v", "foxglove.CompressedVideo", "protobuf", "");
    records.topic(2, "/c", RAW, "cdr", "");
    records.message(1, 0.0, b"x");
    records.message(2, 0.0, &image(0.0, "mono8", [2, 2], &[9; 4], 0));
    let bench = with_recording(records.file());
    let listed = import(&bench, "").ended(0);
    assert!(listed.stdout.contains("/v: make a video of its messages"), "{listed:?}");
    assert!(listed.stdout.contains("pip install mcap-protobuf-support"), "{listed:?}");
    // Control: recordings without video.
    let bench = two_cameras(9, b"");
    assert!(!import(&bench, "").ended(0).stdout.contains("video"));
}

#[test]
fn files_of_other_kinds_are_named() {
    for (format, bytes, expected) in [
        ("avif", &b"\0\0\0\x20ftypavif\0\0"[..], "AVIF (format \"avif\"); JPEG, PNG or WebP expected"),
        ("YUYV; zstd; 16", &[0x28, 0xb5, 0x2f, 0xfd, 1], "raw samples compressed with zstd"),
        ("", b"xyz", "data of an unknown kind (no format stated); JPEG, PNG or WebP expected"),
    ] {
        let mut records = Records::default();
        records.topic(1, "/c", COMPRESSED, "cdr", "");
        records.message(1, 0.0, &compressed(0.0, format, bytes));
        let bench = with_recording(records.file());
        for line in ["", "--topic /c --out out"] {
            let called = import(&bench, line).ended(2);
            assert!(called.stderr.contains(expected), "{called:?}");
            assert!(!called.stderr.contains("video"), "{called:?}");
        }
    }
}

#[test]
fn json_messages_of_ros_are_read() {
    let json = br#"{"header":{"stamp":{"sec":5,"nanosec":500000000},"frame_id":"cam"},"height":1,"width":2,"encoding":"mono8","is_bigendian":0,"step":2,"data":DATA}"#;
    for data in ["\"Bwk=\"", "[7, 9]"] {
        let body = String::from_utf8_lossy(json).replace("DATA", data);
        let mut records = Records::default();
        records.topic(1, "/c", RAW, "json", "");
        records.message(1, 0.0, body.as_bytes());
        let bench = with_recording(records.file());
        import(&bench, "--out out").ended(0);
        let line = &frames(&bench)[0];
        assert_eq!((&line["t"], &line["frame_id"]), (&5.5.into(), &"cam".into()));
        let path = bench.path("out").join(line["rgb"].as_str().unwrap());
        assert_eq!(image::open(path).unwrap().into_rgb8().into_raw(), [7, 7, 7, 9, 9, 9]);
    }
}

#[test]
fn constant_time_stamps_give_way_to_the_recorder() {
    let recording = |stamp: fn(f64) -> f64| {
        let mut records = Records::default();
        records.topic(1, "/c", RAW, "cdr", "");
        for i in 0..6 {
            let at = f64::from(i);
            records.message(1, at, &image(stamp(at), "mono8", [2, 2], &[9; 4], 0));
        }
        with_recording(records.file())
    };
    let bench = recording(|_| -3000.0);
    let called = import(&bench, "--every 2 --out out").ended(0);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN /c: all 6 messages with the same time stamp; the times of the recorder are used
    ");
    assert_eq!(names(&bench), ["drive-0000/000000", "drive-0000/000002", "drive-0000/000004"]);
    assert_eq!(frames(&bench)[1]["t"], 1_700_000_002.0);
    // Control: stamps that advance are kept, without a warning.
    let bench = recording(|at| at - 3000.0);
    let called = import(&bench, "--every 2 --out out").ended(0);
    assert_eq!(called.stderr, "");
    assert_eq!(frames(&bench)[1]["t"], 1_699_997_002.0);
}

#[test]
fn intrinsics_of_realsense_are_found() {
    let topic = "/device_0/sensor_1/Color_0/image/data/compressed";
    for (info, found) in [
        ("/device_0/sensor_1/Color_0/image/camera_info", 1),
        ("/device_0/sensor_1/Color_0/camera_info", 1),
        ("/device_0/sensor_1/Color_0/info/camera_info", 1),
        // Controls: other streams and sensors.
        ("/device_0/sensor_0/Depth_0/image/camera_info", 0),
        ("/device_0/sensor_1/camera_info", 0),
    ] {
        let mut records = Records::default();
        records.topic(1, topic, COMPRESSED, "cdr", "");
        records.topic(2, info, "sensor_msgs/msg/CameraInfo", "cdr", "");
        records.message(2, 0.0, &camera_info(SIZE, [80.0, 81.0]));
        records.message(1, 0.0, &compressed(0.0, "bgr8; jpeg compressed bgr8", &jpeg(1)));
        let bench = with_recording(records.file());
        let called = import(&bench, "--out out").ended(0);
        let line = format!("intrinsics: {found} of 1 frame;");
        assert!(called.stdout.contains(&line), "{info}: {called:?}");
    }
}

#[test]
fn bags_in_sqlite_name_their_conversion() {
    let bench = Bench::new();
    bench.file("x.db3", b"SQLite format 3\0");
    let file = "x.db3: bags of ROS 2 in SQLite are not read; convert it, which changes no image:\n  pip install rosbags\n  rosbags-convert --src x.db3 --dst x --dst-storage mcap\n  darkqa-eval import mcap x\n";
    for command in ["mcap", "rosbag"] {
        let called = bench.call(&["import", command, "x.db3"]).ended(2);
        assert_eq!(called.stderr, format!("error: {file}"));
    }
    // An earlier conversion is not overwritten.
    fs::create_dir(bench.path("x")).unwrap();
    let called = bench.call(&["import", "mcap", "x.db3"]).ended(2);
    assert!(called.stderr.contains("--dst x-mcap --dst-storage"), "{called:?}");
    // Without metadata.yaml, only files can be converted; with it, the folder.
    bench.file("my bag/b.db3", b"SQLite format 3\0");
    bench.file("my bag/a.db3", b"SQLite format 3\0");
    let called = bench.call(&["import", "mcap", "my bag"]).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: my bag: bags of ROS 2 in SQLite are not read; convert it, which changes no image:
      pip install rosbags
      rosbags-convert --src 'my bag/a.db3' --dst 'my bag/a' --dst-storage mcap
      rosbags-convert --src 'my bag/b.db3' --dst 'my bag/b' --dst-storage mcap
      darkqa-eval import mcap 'my bag/a' 'my bag/b'
    ");
    bench.file("my bag/metadata.yaml", b"");
    for path in ["my bag", "my bag/a.db3"] {
        for command in ["mcap", "rosbag"] {
            let called = bench.call(&["import", command, path]).ended(2);
            let convert = "  rosbags-convert --src 'my bag' --dst 'my bag-mcap' --dst-storage mcap\n  darkqa-eval import mcap 'my bag-mcap'\n";
            assert!(called.stderr.contains(convert), "{called:?}");
        }
    }
}

#[test]
fn commands_of_other_formats_lead_on() {
    let bench = with_recording(Records::default().file());
    for path in ["drive.mcap", "."] {
        let called = bench.call(&["import", "rosbag", path]).ended(2);
        let command = format!("no conversion is needed: darkqa-eval import mcap {path}\n");
        assert!(called.stderr.contains(&command), "{called:?}");
    }
    bench.file("old.bag", b"#ROSBAG V2.0\n");
    let by_mcap = bench.call(&["import", "mcap", "old.bag"]).ended(2);
    let by_rosbag = bench.call(&["import", "rosbag", "old.bag"]).ended(2);
    assert_eq!(by_mcap.stderr, by_rosbag.stderr);
    assert!(by_mcap.stderr.contains("--src old.bag --dst old --dst-storage mcap"));
    bench.file("notes.txt", b"hello");
    let called = bench.call(&["import", "rosbag", "notes.txt"]).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: notes.txt: neither a bag of ROS 1 (.bag) or ROS 2 (.db3) nor an MCAP recording
    ");
    bench.file("packed.mcap.zstd", [0x28, 0xb5, 0x2f, 0xfd, 1, 2, 3, 4]);
    let called = bench.call(&["import", "mcap", "packed.mcap.zstd"]).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: packed.mcap.zstd: compressed as a whole; unpack it first:
      zstd -d packed.mcap.zstd -o packed.mcap
      darkqa-eval import mcap packed.mcap
    ");
}
