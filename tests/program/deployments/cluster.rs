//! The manifests for Kubernetes and the scripts in `src/commands/cluster`: their flags exist, and they agree with each
//! other.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;

use darkqa_eval::cli;

use crate::support::run::Bench;
use crate::support::snapshot::redacted;

/// A file of the folder.
fn file(name: &str) -> String {
    let path = path(name);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn path(name: &str) -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    root.join("src/commands/cluster").join(name)
}

/// The words after `args:` in a manifest.
fn words(manifest: &str) -> Vec<String> {
    let text = file(manifest);
    let lines = text.lines().skip_while(|line| line.trim() != "args:");
    lines
        .skip(1)
        .map_while(|line| {
            let word = line.trim().strip_prefix("- ")?;
            Some(word.to_owned())
        })
        .collect()
}

/// The value of a field of a manifest that has it once.
fn field(manifest: &str, name: &str) -> String {
    let text = file(manifest);
    let begin = format!("{name}: ");
    let found: Vec<&str> = text.lines().filter_map(|line| line.trim().strip_prefix(&begin)).collect();
    assert_eq!(found.len(), 1, "{manifest}: {name}: {found:?}");
    found[0].to_owned()
}

/// The value of a flag among words such as `--rpm=500`.
fn value(words: &[String], flag: &str) -> String {
    let begin = format!("{flag}=");
    let value = words.iter().find_map(|word| word.strip_prefix(&begin));
    value.unwrap_or_else(|| panic!("{flag}: {words:?}")).to_owned()
}

/// Checks that the program takes these words.
fn parse(words: &[String]) {
    let program = "darkqa-eval".to_owned();
    let words = std::iter::once(&program).chain(words);
    if let Err(e) = cli::check_words(words.map(OsString::from)) {
        panic!("{e}");
    }
}

const MANIFESTS: [&str; 3] = ["plan.yaml", "job.yaml", "merge.yaml"];

#[test]
fn every_manifest_has_flags_that_exist() {
    for manifest in MANIFESTS {
        let words = words(manifest);
        assert!(words.len() > 3, "{manifest}: {words:?}");
        parse(&words);
    }
}

#[test]
fn the_manifests_are_of_one_run() {
    let (plan, job, merge) = (words("plan.yaml"), words("job.yaml"), words("merge.yaml"));
    assert_eq!(plan[0], "plan");
    // What the plan leaves out is about asking and dividing alone.
    let planned: BTreeSet<&String> = plan[1..].iter().collect();
    let asked: BTreeSet<&String> = job.iter().collect();
    assert!(planned.is_subset(&asked), "{planned:?} {asked:?}");
    let others: Vec<&str> = asked
        .difference(&planned)
        .map(|word| {
            let flag = word.split('=').next();
            flag.unwrap_or_default()
        })
        .collect();
    let expected = ["--quiet", "--rpm", "--shard", "--stop"];
    assert_eq!(others, expected);
    assert_eq!(merge[..2], ["report", "merge"]);
    assert_eq!(merge[2], value(&job, "--out"));
    // Kubernetes tells a pod neither how many there are nor how many run at once.
    let parts = value(&job, "--shard");
    let (parts, workers) = parts.split_once(",workers=").unwrap();
    let parts = parts.strip_prefix("auto/").unwrap();
    assert_eq!(parts, field("job.yaml", "completions"));
    assert_eq!(workers, field("job.yaml", "parallelism"));
    let grace = value(&job, "--stop");
    let grace: u32 = grace.strip_prefix("grace=").unwrap().parse().unwrap();
    let given = field("job.yaml", "terminationGracePeriodSeconds");
    assert!(grace < given.parse().unwrap());
    let images = MANIFESTS.map(|manifest| field(manifest, "image"));
    insta::assert_snapshot!(
        redacted(&images[0]),
        @"registry.example/darkqa-eval@sha256:[DIGEST]"
    );
    assert!(images.iter().all(|image| *image == images[0]), "{images:?}");
}

