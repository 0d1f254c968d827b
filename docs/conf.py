"""Settings of Sphinx for the documentation site: ``sphinx-build -W docs FOLDER``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from crowdsim import __version__

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "crowdsim"
copyright = "the developers of crowdsim, MIT license"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
html_theme = "furo"
html_title = f"crowdsim {release}"
exclude_patterns = ["_build"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

ROOT = Path(__file__).resolve().parents[1]
BESIDE = {"readme": "README.md", "contributing": "CONTRIBUTING.md", "changelog": "CHANGELOG.md"}
"""Pages of the site that are files beside ``docs``; their own files here only point to these."""


def _read(app: Sphinx, page: str, source: list[str]) -> None:
    """Read pages that are files beside ``docs``, and point links to them; show links to other files as plain text."""
    text = source[0]
    if page in BESIDE:
        text = (ROOT / BESIDE[page]).read_text(encoding="utf-8")
        text = re.sub(r"\]\((?!https?:|#|docs/)", "](../", text).replace("](docs/", "](").replace('="docs/', '="')
    for name, file in BESIDE.items():
        text = text.replace(f"](../{file}", f"]({name}.md")
    source[0] = re.sub(r"(?<!!)\[([^\]]*)\]\(\.\./[^)]*\)", r"\1", text)


def setup(app: Sphinx) -> None:
    """Register what changes pages while they are read."""
    app.connect("source-read", _read)
