//! The output files of `realism`: numbers of each pair, summary and figures ([`write_files`]), fitted gains and camera
//! files ([`write_fits`]).

use std::fs;
use std::path::Path;

use super::compare::PairWork;
use super::fit::fitted_camera;
use crate::error::{Error, Result};
use crate::files::write;
use crate::pictures::png;
use crate::report::realism as report;
use crate::report::realism::{PooledResiduals, RealismSummary};
use darkqa_light::{SensorSettings, Synthesis};
use darkqa_score::photographs::realism::PairComparison;
use darkqa_score::photographs::realism::gain::{PooledGain, ProfileFit};
use darkqa_score::photographs::realism::residual::Residuals;

/// Writes the numbers of each pair, the summary and the figures into a folder.
pub(super) fn write_files(out: &Path, works: &[PairWork], summary: &RealismSummary) -> Result<()> {
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
pub(super) fn write_fits(out: &Path, sensor: &SensorSettings, fits: &[ProfileFit]) -> Result<()> {
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
