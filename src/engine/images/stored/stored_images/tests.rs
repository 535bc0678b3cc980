use std::num::NonZeroUsize;

use super::*;
use crate::images::frames::{CameraScope, DegradeStage, SourceFrame};
use darkqa_base::files::FolderAccess;
use darkqa_base::types::{Digest, EnhancerName, InputNote};
use darkqa_enhance::SizeArgs;
use darkqa_light::KindSettings;
use darkqa_pictures::Scaling;

fn recipe() -> Recipe {
    Recipe {
        enhancers: vec![(EnhancerName::new("one").unwrap(), Digest::from_bytes(b"one"))],
        ..Recipe::lossless(&KindSettings::default(), &[])
    }
}

fn frame() -> SourceFrame {
    SourceFrame {
        id: FrameId("a".to_owned()),
        digest: Digest::from_bytes(b"pixels"),
        note: InputNote::default(),
        size: (8, 6),
        exposure_value: None,
        focal: None,
        photographs: Vec::new(),
    }
}

fn sizes() -> SizeArgs {
    SizeArgs { tile: darkqa_enhance::Tiling::Auto, llie_max_side: None, llie_resize: false }
}

fn runtime(version: &str) -> (String, String) {
    ("onnxruntime".to_owned(), version.to_owned())
}

/// Digest of the store key of a frame in a condition.
fn key(recipe: &Recipe, frame: &SourceFrame, condition: &str, maker: &Maker) -> Digest {
    let folder = tempfile::tempdir().unwrap();
    let store = ImageStore::open(folder.path(), FolderAccess::Private, StoredKinds::All, 1 << 20).unwrap();
    let source = FrameId("walk".to_owned());
    let condition = condition.parse().unwrap();
    let stored = StoredImages::new(&store, maker, PngForm::NEWEST);
    let place = stored.place(recipe, &source, frame, &condition).unwrap();
    *place.image.digest()
}

const CONDITION: &str = "L3-noise+one";

/// The key with a changed recipe.
fn key_with_recipe(change: impl FnOnce(&mut Recipe)) -> Digest {
    let mut recipe = recipe();
    change(&mut recipe);
    key(&recipe, &frame(), CONDITION, &Maker::new(Some(runtime("1")), &sizes()))
}

/// The key with this version of the runtime and changed sizes.
fn key_with_maker(version: &str, change: impl FnOnce(&mut SizeArgs)) -> Digest {
    let mut sizes = sizes();
    change(&mut sizes);
    key(&recipe(), &frame(), CONDITION, &Maker::new(Some(runtime(version)), &sizes))
}

#[test]
fn every_fact_that_decides_an_image_changes_its_key() {
    let same = key_with_recipe(|_| {});
    assert_eq!(key_with_maker("1", |_| {}), same);
    let maker = Maker::new(Some(runtime("1")), &sizes());
    let id = FrameId("b".to_owned());
    let digest = Digest::from_bytes(b"other pixels");
    let others = vec![
        key_with_recipe(|recipe| recipe.seed = 1),
        key_with_recipe(|recipe| recipe.format = "jpeg:80".parse().unwrap()),
        key_with_recipe(|recipe| recipe.scaling = Scaling::LongerSide(4)),
        key_with_recipe(|recipe| {
            recipe.scaling = Scaling::LongerSide(4);
            recipe.degraded_at = DegradeStage::Resized;
        }),
        key_with_recipe(|recipe| recipe.camera_scope = CameraScope::Episode),
        key_with_recipe(|recipe| recipe.enhancers[0].1 = Digest::from_bytes(b"another file")),
        key_with_maker("2", |_| {}),
        key_with_maker("1", |sizes| sizes.tile = darkqa_enhance::Tiling::Whole),
        key_with_maker("1", |sizes| sizes.llie_max_side = NonZeroUsize::new(64)),
        key_with_maker("1", |sizes| sizes.llie_resize = true),
        key(&recipe(), &frame(), "L4-noise+one", &maker),
        key(&recipe(), &frame(), "L3-ev+one", &maker),
        key(&recipe(), &frame(), "L3-noise", &maker),
        key(&recipe(), &SourceFrame { id, ..frame() }, CONDITION, &maker),
        key(&recipe(), &SourceFrame { digest, ..frame() }, CONDITION, &maker),
    ];
    for (index, other) in others.iter().enumerate() {
        assert_ne!(*other, same, "{index}");
    }
}

#[test]
fn enhancer_settings_do_not_change_keys_of_degraded_images() {
    let whole = SizeArgs { tile: darkqa_enhance::Tiling::Whole, ..sizes() };
    let [without, with] = [Maker::new(None, &sizes()), Maker::new(Some(runtime("1")), &whole)]
        .map(|maker| key(&recipe(), &frame(), "L3-noise", &maker));
    assert_eq!(with, without);
}
