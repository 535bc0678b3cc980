//! `realism`: compares the synthesis with real pairs of images in normal and low light, as the paper does on
//! LLRGBD-real (DarkQA, Table I), and fits the sensor's gain to them (`--fit`).
//!
//! The image in normal light is made as dark as its partner, by exposure drop alone and with sensor noise. Both results
//! are compared with the real image. A residual is the difference from the clean image after the exposure drop. The
//! residuals of the exposure drop alone are 0, so its divergence depends only on the treatment of empty bins.
//!
//! The output files of `realism`: numbers of each pair, summary and figures ([`write_files`]), fitted gains and camera
//! files ([`write_fits`]).
//!
//! Compares each pair with its synthetic images: [`compare`].

mod check;

use std::fs;
use std::path::Path;

use check::{CheckedPair, PairWorkers, fitted_camera, load};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::types::{FrameId, Rgb};
use darkqa_data::pairs::Pairs;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::pool;
use darkqa_light::raw::noise::Term;
use darkqa_light::{Negative, NoiseKey, SensorSettings, Synthesis, expose_by};
use darkqa_pictures::png;
use darkqa_report::realism as report;
use darkqa_report::realism::{ComparedData, PooledResiduals, RealismSummary, ResidualRules};
use darkqa_runs::Outcome;
use darkqa_score::photographs::realism::gain::{PooledGain, ProfileFit};
use darkqa_score::photographs::realism::residual::{Residuals, divergence};
use darkqa_score::photographs::realism::ssim::ssim;
use darkqa_score::photographs::realism::{
    CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison, psnr,
};

pub(crate) use check::RealismArgs;

/// Compares all pairs. If one fails, the error is logged and counted, and the others continue.
///
/// # Errors
/// If there is no pair, none can be compared, most are swapped, or a file cannot be written.
pub(crate) fn realism(args: &RealismArgs, progress: &Progress) -> Result<Outcome> {
    let (found, place) = match (&args.pairs, &args.normal, &args.low) {
        (None, Some(normal), Some(low)) => (Pairs::from_folders(normal, low, &args.root.data_root)?, low.as_path()),
        (folder, ..) => {
            let folder = folder.as_deref().unwrap_or(Path::new("."));
            let other = "--normal DIR and --low DIR name any two folders, instead of PAIRS";
            (Pairs::open(folder, &args.root.data_root, other)?, folder)
        }
    };
    let sensor = SensorSettings::resolve(&args.sensor)?;
    for path in &found.unmatched {
        tracing::warn!("{}: no partner in the other light", path.display());
    }
    let workers = PairWorkers { pool: pool(args.threads.threads)?, progress };
    let (checked, mut left_out) = check::check(args, &found.pairs, place, &workers)?;
    let fits = if args.fit { check::fit(args, &sensor, &checked, &workers)? } else { Vec::new() };
    let (works, failed) = compare(args, &sensor, &checked, &fits, &workers);
    left_out.failed.extend(failed);
    left_out.failed.sort();
    let status = Outcome::complete_if(left_out.is_empty());
    let source = ComparedData {
        seed: sensor.seed,
        synthesis: serde_json::json!(sensor.readings),
        unmatched: found.unmatched.len(),
        left_out,
    };
    let summary = summary(args, source, &works, fits.clone())?;
    if let Some(out) = &args.out {
        write_files(out, &works, &summary)?;
        write_fits(out, &sensor, &fits)?;
    }
    Ok(match &args.out {
        _ if args.json => Outcome::text(status, summary.json()),
        None => Outcome::text(status, summary.table()),
        Some(out) => Outcome::wrote(out, status, summary.table()),
    })
}

fn summary(
    args: &RealismArgs,
    source: ComparedData,
    works: &[PairWork],
    fits: Vec<ProfileFit>,
) -> Result<RealismSummary> {
    if works.is_empty() {
        return Err(Error::data("pairs", "no pair could be compared"));
    }
    let compared: Vec<&PairComparison> = works.iter().map(|work| &work.compared).collect();
    let rules = ResidualRules { bins: args.kl_bins, empty: args.kl_empty };
    RealismSummary::new(rules, source, &compared, fits)
}

