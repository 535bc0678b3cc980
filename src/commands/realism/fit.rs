//! Fits the gain of the sensor to pairs ([`fit`]), and makes the camera with fitted gains ([`fitted_camera`]).

use super::check::{CheckedPair, load};
use super::settings::RealismArgs;
use super::workers::PairWorkers;
use crate::error::Result;
use crate::types::{FrameId, Pixels, ProfileName, Rgb};
use darkqa_light::{CameraModel, CameraState, CleanRaw, Coupling, NoiseKey, Sampling, SensorSettings, Synthesis};
use darkqa_score::photographs::realism::gain::{GAINS, GainFit, LADDER_STEPS, PairFit, ProfileFit, ladder};
use darkqa_score::photographs::realism::smooth::SmoothBlocks;

/// The fits to all pairs, one for each noise profile. Pairs that cannot be read are left out.
///
/// # Errors
/// If the camera does not accept the gains of the fit.
pub(super) fn fit(
    args: &RealismArgs,
    sensor: &SensorSettings,
    pairs: &[CheckedPair<'_>],
    workers: &PairWorkers<'_>,
) -> Result<Vec<ProfileFit>> {
    let profiles: Vec<ProfileLadder> =
        sensor.readings.iter().map(|(name, synthesis)| ProfileLadder::new(name, synthesis)).collect::<Result<_>>()?;
    let fits = workers.map("pairs fitted", pairs, |_, checked| {
        // A file that can no longer be read fails in the comparison, where it is logged and counted.
        let (normal, low) = load(args, checked.pair, None).ok()?;
        Some(fit_pair(sensor.seed, &profiles, checked, &normal, &low))
    });
    Ok(profiles
        .iter()
        .enumerate()
        .map(|(index, profile)| {
            let pair_fits = pairs
                .iter()
                .zip(&fits)
                .filter_map(|(checked, fits)| {
                    Some(PairFit { pair: checked.pair.name.clone(), fit: *fits.as_ref()?.get(index)? })
                })
                .collect();
            ProfileFit::new(profile.name.clone(), profile.ratio(), pair_fits)
        })
        .collect())
}

/// A noise profile with a camera at the middle of its ranges, for each gain of the ladder.
struct ProfileLadder {
    name: ProfileName,
    ladder: [Synthesis; LADDER_STEPS],
}

impl ProfileLadder {
    fn new(name: &ProfileName, synthesis: &Synthesis) -> Result<Self> {
        let mut camera = synthesis.camera.clone();
        camera.set_sampling(Sampling::Fixed);
        camera.set_gain_range(GAINS)?;
        let given = Synthesis { camera, ..synthesis.clone() };
        let mut at_gains = ladder().map(|_| given.clone());
        for (synthesis, gain) in at_gains.iter_mut().zip(ladder()) {
            synthesis.camera.pin_gain(gain)?;
        }
        Ok(Self { name: name.clone(), ladder: at_gains })
    }

    /// The light ratio r; `None` if it depends on the exposure drop.
    fn ratio(&self) -> Option<f64> {
        let [synthesis, ..] = &self.ladder;
        let is_free = synthesis.coupling == Coupling::Independent;
        is_free.then(|| fixed_state(synthesis, 0.0).ratio)
    }
}

/// The state of a camera at the middle of its ranges, which is the same for all frames.
fn fixed_state(synthesis: &Synthesis, drop_ev: f64) -> CameraState {
    synthesis.state_after_drop(&NoiseKey::new(0, &FrameId(String::new())), drop_ev)
}

/// The fits to one pair, one for each noise profile.
fn fit_pair(
    seed: u64,
    profiles: &[ProfileLadder],
    checked: &CheckedPair<'_>,
    normal: &Pixels,
    low: &Rgb,
) -> Vec<GainFit> {
    // The key differs from that of the comparison, so that fit and comparison do not share noise.
    let key = NoiseKey::new(seed, &FrameId(format!("fit of {}", checked.pair.name)));
    let drop = f64::from(checked.drop);
    let smooth = SmoothBlocks::new(&normal.codes(), drop);
    let real = smooth.spread(low);
    profiles
        .iter()
        .map(|profile| {
            let mut raw = None;
            let curves = profile.ladder.each_ref().map(|synthesis| {
                let state = fixed_state(synthesis, drop);
                // The clean RAW image is the same at all gains, because the colours of the camera are.
                let headroom = synthesis.headroom_ev(drop);
                let raw = raw.get_or_insert_with(|| CleanRaw::new(normal, state.clone(), headroom));
                let negative = raw.negative(&key, &state, synthesis.amplify, synthesis.tone);
                smooth.spread(&negative.develop_by(drop))
            });
            GainFit::fit(&real, &curves)
        })
        .collect()
}

/// The camera of a noise profile with its gain drawn from a fitted range, and with the ratio of the fit.
///
/// # Errors
/// If the camera does not take the range or the ratio.
pub(super) fn fitted_camera(camera: &CameraModel, fit: &ProfileFit, range: [f64; 2]) -> Result<CameraModel> {
    let mut fitted = camera.clone();
    fitted.set_gain_range(range)?;
    if let Some(ratio) = fit.ratio {
        fitted.pin_ratio(ratio)?;
    }
    Ok(fitted)
}
