"""A map in a notebook: a table, and the page or a picture."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO

from ..result import DiskMap
from ..surface.notebook import html_table
from .pictures import picture
from .viewer import view_html

__all__ = ["disk_map_html"]

# Beyond it a page is more than about half a megabyte, and a notebook keeps each that it shows.
MOST_VERTICES = 20_000


def disk_map_html(result: DiskMap) -> str:
    """Return what a notebook shows of a map."""
    distortion = result.distortion
    rows = {
        "map": result.verdict,
        "angular distortion": str(distortion),
        **({} if result.conformal else {"conformal": str(result.conformality)}),
        "certificate": str(result.certificate),
        "boundary": str(result.trace),
        "seconds": f"{sum(result.timings.values()):.2f}",
    }
    table = html_table(f"Disk map of {len(result.uv):,} vertices", rows)
    if not result.valid:
        return table
    if len(result.uv) > MOST_VERTICES:
        hint = "<p>To turn it and look closer: <code>.view()</code>, which opens the browser.</p>"
        return table + _picture(result) + hint
    page = escape(view_html(result), quote=True)
    # In a frame of its own, the page and the notebook cannot touch one another.
    return (
        f'{table}<iframe srcdoc="{page}" title="The surface beside the disk" loading="lazy" '
        'sandbox="allow-scripts" style="width: 100%; height: 520px; border: 0"></iframe>'
    )


def _picture(result: DiskMap) -> str:
    file = BytesIO()
    picture(result.mesh.positions, result.mesh.F, result).savefig(file, format="png", dpi=75)
    source = b64encode(file.getvalue()).decode()
    return f'<img alt="Surface, disk and distortion" src="data:image/png;base64,{source}">'
