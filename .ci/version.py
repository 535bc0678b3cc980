#!/usr/bin/env python3
"""Holds CITATION.cff and the newest version of CHANGELOG.md to the version of Cargo.toml.

With a tag (`.ci/version.py v0.2.0`) the tag is held to it, too, and what CHANGELOG.md says of the version is printed.
"""

import re
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
HEADING = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d{2}-\d{2})$", re.MULTILINE)


def find(pattern, file):
    """What the pattern finds in a file, or nothing."""
    found = re.search(pattern, (TOP / file).read_text(encoding="utf-8"), re.MULTILINE)
    return found and found[1]


def main():
    version = find(r'^version = "([^"]+)"$', "Cargo.toml")
    changes = (TOP / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## .*$", changes, re.MULTILINE)
    odd = [heading for heading in headings[1:] if not HEADING.match(heading)]
    if not headings or headings[0] != "## [Unreleased]" or odd:
        sys.exit(f"CHANGELOG.md: `## [Unreleased]`, then `## [X.Y.Z] - YYYY-MM-DD` expected; there is {odd or headings[:1]}")
    released = HEADING.search(changes)

    stated = {"CITATION.cff, version": (find(r"^version: (\S+)$", "CITATION.cff"), version)}
    if released:
        stated["CHANGELOG.md, newest version"] = (released[1], version)
        stated["CITATION.cff, date-released"] = (find(r"^date-released: \"?([\d-]+)", "CITATION.cff"), released[2])
    for tag in sys.argv[1:]:
        stated["the tag"] = (tag, f"v{version}")
        stated["CHANGELOG.md, newest version"] = (released and released[1], version)
    wrong = [f"{where}: {said}; {expected} expected" for where, (said, expected) in stated.items() if said != expected]
    if wrong:
        sys.exit("\n".join(["the version of Cargo.toml is not everywhere:", *wrong]))

    if sys.argv[1:]:
        print(HEADING.split(changes)[3].strip())


main()