#[test]
fn evicted_pod_has_not_failed() {
    for (manifest, ends, codes) in
        [("plan.yaml", "FailJob", "[2]"), ("job.yaml", "FailIndex", "[2, 3]"), ("merge.yaml", "FailJob", "[2]")]
    {
        let text = file(manifest);
        let rules = text.split_once("rules:\n").unwrap().1;
        let rules = rules.split_once("  template:").unwrap().0;
        let rules: Vec<&str> = rules.lines().map(str::trim).filter(|line| !line.starts_with('#')).collect();
        let codes = format!("onExitCodes: {{containerName: darkqa, operator: In, values: {codes}}}");
        let expected = [
            "- action: Ignore",
            "onPodConditions:",
            "- {type: DisruptionTarget, status: \"True\"}",
            &format!("- action: {ends}"),
            &codes,
        ];
        assert_eq!(rules, expected, "{manifest}");
        // The rules ask for it.
        assert_eq!(field(manifest, "restartPolicy"), "Never");
    }
}

/// Requirements for pods in a namespace that enforces the standard `restricted`.
#[test]
fn a_restricted_namespace_takes_the_pods() {
    for manifest in MANIFESTS {
        for (name, value) in [
            ("runAsNonRoot", "true"),
            ("runAsUser", "65532"),
            ("fsGroup", "65532"),
            ("seccompProfile", "{type: RuntimeDefault}"),
            ("allowPrivilegeEscalation", "false"),
            ("readOnlyRootFilesystem", "true"),
            ("capabilities", "{drop: [ALL]}"),
            ("automountServiceAccountToken", "false"),
        ] {
            assert_eq!(field(manifest, name), value, "{manifest}: {name}");
        }
    }
}

#[test]
fn volumes_are_claimed_with_mode() {
    let claims = file("claims.yaml");
    let mode = |claim: &str| {
        let own = claims.split("---").find(|own| {
            let name = format!("\n  name: {claim}\n");
            own.contains(&name)
        });
        let own = own.unwrap_or_else(|| panic!("claims.yaml has no {claim}"));
        let mode = own.split_once("accessModes: [").unwrap().1;
        mode.split_once(']').unwrap().0
    };
    for manifest in MANIFESTS {
        let text = file(manifest);
        let mut count = 0;
        for line in text.lines() {
            let Some((_, rest)) = line.split_once("persistentVolumeClaim: {claimName: ") else {
                continue;
            };
            let (claim, rest) = rest.split_at(rest.find([',', '}']).unwrap());
            let name = claim.strip_prefix("darkqa-").unwrap();
            let is_read_only = rest.contains("readOnly: true");
            let expected = if is_read_only { "ReadOnlyMany" } else { "ReadWriteMany" };
            assert_eq!(mode(claim), expected, "{manifest}: {claim}");
            let mount = format!("- {{name: {name}, mountPath: /{name}");
            let mount = text.lines().find(|line| line.contains(&mount)).unwrap();
            assert_eq!(mount.contains("readOnly: true"), is_read_only, "{mount}");
            count += 1;
        }
        assert!(count > 0, "{manifest}");
    }
}

/// The script with a `kubectl` that writes down what it is told, and whose jobs end as `ends` says.
#[cfg(unix)]
fn kubectl(ends: &str) -> (Option<i32>, Vec<String>, String) {
    let bench = Bench::new();
    bench.program("kubectl", &format!("echo \"$@\" >> \"$TOLD\"\n{ends}"));
    let output = std::process::Command::new("bash")
        .arg(path("kubernetes.sh"))
        .args(["--namespace", "night"])
        .env("PATH", bench.search_path())
        .env("TOLD", bench.path("told"))
        .output()
        .unwrap();
    let told = fs::read_to_string(bench.path("told")).unwrap();
    let told = told.lines().map(|line| {
        let line = line.strip_prefix("--namespace night ").unwrap();
        // The format of `get` is the rest of its line.
        line.split(" -o ").next().unwrap_or_default().to_owned()
    });
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), told.collect(), said)
}