/// Writes the numbers of each pair, the summary and the figures into a folder.
fn write_files(out: &Path, works: &[PairWork], summary: &RealismSummary) -> Result<()> {
    fs::create_dir_all(out).map_err(|e| Error::file(out, "make", e))?;
    let compared: Vec<&PairComparison> = works.iter().map(|work| &work.compared).collect();
    write(&out.join("pairs.csv"), &report::pairs(&compared)?)?;
    write(&out.join("summary.json"), summary.json().as_bytes())?;
    let pooled = pool_residuals(works);
    write(&out.join("residuals_by_code.csv"), &report::by_code(&pooled)?)?;
    write(&out.join("residuals.svg"), report::figure(&pooled)?.as_bytes())?;
    let crops = works.iter().filter_map(|work| {
        let images = work.images.as_deref()?;
        Some((&work.compared, images))
    });
    write(&out.join("crops.png"), &png(&report::crops(crops))?)
}

/// The residuals of all pairs, pooled.
fn pool_residuals(works: &[PairWork]) -> PooledResiduals {
    let noise = works.iter().take(1).flat_map(|work| &work.compared.noise);
    PooledResiduals {
        real: sum_residuals(works, 0),
        noise: noise
            .enumerate()
            .map(|(index, noise)| (noise.method.clone(), sum_residuals(works, index + 1)))
            .collect(),
    }
}

fn sum_residuals(works: &[PairWork], index: usize) -> Residuals {
    let mut sum = Residuals::default();
    for residuals in works.iter().filter_map(|work| work.residuals.get(index)) {
        sum.add(residuals);
    }
    sum
}

/// Writes the fitted gains of each pair, and a camera file for each noise profile with fitted pairs: `fitted.toml` if
/// there is one noise profile, else `fitted-PROFILE.toml`.
fn write_fits(out: &Path, sensor: &SensorSettings, fits: &[ProfileFit]) -> Result<()> {
    if fits.is_empty() {
        return Ok(());
    }
    write(&out.join("fits.csv"), &report::fits_csv(fits)?)?;
    for fit in fits {
        let file = match fits {
            [_] => "fitted.toml".to_owned(),
            _ => format!("fitted-{}.toml", fit.profile),
        };
        let path = out.join(file);
        let synthesis = sensor.readings.get(&fit.profile);
        if let Some((synthesis, gains)) = synthesis.zip(fit.pooled.as_ref()) {
            write(&path, camera_file(synthesis, fit, gains)?.as_bytes())?;
        } else {
            let earlier = if path.exists() { "; the file that is there is from an earlier run" } else { "" };
            tracing::warn!("{}: not written, because no pair is fitted under {}{earlier}", path.display(), fit.profile);
        }
    }
    Ok(())
}

/// A camera file with the fitted range of K.
fn camera_file(synthesis: &Synthesis, fit: &ProfileFit, gains: &PooledGain) -> Result<String> {
    let fitted = fitted_camera(&synthesis.camera, fit, gains.range)?;
    let mut calibration = fitted.calibration().clone();
    let base = std::mem::replace(&mut calibration.name, format!("{}-fitted", synthesis.camera.calibration().name));
    let mut comments = vec![
        format!(
            "The sensor {base} with its gain K fitted to the noise of real images under the noise profile {}, {}.",
            fit.profile,
            report::AS_SAVED
        ),
        format!("gain: the 10 % to 90 % range of K over the pairs that were fitted, {} in number.", gains.n),
    ];
    if let Some(ratio) = fit.ratio {
        calibration.ratio = [ratio; 2];
        comments.push(format!("ratio: {ratio}, which the fit took, because images show only the product r · K."));
    }
    calibration.to_toml(&comments)
}

/// Maximum number of pairs whose crops are shown (chosen).
const MAX_CROPS: usize = 8;

/// The comparison of a pair, with the data for the figures.
pub(super) struct PairWork {
    pub compared: PairComparison,
    /// Residuals of the real image, then of the images with noise.
    pub residuals: Vec<Residuals>,
    /// The real image, the image with the exposure drop alone, then the images with noise; `None` if no crops are
    /// shown.
    pub images: Option<Vec<Rgb>>,
}

