"""A small picture of the disks of a surface, for the report of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np

from ..arrays import Floats
from ..io import whole_file
from ..result.bijection import _pixel_centers as pixel_centers
from ..result.disk_map import DiskMap
from .stamps import Stamp, put_stamp

__all__ = ["draw_thumbnail"]

SIZE = 64  # pixels
IN_A_ROW = 4
MOST_DISKS = 12


def draw_thumbnail(path: Path, disks: Sequence[DiskMap], stamp: Stamp) -> None:
    """Draw disks in rows, the largest parts first, coloured by the normals of the surface.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    from matplotlib.image import imsave  # of the extra "plot"

    from ..libigl import vertex_normals
    from ..plot.scene import normal_colors

    outside = (abs(pixel_centers(SIZE)) > 1).reshape(SIZE, SIZE)
    images: list[Floats] = []
    for disk in disks[:MOST_DISKS]:
        mesh = disk.mesh
        normals = np.nan_to_num(vertex_normals(mesh.positions, mesh.F))
        image = disk.bake(normal_colors(normals), SIZE)[..., :3]
        image[outside] = 1
        images.append(image)
    columns = min(len(images), IN_A_ROW)
    images += [np.ones_like(images[0])] * (-len(images) % columns)
    rows = [np.hstack(images[i : i + columns]) for i in range(0, len(images), columns)]
    file = BytesIO()
    imsave(file, np.clip(np.vstack(rows), 0, 1), format="jpeg", pil_kwargs={"quality": 85})
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished:
        unfinished.write_bytes(file.getvalue())
        put_stamp(unfinished, stamp)
