#!/usr/bin/env python3
"""Packs the crate, and ends with 1 if it is too large, lacks what the program is built from, or holds anything else."""

import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from embedded import TOP, embedded_files

MOST_BYTES = 2_000_000
NOTICES = {"CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "THIRD-PARTY.md"}
OTHERS = {".cargo_vcs_info.json", "CITATION.cff", "CONTRIBUTING.md", "Cargo.lock", "Cargo.toml", "Cargo.toml.orig", "pyproject.toml"}
FOLDERS = ("src/", "models/", "prompts/")
LEFT_OUT = ("src/python/", "src/docs/images/")

with tempfile.TemporaryDirectory() as folder:
    # Not built here: what it takes is held by the list below.
    command = ["cargo", "package", "--quiet", "--locked", "--no-verify", "--allow-dirty", "--target-dir", folder]
    subprocess.run(command, cwd=TOP, check=True)
    (crate,) = Path(folder, "package").glob("*.crate")
    size = crate.stat().st_size
    with tarfile.open(crate) as archive:
        files = {name.partition("/")[2] for name in archive.getnames()}

sources = {file.relative_to(TOP).as_posix() for file in TOP.glob("src/**/*.rs")}
wrong = [f"is missing: {file}" for file in (sources | embedded_files() | NOTICES) - files]
known = {file for file in files if file.startswith(FOLDERS) and not file.startswith(LEFT_OUT)}
wrong += [f"does not belong into it: {file}" for file in files - known - NOTICES - OTHERS]
if size > MOST_BYTES:
    wrong.append(f"is too large: {size} bytes, at most {MOST_BYTES}")
print(f"{crate.name}: {len(files)} files, {size} bytes")
if wrong:
    sys.exit("\n".join(["the crate is wrong (`exclude` in Cargo.toml decides what is in it):", *sorted(wrong)]))
