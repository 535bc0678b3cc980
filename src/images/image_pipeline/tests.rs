#![allow(clippy::unwrap_used)]

use std::num::NonZeroU32;

use super::*;
use crate::dataset::Dataset;
use crate::images::frames::{CameraScope, DegradeStage};
use crate::images::notes::WantedNotes;
use crate::images::recipes::Recipe;
use crate::images::timings::Timings;
use crate::picture::PayloadFormat;
use crate::picture::Scaling;
use darkqa_light::KindSettings;

/// A folder with one frame as a plain PNG file, and the frame as a source.
fn frame() -> (tempfile::TempDir, Dataset, Source) {
    let folder = tempfile::tempdir().unwrap();
    let samples = (0..40 * 60 * 3).map(|i| (i * i % 251) as u8).collect();
    let pixels = Rgb::new(40, 60, samples).unwrap();
    let payload = Payload::encode(&pixels, PayloadFormat::Png).unwrap();
    std::fs::write(folder.path().join("a.png"), payload.file()).unwrap();
    let dataset = Dataset::from_images(folder.path(), &[]).unwrap();
    let name = dataset.frames().next().unwrap().clone();
    let source = Source::from_questions(&dataset, &name).unwrap();
    (folder, dataset, source)
}

/// The image and the wanted notes about the frame, and whether its file was decoded.
fn pipeline_output(
    condition: &str,
    (format, max_side): (&str, Option<u32>),
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
        camera_of: CameraScope::Frame,
        enhancers: Vec::new(),
        elsewhere: Vec::new(),
    };
    let steps = ImageSteps {
        frames: &dataset,
        recipe: &recipe,
        limit: None,
        timings: &Timings::default(),
        stored: None,
    };
    let mut pipeline = ImagePipeline::new(steps, Vec::new(), Implausible::default());
    let mut work = FrameWork::planned(steps, &source, &source.frames[0]);
    let condition = condition.parse().unwrap();
    let wanted = WantedNotes {
        thumbnail,
        fidelity: condition != Condition::L0,
    };
    let (image, notes) = pipeline
        .image_and_notes(&mut work, &condition, (&source.name, None), wanted)
        .unwrap();
    (image, notes, work.is_decoded())
}

#[test]
fn a_file_that_is_sent_as_it_is_is_decoded_only_for_a_thumbnail() {
    let (image, notes, decoded) = pipeline_output("L0", ("png", None), false);
    assert!(notes.thumbnail.is_none() && !decoded);
    let (folder, ..) = frame();
    let file = std::fs::read(folder.path().join("a.png")).unwrap();
    assert_eq!(image.file(), file);
    let (image, notes, decoded) = pipeline_output("L0", ("png", None), true);
    assert!(decoded);
    assert_eq!(notes.thumbnail.unwrap().image, image.facts().digest);
}

#[test]
fn thumbnails_show_what_was_sent() {
    for condition in ["L0", "L2-ev", "L3-noise"] {
        for how in [("png", None), ("png", Some(50)), ("jpeg:60", Some(50))] {
            let (image, notes, _) = pipeline_output(condition, how, true);
            let thumbnail = notes.thumbnail.unwrap();
            let of_file = crate::images::notes::thumbnail::thumbnail(
                &thumbnail.frame,
                &thumbnail.condition,
                &image,
                None,
                None,
            )
            .unwrap();
            assert_eq!(thumbnail, of_file, "{condition} {how:?}");
        }
    }
}

#[test]
fn fidelity_compares_what_was_sent_with_the_clean_frame_in_its_size() {
    let of = |condition, max_side| {
        let (image, notes, _) = pipeline_output(condition, ("png", max_side), false);
        (image.facts().clone(), notes.fidelity)
    };
    assert_eq!(of("L0", None).1, None);
    let psnr = |condition, max_side| {
        let (facts, fidelity) = of(condition, max_side);
        let fidelity = fidelity.unwrap();
        assert_eq!(fidelity.image, facts.digest);
        let ssim = fidelity.ssim.unwrap();
        assert!(ssim > 0.0 && ssim < 1.0, "{condition}: {ssim}");
        fidelity.psnr.unwrap()
    };
    assert!(psnr("L1-ev", None) > psnr("L3-ev", None));
    // The frame is compared in the size sent: 30 pixels are above the window, and the darkness costs about the same.
    assert!((psnr("L3-ev", Some(30)) - psnr("L3-ev", None)).abs() < 2.0);
    // The sides of this image are below the window of the structural similarity.
    assert_eq!(of("L3-ev", Some(12)).1.unwrap().ssim, None);
}
