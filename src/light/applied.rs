//! A degradation with its parameters for one frame: [`AppliedDegradation`].

use super::auto::{AutoExposure, AutoShot};
use super::draws::NoiseKey;
use super::movement::{FrameView, Motion, Streak};
use super::noise_profile::Synthesis;
use darkqa_base::error::Result;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Degradation, ExposureFacts, ProfileName, Severity};

/// A degradation with all parameters for one frame. Together with the frame and its noise key, they decide the pixels.
#[derive(Debug, Clone, PartialEq)]
pub enum AppliedDegradation {
    /// Less light.
    Exposure(Severity),
    /// Less light, with sensor noise.
    Sensor {
        /// Exposure drop.
        severity: Severity,
        /// Name of the noise profile.
        reading: ProfileName,
        /// Content of the noise profile.
        synthesis: Synthesis,
    },
    /// Less light, with the reaction of automatic exposure.
    Auto {
        /// Exposure settings that the camera chose.
        shot: AutoShot,
        /// Path of the image on the sensor during the exposure.
        streak: Streak,
        /// Sensor noise: the noise profile `physical` at the gain of the shot.
        synthesis: Synthesis,
    },
    /// The motion blur of an exposure.
    Motion {
        /// Exposure time, in seconds.
        time: f64,
        /// Path of the image on the sensor during the exposure.
        streak: Streak,
    },
}

impl AppliedDegradation {
    /// Resolves a degradation for a frame. `synthesis` is its noise profile; a kind without profiles uses only the
    /// sensor of it.
    ///
    /// # Errors
    /// If the sensor does not have the gain that automatic exposure needs, or the image would move too far.
    pub fn new(
        how: &Degradation,
        synthesis: &Synthesis,
        auto: &AutoExposure,
        motion: &Motion,
        view: FrameView,
        key: &NoiseKey,
    ) -> Result<Self> {
        let severity = how.severity();
        Ok(match how.kind() {
            Kind::Exposure => Self::Exposure(severity),
            Kind::Sensor => Self::Sensor {
                severity,
                reading: how.reading().cloned().unwrap_or(ProfileName::PAPER),
                synthesis: synthesis.clone(),
            },
            Kind::Auto => {
                let shot = auto.shot(severity);
                Self::Auto {
                    streak: motion.streak(shot.time, view, key)?,
                    synthesis: shot.synthesis(&synthesis.camera)?,
                    shot,
                }
            }
            Kind::Motion => {
                let time = severity.value() / 1000.0;
                Self::Motion { streak: motion.streak(time, view, key)?, time }
            }
        })
    }

    /// Camera settings of the exposure, for records and files; `None` for a kind without them.
    #[must_use]
    pub fn exposure(&self) -> Option<ExposureFacts> {
        let (shot, time, streak) = match self {
            Self::Exposure(_) | Self::Sensor { .. } => return None,
            Self::Auto { shot, streak, .. } => (Some(shot), shot.time, streak),
            Self::Motion { time, streak } => (None, *time, streak),
        };
        Some(ExposureFacts {
            shutter: shot.map(|shot| shot.shutter),
            gain: shot.map(|shot| shot.gain),
            dark: shot.map(|shot| shot.dark),
            time_ms: 1000.0 * time,
            system_gain: shot.map(|shot| shot.system_gain),
            blur_px: Some(streak.length()),
            blur_angle: Some(streak.angle()),
        })
    }

    /// The settings of the sensor noise; `None` for a kind without noise.
    #[must_use]
    pub fn synthesis(&self) -> Option<&Synthesis> {
        match self {
            Self::Exposure(_) | Self::Motion { .. } => None,
            Self::Sensor { synthesis, .. } | Self::Auto { synthesis, .. } => Some(synthesis),
        }
    }

    /// The remaining exposure drop of the image, in EV; 0 for a kind that does not darken it.
    #[must_use]
    pub fn drop_ev(&self) -> f64 {
        match self {
            Self::Exposure(severity) | Self::Sensor { severity, .. } => severity.value(),
            Self::Auto { shot, .. } => shot.dark,
            Self::Motion { .. } => 0.0,
        }
    }
}
