//! Recordings in every format, and thousands of damaged ones, read from memory.

#[allow(dead_code, missing_docs, unreachable_pub, reason = "the unit tests use a part of what is shared")]
#[path = "../../../../tests/support/recording.rs"]
mod recording;

use std::io::Cursor;

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};

use self::recording::{Compression, Records, drive, image};
use super::*;

/// Result of reading a recording.
#[derive(Debug, Default, PartialEq)]
struct ReadBack {
    /// Messages whose body was read.
    messages: usize,
    /// Images that were decoded.
    images: usize,
    intact_chunks: usize,
    damaged_chunks: usize,
    is_cut: bool,
}

fn read(file: &[u8]) -> ReadBack {
    let mut found = ReadBack::default();
    let Ok(mut reader) = McapReader::open(Cursor::new(file)) else {
        return found;
    };
    while let Some(event) = reader.next_event() {
        match event {
            Event::Message(message) if message.length <= MAX_MESSAGE_BYTES => {
                let schema = &message.channel.schema;
                if let ChannelContent::Image(encoding) = message.channel.content
                    && let Some(start) = reader.start_of_body(64)
                {
                    stamp(schema, encoding, start);
                }
                let Some(body) = reader.body() else {
                    continue;
                };
                found.messages += 1;
                match &message.channel.content {
                    ChannelContent::Image(encoding) => {
                        let parsed = ImageMessage::parse(schema, *encoding, body);
                        found.images += usize::from(parsed.is_ok_and(|message| match message.image {
                            MessageImage::Raw(image) => image.decode().is_ok(),
                            MessageImage::File { bytes, .. } => !bytes.is_empty(),
                        }));
                    }
                    ChannelContent::Camera(encoding) => {
                        drop(CameraInfo::parse(schema, *encoding, body));
                    }
                    ChannelContent::Exposure(fields) => drop(fields.parse(body)),
                    ChannelContent::Unsupported(_) | ChannelContent::Video(_) | ChannelContent::Other => {}
                }
            }
            Event::Message(_) => {}
            Event::ChunkRead => found.intact_chunks += 1,
            Event::ChunkDamaged { .. } => found.damaged_chunks += 1,
            Event::Cut(_) => found.is_cut = true,
        }
    }
    found
}

#[test]
fn chunks_of_each_compression_are_read() {
    for compression in Compression::ALL {
        let found = read(&drive(3, compression));
        let expected = ReadBack { messages: 22, images: 9, intact_chunks: 3, ..ReadBack::default() };
        assert_eq!(found, expected, "{compression:?}");
    }
}

#[test]
fn messages_outside_of_chunks_are_read() {
    let mut records = Records::default();
    records.topic(1, "/a", "sensor_msgs/msg/Image", "cdr", "");
    records.message(1, 0.0, &image(0.0, "mono8", [2, 1], &[1, 2], 0));
    let found = read(&records.file());
    assert_eq!((found.messages, found.images, found.is_cut), (1, 1, false));
}

#[test]
fn a_file_cut_anywhere_keeps_what_is_whole() {
    for compression in Compression::ALL {
        let file = drive(2, compression);
        let whole = read(&file);
        let mut last = 0;
        for length in (8..file.len() - 60).step_by(37) {
            let found = read(&file[..length]);
            assert!(found.is_cut && found.damaged_chunks == 0, "{compression:?} {length}: {found:?}");
            assert!((last..=whole.messages).contains(&found.messages));
            last = found.messages;
        }
        assert!(last > whole.messages / 2, "{compression:?}: {last}");
    }
}

#[test]
fn a_changed_byte_damages_its_chunk_alone() {
    for compression in Compression::ALL {
        let mut file = drive(3, compression);
        let middle = file.len() / 2;
        file[middle] ^= 1;
        let found = read(&file);
        assert_eq!((found.intact_chunks, found.damaged_chunks, found.is_cut), (2, 1, false), "{compression:?}");
    }
}

#[test]
fn unknown_compressions_are_named() {
    let mut file = drive(1, Compression::Lz4);
    let at = file.windows(3).position(|part| part == b"lz4").unwrap();
    file[at..at + 3].copy_from_slice(b"lzx");
    let mut reader = McapReader::open(Cursor::new(file)).unwrap();
    let Some(Event::ChunkDamaged { problem, .. }) = reader.next_event() else { panic!("a damaged chunk expected") };
    assert!(problem.contains("\"lzx\"; zstd, lz4 or none expected"), "{problem}");
}

#[test]
fn a_small_chunk_does_not_become_endless() {
    let mut records = Records::default();
    // A petabyte from a few bytes of a frame that repeats a byte.
    let stored = zstd::encode_all(&[0; 1000][..], 1).unwrap();
    let head = [&[0; 16][..], &(1_u64 << 50).to_le_bytes(), &[0; 4], &4_u32.to_le_bytes(), b"zstd"].concat();
    records.record(6, &[&head[..], &(stored.len() as u64).to_le_bytes(), &stored].concat());
    assert_eq!(read(&records.file()).damaged_chunks, 1);
}

