//! One frame under several degradations: [`Exposures`].

use std::collections::BTreeMap;

use super::applied::AppliedDegradation;
use super::clean::Clean;
use super::draws::NoiseKey;
use super::exposure::expose;
use super::movement::Streak;
use super::movement::blur::{self, blur, blurred_codes};
use super::raw::negative::{Negative, develop_by};
use darkqa_ground::types::degradations::Kind;
use darkqa_ground::types::{Light, ReadingName, Rgb};

/// The degraded images of one frame, with a cache of one [`Negative`] for each noise profile, and of the blurred light.
#[derive(Debug, Default)]
pub struct Exposures {
    negatives: BTreeMap<ReadingName, Negative>,
    /// The light of the last path that was asked for: levels with one exposure time share it.
    blurred: Option<(Streak, Light)>,
}

impl Exposures {
    /// The frame after a degradation. Frame, key and the contents of the noise profiles must be the same in each call.
    #[must_use]
    pub fn degrade(
        &mut self,
        clean: Clean<'_>,
        degradation: &AppliedDegradation,
        key: &NoiseKey,
    ) -> Rgb {
        match degradation {
            AppliedDegradation::Exposure(severity) => expose(clean, *severity),
            AppliedDegradation::Sensor {
                severity,
                reading,
                synthesis,
            } => {
                let cached = self.negatives.remove(reading);
                let negative = cached
                    .filter(|negative| negative.serves(*severity))
                    .unwrap_or_else(|| Negative::new(clean, key, synthesis, *severity));
                let degraded = negative.develop(*severity);
                self.negatives.insert(reading.clone(), negative);
                degraded
            }
            AppliedDegradation::Auto {
                shot,
                streak,
                synthesis,
            } => {
                let light = self.exposed(clean, *streak);
                develop_by(light, key, synthesis, shot.dark)
            }
            AppliedDegradation::Motion { streak, .. } => blurred_codes(clean, *streak),
        }
    }

    /// The light of an exposure: blurred along a path, or the frame itself if it stands still.
    fn exposed<'a>(&'a mut self, clean: Clean<'a>, streak: Streak) -> Clean<'a> {
        if streak.is_still() {
            return clean;
        }
        let cached = self.blurred.take().filter(|(path, _)| *path == streak);
        let (_, light) = self
            .blurred
            .insert(cached.unwrap_or_else(|| (streak, blur(clean, streak))));
        clean.with_light(light)
    }
}

