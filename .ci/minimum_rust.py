#!/usr/bin/env python3
"""Ends with 1 if a dependency asks for a newer Rust than Cargo.toml promises; tests and benchmarks count, too.

Crates that do not say what they need are counted: they are built with the oldest Rust by .github/workflows/ci.yml.
"""

import json
import subprocess
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
METADATA = ["cargo", "metadata", "--locked", "--format-version", "1"]


def number(version):
    return [int(part) for part in f"{version}.0".split(".")[:3]]


packages = json.loads(subprocess.run(METADATA, cwd=TOP, check=True, stdout=subprocess.PIPE).stdout)["packages"]
(own,) = (package["rust_version"] for package in packages if package["source"] is None)
crates = [package for package in packages if package["source"]]
newer = [f"{c['name']} {c['version']} needs Rust {c['rust_version']}" for c in crates if number(c["rust_version"] or "0") > number(own)]
silent = sum(crate["rust_version"] is None for crate in crates)
print(f"{len(crates) - silent} of {len(crates)} crates say which Rust they need")
if newer:
    sys.exit("\n".join([*newer, f"Cargo.toml says {own}: take older versions (`cargo update NAME --precise VERSION`), or raise it"]))
