"""What shows itself in the browser and in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..surface.notebook import table_of

__all__ = ["Shown"]


class Shown:
    """A map that shows itself; the base of all results."""

    def plot(self) -> NDArray[Any]:
        """Draw the surface, its image, a checkerboard and the distortion: `plot.picture`.

        Returns
        -------
        (4,) ndarray of matplotlib.axes.Axes
            In a figure that does not depend on pyplot: ``axes[0].figure.savefig``.
        """
        from .layout import lay_out
        from .pictures import draw  # needs Matplotlib, which is optional and slow to import

        return np.array(draw(lay_out(cast(Any, self))).axes)

    def view(
        self,
        path: str | PathLike[str] | None = None,
        *,
        fields: Mapping[str, ArrayLike] | None = None,
        texture: str | PathLike[str] | ArrayLike | None = None,
        title: str = "",
    ) -> Path:
        """Write a page that shows the map, or open it in the browser.

        Parameters
        ----------
        path, fields, texture, title
            As in `cdcp_igl.plot.view`.

        Returns
        -------
        Path
            Where the page is.

        Raises
        ------
        ValueError, OSError
            As `cdcp_igl.plot.view`.
        """
        from .viewer import view  # needs Matplotlib, which is optional and slow to import

        return view(cast(Any, self), path, fields=fields, texture=texture, title=title)

    def __repr__(self) -> str:
        title = str(self).partition("\n")[0]
        return f"{type(self).__name__}({title.partition(' map of ')[2]})"

    def _repr_html_(self) -> str:
        table = table_of(str(self))
        if not cast(Any, self).valid:
            return table
        from .notebook import framed

        return table + framed(cast(Any, self))
