//! Several degradations of one frame with shared work: [`Exposures`].

use std::collections::BTreeMap;

use super::applied::AppliedDegradation;
use super::clean::Clean;
use super::draws::NoiseKey;
use super::exposure::expose;
use super::movement::Streak;
use super::movement::blur::{self, blur, blurred_codes};
use super::raw::negative::{Negative, develop_by};
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{Light, ProfileName, Rgb};

/// Makes degraded images of one frame. Caches one [`Negative`] per noise profile, and the last blurred frame.
#[derive(Debug, Default)]
pub struct Exposures {
    negatives: BTreeMap<ProfileName, Negative>,
    /// Blurred light of the last path; levels with equal exposure time share it.
    blurred: Option<(Streak, Light)>,
}

impl Exposures {
    /// Applies a degradation to the frame. Frame, key and noise profiles must be the same in each call.
    #[must_use]
    pub fn degrade(&mut self, clean: Clean<'_>, degradation: &AppliedDegradation, key: &NoiseKey) -> Rgb {
        match degradation {
            AppliedDegradation::Exposure(severity) => expose(clean, *severity),
            AppliedDegradation::Sensor { severity, reading, synthesis } => {
                let negative = self
                    .negatives
                    .remove(reading)
                    .filter(|negative| negative.can_develop(*severity))
                    .unwrap_or_else(|| Negative::new(clean, key, synthesis, *severity));
                let degraded = negative.develop(*severity);
                self.negatives.insert(reading.clone(), negative);
                degraded
            }
            AppliedDegradation::Auto { shot, streak, synthesis } => {
                let light = self.blurred(clean, *streak);
                develop_by(light, key, synthesis, shot.dark)
            }
            AppliedDegradation::Motion { streak, .. } => blurred_codes(clean, *streak),
        }
    }

    /// The frame blurred along a path; unchanged if the path has no length.
    fn blurred<'a>(&'a mut self, clean: Clean<'a>, streak: Streak) -> Clean<'a> {
        if streak.is_still() {
            return clean;
        }
        let cached = self.blurred.take().filter(|(path, _)| *path == streak);
        let (_, light) = self.blurred.insert(cached.unwrap_or_else(|| (streak, blur(clean, streak))));
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
        // Both blur and noise change the pixels.
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
    use darkqa_base::error::Result;
    use darkqa_base::types::{Degradation, FrameId, Severity};

    fn key(frame: &str) -> NoiseKey {
        NoiseKey::new(5, &FrameId(frame.to_owned()))
    }

    fn picture() -> Rgb {
        Rgb::new(40, 150, (0..3 * 40 * 150).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect())
            .unwrap()
    }

    /// The parameters of a degradation with these settings.
    fn apply(synthesis: &Synthesis, how: &str, auto: &str, motion: &str) -> Result<AppliedDegradation> {
        let auto: AutoSettings = auto.parse().unwrap();
        let auto = auto.for_camera(&CameraModel::default());
        let motion: Motion = motion.parse().unwrap();
        let how: Degradation = how.parse().unwrap();
        let view = FrameView { width: 640, focal: None };
        AppliedDegradation::new(&how, synthesis, &auto, &motion, view, &key("a"))
    }

    /// [`apply`] for a sensor with pinned gain and ratio, which automatic exposure ignores.
    fn applied(how: &str, auto: &str, motion: &str) -> AppliedDegradation {
        let mut camera = CameraModel::default();
        camera.pin_gain(3.0).unwrap();
        camera.pin_ratio(7.0).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Eld, camera);
        apply(&synthesis, how, auto, motion).unwrap()
    }

    fn image(how: &str, auto: &str, motion: &str) -> Rgb {
        Exposures::default().degrade((&picture()).into(), &applied(how, auto, motion), &key("a"))
    }

