//! `enhance`: images as a model mends them, or what is known of the model.

use std::path::Path;

use crate::ask::png;
use crate::config::{Enhance, Existing};
use crate::dataset::inputs::{Entry, Inputs};
use crate::enhance::{Enhancer, ModelFile};
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::enhancers::OpenEnhancers;
use crate::job::progress::Progress;
use crate::types::manifest::Status;

/// Makes the images, or describes the model.
///
/// What cannot be made of one image is said, counted, and does not stop the others.
///
/// # Errors
/// Where nothing can be made: no such model or input, two images of one name, no folder to write to.
pub fn enhance(config: &Enhance, progress: &Progress) -> Result<Outcome> {
    let files = config.enhancement.models.iter();
    let files = files
        .map(|path| ModelFile::read(path))
        .collect::<Result<Vec<_>>>()?;
    let enhancers = OpenEnhancers::load(files, &config.enhancement)?.take()?;
    let [mut enhancer] = <[Enhancer; 1]>::try_from(enhancers)
        .map_err(|_| Error::usage("MODEL", "one model expected"))?;
    let Some(out) = &config.out else {
        return Ok(Outcome {
            status: Status::Complete,
            output: enhancer.describe(),
        });
    };
    let images = Inputs::open(&config.inputs, config.most_pixels)?;
    let bar = progress.bar("images", images.entries.len());
    let (mut made, mut kept, mut failed) = (0, 0, 0);
    for entry in &images.entries {
        let path = out.join(format!("{}.png", entry.stem));
        if path.exists() && config.existing == Existing::Kept {
            kept += 1;
        } else {
            match one(&mut enhancer, &images, entry, &path) {
                Ok(()) => made += 1,
                Err(e) => {
                    failed += 1;
                    tracing::error!("{e}");
                }
            }
        }
        bar.inc();
    }
    drop(bar);
    let count = |n: usize, what: &str| match n {
        0 => String::new(),
        n => format!(", {n} {what}"),
    };
    Ok(Outcome {
        status: if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: format!(
            "{}: {made} made by {}{}{}\n",
            out.display(),
            enhancer.name(),
            count(kept, "kept as they were (--force makes them again)"),
            count(failed, "failed")
        ),
    })
}

fn one(enhancer: &mut Enhancer, images: &Inputs, entry: &Entry, path: &Path) -> Result<()> {
    let mended = enhancer.enhance(&images.picture(entry)?.decode()?);
    let named = |e| Error::data(format_args!("image {:?}", entry.id.0), e);
    write(path, &png(&mended.map_err(named)?)?)
}
