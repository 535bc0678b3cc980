"""Makes the relative links of README.md absolute, for package indexes and archives, which show it without the repository.

crates.io does the same by itself.
"""

import re
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
REPOSITORY = re.search(r'^repository = "https://github.com/([^"]+)"$', (TOP / "Cargo.toml").read_text(encoding="utf-8"), re.MULTILINE)[1]
PAGES = f"https://github.com/{REPOSITORY}/blob/main/"
PICTURES = f"https://raw.githubusercontent.com/{REPOSITORY}/main/"
# A Markdown link or picture whose target has no scheme and is no heading of the same page.
RELATIVE = re.compile(r"(!?)(\[[^\]]*\])\((?!#|[a-z]+:)([^)]+)\)")


def absolute_links(markdown):
    """The text with absolute links."""
    return RELATIVE.sub(lambda link: f"{link[1]}{link[2]}({PICTURES if link[1] else PAGES}{link[3]})", markdown)


def relative_links(markdown):
    """The relative links of a text."""
    return [link[3] for link in RELATIVE.finditer(markdown)]
