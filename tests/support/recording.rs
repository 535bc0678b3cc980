//! MCAP recordings of robots, written as their specification says (<https://mcap.dev/spec>).
//!
//! It needs nothing else of the tests, because the unit tests of the reader include it, too.

use std::io::{Cursor, Write as _};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A definition of a message type with exposure and gain, as a camera driver has it.
pub const EXPOSURE: &str = "std_msgs/Header header\nuint64 camera_time\nuint32 exposure_time\nfloat32 gain\n";

/// The start of all times, in seconds since 1970.
pub const START: f64 = 1_700_000_000.0;

/// Compression of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    None,
    Zstd,
    Lz4,
}

impl Compression {
    pub const ALL: [Self; 3] = [Self::None, Self::Zstd, Self::Lz4];
}

/// Records of a recording, one after another.
#[derive(Debug, Clone, Default)]
pub struct Records(pub Vec<u8>);

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

impl Records {
    pub fn record(&mut self, opcode: u8, body: &[u8]) {
        self.0.push(opcode);
        self.0.extend((body.len() as u64).to_le_bytes());
        self.0.extend(body);
    }

    /// A topic with a schema of its own.
    pub fn topic(&mut self, id: u16, topic: &str, schema: &str, serialization: &str, definition: &str) {
        let id = id.to_le_bytes();
        self.record(3, &[&id[..], &text(schema), &text("ros2msg"), &text(definition)].concat());
        let no_metadata = 0_u32.to_le_bytes();
        let ids = [id, id].concat();
        self.record(4, &[&ids[..], &text(topic), &text(serialization), &no_metadata].concat());
    }

    /// A message at seconds from [`START`].
    pub fn message(&mut self, topic: u16, at: f64, body: &[u8]) {
        let time = (((START + at) * 1e9) as u64).to_le_bytes();
        self.record(5, &[&topic.to_le_bytes()[..], &[0; 4], &time, &time, body].concat());
    }

    /// A chunk of other records.
    pub fn chunk(&mut self, compression: Compression, records: &Self) {
        let crc = crc32fast::hash(&records.0);
        let (name, stored) = match compression {
            Compression::None => ("", records.0.clone()),
            Compression::Zstd => ("zstd", zstd::encode_all(&*records.0, 1).unwrap()),
            Compression::Lz4 => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&records.0).unwrap();
                ("lz4", encoder.finish().unwrap())
            }
        };
        let head = [&[0; 16][..], &(records.0.len() as u64).to_le_bytes(), &crc.to_le_bytes(), &text(name)].concat();
        self.record(6, &[&head[..], &(stored.len() as u64).to_le_bytes(), &stored].concat());
    }

    /// The file of these records, with its end.
    pub fn file(mut self) -> Vec<u8> {
        self.record(15, &[0; 4]);
        self.record(2, &[0; 20]);
        [MAGIC, &text_record(), &self.0, MAGIC].concat()
    }
}

/// The header record.
fn text_record() -> Vec<u8> {
    let mut header = Records::default();
    header.record(1, &[text("ros2"), text("tests")].concat());
    header.0
}

/// A message in CDR, low byte first.
pub struct Cdr(Vec<u8>);

impl Cdr {
    /// A message that begins with a header: the time at seconds from [`START`], and the frame `cam`.
    pub fn new(at: f64) -> Self {
        let time = START + at;
        let mut message = Self(vec![0, 1, 0, 0]);
        message.u32(time as u32);
        message.u32(((time - time.floor()) * 1e9).round() as u32);
        message.text("cam");
        message
    }

    fn align(&mut self, size: usize) {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    pub fn f32(&mut self, value: f32) {
        self.u32(value.to_bits());
    }

    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    pub fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend(text.bytes());
        self.0.push(0);
    }

    pub fn bytes(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.0.extend(bytes);
    }

    pub fn done(self) -> Vec<u8> {
        self.0
    }
}

