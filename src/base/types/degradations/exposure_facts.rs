//! Camera settings of a simulated exposure: [`ExposureFacts`].

use serde::{Deserialize, Serialize};

/// Camera settings of a simulated exposure, for records and sidecars. All numbers are finite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExposureFacts {
    /// Longer exposure time, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shutter: Option<f64>,
    /// Gain, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Remaining darkness that the exposure did not compensate, in EV; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dark: Option<f64>,
    /// Exposure time, in milliseconds.
    pub time_ms: f64,
    /// System gain K, in ADU per electron; `None` without automatic exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_gain: Option<f64>,
    /// Length of the motion blur, in pixels of the frame; `None` for several frames in which it differs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur_px: Option<f64>,
    /// Direction of the motion blur in degrees: 0 is along a row, 90 down a column; `None` as for the length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blur_angle: Option<f64>,
}

impl ExposureFacts {
    /// The settings of a walk: blur length and angle only if they are equal in all frames, the others from the first
    /// frame. `None` if a frame has no settings.
    #[must_use]
    pub fn shared(mut all: impl Iterator<Item = Option<Self>>) -> Option<Self> {
        let first = all.next()??;
        all.try_fold(first, |shared, other| {
            let other = other?;
            Some(Self {
                blur_px: shared.blur_px.filter(|px| other.blur_px == Some(*px)),
                blur_angle: shared.blur_angle.filter(|angle| other.blur_angle == Some(*angle)),
                ..shared
            })
        })
    }
}

// No number is NaN.
impl Eq for ExposureFacts {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_share_equal_settings() {
        let [first, second] = [10.0, 20.0].map(|blur_angle| {
            Some(ExposureFacts {
                shutter: Some(2.0),
                gain: None,
                dark: None,
                time_ms: 8.33,
                system_gain: None,
                blur_px: Some(2.0),
                blur_angle: Some(blur_angle),
            })
        });
        let one = ExposureFacts::shared([first, second].into_iter()).unwrap();
        assert_eq!((one.blur_px, one.blur_angle), (Some(2.0), None));
        assert_eq!(one.shutter, Some(2.0));
        assert_eq!(ExposureFacts::shared([first].into_iter()), first);
        assert_eq!(ExposureFacts::shared([first, None].into_iter()), None);
        assert_eq!(ExposureFacts::shared([].into_iter()), None);
        let text = serde_json::to_string(&one).unwrap();
        assert_eq!(text, r#"{"shutter":2.0,"time_ms":8.33,"blur_px":2.0}"#);
        assert_eq!(serde_json::from_str::<ExposureFacts>(&text).unwrap(), one);
    }
}
