//! `realism`: comparing the synthesis with real pairs of images in normal and low light, as the paper does on LLRGBD-real
//! (DarkQA, Table I).
//!
//! The image in normal light is made as dark as its partner, by exposure drop alone and with sensor noise. Both results
//! are compared with the real image. A residual is the difference from the clean image after the exposure drop. The
//! residuals of the exposure drop alone are 0, so its divergence depends only on how empty bins are counted.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use crate::ask::png;
use crate::dataset::pairs::{Pair, Pairs};
use crate::dataset::{Picture, PixelLimit};
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::progress::Progress;
use crate::job::workers::{ThreadArgs, pool};
use crate::report;
use crate::report::realism::{ComparedData, RealismSummary, ResidualRules};
use crate::score::realism::residual::{Bins, EmptyBins, Residuals, divergence};
use crate::score::realism::ssim::ssim;
use crate::score::realism::{ImageComparison, PairComparison, exposure_drop, psnr, same_size};
use crate::synthesis::noise::Term;
use crate::synthesis::{Negative, NoiseKey, SensorArgs, SensorSettings, expose_by};
use crate::types::manifest::Status;
use crate::types::{Decides, FrameId, Rgb};

/// The maximum number of pairs whose crops are shown (chosen).
const MOST_CROPS: usize = 8;

/// The minimum and maximum of `--ev`, in EV.
const DROPS: [f32; 2] = [-20.0, 20.0];

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
    /// The exposure drop of every pair in EV, -20 to 20; default: estimated for each from its mean light
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = drop_ev, add = Decides::Pixels)]
    pub ev: Option<f32>,
    /// The bins of the residuals' divergence
    #[arg(long, value_enum, default_value_t, add = Decides::Nothing)]
    pub kl_bins: Bins,
    /// What is done about empty bins of fu; both are shown
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
    /// The maximum size of an image.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The exposure drop in a text, in EV.
fn drop_ev(text: &str) -> Result<f32, String> {
    let [least, most] = DROPS;
    let ev = text.parse().ok();
    let ev = ev.filter(|ev| (least..=most).contains(ev));
    ev.ok_or_else(|| format!("a number from {least} to {most} expected"))
}

/// The comparison of a pair, with the data for the figures.
struct PairWork {
    compared: PairComparison,
    /// The residuals of the real and of the noisy image.
    residuals: [Residuals; 2],
    /// The real image, the one by exposure alone and the noisy one; `None` if no crops are shown.
    images: Option<[Rgb; 3]>,
}

/// Compares all pairs.
///
/// If one pair fails, the error is logged and counted, and the others continue.
///
/// # Errors
/// If there is no pair, none can be compared, or a file cannot be written.
pub(crate) fn realism(args: &RealismArgs, progress: &Progress) -> Result<Outcome> {
    let Pairs { pairs, unmatched } = match (&args.pairs, &args.normal, &args.low) {
        (None, Some(normal), Some(low)) => Pairs::of_folders(normal, low)?,
        (folder, ..) => Pairs::open(folder.as_deref().unwrap_or(Path::new(".")))?,
    };
    let sensor = SensorSettings::resolve(&args.sensor)?;
    for path in &unmatched {
        tracing::warn!("{}: no partner in the other light", path.display());
    }
    let workers = pool(args.threads.threads)?;
    let bar = progress.bar("pairs", pairs.len());
    let results: Vec<Option<PairWork>> = workers.install(|| {
        let pairs = pairs.par_iter().enumerate();
        let compared = pairs.map(|(index, pair)| {
            let work = compare(args, &sensor, pair, index < MOST_CROPS);
            bar.inc();
            work.map_err(|e| tracing::error!("{}: {e}", pair.name)).ok()
        });
        compared.collect()
    });
    drop(bar);
    let works: Vec<PairWork> = results.into_iter().flatten().collect();
    if works.is_empty() {
        return Err(Error::data("pairs", "no pair could be compared"));
    }
    let failed = pairs.len() - works.len();
    let compared: Vec<&PairComparison> = works.iter().map(|work| &work.compared).collect();
    let rules = ResidualRules {
        bins: args.kl_bins,
        empty: args.kl_empty,
    };
    let source = ComparedData {
        seed: sensor.seed,
        synthesis: serde_json::json!(sensor.readings.only()?),
        unmatched: unmatched.len(),
        failed,
    };
    let summary = RealismSummary::new(rules, source, &compared)?;
    if let Some(out) = &args.out {
        write_files(out, &works, &summary)?;
    }
    Ok(Outcome {
        status: if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: if args.json {
            summary.json()
        } else {
            summary.table()
        },
    })
}

fn compare(
    args: &RealismArgs,
    sensor: &SensorSettings,
    pair: &Pair,
    shown: bool,
) -> Result<PairWork> {
    let decoded = |path: &Path| {
        let bytes = fs::read(path).map_err(|e| Error::file(path, "read", e))?;
        let place = path.display().to_string();
        let most_pixels = args.limit.max_pixels.get();
        Picture::Encoded {
            bytes,
            place,
            most_pixels,
        }
        .decode()
    };
    let (normal, real) = (decoded(&pair.normal)?, decoded(&pair.low)?);
    same_size(&normal, &real)?;
    let drop = match args.ev {
        Some(drop) => drop,
        None => exposure_drop(&normal, &real)?,
    };
    let exposure = expose_by(&normal, f64::from(drop));
    let synthesis = sensor.readings.only()?;
    let key = NoiseKey::new(sensor.seed, &FrameId(pair.name.clone()));
    let state = synthesis.state_by(&key, f64::from(drop));
    let take = |terms: &[Term]| {
        let (amplify, tone) = (synthesis.amplify, synthesis.tone);
        Negative::with_state(&normal, &key, &state, amplify, tone, terms)
            .develop_by(f64::from(drop))
    };
    let (noise, clean) = (take(&Term::ALL), take(&[]));
    let residuals = [&real, &noise, &exposure].map(|image| Residuals::of(image, &exposure));
    let [of_real, of_noise, of_exposure] = residuals;
    let (of_real, of_noise, of_exposure) = (of_real?, of_noise?, of_exposure?);
    let other = args.kl_empty.other();
    let measured = |image: &Rgb, residuals: &Residuals| -> Result<ImageComparison> {
        Ok(ImageComparison {
            psnr: psnr(&real, image)?,
            ssim: ssim(&real, image)?,
            kl: divergence(&of_real, residuals, args.kl_bins, args.kl_empty),
            kl_other: divergence(&of_real, residuals, args.kl_bins, other),
        })
    };
    Ok(PairWork {
        compared: PairComparison {
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

/// Writes the numbers of each pair, the summary and the figures into a folder.
fn write_files(out: &Path, works: &[PairWork], summary: &RealismSummary) -> Result<()> {
    fs::create_dir_all(out).map_err(|e| Error::file(out, "make", e))?;
    let compared: Vec<&PairComparison> = works.iter().map(|work| &work.compared).collect();
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
