#![allow(clippy::unwrap_used)]

use std::num::NonZeroU32;

use super::*;
use crate::images::frames::{CameraScope, DegradeStage};
use crate::images::notes::WantedNotes;
use crate::images::recipes::Recipe;
use crate::images::timings::Timings;
use darkqa_base::types::manifests::PngForm;
use darkqa_data::{Dataset, open_images};
use darkqa_light::KindSettings;
use darkqa_pictures::{PayloadFormat, Scaling};

/// A folder with one frame as a plain PNG file, and the frame as a source.
fn frame() -> (tempfile::TempDir, Dataset, Source) {
    let folder = tempfile::tempdir().unwrap();
    let samples = (0..40 * 60 * 3).map(|i| (i * i % 251) as u8).collect();
    let pixels = Rgb::new(40, 60, samples).unwrap();
    let payload = Payload::encode(&pixels, PayloadFormat::Png).unwrap();
    std::fs::write(folder.path().join("a.png"), payload.file()).unwrap();
    let dataset = open_images(folder.path(), &[]).unwrap();
    let name = dataset.frames().next().unwrap().clone();
    let source = Source::from_questions(&dataset, &name).unwrap();
    (folder, dataset, source)
}

/// The image and the wanted notes of the frame, and whether its file was decoded. `max_side` is in pixels.
fn pipeline_output(
    condition: &str,
    format: &str,
    max_side: Option<u32>,
    thumbnail: bool,
) -> (Arc<Payload>, ImageNotes, bool) {
    let (_folder, dataset, source) = frame();
    let max_side = max_side.and_then(NonZeroU32::new);
    let recipe = Recipe {
        seed: 0,
        kinds: KindSettings::default(),
        format: format.parse().unwrap(),
        scaling: max_side.map_or(Scaling::Never, Scaling::MaxSide),
        degraded_at: DegradeStage::Native,
        camera_scope: CameraScope::Frame,
        enhancers: Vec::new(),
        enhanced_images: Vec::new(),
    };
    let steps = ImageSteps {
        frames: &dataset,
        recipe: &recipe,
        limit: None,
        timings: &Timings::default(),
        png: PngForm::NEWEST,
        stored: None,
    };
    let mut pipeline = ImagePipeline::new(steps, Vec::new(), Implausible::default());
    let mut work = FrameWork::for_source(steps, &source, &source.frames[0]);
    let condition = condition.parse().unwrap();
    let wanted = WantedNotes { thumbnail, fidelity: condition != Condition::L0 };
    let (image, notes) = pipeline.image_and_notes(&mut work, &condition, &source.name, None, wanted).unwrap();
    (image, notes, work.is_decoded())
}

#[test]
fn an_unchanged_file_is_decoded_only_for_its_thumbnail() {
    let (image, notes, decoded) = pipeline_output("L0", "png", None, false);
    assert!(notes.thumbnail.is_none() && !decoded);
    let (folder, ..) = frame();
    let file = std::fs::read(folder.path().join("a.png")).unwrap();
    assert_eq!(image.file(), file);
    let (image, notes, decoded) = pipeline_output("L0", "png", None, true);
    assert!(decoded);
    assert_eq!(notes.thumbnail.unwrap().image, image.facts().digest);
}

#[test]
fn thumbnails_show_the_sent_image() {
    for condition in ["L0", "L2-ev", "L3-noise"] {
        for (format, max_side) in [("png", None), ("png", Some(50)), ("jpeg:60", Some(50))] {
            let (image, notes, _) = pipeline_output(condition, format, max_side, true);
            let thumbnail = notes.thumbnail.unwrap();
            let from_payload =
                crate::images::notes::thumbnail(&thumbnail.frame, &thumbnail.condition, &image, None, None).unwrap();
            assert_eq!(thumbnail, from_payload, "{condition} {format} {max_side:?}");
        }
    }
}

/// PSNR of the frame in a condition, in dB.
fn psnr(condition: &str, max_side: Option<u32>) -> f64 {
    let (image, notes, _) = pipeline_output(condition, "png", max_side, false);
    let fidelity = notes.fidelity.unwrap();
    assert_eq!(fidelity.image, image.facts().digest);
    let ssim = fidelity.ssim.unwrap();
    assert!(ssim > 0.0 && ssim < 1.0, "{condition}: {ssim}");
    fidelity.psnr.unwrap()
}

#[test]
fn fidelity_is_measured_in_the_size_sent() {
    let (_, notes, _) = pipeline_output("L0", "png", None, false);
    assert_eq!(notes.fidelity, None);
    assert!(psnr("L1-ev", None) > psnr("L3-ev", None));
    // The frame is compared in the size sent. A side of 30 pixels is larger than the SSIM window, and the PSNR is about
    // the same.
    assert!((psnr("L3-ev", Some(30)) - psnr("L3-ev", None)).abs() < 2.0);
    // The sides of this image are smaller than the SSIM window.
    let (_, notes, _) = pipeline_output("L3-ev", "png", Some(12), false);
    assert_eq!(notes.fidelity.unwrap().ssim, None);
}
