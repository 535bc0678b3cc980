//! Remedies of `src/enhance`, `src/engine/images/enhancement` and `src/commands/enhance`.

use super::{Bench, ROW, Remedy, Unfollowed, Why, photograph};
use crate::support::onnx::{self, Graph};

fn model(bench: &Bench, graph: &Graph) {
    graph.write(&bench.path(""), "model.onnx");
    photograph(bench, "images/1.png", 9);
}

fn sidecar(bench: &Bench, text: &str) {
    bench.file("model.onnx.toml", text);
}

/// Enhances images; the trial of the model is not what is tested here.
const ENHANCE: &str = "enhance model.onnx images --out out --allow bad-enhancer";
const TRIAL: &str = "enhance model.onnx images --out out";
const TILE: &str = "enhance model.onnx images --out out --allow bad-enhancer --llie-options tile=40";

/// All remedies that are followed here.
pub(super) const ROWS: &[Remedy] = &[
    Remedy {
        says: "tries tiles and checks every seam",
        state: |bench| model(bench, &onnx::gain(2.0)),
        command: "enhance describe model.onnx",
        printed: "--llie-options tile=N",
        followed: "enhance model.onnx images --out out --allow bad-enhancer --llie-options tile=80",
        ..ROW
    },
    Remedy {
        says: "has several outputs that could be the image",
        state: |bench| model(bench, &onnx::two_outputs()),
        command: ENHANCE,
        printed: "`darkqa-eval enhance doctor` shows which are plausible",
        effect: |bench| sidecar(bench, "output = \"18\""),
        followed: ENHANCE,
    },
    Remedy {
        says: "; presets with such outputs:",
        state: |bench| model(bench, &onnx::two_outputs()),
        command: ENHANCE,
        printed: "presets with such outputs: darkir, sci, zero-dce++ (--llie PRESET:FILE)",
        followed: "enhance sci:model.onnx images --out out --allow bad-enhancer",
        ..ROW
    },
    Remedy {
        says: "like a residual; if the model's code adds it",
        state: |bench| model(bench, &onnx::residual()),
        command: TRIAL,
        printed: "`image = \"input + output\"`; `darkqa-eval enhance doctor` shows both",
        effect: |bench| sidecar(bench, "image = \"input + output\""),
        followed: "enhance model.onnx images --out other --allow bad-enhancer",
    },
    Remedy {
        says: "like a light map; if the model's code divides by it",
        state: |bench| model(bench, &onnx::light_map()),
        command: TRIAL,
        printed: "`darkqa-eval enhance doctor` shows both",
        effect: |bench| sidecar(bench, "image = \"clip(input / max(output, 0.001), 0, 1)\""),
        followed: "enhance model.onnx images --out other --allow bad-enhancer",
    },
    Remedy {
        says: "of context on each side leave nothing",
        state: |bench| {
            model(bench, &onnx::blurred());
            sidecar(bench, "tile = \"exact:2\"");
        },
        command: "enhance model.onnx images --out out --allow bad-enhancer --llie-options tile=4",
        printed: "set larger tiles with --llie-options tile=N",
        followed: TILE,
        ..ROW
    },
    Remedy {
        says: "padding or tiling would change it, because",
        state: |bench| model(bench, &onnx::of_size(&onnx::mean_added(), 1, [32, 48])),
        command: ENHANCE,
        printed: "--llie-options resize",
        followed: "enhance model.onnx images --out out --allow bad-enhancer --llie-options resize",
        ..ROW
    },
    Remedy {
        says: "Leave out --llie-options tile to enhance the whole image",
        state: |bench| {
            model(bench, &onnx::mean_added());
            sidecar(bench, "tile = \"exact:0\"");
        },
        command: TILE,
        printed: "Leave out --llie-options tile",
        followed: ENHANCE,
        ..ROW
    },
    Remedy {
        says: "export it as `darkqa-eval enhance presets` shows",
        state: |bench| model(bench, &onnx::six_channels()),
        command: "enhance agllnet:model.onnx images --out out",
        printed: "`darkqa-eval enhance presets`",
        followed: "enhance presets",
        ..ROW
    },
];

