"""The page of a live simulation: the viewer of exported pages, and a panel of commands."""

from __future__ import annotations

from importlib import resources

from crowdsim.export.page.page import fill_page, shared_text


def live_page(title: str) -> bytes:
    """Return the page of a simulation with a title."""
    own = resources.files("crowdsim.live")
    panel, style = ((own / name).read_text(encoding="utf-8") for name in ("panel.html", "panel.css"))
    scripts = [shared_text("viewer.min.js"), shared_text("live.min.js")]
    style = shared_text("page.css") + style
    return fill_page(title, scripts, style, panel=panel, allowed=["connect-src 'self'"]).encode()
