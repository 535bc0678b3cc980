//! The calls of the program: which files each reads, and which of them are damaged.

/// A call of the program.
pub(crate) struct Case {
    /// Its words. `URL` is the address of a mock endpoint, whose answers stand in `reply/`.
    pub(crate) line: &'static str,
    /// Files to damage, one at a time, and their folders.
    pub(crate) reads: &'static [&'static str],
    /// What it needs besides.
    pub(crate) needs: &'static [&'static str],
}

impl Case {
    const fn new(line: &'static str, reads: &'static [&'static str], needs: &'static [&'static str]) -> Self {
        Self { line, reads, needs }
    }

    /// The exit codes that the documentation has for it.
    pub(crate) fn codes(&self) -> &'static [i32] {
        if self.line.contains("--max-cost") { &[0, 1, 2, 3, 130] } else { &[0, 1, 2, 130] }
    }

    pub(crate) fn asks(&self) -> bool {
        self.line.contains("URL") || self.reads.contains(&"models.toml") || self.reads.contains(&"submitted")
    }

    pub(crate) fn serves(&self) -> bool {
        self.line.starts_with("serve ")
    }

    /// Whether it goes on for as long as an endpoint, retries or a number of the user say: it is then asked to end.
    pub(crate) fn waits(&self) -> bool {
        let begins = ["batch run", "models", "rooms", "serve"];
        begins.iter().any(|begin| self.line.starts_with(begin))
    }
}

/// Every subcommand, and every kind of file.
pub(crate) const CASES: &[Case] = &[
    // Data of evaluations.
    Case::new("--model random --data frames --levels L0,L3 --out out", &["frames"], &[]),
    Case::new("--model observer --data frames --levels L0,L3 --out out", &["frames"], &[]),
    Case::new("--model random --data set.jsonl --levels L0,L3 --out out", &["set.jsonl", "a.png", "b.png"], &[]),
    Case::new(
        "--model random --data set.jsonl --levels L0 --ask-per-image 1 --ask bank.jsonl --out out",
        &["bank.jsonl"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new("--model random --data set.json --rows items --levels L0 --out out", &["set.json"], &["a.png"]),
    Case::new("--model random --data set.tsv --levels L0 --out out", &["set.tsv"], &[]),
    Case::new("--model random --data set.csv --levels L0 --out out", &["set.csv"], &["a.png"]),
    Case::new("--model random --data set.parquet --levels L0 --out out", &["set.parquet"], &[]),
    Case::new("--model random --data labelled --label-folders What? --levels L0,L5 --out out", &["labelled"], &[]),
    Case::new(
        "--model random --pairs pairs --questions paired.jsonl --levels L0 --out out",
        &["pairs", "paired.jsonl"],
        &[],
    ),
    Case::new("--model random --data photos --ask bank.jsonl --levels L0,L3 --out out", &["photos", "bank.jsonl"], &[]),
    Case::new("--model random --data asked --levels L0,L3,T66.67 --variant all --out out", &["asked"], &[]),
    // Settings of evaluations.
    Case::new("--model random --data frames --rules rules.toml --levels L0 --out out", &["rules.toml"], &["frames"]),
    Case::new(
        "--model random --data set.jsonl --config darkqa.toml --out out",
        &["darkqa.toml"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model random --data set.jsonl --camera camera.toml --levels L0,L3 --variant noise --out out",
        &["camera.toml"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model script:script.jsonl --data set.jsonl --levels L0,L3 --out out",
        &["script.jsonl"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model m --base-url URL --prompts prompts --data set.jsonl --levels L0 --retries 0 --timeout 2 --out out",
        &["prompts"],
        &["set.jsonl", "a.png", "b.png", "reply/chat.json"],
    ),
    Case::new(
        "--model m --base-url URL --prices prices.toml --max-cost 5 --data set.jsonl --levels L0 --retries 0 --out out",
        &["prices.toml"],
        &["set.jsonl", "a.png", "b.png", "reply/chat.json"],
    ),
    Case::new(
        "--models models.toml --data set.jsonl --levels L0 --retries 0 --timeout 2 --out out",
        &["models.toml"],
        &["set.jsonl", "a.png", "b.png", "reply/chat.json"],
    ),
    // Replies of endpoints.
    Case::new(
        "--model m --base-url URL --data set.jsonl --levels L0 --retries 0 --timeout 2 --out out",
        &["reply/chat.json"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model m --base-url URL --data set.jsonl --levels L0 --probabilities --retries 0 --timeout 2 --out out",
        &["reply/chat.json"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model m --base-url URL --data set.jsonl --levels L0 --retries 0 --timeout 2 --out out",
        &["reply/chat.http"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model m --base-url URL --data set.jsonl --levels L0 --retries 1 --max-wait 1 --patience 0.5 --timeout 2 --out out",
        &["reply/refusal.http"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model m --base-url URL --data set.jsonl --levels L0 --retries 0 --timeout 2 --out out",
        &["set.jsonl", "a.png", "b.png"],
        &["reply/chat.json"],
    ),
    // Folders that are read again.
    Case::new(
        "--model random --blind-model random --data set.jsonl --levels L0,L3 --out run",
        &["run"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--model random --data set.jsonl --levels L0,L3 --out planned --shard 1/2",
        &["planned"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "--data frames --model random --levels L0,L3 --llie lift --images-cache store --out out",
        &["store"],
        &["frames"],
    ),
    Case::new("report run other --out out --full", &["run"], &["other"]),
    Case::new("report run --rescore", &["run"], &[]),
    Case::new("report run --baseline other --json", &["run", "other"], &[]),
    Case::new("report walked", &["walked"], &[]),
    Case::new("report sent.zip --out out", &["sent.zip"], &[]),
    Case::new("figures run other --out out", &["run"], &["other"]),
    Case::new("bundle run --out out.zip", &["run"], &[]),
    Case::new("site run other --out out", &["run"], &["other"]),
    Case::new("report merge parts --out out", &["parts"], &[]),
    Case::new("show run q0 --out out", &["run", "set.jsonl", "a.png", "b.png"], &[]),
    Case::new("show run q0 --sheet out.png", &["run"], &["set.jsonl", "a.png", "b.png"]),
    Case::new("cache store", &["store"], &[]),
    Case::new("cache store --clear", &["store"], &[]),
    Case::new("study pack run --out out", &["run"], &["set.jsonl", "a.png", "b.png"]),
    Case::new("study read run answers.jsonl --out out", &["answers.jsonl", "run"], &[]),
    // Batches.
    Case::new(
        "batch export --data set.jsonl --model m --levels L0,L3 --out batched --base-url http://127.0.0.1:9/v1",
        &["batched"],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new("batch import batched output.jsonl", &["output.jsonl", "batched"], &[]),
    Case::new(
        "batch run --data set.jsonl --model m --levels L0 --out out --poll 0.02 --no-scout --retries 0 --timeout 2 --base-url URL",
        &[
            "reply/POST-files.json",
            "reply/POST-batches.json",
            "reply/GET-batches-id.json",
            "reply/GET-files-id-content.jsonl",
        ],
        &["set.jsonl", "a.png", "b.png"],
    ),
    Case::new(
        "batch status submitted",
        &["submitted"],
        &["reply/GET-batches-id.json", "reply/GET-files-id-content.jsonl"],
    ),
    Case::new(
        "batch fetch submitted",
        &["submitted"],
        &["reply/GET-batches-id.json", "reply/GET-files-id-content.jsonl"],
    ),
    Case::new(
        "batch cancel submitted --poll 0.02",
        &["submitted"],
        &["reply/GET-batches-id.json", "reply/GET-files-id-content.jsonl"],
    ),
    // Images and models.
    Case::new("check asked --deep --levels L0", &["asked"], &[]),
    Case::new("check photos --deep --ask bank.jsonl", &["photos"], &["bank.jsonl"]),
    Case::new("synthesize photos --levels L3 --out out", &["photos"], &[]),
    Case::new("synthesize frames --levels L3,T66.67 --variant all --out out", &["frames"], &[]),
    Case::new("synthesize check made", &["made"], &[]),
    Case::new("synthesize from made/a_L3-ev.json a.png --out out", &["made/a_L3-ev.json", "a.png"], &[]),
    Case::new("realism pairs --out out", &["pairs"], &[]),
    Case::new("calibrate recording --white 16383 --out out.toml", &["recording"], &[]),
    Case::new(
        "enhance lift photos/whole.webp photos/turned.jpg photos/palette.png --out out",
        &["photos/whole.webp", "photos/turned.jpg", "photos/palette.png"],
        &[],
    ),
    Case::new(
        "enhance models/gain.onnx a.png --offline --llie-anyway --llie-timeout 5 --out out",
        &["models/gain.onnx", "a.png"],
        &[],
    ),
    Case::new(
        "enhance models/two.onnx a.png --offline --llie-anyway --llie-timeout 5 --out out",
        &["models/two.onnx.toml", "models/two.onnx"],
        &["a.png"],
    ),
    Case::new(
        "enhance models/external.onnx a.png --offline --llie-anyway --llie-timeout 5 --out out",
        &["models/external.onnx", "models/factor.bin"],
        &["a.png"],
    ),
    Case::new("enhance describe models/gain.onnx --offline", &["models/gain.onnx"], &[]),
    Case::new(
        "enhance doctor models/gain.onnx a.png --offline --llie-timeout 5 --out out",
        &["models/gain.onnx"],
        &["a.png"],
    ),
    // The other subcommands.
    Case::new("questions frames --out out.jsonl", &["frames"], &[]),
    Case::new("init out --frames photos", &["photos"], &[]),
    Case::new("plan --data frames --model random --levels L0 --out out", &["frames"], &[]),
    Case::new("import habitat --src habitat --out out", &["habitat"], &[]),
    Case::new("import scannet --src scannet --out out", &["scannet"], &[]),
    Case::new("import nyu --src nyu --labels nyu40-1 --depth-scale 0.0002 --out out", &["nyu"], &[]),
    Case::new("import sunrgbd --src sunrgbd --out out", &["sunrgbd"], &[]),
    Case::new("import thor --src thor --hfov 90 --out out", &["thor"], &[]),
    Case::new("import folder --src home --labels nyu40 --out out", &["home"], &[]),
    Case::new("import folder --src frames --out out", &["frames"], &[]),
    Case::new("import mcap drive.mcap", &["drive.mcap"], &[]),
    Case::new("import mcap drive.mcap --topic /front/image_raw --max-frames 3 --out out", &["drive.mcap"], &[]),
    Case::new("import lerobot robot3", &["robot3/meta"], &["robot3/data"]),
    Case::new("import lerobot robot3 --camera observation.images.front --every 0 --out out", &["robot3"], &[]),
    Case::new("import lerobot robot2 --camera observation.images.wrist --max-frames 2 --out out", &["robot2"], &[]),
    Case::new("import script habitat --config plain.toml", &["plain.toml"], &[]),
    Case::new("export vlmevalkit set.jsonl --levels L0 --out out", &["set.jsonl", "a.png", "b.png"], &[]),
    Case::new("export llava asked --levels L3 --out out", &["asked"], &[]),
    Case::new("export imagefolder set.parquet --levels L3 --out out", &["set.parquet"], &[]),
    Case::new("rooms --config rooms.toml --out out", &["rooms.toml"], &[]),
    Case::new("models models.toml --check", &["models.toml"], &["reply/chat.json"]),
    Case::new(
        "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 32 --levels L0,L3 --model script:script.jsonl --judge script:judge.jsonl --out out",
        &["questions.json", "walks", "judge.jsonl"],
        &["script.jsonl"],
    ),
    Case::new(
        "openeqa --questions questions.json --subset subset.json --frames walks --num-frames 2 --image-size 32 --levels L0 --model m --judge m --base-url URL --retries 0 --timeout 2 --out out",
        &["subset.json", "reply/chat.json"],
        &["questions.json", "walks"],
    ),
    Case::new(
        "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 32 --levels L0,L3 --model script:script.jsonl --judge script:judge.jsonl --out walked",
        &["walked"],
        &["questions.json", "walks", "script.jsonl", "judge.jsonl"],
    ),
    Case::new("serve --data frames --port 0", &["frames"], &["request/body.json"]),
    Case::new("serve --data frames --port 0", &["request/whole.http"], &["frames"]),
    Case::new("serve --data frames --port 0", &["request/body.json"], &["frames"]),
    Case::new("completions bash --config plain.toml", &["plain.toml"], &[]),
    Case::new("man out --config plain.toml", &["plain.toml"], &[]),
    Case::new("help report", &["plain.toml"], &[]),
];
