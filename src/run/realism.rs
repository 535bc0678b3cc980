//! `realism`: the synthesis against real pairs of images in normal and low light, as the paper's comparison on
//! LLRGBD-real (DarkQA, Table I).
//!
//! Each pair's image in normal light is made as dark as its partner, by exposure drop alone and with the sensor's noise,
//! and both are compared with the real one. Residuals stand over the dropped clean image on either side; those of the
//! exposure drop itself are 0 everywhere, so that its divergence says how empty bins are counted, and no more.

use std::fs;
use std::path::Path;

use rayon::prelude::*;

use crate::ask::png;
use crate::config::{PairPlace, Realism, Show};
use crate::dataset::Picture;
use crate::dataset::pairs::{Pair, Pairs};
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::progress::Progress;
use crate::job::workers::pool;
use crate::report;
use crate::report::realism::{Rules, Source, Summary};
use crate::score::realism::residual::{Residuals, divergence};
use crate::score::realism::ssim::ssim;
use crate::score::realism::{Compared, Measured, exposure_drop, psnr, same_size};
use crate::synthesis::noise::Term;
use crate::synthesis::{Negative, NoiseKey, expose_by};
use crate::types::manifest::Status;
use crate::types::{FrameId, Rgb};

/// The most pairs whose crops are shown.
const MOST_CROPS: usize = 8;

/// A pair that was compared, with what the figures need.
struct Work {
    compared: Compared,
    /// Real and synthetic.
    residuals: [Residuals; 2],
    /// Real, by exposure and with noise, of the first pairs.
    images: Option<[Rgb; 3]>,
}

/// Compares all pairs.
///
/// A pair that cannot be compared is said, counted, and does not stop the others.
///
/// # Errors
/// Where there is no pair, none can be compared, or a file cannot be written.
pub fn realism(config: &Realism, progress: &Progress) -> Result<Outcome> {
    let Pairs { pairs, unmatched } = match &config.pairs {
        PairPlace::Together(folder) => Pairs::open(folder)?,
        PairPlace::Apart { normal, low } => Pairs::of_folders(normal, low)?,
    };
    for path in &unmatched {
        tracing::warn!("{}: no partner in the other light", path.display());
    }
    let cores = pool(config.threads)?;
    let bar = progress.bar("pairs", pairs.len());
    let results: Vec<Option<Work>> = cores.install(|| {
        let pairs = pairs.par_iter().enumerate();
        let compared = pairs.map(|(index, pair)| {
            let work = compare(config, pair, index < MOST_CROPS);
            bar.inc();
            work.map_err(|e| tracing::error!("{}: {e}", pair.name)).ok()
        });
        compared.collect()
    });
    drop(bar);
    let works: Vec<Work> = results.into_iter().flatten().collect();
    if works.is_empty() {
        return Err(Error::data("pairs", "none of them could be compared"));
    }
    let failed = pairs.len() - works.len();
    let compared: Vec<&Compared> = works.iter().map(|work| &work.compared).collect();
    let rules = Rules {
        bins: config.bins,
        empty: config.empty,
    };
    let source = Source {
        seed: config.sensor.seed,
        synthesis: serde_json::json!(config.sensor.readings.only()?),
        unmatched: unmatched.len(),
        failed,
    };
    let summary = Summary::new(rules, source, &compared)?;
    if let Some(out) = &config.out {
        files(out, &works, &summary)?;
    }
    Ok(Outcome {
        status: if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: match config.show {
            Show::Table => summary.table(),
            Show::Json => summary.json(),
        },
    })
}

fn compare(config: &Realism, pair: &Pair, shown: bool) -> Result<Work> {
    let decoded = |path: &Path| {
        let bytes = fs::read(path).map_err(|e| Error::file(path, "read", e))?;
        let place = path.display().to_string();
        let most_pixels = config.most_pixels;
        Picture::Encoded {
            bytes,
            place,
            most_pixels,
        }
        .decode()
    };
    let (normal, real) = (decoded(&pair.normal)?, decoded(&pair.low)?);
    same_size(&normal, &real)?;
    let drop = match config.drop {
        Some(drop) => drop,
        None => exposure_drop(&normal, &real)?,
    };
    let exposure = expose_by(&normal, f64::from(drop));
    let synthesis = config.sensor.readings.only()?;
    let key = NoiseKey::new(config.sensor.seed, &FrameId(pair.name.clone()));
    let state = synthesis.state_by(&key, f64::from(drop));
    let take = |terms: &[Term]| {
        let (amplify, tone) = (synthesis.amplify, synthesis.tone);
        Negative::taken(&normal, &key, &state, amplify, tone, terms).develop_by(f64::from(drop))
    };
    let (noise, clean) = (take(&Term::ALL), take(&[]));
    let residuals = [&real, &noise, &exposure].map(|image| Residuals::of(image, &exposure));
    let [of_real, of_noise, of_exposure] = residuals;
    let (of_real, of_noise, of_exposure) = (of_real?, of_noise?, of_exposure?);
    let other = config.empty.other();
    let measured = |image: &Rgb, residuals: &Residuals| -> Result<Measured> {
        Ok(Measured {
            psnr: psnr(&real, image)?,
            ssim: ssim(&real, image)?,
            kl: divergence(&of_real, residuals, config.bins, config.empty),
            kl_other: divergence(&of_real, residuals, config.bins, other),
        })
    };
    Ok(Work {
        compared: Compared {
            pair: pair.name.clone(),
            drop,
            exposure: measured(&exposure, &of_exposure)?,
            noise: measured(&noise, &of_noise)?,
            clean_psnr: psnr(&real, &clean)?,
        },
        residuals: [of_real, of_noise],
        images: shown.then_some([real, exposure, noise]),
    })
}

/// Leaves the numbers by pair, the summary and the figures in a folder.
fn files(out: &Path, works: &[Work], summary: &Summary) -> Result<()> {
    fs::create_dir_all(out).map_err(|e| Error::file(out, "make", e))?;
    let compared: Vec<&Compared> = works.iter().map(|work| &work.compared).collect();
    write(&out.join("pairs.csv"), &report::realism::pairs(&compared)?)?;
    write(&out.join("summary.json"), summary.json().as_bytes())?;
    let mut pooled = [Residuals::default(), Residuals::default()];
    for work in works {
        for (sum, residuals) in pooled.iter_mut().zip(&work.residuals) {
            sum.add(residuals);
        }
    }
    write(
        &out.join("residuals_by_code.csv"),
        &report::realism::by_code(&pooled)?,
    )?;
    write(
        &out.join("residuals.svg"),
        report::realism::figure(&pooled)?.as_bytes(),
    )?;
    let crops = works.iter().filter_map(|work| {
        let images = work.images.as_ref()?;
        Some((&work.compared, images))
    });
    write(
        &out.join("crops.png"),
        &png(&report::realism::crops(crops))?,
    )
}
