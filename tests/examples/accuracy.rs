//! The accuracy of each model at each level and variant, without enhancers: `cargo run --example accuracy --
//! results/reference`.

use std::collections::BTreeMap;
use std::path::Path;

use darkqa_eval::{Result, StoredRun};

/// The numbers of replies that were scored, and of those that are right.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Score {
    pub(crate) right: usize,
    pub(crate) replies: usize,
}

/// The score of each model, level and variant of the run in a folder, by the strict parsing. Failed trials are left
/// out.
///
/// # Errors
/// If the folder holds no run.
pub(crate) fn accuracy(folder: &Path) -> Result<BTreeMap<[String; 3], Score>> {
    let mut scores = BTreeMap::<[String; 3], Score>::new();
    for record in StoredRun::open(folder)?.records()? {
        let record = record?;
        let (Some(level), None) = (record.text("level")?, record.text("enhancer")?) else {
            continue;
        };
        let Some(is_right) = record.flag("right")? else {
            continue;
        };
        let model = record.text("model")?.unwrap_or_default();
        let variant = record.text("variant")?.unwrap_or_default();
        let subject = [model, level, variant].map(str::to_owned);
        let score = scores.entry(subject).or_default();
        score.replies += 1;
        score.right += usize::from(is_right);
    }
    Ok(scores)
}

#[allow(clippy::print_stdout, dead_code, reason = "a program, which a test includes")]
fn main() -> Result<()> {
    let folder = std::env::args().nth(1);
    let folder = folder.unwrap_or_else(|| "results/reference".to_owned());
    for ([model, level, variant], Score { right, replies }) in accuracy(Path::new(&folder))? {
        let percent = 100.0 * right as f64 / replies as f64;
        println!("{model:<24} {level:<4} {variant:<6} {percent:5.1} % of {replies}");
    }
    Ok(())
}
