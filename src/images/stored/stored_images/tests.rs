use std::num::NonZeroUsize;

use super::*;
use crate::files::folder_access::FolderAccess;
use crate::images::frames::{CameraScope, DegradeStage, SourceFrame};
use crate::picture::Scaling;
use crate::types::{Digest, EnhancerName, InputNote};
use darkqa_enhance::SizeArgs;
use darkqa_light::KindSettings;

fn recipe() -> Recipe {
    Recipe {
        enhancers: vec![(
            EnhancerName::new("one").unwrap(),
            Digest::from_bytes(b"one"),
        )],
        ..Recipe::lossless(&KindSettings::default(), &[])
    }
}

fn frame() -> SourceFrame {
    SourceFrame {
        id: FrameId("a".to_owned()),
        digest: Digest::from_bytes(b"pixels"),
        note: InputNote::default(),
        size: (8, 6),
        focal: None,
        photographs: Vec::new(),
    }
}

fn sizes() -> SizeArgs {
    SizeArgs {
        tile: darkqa_enhance::Tiling::Auto,
        llie_max_side: None,
        llie_resize: false,
    }
}

fn runtime(version: &str) -> (String, String) {
    ("onnxruntime".to_owned(), version.to_owned())
}

/// The digest of the key of a frame in a condition.
fn key(recipe: &Recipe, frame: &SourceFrame, condition: &str, maker: &Maker) -> Digest {
    let folder = tempfile::tempdir().unwrap();
    let store = ImageStore::open(
        folder.path(),
        FolderAccess::Private,
        StoredKinds::All,
        1 << 20,
    )
    .unwrap();
    let source = FrameId("walk".to_owned());
    let condition = condition.parse().unwrap();
    let stored = StoredImages::new(&store, maker);
    let place = stored.place(recipe, (&source, frame), &condition).unwrap();
    *place.image.digest()
}

const CONDITION: &str = "L3-noise+one";

/// The key with one part of the recipe changed.
fn changed(change: impl FnOnce(&mut Recipe)) -> Digest {
    let mut recipe = recipe();
    change(&mut recipe);
    key(
        &recipe,
        &frame(),
        CONDITION,
        &Maker::new(Some(runtime("1")), &sizes()),
    )
}

/// The key with another version of the runtime or other sizes.
fn made_by(version: &str, change: impl FnOnce(&mut SizeArgs)) -> Digest {
    let mut sizes = sizes();
    change(&mut sizes);
    key(
        &recipe(),
        &frame(),
        CONDITION,
        &Maker::new(Some(runtime(version)), &sizes),
    )
}

#[test]
fn every_part_of_what_decides_an_image_gives_another_key() {
    let same = changed(|_| {});
    assert_eq!(made_by("1", |_| {}), same);
    let maker = Maker::new(Some(runtime("1")), &sizes());
    let of = |frame: &SourceFrame, condition| key(&recipe(), frame, condition, &maker);
    let mut others = vec![
        changed(|recipe| recipe.seed = 1),
        changed(|recipe| recipe.format = "jpeg:80".parse().unwrap()),
        changed(|recipe| recipe.scaling = Scaling::LongerSide(4)),
        changed(|recipe| {
            recipe.scaling = Scaling::LongerSide(4);
            recipe.degraded_at = DegradeStage::Resized;
        }),
        changed(|recipe| recipe.camera_of = CameraScope::Episode),
        changed(|recipe| recipe.enhancers[0].1 = Digest::from_bytes(b"another file")),
        made_by("2", |_| {}),
        made_by("1", |sizes| sizes.tile = darkqa_enhance::Tiling::Whole),
        made_by("1", |sizes| sizes.llie_max_side = NonZeroUsize::new(64)),
        made_by("1", |sizes| sizes.llie_resize = true),
        of(&frame(), "L4-noise+one"),
        of(&frame(), "L3-ev+one"),
        of(&frame(), "L3-noise"),
    ];
    let id = FrameId("b".to_owned());
    others.push(of(&SourceFrame { id, ..frame() }, CONDITION));
    let digest = Digest::from_bytes(b"other pixels");
    others.push(of(&SourceFrame { digest, ..frame() }, CONDITION));
    for (place, other) in others.iter().enumerate() {
        assert_ne!(*other, same, "{place}");
    }
}

#[test]
fn what_decides_no_degraded_image_leaves_its_key() {
    let of = |maker: &Maker| key(&recipe(), &frame(), "L3-noise", maker);
    let whole = SizeArgs {
        tile: darkqa_enhance::Tiling::Whole,
        ..sizes()
    };
    let without = of(&Maker::new(None, &sizes()));
    assert_eq!(of(&Maker::new(Some(runtime("1")), &whole)), without);
}
