//! A page on which people answer open questions about walks, each walk in one condition alone.

use std::path::Path;
use std::sync::Arc;

use super::episode::Episode;
use super::stage::Stage;
use super::theatre::Theatre;
use crate::ask::Payload;
use crate::config::OpenEqa;
use crate::error::Result;
use crate::report::study::{Asked, Shot, page};
use crate::run::progress::Progress;
use crate::run::written::write;
use crate::run::{Verdict, open_enhancers};
use crate::types::manifest::Status;
use crate::types::{Condition, Digest};

/// Writes the page and its images, each the very file that a model would be sent; the true answers are not in it.
///
/// # Errors
/// Where a frame cannot be made or a file not be written.
pub(super) fn pack(
    config: &OpenEqa,
    mut stage: Stage<'_>,
    folder: &Path,
    progress: &Progress,
) -> Result<Verdict> {
    let files = std::mem::take(&mut stage.files);
    let (_, enhancers) = open_enhancers(files, &config.enhancement)?;
    let conditions: Vec<&Condition> = stage.conditions.iter().collect();
    let mut theatre = Theatre::new(config, &stage, enhancers);
    let bar = progress.bar("walks", stage.episodes.len());
    let (mut asked, mut images, mut walks) = (Vec::new(), 0, 0);
    for (number, Episode { name, reel }) in stage.episodes.iter().enumerate() {
        if reel.is_err() {
            continue;
        }
        let shown = theatre.walk(number, &conditions)?;
        let mut shots = Vec::new();
        for (condition, payloads) in shown {
            let sent = once(payloads);
            let mut names = Vec::with_capacity(sent.len());
            for (place, payload) in sent.iter().enumerate() {
                let name = image(name, &condition, place, payload);
                write(&folder.join(&name), &payload.file()?)?;
                names.push(name);
            }
            images += names.len();
            shots.push(Shot {
                condition: condition.to_string(),
                images: names,
            });
        }
        walks += 1;
        let questions = stage
            .questions
            .iter()
            .filter(|question| question.episode == *name);
        asked.extend(questions.map(|question| Asked {
            id: question.id.0.clone(),
            frame: number,
            text: question.text.clone(),
            choices: Vec::new(),
            shots: shots.clone(),
        }));
        bar.inc();
    }
    drop(bar);
    let path = folder.join("study.html");
    write(&path, page(&asked)?.as_bytes())?;
    Ok(Verdict {
        status: Status::Complete,
        output: format!(
            "{}: {} questions about {walks} walks, {images} images, {} conditions; a person sees each walk in one of them, and {} people \
             see it in all\nwhat they save is marked by openeqa --answers NAME=FILE\n",
            path.display(),
            asked.len(),
            conditions.len(),
            conditions.len()
        ),
    })
}

/// The images without those that only repeat the one before.
fn once(payloads: Vec<Arc<Payload>>) -> Vec<Arc<Payload>> {
    let mut sent: Vec<Arc<Payload>> = payloads;
    sent.dedup_by(|next, before| Arc::ptr_eq(next, before));
    sent
}

/// The name of an image, which says nothing of the level.
fn image(walk: &str, condition: &Condition, place: usize, payload: &Payload) -> String {
    let digest = Digest::of_parts([walk.as_bytes(), condition.to_string().as_bytes()]);
    let ending = if payload.facts().format == "png" {
        "png"
    } else {
        "jpg"
    };
    format!("images/{}-{place:03}.{ending}", &digest.to_string()[..16])
}
