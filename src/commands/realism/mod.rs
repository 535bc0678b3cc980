//! `realism`: compares the synthesis with real pairs of images in normal and low light, as the paper does on
//! LLRGBD-real (DarkQA, Table I), and fits the sensor's gain to them (`--fit`).
//!
//! The image in normal light is made as dark as its partner, by exposure drop alone and with sensor noise. Both results
//! are compared with the real image. A residual is the difference from the clean image after the exposure drop. The
//! residuals of the exposure drop alone are 0, so its divergence depends only on the treatment of empty bins.

mod check;
mod compare;
mod files;
mod fit;
mod settings;
mod workers;

use std::path::Path;

use compare::PairWork;
pub(crate) use settings::RealismArgs;
use workers::PairWorkers;

use crate::data::pairs::Pairs;
use crate::engine::images::progress::Progress;
use crate::engine::images::workers::pool;
use crate::error::{Error, Result};
use crate::report::realism::{ComparedData, RealismSummary, ResidualRules};
use crate::runs::Outcome;
use darkqa_light::SensorSettings;
use darkqa_score::photographs::realism::PairComparison;
use darkqa_score::photographs::realism::gain::ProfileFit;

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
    let fits = if args.fit { fit::fit(args, &sensor, &checked, &workers)? } else { Vec::new() };
    let (works, failed) = compare::compare(args, &sensor, &checked, &fits, &workers);
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
        files::write_files(out, &works, &summary)?;
        files::write_fits(out, &sensor, &fits)?;
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
