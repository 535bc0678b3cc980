//! An endpoint that answers with the files of a case.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::endpoint::{Answer, MockEndpoint, Request};

/// An endpoint whose answers stand in `reply/` of a folder: those of a route under its name, else `chat`.
pub(crate) fn endpoint(folder: &Path) -> MockEndpoint {
    let folder = folder.join("reply");
    MockEndpoint::watching(move |request| answer(&folder, request))
}

fn answer(folder: &Path, request: &Request) -> Answer {
    let mut words = request.line.split(' ');
    let method = words.next().unwrap_or_default();
    let target = words.next().unwrap_or_default();
    let target = target.strip_prefix("/v1/").unwrap_or(target);
    let mut parts: Vec<&str> = target.split(['/', '?']).collect();
    if parts.len() > 1 {
        parts[1] = "id";
    }
    let route = format!("{method}-{}", parts.join("-"));
    let endings = ["http", "json", "jsonl"];
    let file = |name: &str| -> Option<PathBuf> {
        endings.map(|ending| folder.join(format!("{name}.{ending}"))).into_iter().find(|path| path.is_file())
    };
    let Some(path) = file(&route).or_else(|| file("refusal")).or_else(|| file("chat")) else {
        return Answer::new(404, "");
    };
    let bytes = fs::read(&path).unwrap_or_default();
    if path.extension().is_some_and(|ending| ending == "http") { Answer::raw(bytes) } else { Answer::new(200, bytes) }
}