#[cfg(unix)]
#[test]
fn script_applies_steps_in_order() {
    // Each step is complete at the second wait.
    let slow = "case \"$*\" in *wait*) test $(($(grep -c wait \"$TOLD\") % 2)) = 0;; esac";
    let (code, told, said) = kubectl(slow);
    assert_eq!(code, Some(0), "{said}");
    let wait = "wait --for=condition=complete --timeout=30s -f";
    let mut expected = vec!["apply -f claims.yaml".to_owned()];
    for step in MANIFESTS {
        expected.push(format!("apply -f {step}"));
        expected.push(format!("{wait} {step}"));
        expected.push(format!("get -f {step}"));
        expected.push(format!("{wait} {step}"));
    }
    assert_eq!(told, expected);
}

/// The script of Slurm on a login node, with an `sbatch` that writes down what it is told; its code and these lines.
#[cfg(unix)]
fn sbatch(parts: &str, words: &[&str]) -> (Option<i32>, Vec<String>) {
    let bench = Bench::new();
    bench.program("sbatch", "echo \"$@\" >> \"$TOLD\"\nwc -l < \"$TOLD\"");
    let output = std::process::Command::new("bash")
        .arg(path("slurm.sh"))
        .args(words)
        .env("PATH", bench.search_path())
        .env("TOLD", bench.path("told"))
        .env("PARTS", parts)
        .env("AT_ONCE", "3")
        .env_remove("SLURM_JOB_ID")
        .output()
        .unwrap();
    let told = fs::read_to_string(bench.path("told")).unwrap_or_default();
    let own = path("slurm.sh").display().to_string();
    let told = told.lines().map(|line| line.replace(&own, "SCRIPT"));
    (output.status.code(), told.collect())
}

#[cfg(unix)]
#[test]
fn slurm_script_submits_three_jobs() {
    let flags = "--model gpt-4o --data frames/ --rpm 500";
    for out in ["--out runs/a", "--out=runs/a"] {
        let line = format!("{out} {flags}");
        let words: Vec<&str> = line.split(' ').collect();
        let (code, told) = sbatch("12", &words);
        assert_eq!(code, Some(0), "{told:?}");
        let calls: Vec<(&str, &str)> = told.iter().map(|line| line.split_once(" SCRIPT ").unwrap()).collect();
        let [plan, array, merge] = calls[..] else {
            panic!("{told:?}");
        };
        assert_eq!(plan.1, format!("plan {line}"));
        assert_eq!(array.1, format!("--shard workers=3 {line}"));
        assert!(array.0.contains("--array=0-11%3") && array.0.contains("--dependency=afterok:1"), "{array:?}");
        assert_eq!(merge.1, "report merge runs/a --out runs/a-whole --quiet");
        assert!(merge.0.contains("--dependency=afterok:2"), "{merge:?}");
        for (_, words) in calls {
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            parse(&words);
        }
    }
    for (parts, words) in [("12", &["--model", "gpt-4o"][..]), ("1", &["--out", "runs/a", "--model", "gpt-4o"])] {
        let (code, told) = sbatch(parts, words);
        assert_eq!((code, told.len()), (Some(2), 0), "{words:?}");
    }
}

/// The lines in the heads of the scripts and on the page of clusters that start the script of Slurm.
#[test]
fn script_calls_use_existing_flags() {
    let page = fs::read_to_string(path("../../docs/cluster.md")).unwrap();
    let mut count = 0;
    for line in file("slurm.sh").lines().chain(page.lines()) {
        let words = line.split_once("slurm.sh --").map(|(_, words)| words);
        if let Some(words) = words {
            let words = format!("--{words}");
            let words: Vec<String> = words.split(' ').map(str::to_owned).collect();
            parse(&words);
            count += 1;
        }
    }
    assert_eq!(count, 3);
}

#[cfg(unix)]
#[test]
fn script_stops_at_step_that_failed() {
    let failing = "case \"$*\" in *\"wait\"*job.yaml*) exit 1;; *get*) echo MaxFailedIndexesExceeded;; esac";
    let (code, told, said) = kubectl(failing);
    assert_eq!(code, Some(1), "{said}");
    insta::assert_snapshot!(redacted(&said), @"
    job.yaml has failed (MaxFailedIndexesExceeded): see its pods' logs; after 'kubectl delete -f job.yaml' this
        script goes on, and only what is missing is asked
    ");
    assert!(!told.iter().any(|line| line.contains("merge.yaml")), "{told:?}");
}