    /// The noise variant in the noise profile `physical`, with a pinned gain.
    fn physical(severity: Severity, gain: f64) -> Rgb {
        let mut camera = CameraModel::default();
        camera.pin_gain(gain).unwrap();
        let synthesis = Synthesis::new(NoiseProfile::Physical, camera);
        Negative::new(&picture(), &key("a"), &synthesis, severity).develop(severity)
    }

    #[test]
    fn without_reaction_and_motion_auto_equals_the_physical_profile() {
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

    /// At L3 shutter and gain compensate the whole drop: the image is as bright as without a drop, with the noise of
    /// the gain K = 0.375 · 2⁴.
    #[test]
    fn gain_brightens_and_keeps_the_noise_of_its_photons() {
        let AppliedDegradation::Auto { shot, synthesis, .. } = applied("L3-auto", "gain=4", "speed=0") else {
            panic!("automatic exposure expected");
        };
        let state = synthesis.state_after_drop(&key("a"), shot.dark);
        assert!((state.system_gain - 6.0).abs() < 1e-12 && (state.ratio - 1.0).abs() < 1e-12);
        let (bright, dark) = (image("L3-auto", "gain=4", "speed=0"), physical(Severity::L3, 6.0));
        let [bright, dark] =
            [bright, dark].map(|image| image.samples().iter().map(|code| u64::from(*code)).sum::<u64>());
        assert!(bright > 4 * dark);
    }

    /// Green samples of an image of 256 × 256 sites.
    fn green_samples(raw: &Bayer) -> Vec<f64> {
        (0..256)
            .flat_map(|row| (0..128).map(move |i| (row, 2 * i + (row + 1) % 2)))
            .map(|(row, column)| f64::from(raw.sample(row, column)))
            .collect()
    }

    fn mean_and_variance(samples: &[f64]) -> (f64, f64) {
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let squares = samples.iter().map(|sample| (sample - mean).powi(2));
        (mean, squares.sum::<f64>() / n)
    }

    /// Variance of the shot noise of a flat grey, relative to the squared signal, times the signal in ADU.
    fn relative_shot_variance(auto: &str, how: &str) -> f64 {
        let AppliedDegradation::Auto { shot, synthesis, .. } = applied(how, auto, "speed=0") else {
            panic!("automatic exposure expected");
        };
        let grey = Rgb::new(256, 256, vec![117; 3 * 256 * 256]).unwrap();
        let state = synthesis.state_after_drop(&key("a"), shot.dark);
        let mut raw = unprocess(&grey, &state);
        let (light, _) = mean_and_variance(&green_samples(&raw));
        add(&mut raw, &state, &key("a"), Amplify::All, &[Term::Shot]);
        let (mean, variance) = mean_and_variance(&green_samples(&raw));
        assert!((mean / light - 1.0).abs() < 0.02, "{auto}: {mean} {light}");
        variance / (light * light) * (light * state.adu_range)
    }

    /// The relative variance of the shot noise is K₀ · 2^(ΔEV − s) / y, whatever the split between gain and darkness.
    #[test]
    fn shot_noise_follows_the_photons_alone() {
        for (auto, how, expected) in [
            ("shutter=2,gain=4", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=0", "L3-auto", 0.375 * 16.0),
            ("shutter=2,gain=2.5", "L3-auto", 0.375 * 16.0),
            ("shutter=4,gain=1", "L3-auto", 0.375 * 4.0),
            ("shutter=0,gain=3", "L1-auto", 0.375 * 4.0),
            ("shutter=2,gain=4", "L5-auto", 0.375 * 128.0),
        ] {
            let found = relative_shot_variance(auto, how);
            let off = found / expected - 1.0;
            assert!(off.abs() < 0.03, "{auto} at {how}: {found} instead of {expected}");
        }
    }

    fn camera_state(how: &str, motion: &str) -> CameraState {
        let applied = applied(how, "gain=4", motion);
        let synthesis = applied.synthesis().unwrap();
        synthesis.state_after_drop(&key("a"), applied.drop_ev())
    }

    /// σ of read and row noise, relative to its median at the same gain.
    fn fit_scatter(state: &CameraState) -> [f64; 2] {
        let mut camera = CameraModel::default();
        camera.set_sampling(crate::Sampling::Fixed);
        camera.pin_gain(state.system_gain).unwrap();
        let median = CameraState::draw(&key("a"), &camera);
        [state.read_scale / median.read_scale, state.row_deviation / median.row_deviation]
    }

    /// Common random numbers: all kinds of degradation share the draws of a frame, and a random direction does not
    /// change them.
    #[test]
    fn auto_and_noise_share_their_draws() {
        let noise = camera_state("L3-noise@eld", "angle=0");
        let auto = camera_state("L3-auto", "angle=random");
        assert_eq!(noise.rgb_to_camera, auto.rgb_to_camera);
        let [noise_gains, auto_gains] =
            [&noise, &auto].map(|state| [state.rgb_gain, state.red_gain, state.blue_gain].map(f64::to_bits));
        assert_eq!(noise_gains, auto_gains);
        // The scatter of the fits is shared, too.
        for (noise, auto) in fit_scatter(&noise).iter().zip(fit_scatter(&auto)) {
            assert!((noise / auto - 1.0).abs() < 1e-12 && (noise - 1.0).abs() > 1e-3);
        }
        let still = image("L3-auto", "gain=4", "speed=0,angle=0");
        assert_eq!(image("L3-auto", "gain=4", "speed=0,angle=random"), still);
        let moved = image("L3-auto", "gain=4", "angle=random");
        assert_ne!(moved, image("L3-auto", "gain=4", "angle=0"));
    }

    fn mean_light(image: &Rgb) -> f64 {
        image.samples().iter().map(|code| (f64::from(*code) / 255.0).powf(2.2)).sum::<f64>()
            / image.samples().len() as f64
    }

    /// Motion blur alone does not change the mean light; without motion, the image is unchanged.
    #[test]
    fn motion_blurs_and_does_not_darken() {
        assert_eq!(image("T33.33-motion", "gain=4", "speed=0"), picture());
        let blurred = image("T33.33-motion", "gain=4", "angle=20");
        assert_ne!(blurred, picture());
        assert!((mean_light(&blurred) / mean_light(&picture()) - 1.0).abs() < 0.01);
        let facts = applied("T33.33-motion", "gain=4", "angle=20").exposure().unwrap();
        assert_eq!((facts.shutter, facts.system_gain), (None, None));
        assert!((facts.time_ms - 33.33).abs() < 1e-9);
        assert!((facts.blur_px.unwrap() - 6.776).abs() < 1e-2);
    }

    /// Images of one instance in any order equal images of separate instances.
    #[test]
    fn the_cache_does_not_change_images() {
        let mut exposures = Exposures::default();
        for how in ["L5-auto", "L1-auto", "E1-auto", "L3-auto", "L3-noise@eld", "T16.67-motion"] {
            let applied = applied(how, "gain=4", "speed=30");
            let found = exposures.degrade((&picture()).into(), &applied, &key("a"));
            assert_eq!(found, image(how, "gain=4", "speed=30"), "{how}");
        }
    }

    fn apply_error(how: &str, auto: &str, motion: &str) -> String {
        apply(&Synthesis::default(), how, auto, motion).unwrap_err().to_string()
    }

    #[test]
    fn impossible_gains_and_paths_are_refused() {
        let error = apply_error("L5-auto", "gain=5", "speed=30");
        assert!(error.contains("K from 0.1 to 6"), "{error}");
        let error = apply_error("T133.33-motion", "gain=4", "speed=360");
        assert!(error.contains("325.20 pixels") && error.contains("at most 256"), "{error}");
        let error = apply_error("L1-auto", "shutter=2", "speed=1200");
        assert!(error.contains("pixels during the exposure"), "{error}");
    }
}