/// A `sensor_msgs/Image` whose rows have `padding` more bytes.
pub fn image(at: f64, encoding: &str, [width, height]: [u32; 2], rows: &[u8], padding: usize) -> Vec<u8> {
    let row = rows.len() / height as usize;
    let padded: Vec<u8> =
        rows.chunks(row).flat_map(|row| row.iter().copied().chain(std::iter::repeat_n(0xee, padding))).collect();
    let mut message = Cdr::new(at);
    message.u32(height);
    message.u32(width);
    message.text(encoding);
    message.u8(0);
    message.u32((row + padding) as u32);
    message.bytes(&padded);
    message.done()
}

/// A `sensor_msgs/CompressedImage`.
pub fn compressed(at: f64, format: &str, file: &[u8]) -> Vec<u8> {
    let mut message = Cdr::new(at);
    message.text(format);
    message.bytes(file);
    message.done()
}

/// A `sensor_msgs/CameraInfo` with these focal lengths and the centre in the middle.
pub fn camera_info([width, height]: [u32; 2], focal: [f64; 2]) -> Vec<u8> {
    let mut message = Cdr::new(0.0);
    message.u32(height);
    message.u32(width);
    message.text("plumb_bob");
    message.u32(0);
    let centre = [width, height].map(|side| f64::from(side - 1) / 2.0);
    let k = [focal[0], 0.0, centre[0], 0.0, focal[1], centre[1], 0.0, 0.0, 1.0];
    k.iter().chain(&[0.0; 21]).for_each(|number| message.f64(*number));
    message.done()
}

/// A message of the type [`EXPOSURE`].
pub fn exposure(at: f64, microseconds: u32, gain: f32) -> Vec<u8> {
    let mut message = Cdr::new(at);
    message.u64(9);
    message.u32(microseconds);
    message.f32(gain);
    message.done()
}

/// The samples of a small picture, red first, that differs by its number.
pub fn picture(number: u8, [width, height]: [u32; 2]) -> image::RgbImage {
    image::RgbImage::from_fn(width, height, |x, y| {
        let shade = |step: u32, at: u32| (at * step) as u8;
        image::Rgb([shade(2, x).wrapping_add(number.wrapping_mul(29)), shade(3, y), number.wrapping_mul(51)])
    })
}

/// The size of the images of [`drive`].
pub const SIZE: [u32; 2] = [96, 64];

/// A drive of a robot with two cameras: `/front/image_raw` in bgr8 twice a second, with the camera's intrinsics and
/// exposures, and `/rear/image_raw/compressed` as JPEG once a second; and a topic without images. Each second is a
/// chunk.
pub fn drive(seconds: u32, compression: Compression) -> Vec<u8> {
    let mut records = Records::default();
    for second in 0..seconds {
        let mut chunk = Records::default();
        if second == 0 {
            topics(&mut chunk);
            chunk.message(3, 0.0, &camera_info(SIZE, [80.0, 81.0]));
        }
        for half in 0..2 {
            let at = f64::from(second) + f64::from(half) * 0.5;
            let mut rows = picture((2 * second + half) as u8, SIZE).into_raw();
            rows.chunks_exact_mut(3).for_each(<[u8]>::reverse);
            chunk.message(1, at, &image(at, "bgr8", SIZE, &rows, 4));
            chunk.message(4, at, &exposure(at, 10_000 + second, 2.5));
            chunk.message(5, at, &Cdr::new(at).done());
        }
        let at = f64::from(second);
        let mut file = Cursor::new(Vec::new());
        let picture = picture(200_u8.wrapping_add(second as u8), SIZE);
        picture.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        chunk.message(2, at, &compressed(at, "bgr8; jpeg compressed bgr8", &file.into_inner()));
        records.chunk(compression, &chunk);
    }
    records.file()
}

fn topics(records: &mut Records) {
    records.topic(1, "/front/image_raw", "sensor_msgs/msg/Image", "cdr", "");
    records.topic(2, "/rear/image_raw/compressed", "sensor_msgs/msg/CompressedImage", "cdr", "");
    records.topic(3, "/front/camera_info", "sensor_msgs/msg/CameraInfo", "cdr", "");
    records.topic(4, "/front/meta", "driver/msg/ImageMetaData", "cdr", EXPOSURE);
    records.topic(5, "/imu", "sensor_msgs/msg/Imu", "cdr", "");
}
