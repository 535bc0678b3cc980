//! Remedies of `src/data/import` and `src/commands/import`.

use std::fs;

use super::{Bench, ROW, Remedy, Unfollowed, Why, photograph};
use crate::support::recording::{Compression, Records, compressed, drive, image};

/// A folder with an image, and depth of it as NumPy writes it.
fn depth(bench: &Bench, descr: &str, values: &[u8]) {
    photograph(bench, "set/home/rgb/0.png", 9);
    let count = 96 * 64;
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (64, 96), }}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.bytes());
    file.extend(values.repeat(count));
    bench.file("set/home/depth/0.npy", file);
}

/// A folder with an image, and depth of it as PNG of 16 bits.
fn deep_png(bench: &Bench) {
    photograph(bench, "set/home/rgb/0.png", 9);
    let depth = image::ImageBuffer::from_pixel(96, 64, image::Luma([2_000_u16]));
    fs::create_dir_all(bench.path("set/home/depth")).unwrap();
    depth.save(bench.path("set/home/depth/0.png")).unwrap();
}

fn imported(bench: &Bench) {
    depth(bench, "<f4", &2_f32.to_le_bytes());
    super::call(bench, "import folder --labels nyu40 --src set --out out").ended(0);
}

/// Two folders of frames with other numbers of classes.
fn two_label_spaces(bench: &Bench) {
    for (number, labels) in ["nyu40", "ade150"].into_iter().enumerate() {
        photograph(bench, &format!("src/{number}/home/rgb/0.png"), 9);
        let classes = image::GrayImage::from_pixel(96, 64, image::Luma([4]));
        let path = bench.path(&format!("src/{number}/home/sem/0.png"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        classes.save(path).unwrap();
        let line = format!("import folder --src src/{number} --labels {labels} --out {number}");
        super::call(bench, &line).ended(0);
    }
}

fn recording(bench: &Bench) {
    bench.file("drive.mcap", drive(2, Compression::None));
}

/// A recording of one camera in raw images of 16 bits and a second one that is not read.
fn deep_recording(bench: &Bench, codes: u16) {
    let mut records = Records::default();
    records.topic(1, "/deep", "sensor_msgs/msg/Image", "cdr", "");
    let rows = codes.to_le_bytes().repeat(96 * 64);
    records.message(1, 0.0, &image(0.0, "mono16", [96, 64], &rows, 0));
    bench.file("drive.mcap", records.file());
}

/// A recording with PNG files of 16 bits, which state their encoding.
fn stated_deep_recording(bench: &Bench) {
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 8, 8);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_source_gamma(png::ScaledFloat::new(1.0));
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[1; 128]).unwrap();
    writer.finish().unwrap();
    let mut records = Records::default();
    records.topic(1, "/deep", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.message(1, 0.0, &compressed(0.0, "mono16; png compressed ", &png));
    bench.file("drive.mcap", records.file());
}

/// A recording with a camera in JPEG, and one whose images are no images.
fn one_unread_camera(bench: &Bench) {
    let mut records = Records::default();
    for (id, topic) in [(1, "/front"), (2, "/rear")] {
        records.topic(id, topic, "sensor_msgs/msg/CompressedImage", "cdr", "");
    }
    photograph(bench, "1.jpg", 9);
    let jpeg = fs::read(bench.path("1.jpg")).unwrap();
    records.message(1, 0.0, &compressed(0.0, "jpeg", &jpeg));
    records.message(2, 0.0, &compressed(0.0, "gif", b"GIF89a\x01\0\x01\0"));
    bench.file("drive.mcap", records.file());
}

/// All remedies that are followed here.
pub(super) const ROWS: &[Remedy] = &[
    Remedy {
        says: "(--depth-scale METRES sets it)",
        state: deep_png,
        command: "import folder --labels nyu40 --src set --out out",
        printed: "(--depth-scale METRES sets it)",
        followed: "import folder --labels nyu40 --src set --out out --depth-scale 0.001",
        ..ROW
    },
    Remedy {
        says: ", or the metres per unit: --depth-scale METRES",
        state: |bench| depth(bench, "<u2", &2_000_u16.to_le_bytes()),
        command: "import folder --labels nyu40 --src set --out out",
        printed: "--depth-scale METRES",
        followed: "import folder --labels nyu40 --src set --out out --depth-scale 0.001",
        ..ROW
    },
    Remedy {
        says: "all values are in 0..1",
        state: |bench| depth(bench, "<f4", &0.5_f32.to_le_bytes()),
        command: "import folder --labels nyu40 --src set --out out",
        printed: "--depth-scale 10 for habitat-lab's default of max_depth",
        followed: "import folder --labels nyu40 --src set --out out --depth-scale 10",
        ..ROW
    },
    Remedy {
        says: "set --depth-scale to the metres per unit of depth",
        state: |bench| depth(bench, "<f4", &200_f32.to_le_bytes()),
        command: "import folder --labels nyu40 --src set --out out",
        printed: "set --depth-scale to the metres per unit of depth",
        followed: "import folder --labels nyu40 --src set --out out --depth-scale 0.01",
        ..ROW
    },
    Remedy {
        says: "the folder has frames already; --force overwrites them, another --out keeps both",
        state: imported,
        command: "import folder --labels nyu40 --src set --out out",
        printed: "--force overwrites them",
        followed: "import folder --labels nyu40 --src set --out out --force",
        ..ROW
    },
    Remedy {
        says: "the folder has frames already; --force overwrites them, another --out keeps both",
        state: imported,
        command: "import folder --labels nyu40 --src set --out out",
        printed: "another --out keeps both",
        followed: "import folder --labels nyu40 --src set --out other",
        ..ROW
    },
    Remedy {
        says: "the folder has frames already; --force overwrites them, another --out keeps both",
        state: |bench| {
            recording(bench);
            super::call(bench, "import mcap drive.mcap --topic /front/image_raw --out out").ended(0);
        },
        command: "import mcap drive.mcap --topic /front/image_raw --out out",
        printed: "--force overwrites them",
        followed: "import mcap drive.mcap --topic /front/image_raw --out out --force",
        ..ROW
    },
    Remedy {
        says: "has no time; state the frames per second with --fps, or use --count N",
        state: |bench| depth(bench, "<f4", &2_f32.to_le_bytes()),
        command: "import folder --labels nyu40 --src set --out out --every 2",
        printed: "--fps, or use --count N, which needs no time",
        followed: "import folder --labels nyu40 --src set --out out --every 2 --fps 10",
        ..ROW
    },
    Remedy {
        says: "has no time; state the frames per second with --fps, or use --count N",
        state: |bench| depth(bench, "<f4", &2_f32.to_le_bytes()),
        command: "import folder --labels nyu40 --src set --out out --every 2",
        printed: "--count N, which needs no time",
        followed: "import folder --labels nyu40 --src set --out out --count 1",
        ..ROW
    },
    Remedy {
        says: "import each with its own --out",
        state: two_label_spaces,
        command: "import folder --src 0 --src 1 --out out",
        printed: "have different class numbers (classes.json, --labels); import each with its own --out",
        followed: "import folder --src 1 --out out-1",
        ..ROW
    },
    Remedy {
        says: "class numbers (classes.json, --labels)",
        state: two_label_spaces,
        command: "import folder --src 0 --src 1 --out out",
        printed: "class numbers (classes.json, --labels)",
        followed: "import folder --src 0 --out out-0",
        ..ROW
    },
    Remedy {
        says: "an MCAP recording; no conversion is needed",
        state: recording,
        command: "import rosbag drive.mcap",
        printed: "darkqa-eval import mcap drive.mcap",
        followed: "import mcap drive.mcap",
        ..ROW
    },
    Remedy {
        says: "compressed as a whole; unpack it first",
        state: |bench| {
            let packed = zstd::encode_all(&*drive(2, Compression::None), 1).unwrap();
            bench.file("drive.mcap.zstd", packed);
        },
        command: "import mcap drive.mcap.zstd",
        printed: "zstd -d drive.mcap.zstd -o drive.mcap darkqa-eval import mcap drive.mcap",
        effect: recording,
        followed: "import mcap drive.mcap",
    },
    Remedy {
        says: "the greatest code of the images of 16 bits is",
        state: |bench| deep_recording(bench, 2_048),
        command: "import mcap drive.mcap --out out",
        printed: "for a sensor of 12 bits set --white 4095",
        followed: "import mcap drive.mcap --out out --force --white 4095",
        ..ROW
    },
    Remedy {
        says: "so --white does not apply; leave it out",
        state: stated_deep_recording,
        command: "import mcap drive.mcap --out out --white 4095",
        printed: "so --white does not apply; leave it out",
        followed: "import mcap drive.mcap --out out",
        ..ROW
    },
    Remedy {
        says: "leaves out this warning)",
        state: one_unread_camera,
        command: "import mcap drive.mcap --out out",
        printed: "(--topic /front leaves out this warning)",
        followed: "import mcap drive.mcap --out other --topic /front",
        ..ROW
    },
];

const NETWORK: &str = "it downloads from the hub, or from the registry of Python";
const PYTHON: &str = "tests/program/data/remedies/python.rs";

/// Messages whose remedies are not followed here.
pub(super) const UNFOLLOWED: &[Unfollowed] = &[
    Unfollowed { says: "take a newer darkqa-eval, or the revision v3.0", why: Why::Cannot(NETWORK) },
    Unfollowed { says: "The hub may have a newer revision", why: Why::Cannot(NETWORK) },
    Unfollowed {
        says: "install it (apt install ffmpeg, brew install ffmpeg)",
        why: Why::Cannot("it installs a program on the machine"),
    },
    Unfollowed {
        says: "the installed one has no decoder for",
        why: Why::Cannot("it installs a program on the machine"),
    },
    Unfollowed { says: "-c:v ffv1 converted.mkv", why: Why::Test(PYTHON, "colours_of_videos_are_converted") },
    Unfollowed {
        says: "zstd -d {file} -o {new}",
        why: Why::Test("tests/program/data/remedies/mod.rs", "remedies_of_imports_lead_on"),
    },
    Unfollowed { says: "convert it, which changes no image:", why: Why::Test(PYTHON, "bags_are_converted") },
    Unfollowed { says: "rosbags-convert --src {old}", why: Why::Test(PYTHON, "bags_are_converted") },
    Unfollowed { says: "darkqa-eval import mcap {}", why: Why::Test(PYTHON, "bags_are_converted") },
    Unfollowed {
        says: "make a video of its messages, with their mean rate",
        why: Why::Test(PYTHON, "video_of_a_topic_is_extracted"),
    },
    Unfollowed {
        says: "without --out prints the commands that make a video file of it",
        why: Why::Test(PYTHON, "video_of_a_topic_is_extracted"),
    },
    Unfollowed { says: "--at: no frame at one of its times in", why: Why::NoRemedy },
    Unfollowed { says: "of --at", why: Why::NoRemedy },
    Unfollowed {
        says: "the video does not state its duration, over which frames would be spread; use --every",
        why: Why::Test(PYTHON, "video_without_duration_needs_every"),
    },
];
