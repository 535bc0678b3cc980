//! Checks which pairs can be compared, before any is compared: [`check`].
//!
//! Fits the gain of the sensor to pairs ([`fit`]), and makes the camera with fitted gains ([`fitted_camera`]).
//!
//! The flags of `realism`: [`RealismArgs`].
//!
//! Threads that process the pairs: [`PairWorkers`].

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::ThreadPool;
use rayon::prelude::*;

use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Decides, FrameId, Pixels, ProfileName, Rgb};
use darkqa_data::pairs::Pair;
use darkqa_data::{DecodeArgs, RootArgs};
use darkqa_engine::images::frames::InputTally;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::ThreadArgs;
use darkqa_light::{
    CameraModel, CameraState, CleanRaw, Coupling, NoiseKey, Sampling, SensorArgs, SensorSettings, Synthesis,
};
use darkqa_pictures::ImageFile;
use darkqa_report::realism::LeftOut;
use darkqa_score::photographs::realism::gain::{GAINS, GainFit, LADDER_STEPS, PairFit, ProfileFit, ladder};
use darkqa_score::photographs::realism::residual::{Bins, EmptyBins};
use darkqa_score::photographs::realism::smooth::SmoothBlocks;
use darkqa_score::photographs::realism::{MIN_CORRELATION, SceneMatch, exposure_drop, same_size};

/// Absolute exposure drop in EV below which the images of a pair have nearly the same light (chosen).
const SMALL_DROP: f32 = 0.5;

/// A pair that can be compared.
pub(super) struct CheckedPair<'a> {
    pub pair: &'a Pair,
    /// Exposure drop in EV, as set or estimated.
    pub drop: f32,
    pub scene: SceneMatch,
}

/// Exposure drop and scene of a pair.
struct PairLight {
    /// Exposure drop in EV, as set or estimated.
    drop: f32,
    /// Exposure drop in EV estimated from the mean light of both images; `None` if one is black.
    estimated: Option<f32>,
    scene: SceneMatch,
}

/// Loads the images of a pair: in normal light at full bit depth, because it will be darkened, and in low light at 8
/// bits. The notes of the image files are added to `tally`.
pub(super) fn load(args: &RealismArgs, pair: &Pair, tally: Option<&InputTally>) -> Result<(Pixels, Rgb)> {
    let open = |path: &Path| {
        let file = ImageFile::open(path, args.decode.rule())?;
        if let Some(tally) = tally {
            tally.add(&FrameId(path.display().to_string()), &file.note());
        }
        Ok(file)
    };
    let normal = open(&pair.normal)?.pixels()?;
    let low = open(&pair.low)?.decode()?;
    same_size(&normal.codes(), &low)?;
    Ok((normal, low))
}

/// The pairs that can be compared, and the names of the others. Each pair left out is logged with the reason.
///
/// # Errors
/// If more than half of the pairs are swapped, because then the folders probably are.
pub(super) fn check<'a>(
    args: &RealismArgs,
    pairs: &'a [Pair],
    place: &Path,
    workers: &PairWorkers<'_>,
) -> Result<(Vec<CheckedPair<'a>>, LeftOut)> {
    let tally = InputTally::default();
    let lights = workers.map("pairs checked", pairs, |_, pair| measure_light(args, pair, &tally));
    tally.warn();
    refuse_swapped_folders(args, place, &lights)?;
    if let Some(ev) = args.ev.filter(|ev| ev.abs() < SMALL_DROP) {
        tracing::warn!("--ev {ev}: below {SMALL_DROP} EV both images have nearly the same light");
    }
    let (mut checked, mut left_out) = (Vec::new(), LeftOut::default());
    for (pair, light) in pairs.iter().zip(lights) {
        let name = &pair.name;
        let list = match light {
            Err(e) => {
                tracing::error!("{name}: {e}");
                &mut left_out.failed
            }
            Ok(light) if light.scene.is_of_two_scenes() => {
                let found = light.scene.correlation.unwrap_or_default();
                tracing::error!(
                    "{name}: its images show two scenes, so it is left out: their structure correlates by {found:.2}, that of one scene by {MIN_CORRELATION} or more"
                );
                &mut left_out.two_scenes
            }
            Ok(light) if light.is_swapped(args) => {
                let brighter = -light.estimated.unwrap_or_default();
                tracing::error!(
                    "{name}: low is brighter than normal by {brighter:.2} EV, so it is left out: are the two images swapped?"
                );
                &mut left_out.swapped
            }
            Ok(light) => {
                light.warn(args, name);
                checked.push(CheckedPair { pair, drop: light.drop, scene: light.scene });
                continue;
            }
        };
        list.push(name.clone());
    }
    Ok((checked, left_out))
}

fn measure_light(args: &RealismArgs, pair: &Pair, tally: &InputTally) -> Result<PairLight> {
    let (normal, low) = load(args, pair, Some(tally))?;
    let normal = normal.codes();
    let estimated = exposure_drop(&normal, &low);
    let (drop, estimated) = match args.ev {
        Some(drop) => (drop, estimated.ok()),
        None => estimated.map(|drop| (drop, Some(drop)))?,
    };
    Ok(PairLight { drop, estimated, scene: SceneMatch::new(&normal, &low, f64::from(drop)) })
}

