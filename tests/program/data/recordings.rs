//! `import mcap` and `import rosbag`: frames of recordings that the tests write.

use std::fs;

use serde_json::Value;

use crate::support::image_files::{chunk, with_chunks};
use crate::support::recording::{Compression, Records, SIZE, compressed, drive, image, picture};
use crate::support::run::{Bench, Called};

/// A folder with the recording `drive.mcap`.
pub(super) fn with_recording(file: impl AsRef<[u8]>) -> Bench {
    let bench = Bench::new();
    bench.file("drive.mcap", file);
    bench
}

pub(super) fn import(bench: &Bench, line: &str) -> Called {
    let words: Vec<&str> = line.split_whitespace().collect();
    bench.call(&[&["import", "mcap", "drive.mcap"], &words[..]].concat())
}

/// The lines of `out/frames.jsonl`.
pub(super) fn frames(bench: &Bench) -> Vec<Value> {
    let text = fs::read_to_string(bench.path("out/frames.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub(super) fn names(bench: &Bench) -> Vec<String> {
    let name = |line: &Value| format!("{}/{}", line["scene"].as_str().unwrap(), line["frame"].as_str().unwrap());
    frames(bench).iter().map(name).collect()
}

#[test]
fn topics_are_listed_without_a_folder() {
    let bench = with_recording(drive(4, Compression::Zstd));
    let listed = import(&bench, "").ended(0);
    let lines: Vec<Vec<&str>> = listed.stdout.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines[0].join(" "), "/front/image_raw sensor_msgs/Image 96×64 bgr8 8 messages, 2.0 Hz, 3.5 s");
    assert_eq!(
        lines[1].join(" "),
        "/rear/image_raw/compressed sensor_msgs/CompressedImage 96×64 bgr8; jpeg compressed bgr8 4 messages, 1.0 Hz, 3.0 s"
    );
    assert_eq!(lines[2].join(" "), "3 further topics without images");
    assert!(!bench.path("out").exists());
    let refused = import(&bench, "--out out").ended(2);
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --topic: several topics have images; choose one or more of /front/image_raw, /rear/image_raw/compressed
    ");
}

#[test]
fn frames_keep_pixels_times_and_cameras() {
    for compression in Compression::ALL {
        let bench = with_recording(drive(4, compression));
        let called = import(&bench, "--topic /front/image_raw --every 0 --out out").ended(0);
        assert!(called.stdout.contains("8 frames of 1 scene (30 s each)\n"), "{called:?}");
        let frames = frames(&bench);
        for (i, line) in frames.iter().enumerate() {
            let found = image::open(bench.path("out").join(line["rgb"].as_str().unwrap())).unwrap();
            assert_eq!(found.into_rgb8(), picture(i as u8, SIZE), "{i}");
            assert_eq!(line["t"], 1_700_000_000.0 + i as f64 * 0.5);
            assert_eq!(line["frame_id"], "cam");
            assert_eq!(line["intrinsics"], serde_json::json!({"fx": 80.0, "fy": 81.0, "cx": 47.5, "cy": 31.5}));
            assert_eq!(line["exposure"], serde_json::json!({"exposure_time": 10_000 + i / 2, "gain": 2.5}));
        }
    }
}

#[test]
fn compressed_images_are_copied() {
    let bench = with_recording(drive(2, Compression::None));
    import(&bench, "--topic /rear/image_raw/compressed --out out").ended(0);
    let lines = frames(&bench);
    assert_eq!(lines.len(), 1);
    assert_eq!(lines[0]["rgb"], "scenes/drive-0000/rgb/000000.jpg");
    let file = fs::read(bench.path("out/scenes/drive-0000/rgb/000000.jpg")).unwrap();
    let recording = fs::read(bench.path("drive.mcap")).unwrap();
    assert!(recording.windows(file.len()).any(|part| part == file));
}

#[test]
fn stretches_are_scenes_whatever_is_taken() {
    let bench = with_recording(drive(6, Compression::None));
    import(&bench, "--topic /front/image_raw --every 1.5 --stretch 2 --out out").ended(0);
    assert_eq!(names(&bench), ["drive-0000/000000", "drive-0000/000003", "drive-0001/000006", "drive-0002/000009"]);
    import(&bench, "--topic /front/image_raw --at 5,2.1 --stretch 2 --out out --force").ended(0);
    assert_eq!(names(&bench), ["drive-0001/000005", "drive-0002/000010"]);
    import(&bench, "--topic /front/image_raw --max-frames 3 --stretch 2 --out out --force").ended(0);
    assert_eq!(names(&bench).len(), 3);
    let missed = import(&bench, "--topic /front/image_raw --at 1,99 --out out --force").ended(0);
    insta::assert_snapshot!(missed.messages(), @"
    exit code: 0
     WARN /front/image_raw: no frame at [TIME] or later; 1 time of --at
    ");
}

#[test]
fn unchanged_frames_are_skipped() {
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/Image", "cdr", "");
    for (i, shade) in [10, 12, 60, 61, 13].into_iter().enumerate() {
        let at = i as f64;
        records.message(1, at, &image(at, "mono8", [8, 8], &[shade; 64], 0));
    }
    let bench = with_recording(records.file());
    import(&bench, "--changed 5 --out out").ended(0);
    assert_eq!(names(&bench), ["drive-0000/000000", "drive-0000/000002", "drive-0000/000004"]);
}

#[test]
fn two_cameras_share_scenes() {
    let bench = with_recording(drive(4, Compression::Zstd));
    let line = "--topic /front/image_raw --topic /rear/image_raw/compressed --every 2 --stretch 2 --out out";
    import(&bench, line).ended(0);
    assert_eq!(
        names(&bench),
        [
            "drive-0000/front_image_raw-000000",
            "drive-0000/rear_image_raw_compressed-000000",
            "drive-0001/front_image_raw-000004",
            "drive-0001/rear_image_raw_compressed-000002",
        ]
    );
}

#[test]
fn a_cut_recording_gives_its_frames() {
    let mut file = drive(4, Compression::Zstd);
    file.truncate(file.len() * 7 / 10);
    let bench = with_recording(file);
    let called = import(&bench, "--topic /front/image_raw --every 0 --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mcap: the recording is cut off after /front/image_raw at [TIME]: its bytes end too early; frames
        up to there are kept
    ");
    let frames = frames(&bench).len();
    assert!((4..8).contains(&frames), "{frames}");
}

#[test]
fn a_damaged_chunk_is_left_out() {
    let mut file = drive(4, Compression::None);
    // The end of a row of the second second.
    let row = file.len() / 4 + file.len() / 8;
    file[row] ^= 0x10;
    let bench = with_recording(file);
    let called = import(&bench, "--topic /front/image_raw --every 0 --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mcap: a damaged chunk, -[TIME] to -[TIME]: its checksum differs; 2 frames of it left out
    ");
    assert_eq!(frames(&bench).len(), 6);
}

#[test]
fn time_reversal_starts_new_scene() {
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/Image", "cdr", "");
    for at in [100.0, 101.0, 102.0, 5.0, 6.0, 7.0] {
        records.message(1, at, &image(at, "mono8", [2, 2], &[9; 4], 0));
    }
    let bench = with_recording(records.file());
    let called = import(&bench, "--out out").ended(0);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 0
     WARN drive.mcap: time goes back 1 time, first /c at [TIME], [TIME] before the frame in front of it
    ");
    assert_eq!(names(&bench), ["drive-0000/000000", "drive-0000/000002", "drive-0001/000003", "drive-0001/000005"]);
}

#[test]
fn topics_with_other_clocks_sample_alike() {
    let mut records = Records::default();
    records.topic(1, "/front", "sensor_msgs/msg/Image", "cdr", "");
    records.topic(2, "/rear", "sensor_msgs/msg/Image", "cdr", "");
    for second in 0..40 {
        let at = f64::from(second);
        records.message(1, at, &image(at, "mono8", [2, 2], &[9; 4], 0));
        records.message(2, at, &image(at - 2.0, "mono8", [2, 2], &[9; 4], 0));
    }
    let bench = with_recording(records.file());
    let called = import(&bench, "--topic /front --topic /rear --every 10 --out out").ended(0);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    out: 8 frames of 2 scenes ([TIME] each), chosen from 80
    topics: /front, /rear; one every [TIME]
    intrinsics: 0 of 8 frames; exposure: 0
    ");
}

#[test]
fn empty_topic_keeps_other_frames() {
    let bench = with_recording(drive(4, Compression::None));
    let called = import(&bench, "--topic /front/image_raw --topic /middle --out out").ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN drive.mcap: no messages of /middle; topics with images: /front/image_raw, /rear/image_raw/compressed
    ");
    assert_eq!(frames(&bench).len(), 2);
}

#[test]
fn long_texts_of_recording_are_cut() {
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.message(1, 0.0, &compressed(0.0, &"x\n".repeat(40_000), b"x"));
    let bench = with_recording(records.file());
    for line in ["", "--topic /c --out out"] {
        let called = import(&bench, line).ended(2);
        assert!(called.stderr.len() < 800, "{}", called.stderr.len());
    }
}

#[test]
fn mosaic_and_depth_files_are_refused() {
    let mut png = std::io::Cursor::new(Vec::new());
    picture(0, SIZE).write_to(&mut png, image::ImageFormat::Png).unwrap();
    for (format, expected) in
        [("bayer_rggb8; png compressed ", "is a mosaic in an image file"), ("16UC1; png compressed ", "is depth")]
    {
        let mut records = Records::default();
        records.topic(1, "/c", "sensor_msgs/msg/CompressedImage", "cdr", "");
        records.message(1, 0.0, &compressed(0.0, format, png.get_ref()));
        let bench = with_recording(records.file());
        let called = import(&bench, "--out out").ended(2);
        assert!(called.stderr.contains(expected), "{called:?}");
    }
}

#[test]
fn unreadable_images_are_named() {
    let mut records = Records::default();
    records.topic(1, "/good", "sensor_msgs/msg/Image", "cdr", "");
    records.topic(2, "/odd", "sensor_msgs/msg/Image", "cdr", "");
    records.topic(3, "/depth", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.topic(4, "/flat", "foxglove.RawImage", "flatbuffer", "");
    for at in [0.0, 3.0] {
        records.message(1, at, &image(at, "mono8", [2, 2], &[9; 4], 0));
        records.message(2, at, &image(at, "yuv420p", [2, 2], &[9; 6], 0));
        records.message(3, at, &compressed(at, "16UC1; compressedDepth png", b"x"));
        records.message(4, at, b"x");
    }
    let bench = with_recording(records.file());
    let listed = import(&bench, "").ended(0);
    insta::assert_snapshot!(listed, @r#"
    exit code: 0
    stdout:
    /depth  sensor_msgs/CompressedImage  not read: format "16UC1; compressedDepth png" is depth, not an image
                                    2 messages, 0.3 Hz, [TIME]
    /flat   foxglove.RawImage            not read: serialization "flatbuffer"; cdr, ros1, protobuf or json
        expected                            2 messages, 0.3 Hz, [TIME]
    /good   sensor_msgs/Image            2×2 mono8
                                    2 messages, 0.3 Hz, [TIME]
    /odd    sensor_msgs/Image            not read: unknown encoding "yuv420p"; rgb8, bgr8, rgba8, bgra8, mono8,
        bayer_*8 or the same with 16…  2 messages, 0.3 Hz, [TIME]
    0 further topics without images
    "#);
    // The only topic that can be read is taken.
    import(&bench, "--out out").ended(0);
    assert_eq!(frames(&bench)[0]["topic"], "/good");
    let named = import(&bench, "--topic /good --topic /odd --out out --force").ended(1);
    insta::assert_snapshot!(named.messages(), @r#"
    exit code: 1
    ERROR drive: /odd at [TIME]: unknown encoding "yuv420p"; rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8 or the same
        with 16, uyvy, yuyv, nv12, nv21, nv16, nv61 or nv24 expected
     WARN drive: /odd: 2 frames could not be read
    "#);

    let flat = import(&bench, "--topic /flat --out out --force").ended(2);
    insta::assert_snapshot!(flat.messages(), @r#"
    exit code: 2
    ERROR drive: /flat: serialization "flatbuffer"; cdr, ros1, protobuf or json expected
    error: drive.mcap: no frame of it could be taken
    "#);
    let none = import(&bench, "--topic /nothing --out out --force").ended(2);
    insta::assert_snapshot!(none.messages(), @"
    exit code: 2
    error: drive.mcap: no messages of /nothing; topics with images: /depth, /good, /odd
    ");
}

#[test]
fn sixteen_bit_codes_are_scaled() {
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/Image", "cdr", "");
    let codes: Vec<u8> = [0_u16, 1000, 4095, 2000].iter().flat_map(|code| code.to_le_bytes()).collect();
    records.message(1, 0.0, &image(0.0, "mono16", [2, 2], &codes, 0));
    let bench = with_recording(records.file());
    let third = || image::open(bench.path("out/scenes/drive-0000/rgb/000000.png")).unwrap().into_rgb16()[(0, 1)].0;
    let dark = import(&bench, "--out out").ended(0);
    insta::assert_snapshot!(dark.messages(), @"
    exit code: 0
     WARN the greatest code of the images of 16 bits is 4095: they are dark, unless their white is less than
        65535; for a sensor of 12 bits set --white 4095
    ");
    assert_eq!(third(), [4095; 3]);
    let scaled = import(&bench, "--out out --force --white 4095").ended(0);
    assert_eq!((third(), &*scaled.stderr), ([65535; 3], ""));
}

/// A PNG of `compressed_image_transport`: the same code in 2 × 2 pixels of a number type.
fn png_of<P: image::Pixel + image::PixelWithColorType>(pixel: P) -> Vec<u8>
where
    [P::Subpixel]: image::EncodableLayout,
{
    let mut file = std::io::Cursor::new(Vec::new());
    image::ImageBuffer::from_pixel(2, 2, pixel).write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

#[test]
fn white_applies_to_compressed_images_of_16_bits() {
    for (format, file) in [
        ("mono16; png compressed mono16", png_of(image::Luma([2048_u16]))),
        ("rgb16; png compressed rgb16", png_of(image::Rgb([2048_u16; 3]))),
    ] {
        let mut records = Records::default();
        records.topic(1, "/c", "sensor_msgs/msg/CompressedImage", "cdr", "");
        records.message(1, 0.0, &compressed(0.0, format, &file));
        let bench = with_recording(records.file());
        let path = bench.path("out/scenes/drive-0000/rgb/000000.png");
        let dark = import(&bench, "--out out").ended(0);
        assert!(dark.stderr.contains("is 2048: they are dark"), "{dark:?}");
        assert!(dark.stderr.contains("set --white 4095"), "{dark:?}");
        assert_eq!(fs::read(&path).unwrap(), file);
        // Choosing frames by their change reads the images, too.
        let line = "--out out --force --white 4095 --changed 5";
        let called = import(&bench, line).ended(0);
        assert!(!called.stderr.contains("--white"), "{called:?}");
        let scaled = image::open(&path).unwrap().into_rgb16();
        assert_eq!(scaled[(1, 1)].0, [(2048 * 65_535_u32 / 4095 + 1) as u16; 3]);
    }
}

#[test]
fn white_does_not_change_compressed_images_of_8_bits() {
    let file = png_of(image::Rgb([200_u8; 3]));
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.message(1, 0.0, &compressed(0.0, "rgb8; png compressed bgr8", &file));
    let bench = with_recording(records.file());
    let called = import(&bench, "--out out --white 4095").ended(0);
    assert_eq!(called.stderr, "");
    let path = bench.path("out/scenes/drive-0000/rgb/000000.png");
    assert_eq!(fs::read(path).unwrap(), file);
}

/// Linear light has its white already.
#[test]
fn white_is_refused_for_files_that_state_their_codes() {
    let gamma = chunk(*b"gAMA", &100_000_u32.to_be_bytes());
    let file = with_chunks(&png_of(image::Rgb([2048_u16; 3])), &[gamma]);
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.message(1, 0.0, &compressed(0.0, "png", &file));
    let bench = with_recording(records.file());
    let called = import(&bench, "--out out --white 4095").ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    ERROR drive: /c at [TIME]: the file states what its codes mean, so --white does not apply; leave it out, or
        take the topic alone
    error: drive.mcap: no frame of it could be taken
    ");
    import(&bench, "--out out").ended(0);
}

#[test]
fn unrelated_files_are_identified() {
    for (bytes, expected) in [
        (&b"#ROSBAG V2.0\n"[..], "rosbags-convert"),
        (b"SQLite format 3\0", "rosbags-convert"),
        (&[0x28, 0xb5, 0x2f, 0xfd, 1, 2, 3, 4], "zstd -d"),
        (b"x", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "no topic with images: drive.mcap: the recording is cut off"),
    ] {
        let called = import(&with_recording(bytes), "").ended(2);
        assert!(called.stderr.contains(expected), "{called:?}");
    }
    let mut records = Records::default();
    records.topic(1, "/imu", "sensor_msgs/msg/Imu", "cdr", "");
    records.message(1, 0.0, b"x");
    let called = import(&with_recording(records.file()), "--out out").ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: drive.mcap: no topic with images: its topics are /imu (sensor_msgs/Imu)
    ");
}

#[test]
fn bag_folder_keeps_file_order() {
    let bench = Bench::new();
    for (number, at) in [(0, 0.0), (2, 60.0), (10, 90.0)] {
        let mut records = Records::default();
        records.topic(1, "/c", "sensor_msgs/msg/Image", "cdr", "");
        records.message(1, at, &image(at, "mono8", [2, 2], &[number; 4], 0));
        bench.file(&format!("bag/bag_{number}.mcap"), records.file());
    }
    let called = bench.call(&["import", "mcap", "bag", "--out", "out"]).ended(0);
    assert_eq!(names(&bench), ["bag-0000/000000", "bag-0002/000001", "bag-0003/000002"]);
    assert_eq!(called.stderr, "");
}

#[test]
fn broken_file_of_bag_keeps_others() {
    let bench = Bench::new();
    let mut records = Records::default();
    records.topic(1, "/c", "sensor_msgs/msg/Image", "cdr", "");
    records.message(1, 0.0, &image(0.0, "mono8", [2, 2], &[9; 4], 0));
    bench.file("bag/bag_0.mcap", records.file());
    bench.file("bag/bag_1.mcap", b"");
    let called = bench.call(&["import", "mcap", "bag", "--out", "out"]).ended(1);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN bag/bag_1.mcap: the file is empty, as a recorder leaves it that is killed
    ");
    assert_eq!(frames(&bench).len(), 1);
    bench.file("other/bag.db3", b"SQLite format 3\0");
    let called = bench.call(&["import", "mcap", "other"]).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: other: bags of ROS 2 in SQLite are not read; convert it, which changes no image:
      pip install rosbags
      rosbags-convert --src other/bag.db3 --dst other/bag --dst-storage mcap
      darkqa-eval import mcap other/bag
    ");
}

#[test]
fn ros_1_bag_names_its_conversion() {
    let bench = Bench::new();
    bench.file("my drive.bag", b"#ROSBAG V2.0\n");
    let called = bench.call(&["import", "rosbag", "my drive.bag"]).ended(2);
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: my drive.bag: bags of ROS 1 are not read; convert it, which changes no image:
      pip install rosbags
      rosbags-convert --src 'my drive.bag' --dst 'my drive' --dst-storage mcap
      darkqa-eval import mcap 'my drive'
    ");
}
