//! Compares each pair with its synthetic images: [`compare`].

use super::check::{CheckedPair, load};
use super::fit::fitted_camera;
use super::settings::RealismArgs;
use super::workers::PairWorkers;
use crate::error::Result;
use crate::types::{FrameId, Rgb};
use darkqa_light::raw::noise::Term;
use darkqa_light::{Negative, NoiseKey, SensorSettings, Synthesis, expose_by};
use darkqa_score::photographs::realism::gain::ProfileFit;
use darkqa_score::photographs::realism::residual::{Residuals, divergence};
use darkqa_score::photographs::realism::ssim::ssim;
use darkqa_score::photographs::realism::{
    CameraOrigin, ImageComparison, NoiseComparison, NoiseMethod, PairComparison, psnr,
};

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
pub(super) fn compare(
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
