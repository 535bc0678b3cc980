#!/usr/bin/env python3
"""Writes the notices of all crates into THIRD-PARTY.md; with --check it only says whether they are there.

Every crate of a release target is taken whose code is in the program or built it (`cargo tree` knows the features), with the
files of licences that its package holds, word for word. What stands above the marker in THIRD-PARTY.md is written by hand.

This is not left to cargo-about (0.9.3 was tried): for 17 of these crates it printed a general text in place of the package's
own file (Microsoft's lost their line of copyright), it named a crate that no target compiles, and the package index of Python
has no built program of it.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

from embedded import TOP, embedded_files

TARGETS = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
    "x86_64-pc-windows-msvc",
]
NOTICES = TOP / "THIRD-PARTY.md"
MARKER = "<!-- What follows is written by .ci/third_party.py. -->\n"
LICENCE = re.compile(r"(?i)(un)?licen[cs]e|copying")
BESIDE = re.compile(r"(?i)copyright|notice|.*third-party")


def cargo(*arguments):
    command = ["cargo", *arguments]
    return subprocess.run(command, cwd=TOP, check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout


def crates():
    """The packages of `cargo metadata` that are in a program or built one, ordered by name."""
    platforms = [word for target in TARGETS for word in ("--target", target)]
    tree = cargo("tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}", *platforms)
    used = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    packages = json.loads(cargo("metadata", "--locked", "--format-version", "1"))["packages"]
    used_packages = [package for package in packages if (package["name"], f"v{package['version']}") in used]
    if len(used_packages) != len(used):
        sys.exit("`cargo tree` and `cargo metadata` name different packages: mend .ci/third_party.py")
    return sorted((p for p in used_packages if p["source"]), key=lambda p: (p["name"], p["version"]))


def notices(package):
    """The files of a package that must go with its code."""
    files = sorted(file for file in Path(package["manifest_path"]).parent.iterdir() if file.is_file())
    licences = [file for file in files if LICENCE.match(file.name)]
    if not licences:
        sys.exit(f"{package['name']} {package['version']} has no file of its licence: write its notice by hand")
    mit = [file for file in licences if "mit" in file.name.lower()]
    if mit and " AND " not in package["license"]:
        licences = mit
    beside = [file for file in files if BESIDE.match(file.name)]
    return list(dict.fromkeys(licences + beside))


def generated():
    table, texts = [], {}
    for package in crates():
        name = f"{package['name']} {package['version']}"
        table.append(f"| {package['name']} | {package['version']} | {package['license']} |\n")
        for file in notices(package):
            text = "\n".join(line.rstrip() for line in file.read_text(encoding="utf-8").strip("\ufeff\r\n").splitlines())
            _, users = texts.setdefault(" ".join(text.split()), (text, []))
            if name not in users:
                users.append(name)
    yield f"\n## {len(table)} crates\n\n| crate | version | licence |\n|---|---|---|\n"
    yield from table
    yield "\n## Their notices\n"
    for text, users in texts.values():
        yield f"\n**{', '.join(users)}**\n\n````text\n{text}\n````\n"


def check_embedded(by_hand):
    """Ends the program if a file is embedded in the program of which THIRD-PARTY.md does not say where it is from."""
    named = re.findall(r"`([^`\n]+)`", by_hand)
    for file in sorted(embedded_files()):
        if not any(file == name or name.endswith("/") and file.startswith(name) for name in named):
            sys.exit(f"{file} is compiled into the program: say in THIRD-PARTY.md where it is from, and under which licence")


def main():
    present = NOTICES.read_text(encoding="utf-8")
    by_hand, marker, _ = present.partition(MARKER)
    if not marker:
        sys.exit(f"{NOTICES} has no line {MARKER.strip()}")
    check_embedded(by_hand)
    current = by_hand + marker + "".join(generated())
    if sys.argv[1:] == ["--check"]:
        if current != present:
            lines = set(present.splitlines()) ^ set(current.splitlines())
            changed = sorted(line for line in lines if line.startswith("| "))
            sys.exit("\n".join(["THIRD-PARTY.md is out of date; run .ci/third_party.py", *changed]))
    else:
        NOTICES.write_text(current, encoding="utf-8")


main()