/// The comparisons of all pairs, and the names of those that failed. Failures are logged.
fn compare(
    args: &RealismArgs,
    sensor: &SensorSettings,
    pairs: &[CheckedPair<'_>],
    fits: &[ProfileFit],
    workers: &PairWorkers<'_>,
) -> (Vec<PairWork>, Vec<String>) {
    let compared =
        workers.map("pairs", pairs, |index, checked| compare_pair(args, sensor, checked, fits, index < MAX_CROPS));
    let (mut works, mut failed) = (Vec::new(), Vec::new());
    for (work, checked) in compared.into_iter().zip(pairs) {
        match work {
            Ok(work) => works.push(work),
            Err(e) => {
                tracing::error!("{}: {e}", checked.pair.name);
                failed.push(checked.pair.name.clone());
            }
        }
    }
    (works, failed)
}

/// The noise methods for a pair: each noise profile with the given camera, and with the fitted one.
fn methods(sensor: &SensorSettings, fits: &[ProfileFit], pair: &str) -> Result<Vec<(NoiseMethod, Synthesis)>> {
    let mut methods = Vec::new();
    for (profile, synthesis) in sensor.readings.iter() {
        let method = |camera| NoiseMethod { profile: profile.clone(), camera };
        methods.push((method(CameraOrigin::Given), synthesis.clone()));
        let fit = fits.iter().find(|fit| fit.profile == *profile);
        if let Some((fit, (gains, origin))) = fit.and_then(|fit| Some((fit, fit.for_pair(pair)?))) {
            let camera = fitted_camera(&synthesis.camera, fit, gains.range)?;
            let fitted = Synthesis { camera, ..synthesis.clone() };
            methods.push((method(origin), fitted));
        }
    }
    Ok(methods)
}

fn compare_pair(
    args: &RealismArgs,
    sensor: &SensorSettings,
    checked: &CheckedPair<'_>,
    fits: &[ProfileFit],
    with_images: bool,
) -> Result<PairWork> {
    let (normal, real) = load(args, checked.pair, None)?;
    let drop = f64::from(checked.drop);
    let exposure = expose_by(&normal, drop);
    let key = NoiseKey::new(sensor.seed, &FrameId(checked.pair.name.clone()));
    let real_residuals = Residuals::new(&real, &exposure)?;
    let compare_image = |image: &Rgb| -> Result<(ImageComparison, Residuals)> {
        let residuals = Residuals::new(image, &exposure)?;
        let comparison = ImageComparison {
            psnr: psnr(&real, image)?,
            ssim: ssim(&real, image)?,
            kl: divergence(&real_residuals, &residuals, args.kl_bins, args.kl_empty),
            kl_other: divergence(&real_residuals, &residuals, args.kl_bins, args.kl_empty.other()),
        };
        Ok((comparison, residuals))
    };
    let (exposure_comparison, _) = compare_image(&exposure)?;
    let (mut noise, mut residuals, mut images) = (Vec::new(), Vec::new(), Vec::new());
    for (method, synthesis) in methods(sensor, fits, &checked.pair.name)? {
        let state = synthesis.state_after_drop(&key, drop);
        let render = |terms: &[Term]| {
            let (amplify, tone) = (synthesis.amplify, synthesis.tone);
            let headroom = synthesis.headroom_ev(drop);
            Negative::with_state(&normal, &key, &state, amplify, tone, terms, headroom).develop_by(drop)
        };
        let (noisy, clean) = (render(&Term::ALL), render(&[]));
        let (image, noise_residuals) = compare_image(&noisy)?;
        noise.push(NoiseComparison { method, image, clean_psnr: psnr(&real, &clean)? });
        residuals.push(noise_residuals);
        images.push(noisy);
    }
    residuals.insert(0, real_residuals.clone());
    let images = with_images.then(|| [vec![real, exposure.clone()], images].concat());
    Ok(PairWork {
        compared: PairComparison {
            pair: checked.pair.name.clone(),
            drop: checked.drop,
            scene: checked.scene,
            exposure: exposure_comparison,
            noise,
        },
        residuals,
        images,
    })
}
