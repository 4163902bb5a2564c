"""A map in a notebook: the page, or a picture."""

from __future__ import annotations

from html import escape

from .layout import Mapped, Opened, lay_out
from .viewer import poster, view_html

__all__ = ["framed"]

# Beyond it a page is more than about half a megabyte, and a notebook keeps each that it shows.
MOST_VERTICES = 20_000


def framed(result: Mapped | Opened) -> str:
    """Return the page of a map in a frame, or a picture if it has many vertices."""
    if len(lay_out(result).V) > MOST_VERTICES:
        hint = "<p>To turn it and look closer: <code>.view()</code>, which opens the browser.</p>"
        return poster(result) + hint
    page = escape(view_html(result), quote=True)
    # In a frame of its own, the page and the notebook cannot touch one another.
    return (
        f'<iframe srcdoc="{page}" title="The surface beside its image" loading="lazy" '
        'sandbox="allow-scripts" style="width: 100%; height: 560px; border: 0"></iframe>'
    )