/// Damages a file as disks, networks and strangers do.
fn damaged(file: &[u8], random: &mut StdRng) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..random.random_range(1..6) {
        if file.is_empty() {
            break;
        }
        let at = random.random_range(0..file.len());
        let few = random.random_range(1..40).min(file.len() - at);
        match random.random_range(0..7) {
            0 => file[at] ^= 1 << random.random_range(0..8),
            1 => file[at..at + few].fill(random.random()),
            2 => file[at] = [0, 1, 0x7f, 0x80, 0xff][random.random_range(0..5)],
            3 => file.truncate(at.max(8)),
            4 => drop(file.drain(at..at + few)),
            5 => {
                let part = file[at..at + few].to_vec();
                file.splice(at..at, part);
            }
            _ => {
                let length = random.random::<u64>() >> random.random_range(0..64);
                let bytes = length.to_le_bytes();
                let few = few.min(8);
                file[at..at + few].copy_from_slice(&bytes[..few]);
            }
        }
    }
    file
}

#[test]
fn two_thousand_damaged_recordings_are_read_or_refused() {
    let files = Compression::ALL.map(|compression| drive(1, compression));
    let mut random = StdRng::seed_from_u64(60);
    let [mut whole, mut partial] = [0; 2];
    for i in 0..2000 {
        let found = read(&damaged(&files[i % 3], &mut random));
        whole += usize::from(found.messages == 8);
        partial += usize::from((1..8).contains(&found.messages));
    }
    // Most damage is in pixels, some in what leads to them.
    assert!(whole > 100 && partial > 100, "{whole} {partial}");
}

fn decodes(schema: &str, encoding: Encoding, bytes: &[u8]) -> bool {
    stamp(schema, encoding, bytes);
    drop(CameraInfo::parse(schema, encoding, bytes));
    ImageMessage::parse(schema, encoding, bytes).is_ok_and(|message| match message.image {
        MessageImage::Raw(image) => image.decode().is_ok(),
        MessageImage::File { .. } => true,
    })
}

#[test]
fn damaged_messages_of_every_serialization_are_parsed_or_refused() {
    let mut random = StdRng::seed_from_u64(61);
    let raw = image(0.0, "bayer_rggb8", [4, 2], &[7; 8], 3);
    let json = br#"{"timestamp":{"sec":1,"nsec":2},"frame_id":"a","width":1,"height":1,"encoding":"mono8","step":1,"data":"AA=="}"#;
    let protobuf = [
        0x0a, 4, 8, 5, 16, 6, 0x15, 1, 0, 0, 0, 0x1d, 1, 0, 0, 0, 0x22, 5, b'm', b'o', b'n', b'o', b'8', 0x2d, 1, 0, 0,
        0, 0x32, 1, 9, 0x3a, 1, b'c',
    ];
    let cases = [
        ("sensor_msgs/Image", Encoding::Cdr, &raw[..]),
        ("sensor_msgs/Image", Encoding::Ros1, &raw[..]),
        ("sensor_msgs/CompressedImage", Encoding::Cdr, &raw[..]),
        ("foxglove.RawImage", Encoding::Json, &json[..]),
        ("foxglove.RawImage", Encoding::Protobuf, &protobuf[..]),
        ("foxglove.CompressedImage", Encoding::Protobuf, &protobuf[..]),
        ("foxglove_msgs/RawImage", Encoding::Cdr, &raw[..]),
    ];
    assert!([0, 3, 4].into_iter().all(|i| decodes(cases[i].0, cases[i].1, cases[i].2)));
    let mut decoded = 0;
    for i in 0..7000 {
        let (schema, encoding, bytes) = cases[i % cases.len()];
        decoded += usize::from(decodes(schema, encoding, &damaged(bytes, &mut random)));
    }
    assert!((50..6000).contains(&decoded), "{decoded}");
}

#[test]
fn messages_of_foxglove_have_their_times_and_pixels() {
    let protobuf = [
        0x0a, 4, 8, 5, 16, 6, 0x15, 1, 0, 0, 0, 0x1d, 1, 0, 0, 0, 0x22, 5, b'm', b'o', b'n', b'o', b'8', 0x2d, 1, 0, 0,
        0, 0x32, 1, 9, 0x3a, 1, b'c',
    ];
    let message = ImageMessage::parse("foxglove.RawImage", Encoding::Protobuf, &protobuf).unwrap();
    assert_eq!((message.stamp, &*message.frame_id), (Some(5_000_000_006), "c"));
    assert_eq!(stamp("foxglove.RawImage", Encoding::Protobuf, &protobuf), message.stamp);
    let json = br#"{"timestamp":{"sec":5,"nsec":6},"frame_id":"c","format":"png","data":"AQI="}"#;
    let message = ImageMessage::parse("foxglove.CompressedImage", Encoding::Json, json).unwrap();
    assert_eq!(message.stamp, Some(5_000_000_006));
    assert!(matches!(message.image, MessageImage::File { bytes, .. } if *bytes == [1, 2]));
}