impl PairLight {
    /// True if the low-light image is at least as bright as the other one, unless `--ev` states so.
    fn is_swapped(&self, args: &RealismArgs) -> bool {
        let is_meant = args.ev.is_some_and(|drop| drop <= 0.0);
        !is_meant && self.estimated.is_some_and(|drop| drop <= 0.0)
    }

    /// Warns about reasons why the comparison of a pair may be meaningless.
    fn warn(&self, args: &RealismArgs, name: &str) {
        if args.ev.is_none() && self.drop.abs() < SMALL_DROP {
            tracing::warn!(
                "{name}: its exposure drop is {:.2} EV: below {SMALL_DROP} EV both images have nearly the same light",
                self.drop
            );
        }
        if self.scene.correlation.is_none() {
            tracing::warn!(
                "{name}: too little structure, or too much noise, to tell whether both images show one scene"
            );
        }
    }
}

/// Returns an error if most pairs are swapped.
fn refuse_swapped_folders(args: &RealismArgs, place: &Path, lights: &[Result<PairLight>]) -> Result<()> {
    let known: Vec<&PairLight> = lights.iter().flatten().filter(|light| light.estimated.is_some()).collect();
    let swapped: Vec<&&PairLight> = known.iter().filter(|light| light.is_swapped(args)).collect();
    if 2 * swapped.len() <= known.len() {
        return Ok(());
    }
    let how = if swapped.iter().any(|light| light.estimated.is_some_and(|drop| drop < 0.0)) {
        "brighter than"
    } else {
        "as bright as"
    };
    let problem = format_args!(
        "low is {how} normal in {} of {} pairs: are the folders swapped? (--ev states a drop that is meant)",
        swapped.len(),
        known.len()
    );
    Err(Error::data(place.display(), problem))
}

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

/// Minimum and maximum of `--ev`, in EV.
const DROP_RANGE: [f32; 2] = [-20.0, 20.0];

/// The flags of `realism`.
#[derive(Debug, Args)]
pub(crate) struct RealismArgs {
    /// A folder of pairs: normal/ and low/, high/ and low/, val_rgb_h/ and val_rgb_l/, or files like normal1.png and
    /// low1.png
    #[arg(
        value_name = "PAIRS",
        required_unless_present = "normal",
        conflicts_with = "normal", add = Decides::Pixels)]
    pub pairs: Option<PathBuf>,
    /// The images in normal light, if they lie elsewhere; default: in PAIRS
    #[arg(long, value_name = "DIR", requires = "low", add = Decides::Pixels)]
    pub normal: Option<PathBuf>,
    /// The images in low light, of the same names; default: in PAIRS
    #[arg(long, value_name = "DIR", requires = "normal", add = Decides::Pixels)]
    pub low: Option<PathBuf>,
    /// Further folders that images may lie in.
    #[command(flatten)]
    pub root: RootArgs,
    /// The exposure drop of every pair in EV, -20 to 20; default: estimated for each from its mean light
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = drop_ev, add = Decides::Pixels)]
    pub ev: Option<f32>,
    /// Fit the sensor's gain K to the noise of each pair, in each noise profile, and compare the fitted camera too
    ///
    /// The gain is the one whose noise has the spread of the low-light image in blocks that are smooth in normal light,
    /// as saved: a smaller K than the sensor's means that noise was averaged away. paper and eld take the middle of the
    /// camera's r, or --noise ratio, because images show the product rK alone. With 3 fitted pairs or more, each pair
    /// is judged by the gains of the others. --out also gets a camera file for --noise camera: fitted.toml, or
    /// fitted-READING.toml for each of several readings.
    #[arg(long, conflicts_with = "gain", add = Decides::Pixels)]
    pub fit: bool,
    /// The bins of the residuals' divergence
    #[arg(long, value_enum, default_value_t, add = Decides::Nothing)]
    pub kl_bins: Bins,
    /// Treatment of empty bins of fu; both are shown
    #[arg(long, value_enum, default_value_t, add = Decides::Nothing)]
    pub kl_empty: EmptyBins,
    /// The sensor and its noise.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Where the numbers by pair, the summary and the figures go; default: nowhere
    #[arg(long, value_name = "DIR", help_heading = "Output", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// The reading of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Parses an exposure drop in EV.
fn drop_ev(text: &str) -> Result<f32, String> {
    let [min, max] = DROP_RANGE;
    text.parse()
        .ok()
        .filter(|ev| (min..=max).contains(ev))
        .ok_or_else(|| format!("a number from {min} to {max} expected"))
}

/// Threads that process the pairs, with a progress bar.
pub(super) struct PairWorkers<'a> {
    pub pool: ThreadPool,
    pub progress: &'a Progress,
}

impl PairWorkers<'_> {
    /// Applies `work` to each item and its index, and returns the results in order. `what` is the name of the items in
    /// the progress bar.
    pub(super) fn map<I: Sync, T: Send>(
        &self,
        what: &'static str,
        items: &[I],
        work: impl Fn(usize, &I) -> T + Sync,
    ) -> Vec<T> {
        let bar = self.progress.bar(what, items.len());
        self.pool.install(|| {
            items
                .par_iter()
                .enumerate()
                .map(|(index, item)| {
                    let result = work(index, item);
                    bar.inc();
                    result
                })
                .collect()
        })
    }
}