/// Version of a kind of degradation, raised whenever one of its pixels changes, so that results of an older version are
/// not reused.
#[must_use]
pub fn version(kind: Kind) -> u32 {
    match kind {
        Kind::Exposure => super::exposure::VERSION,
        Kind::Sensor => super::VERSION,
        // The pixels are those of blur and noise.
        Kind::Auto => 100 * super::VERSION + blur::VERSION,
        Kind::Motion => blur::VERSION,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise_profile::{Amplify, NoiseProfile, Synthesis};
    use crate::raw::noise::{Term, add};
    use crate::raw::{Bayer, unprocess};
    use crate::{AutoSettings, CameraModel, CameraState, FrameView, Motion};
    use darkqa_ground::error::Result;
    use darkqa_ground::types::{Degradation, FrameId, Severity};

    fn key(frame: &str) -> NoiseKey {
        NoiseKey::new(5, &FrameId(frame.to_owned()))
    }

    fn picture() -> Rgb {
        Rgb::new(
            40,
            150,
            (0..3 * 40 * 150)
                .map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
                .collect(),
        )
        .unwrap()
    }

    /// A degradation of a frame with these settings.
    fn applied_by(
        synthesis: &Synthesis,
        how: &str,
        auto: &str,
        motion: &str,
    ) -> Result<AppliedDegradation> {
        let auto: AutoSettings = auto.parse().unwrap();
        let auto = auto.for_camera(&CameraModel::default());
        let motion: Motion = motion.parse().unwrap();
        let how: Degradation = how.parse().unwrap();
        let view = FrameView {
            width: 640,
            focal: None,
        };
        AppliedDegradation::new(&how, synthesis, &auto, &motion, view, &key("a"))
    }

    /// The same by a sensor whose gain and ratio are pinned, which automatic exposure ignores.
    fn applied(how: &str, auto: &str, motion: &str) -> AppliedDegradation {
        let mut camera = CameraModel::default();
        camera.pin_gain(3.0).unwrap();
        camera.pin_ratio(7.0).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Eld, camera);
        applied_by(&synthesis, how, auto, motion).unwrap()
    }

    fn image(how: &str, auto: &str, motion: &str) -> Rgb {
        Exposures::default().degrade((&picture()).into(), &applied(how, auto, motion), &key("a"))
    }

    /// The noise variant in the noise profile physical, with the gain pinned.
    fn physical(severity: Severity, gain: f64) -> Rgb {
        let mut camera = CameraModel::default();
        camera.pin_gain(gain).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Physical, camera);
        Negative::new(&picture(), &key("a"), &synthesis, severity).develop(severity)
    }

    /// Without shutter, gain and motion, automatic exposure is the physical profile at its gain.
    #[test]
    fn what_is_met_by_nothing_is_the_physical_reading() {
        let none = "shutter=0,gain=0,base-gain=1.5";
        for severity in Severity::LADDER {
            let level = Kind::Auto.label(severity);
            let found = image(&format!("{level}-auto"), none, "speed=0");
            assert_eq!(found, physical(severity, 1.5), "{level}");
        }
        let expected = physical(Severity::L3, 1.5);
        for (auto, motion) in [
            ("shutter=0.01,gain=0,base-gain=1.5", "speed=0"),
            ("shutter=0,gain=0.01,base-gain=1.5", "speed=0"),
            ("shutter=0,gain=0,base-gain=1.51", "speed=0"),
            (none, "speed=5"),
        ] {
            assert_ne!(image("L3-auto", auto, motion), expected, "{auto} {motion}");
        }
    }

    /// At L3 the shutter and the gain meet all of the drop: the picture is as bright as the physical profile without a drop, with
    /// the noise of the gain K = 0.375 · 2⁴.
    #[test]
    fn gain_brightens_and_keeps_the_noise_of_its_photons() {
        let AppliedDegradation::Auto {
            shot, synthesis, ..
        } = applied("L3-auto", "gain=4", "speed=0")
        else {
            panic!("automatic exposure expected");
        };
        let state = synthesis.state_by(&key("a"), shot.dark);
        assert!((state.system_gain - 6.0).abs() < 1e-12 && (state.ratio - 1.0).abs() < 1e-12);
        let (bright, dark) = (
            image("L3-auto", "gain=4", "speed=0"),
            physical(Severity::L3, 6.0),
        );
        let sum =
            |image: &Rgb| -> u64 { image.samples().iter().map(|code| u64::from(*code)).sum() };
        assert!(sum(&bright) > 4 * sum(&dark));
    }

    /// The relative variance of the shot noise is K₀ · 2^(ΔEV − s) / y, whatever is gain and whatever is left dark.
    #[test]
    fn shot_noise_follows_the_photons_alone() {
        let grey = Rgb::new(256, 256, vec![117; 3 * 256 * 256]).unwrap();
        let greens = |raw: &Bayer| -> Vec<f64> {
            let sites =
                (0..256).flat_map(|row| (0..128).map(move |i| (row, 2 * i + (row + 1) % 2)));
            sites
                .map(|(row, column)| f64::from(raw.sample(row, column)))
                .collect()
        };
        let moments = |samples: &[f64]| {
            let n = samples.len() as f64;
            let mean = samples.iter().sum::<f64>() / n;
            let squares = samples.iter().map(|sample| (sample - mean).powi(2));
            (mean, squares.sum::<f64>() / n)
        };
        let relative = |auto: &str, how: &str| {
            let AppliedDegradation::Auto {
                shot, synthesis, ..
            } = applied(how, auto, "speed=0")
            else {
                panic!("automatic exposure expected");
            };
            let state = synthesis.state_by(&key("a"), shot.dark);
            let mut raw = unprocess(&grey, &state);
            let (light, _) = moments(&greens(&raw));
            add(&mut raw, &state, &key("a"), Amplify::All, &[Term::Shot]);
            let (mean, variance) = moments(&greens(&raw));
            assert!((mean / light - 1.0).abs() < 0.02, "{auto}: {mean} {light}");
            variance / (light * light) * (light * state.adu_range)
        };
        for (auto, how, expected) in [
            ("shutter=2,gain=4", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=0", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=2.5", "L3-auto", 0.375 * 16.0),
            ("shutter=4,gain=1", "L3-auto", 0.375 * 4.0),
            ("shutter=0,gain=3", "L1-auto", 0.375 * 4.0),
            ("shutter=2,gain=4", "L5-auto", 0.375 * 128.0),
        ] {
            let found = relative(auto, how);
            let off = found / expected - 1.0;
            assert!(
                off.abs() < 0.03,
                "{auto} at {how}: {found} instead of {expected}"
            );
        }
    }

    /// Common random numbers: the draws for a frame are the same in every kind, and a random direction moves no other draw.
    #[test]
    fn draws_are_those_of_the_noise_variant() {
        let state = |how: &str, motion: &str| -> CameraState {
            let applied = applied(how, "gain=4", motion);
            let synthesis = applied.synthesis().unwrap();
            synthesis.state_by(&key("a"), applied.drop_ev())
        };
        let (noise, auto) = (
            state("L3-noise@eld", "angle=0"),
            state("L3-auto", "angle=random"),
        );
        assert_eq!(noise.rgb_to_camera, auto.rgb_to_camera);
        let gains = |state: &CameraState| {
            [state.rgb_gain, state.red_gain, state.blue_gain].map(f64::to_bits)
        };
        assert_eq!(gains(&noise), gains(&auto));
        // The scatter of the fits is shared, too: σ over its median at the gain.
        let fixed = |gain: f64| {
            let mut camera = CameraModel::default();
            camera.set_sampling(crate::Sampling::Fixed);
            camera.pin_gain(gain).unwrap();
            CameraState::draw(&key("a"), &camera)
        };
        let scatter = |state: &CameraState| {
            let median = fixed(state.system_gain);
            [
                state.read_scale / median.read_scale,
                state.row_deviation / median.row_deviation,
            ]
        };
        for (noise, auto) in scatter(&noise).iter().zip(scatter(&auto)) {
            assert!((noise / auto - 1.0).abs() < 1e-12 && (noise - 1.0).abs() > 1e-3);
        }
        let still = image("L3-auto", "gain=4", "speed=0,angle=0");
        assert_eq!(image("L3-auto", "gain=4", "speed=0,angle=random"), still);
        let moved = image("L3-auto", "gain=4", "angle=random");
        assert_ne!(moved, image("L3-auto", "gain=4", "angle=0"));
    }

    /// Motion blur alone leaves the light, and what does not move is unchanged.
    #[test]
    fn motion_blurs_and_does_not_darken() {
        assert_eq!(image("T33.33-motion", "gain=4", "speed=0"), picture());
        let mean_light = |image: &Rgb| {
            image
                .samples()
                .iter()
                .map(|code| (f64::from(*code) / 255.0).powf(2.2))
                .sum::<f64>()
                / image.samples().len() as f64
        };
        let blurred = image("T33.33-motion", "gain=4", "angle=20");
        assert_ne!(blurred, picture());
        assert!((mean_light(&blurred) / mean_light(&picture()) - 1.0).abs() < 0.01);
        let facts = applied("T33.33-motion", "gain=4", "angle=20")
            .exposure()
            .unwrap();
        assert_eq!((facts.shutter, facts.system_gain), (None, None));
        assert!((facts.time_ms - 33.33).abs() < 1e-9);
        assert!((facts.blur_px.unwrap() - 6.776).abs() < 1e-2);
    }

    /// Levels in any order, with a path that changes between them, are as if each were made alone.
    #[test]
    fn the_cache_changes_nothing() {
        let mut exposures = Exposures::default();
        for how in [
            "L5-auto",
            "L1-auto",
            "E1-auto",
            "L3-auto",
            "L3-noise@eld",
            "T16.67-motion",
        ] {
            let applied = applied(how, "gain=4", "speed=30");
            let found = exposures.degrade((&picture()).into(), &applied, &key("a"));
            assert_eq!(found, image(how, "gain=4", "speed=30"), "{how}");
        }
    }

    #[test]
    fn a_gain_or_a_path_beyond_the_camera_is_refused() {
        let refused = |how: &str, auto: &str, motion: &str| {
            let applied = applied_by(&Synthesis::default(), how, auto, motion);
            applied.unwrap_err().to_string()
        };
        let error = refused("L5-auto", "gain=5", "speed=30");
        assert!(error.contains("K from 0.1 to 6"), "{error}");
        let error = refused("T133.33-motion", "gain=4", "speed=360");
        assert!(
            error.contains("325.20 pixels") && error.contains("at most 256"),
            "{error}"
        );
        let error = refused("L1-auto", "shutter=2", "speed=1200");
        assert!(error.contains("pixels during the exposure"), "{error}");
    }
}
