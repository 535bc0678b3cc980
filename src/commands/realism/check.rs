//! Checks which pairs can be compared, before any is compared: [`check`].

use std::path::Path;

use super::settings::RealismArgs;
use super::workers::PairWorkers;
use crate::data::pairs::Pair;
use crate::engine::images::frames::InputTally;
use crate::error::{Error, Result};
use crate::pictures::ImageFile;
use crate::report::realism::LeftOut;
use crate::types::Rgb;
use crate::types::{FrameId, Pixels};
use darkqa_score::photographs::realism::scene::{MIN_CORRELATION, SceneMatch};
use darkqa_score::photographs::realism::{exposure_drop, same_size};

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
