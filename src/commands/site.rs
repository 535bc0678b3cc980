//! `site`: writes a leaderboard and the report pages of many runs.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_report::joined;
use darkqa_report::site::{DATA, PAGES, SCHEMA, products};
use darkqa_runs::Outcome;
use darkqa_runs::sharded_run::open_any_run;

/// The flags of `site`.
#[derive(Debug, Args)]
pub(crate) struct SiteArgs {
    /// The folders of the runs, of either kind, or ZIP files of bundles
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// Where the site goes: a new or empty folder, or one with a site, whose files are replaced
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
}

/// Writes a site.
///
/// # Errors
/// If a folder has no run of this version, a run is named twice, a record is broken, or `--out` has other files.
pub(crate) fn site(args: &SiteArgs) -> Result<Outcome> {
    check_distinct(&args.runs)?;
    check_target(&args.out)?;
    let runs = args.runs.iter().map(|folder| open_any_run(folder)).collect::<Result<_>>()?;
    let site = joined::site(runs)?;
    let mut output = String::new();
    for (run, why) in &site.others {
        let _ = writeln!(output, "{}: in no table: {why}", run.name);
    }
    let (runs, tables) = (site.pages.len(), site.groups.len());
    let contents = products(site)?;
    let names: BTreeSet<String> = contents.iter().map(|(name, _)| name.clone()).collect();
    for (name, content) in contents {
        files::write(&args.out.join(name), &content)?;
    }
    for page in stale_pages(&args.out, &names)? {
        let _ = writeln!(output, "{page}: this page belongs to no run of this site; it can be deleted");
    }
    let index = args.out.join("index.html");
    let _ = writeln!(output, "site: {} (runs: {runs}, tables: {tables})", index.display());
    Ok(Outcome::wrote(index, Status::Complete, output))
}

/// Refuses a run that is named twice, because its models would be compared with themselves.
fn check_distinct(folders: &[PathBuf]) -> Result<()> {
    let mut known = BTreeSet::new();
    for folder in folders {
        let place = folder.canonicalize().unwrap_or_else(|_| folder.clone());
        if !known.insert(place) {
            let problem = format_args!("{} is named twice; name each run once", folder.display());
            return Err(Error::usage("RUN", problem));
        }
    }
    Ok(())
}

/// Refuses a folder with other files than a site, and a folder of pages that is a symbolic link.
fn check_target(out: &Path) -> Result<()> {
    let mut entries = match fs::read_dir(out) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(|e| Error::file(out, "read", e))?,
    };
    let is_empty = entries.all(|entry| entry.is_ok_and(|entry| files::is_unfinished(&entry.file_name())));
    if is_empty {
        return Ok(());
    }
    let is_site = files::read(&out.join(DATA))
        .ok()
        .and_then(|text| serde_json::from_slice::<Value>(&text).ok())
        .is_some_and(|data| data.get("schema").and_then(Value::as_str) == Some(SCHEMA));
    if !is_site {
        let problem = "the folder is not empty and holds no site; name another --out";
        return Err(Error::data(out.display(), problem));
    }
    let pages = out.join(PAGES);
    if pages.symlink_metadata().is_ok_and(|pages| pages.is_symlink()) {
        let problem = "a link; its folder would be written to. Delete the link, or name another --out";
        return Err(Error::data(pages.display(), problem));
    }
    Ok(())
}

/// Pages in the folder of a site that belong to no run of the site, sorted.
fn stale_pages(out: &Path, names: &BTreeSet<String>) -> Result<Vec<String>> {
    let pages = out.join(PAGES);
    let mut stale = Vec::new();
    for entry in fs::read_dir(&pages).map_err(|e| Error::file(&pages, "read", e))? {
        let name = entry.map_err(|e| Error::file(&pages, "read", e))?.file_name();
        let name = format!("{PAGES}/{}", name.to_string_lossy());
        if !names.contains(&name) {
            stale.push(name);
        }
    }
    stale.sort();
    Ok(stale)
}