const INSTALLS: &str = "it installs another version of ONNX Runtime, or needs a machine without one";
const ENDLESS: &str = "the models of the tests that are slow or large never end";

/// Messages whose remedies are not followed here.
pub(super) const UNFOLLOWED: &[Unfollowed] = &[
    Unfollowed { says: "--size {size}", why: Why::NoRemedy },
    Unfollowed { says: "use: --llie {name}:{file}", why: Why::NoRemedy },
    Unfollowed {
        says: "exceeded the limit of time or memory (--llie-options timeout, max-memory)",
        why: Why::Cannot(ENDLESS),
    },
    Unfollowed { says: "s for an image; allow more with --llie-options timeout=SECONDS", why: Why::Cannot(ENDLESS) },
    Unfollowed { says: "allow more with --llie-options max-memory=GB", why: Why::Cannot(ENDLESS) },
    Unfollowed { says: "s to load; allow more with --llie-options timeout=SECONDS", why: Why::Cannot(ENDLESS) },
    Unfollowed {
        says: "an enhancer exceeded --llie-options max-memory and could not be stopped",
        why: Why::Cannot(ENDLESS),
    },
    Unfollowed { says: "an enhancer could not be stopped within", why: Why::Cannot(ENDLESS) },
    Unfollowed {
        says: "--llie-options max-side=1280 enhances a smaller image",
        why: Why::Cannot("it needs an image that fills the memory"),
    },
    Unfollowed {
        says: "--llie-options tile=256 needs a fraction of it",
        why: Why::Cannot("it needs an image that fills the memory"),
    },
    Unfollowed { says: "reads it: name its library with --llie-options ort-lib=FILE", why: Why::Cannot(INSTALLS) },
    Unfollowed { says: "name the library of a newer one with --llie-options ort-lib=FILE", why: Why::Cannot(INSTALLS) },
    Unfollowed { says: "no library was found{skipped}", why: Why::Cannot(INSTALLS) },
    Unfollowed { says: "Check pip's index and find-links settings", why: Why::Cannot(INSTALLS) },
    Unfollowed { says: "or leave both out to search for one", why: Why::Cannot(INSTALLS) },
    Unfollowed { says: "named by --llie-options ort-lib or ORT_DYLIB_PATH", why: Why::NoRemedy },
    Unfollowed { says: "--llie-options offline forbids installing it", why: Why::NoRemedy },
    Unfollowed {
        says: "fetch the model itself with `git lfs pull`",
        why: Why::Cannot("git lfs needs the server of the repository"),
    },
    Unfollowed {
        says: "which cannot be cut into tiles; leave out --llie-options tile",
        why: Why::Test("tests/program/images/enhance/inputs.rs", "noise_of_other_size_is_untiled"),
    },
    Unfollowed {
        says: "--allow bad-enhancer uses them anyway",
        why: Why::Test("tests/program/images/enhance/elsewhere.rs", "images_of_other_sources_are_refused"),
    },
    Unfollowed {
        says: "tries each value range and colour order; --allow bad-enhancer uses it anyway",
        why: Why::Test("tests/program/images/enhance/probe.rs", "impossible_enhancement_stops_the_run"),
    },
    Unfollowed { says: "because of --allow bad-enhancer", why: Why::NoRemedy },
    Unfollowed {
        says: "missing; try `darkqa-eval enhance lift IMAGES… --out DIR`",
        why: Why::Cannot("the parser of arguments refuses such a call first"),
    },
    Unfollowed {
        says: "`darkqa-eval enhance doctor` finds it",
        why: Why::Test("tests/program/images/enhance/probe.rs", "doctor_proposes_sidecar_that_mends_model"),
    },
    Unfollowed { says: "see --llie-on", why: Why::NoRemedy },
];
