//! Parser for camera calibration messages: [`CameraInfo`].

use serde::Deserialize;

use super::encoding::Encoding;
use super::fields::FieldReader;
use super::image_message::skip_sequence_number;
use super::protobuf::fields;
use crate::types::Intrinsics;

/// Intrinsics of a camera, for raw and rectified images of one size in pixels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CameraInfo {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Intrinsics of raw images, from the matrix K; `None` if K is missing or invalid.
    pub(crate) raw: Option<Intrinsics>,
    /// Intrinsics of rectified images, from the matrix P; `None` if P is missing or invalid.
    pub(crate) rectified: Option<Intrinsics>,
}

impl CameraInfo {
    /// Parses a `sensor_msgs/CameraInfo` or `foxglove.CameraCalibration` message.
    ///
    /// # Errors
    /// If `bytes` is not such a message.
    pub(crate) fn parse(schema: &str, encoding: Encoding, bytes: &[u8]) -> Result<Self, String> {
        match encoding {
            Encoding::Cdr => Self::from_fields(schema, encoding, FieldReader::cdr(bytes)?),
            Encoding::Ros1 => Self::from_fields(schema, encoding, FieldReader::unaligned(bytes)),
            Encoding::Protobuf => {
                let (mut size, mut k, mut p) = ([0; 2], Vec::new(), Vec::new());
                for field in fields(bytes) {
                    match field? {
                        (2, value) => size[0] = value.number() as usize,
                        (3, value) => size[1] = value.number() as usize,
                        (6, value) => k.extend(value.doubles()),
                        (8, value) => p.extend(value.doubles()),
                        _ => {}
                    }
                }
                Ok(Self::new(size, &k, &p))
            }
            Encoding::Json => {
                let message: JsonCamera = serde_json::from_slice(bytes).map_err(|e| e.to_string())?;
                Ok(Self::new([message.width, message.height], &message.k, &message.p))
            }
        }
    }

    /// Parses a CDR or ROS 1 message.
    fn from_fields(schema: &str, encoding: Encoding, mut reader: FieldReader<'_>) -> Result<Self, String> {
        skip_sequence_number(schema, encoding, &mut reader)?;
        let _stamp = reader.time()?;
        let _frame_id = reader.text()?;
        let [first, second] = [reader.u32()?, reader.u32()?].map(|side| side as usize);
        // Foxglove stores the width first, ROS the height.
        let size = if schema.starts_with("foxglove") { [first, second] } else { [second, first] };
        let _distortion_model = reader.text()?;
        let _distortion_parameters = reader.doubles()?;
        let (k, _rotation, p) =
            (read_matrix(&mut reader, 9)?, read_matrix(&mut reader, 9)?, read_matrix(&mut reader, 12)?);
        Ok(Self::new(size, &k, &p))
    }

    /// The calibration from the matrices K (3×3) and P (3×4), each in row-major order.
    fn new([width, height]: [usize; 2], k: &[f64], p: &[f64]) -> Self {
        Self { width, height, raw: intrinsics(k, 3), rectified: intrinsics(p, 4) }
    }

    /// Intrinsics for an image of this size: rectified if the topic name contains `rect`, else raw. `None` if they are
    /// unknown or the calibration is for another size.
    pub(crate) fn intrinsics_for(&self, topic: &str, size: (usize, usize)) -> Option<Intrinsics> {
        if (self.width, self.height) != size {
            return None;
        }
        if topic.contains("rect") { self.rectified } else { self.raw }
    }
}

fn read_matrix(reader: &mut FieldReader<'_>, count: usize) -> Result<Vec<f64>, String> {
    (0..count).map(|_| reader.f64()).collect::<Result<Vec<f64>, _>>()
}

/// Intrinsics in a row-major matrix with this number of columns; `None` unless all are finite and both focal lengths
/// positive.
fn intrinsics(matrix: &[f64], columns: usize) -> Option<Intrinsics> {
    let [fx, cx, fy, cy] = [0, 2, columns + 1, columns + 2].map(|i| matrix.get(i).copied().unwrap_or_default());
    let is_valid = [fx, cx, fy, cy].iter().all(|number| number.is_finite()) && fx > 0.0 && fy > 0.0;
    is_valid.then_some(Intrinsics { fx, fy, cx, cy })
}

/// A `foxglove.CameraCalibration` message in JSON.
#[derive(Deserialize)]
struct JsonCamera {
    width: usize,
    height: usize,
    #[serde(rename = "K", alias = "k", default)]
    k: Vec<f64>,
    #[serde(rename = "P", alias = "p", default)]
    p: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intrinsics_of(info: &CameraInfo, topic: &str, size: (usize, usize)) -> Option<(f64, f64, f64, f64)> {
        info.intrinsics_for(topic, size).map(|camera| (camera.fx, camera.fy, camera.cx, camera.cy))
    }

    #[test]
    fn rectified_topics_use_matrix_p() {
        let k = [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0];
        let p = [400.0, 0.0, 300.0, 0.0, 0.0, 401.0, 200.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let info = CameraInfo::new([640, 480], &k, &p);
        assert_eq!(intrinsics_of(&info, "/c/image_raw", (640, 480)), Some((500.0, 501.0, 320.0, 240.0)));
        assert_eq!(intrinsics_of(&info, "/c/image_rect", (640, 480)), Some((400.0, 401.0, 300.0, 200.0)));
        assert_eq!(intrinsics_of(&info, "/c/image_raw", (320, 240)), None);
        assert_eq!(CameraInfo::new([640, 480], &[0.0; 9], &[]).raw, None);
    }
}
