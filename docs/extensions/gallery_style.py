"""How the pictures of the gallery look, and how they are found."""

import re
from pathlib import Path

import matplotlib as mpl
import pooch
from matplotlib.figure import Figure
from PIL import Image, ImageChops
from sphinx_gallery.scrapers import figure_rst


def style(gallery_conf, fname):
    """Set Matplotlib's defaults, before and after each program; no word of downloads."""
    pooch.get_logger().setLevel("WARNING")
    mpl.rcParams.update(
        {
            "figure.dpi": 100,
            "savefig.dpi": 100,
            "image.cmap": "cividis",  # looks much the same to every kind of eye
        }
    )


def _get_sg_image_scraper():
    return _figures


def _figures(block, block_vars, gallery_conf):
    """Save the figures of `cdcp_igl.plot`, which pyplot does not know."""
    variables = block_vars["example_globals"]
    paths = []
    for name, value in variables.items():
        known_to_pyplot = hasattr(value, "number")  # and found by the next scraper
        made_here = re.search(rf"^{name} = ", block[1], re.MULTILINE)
        if isinstance(value, Figure) and made_here and not known_to_pyplot:
            paths.append(next(block_vars["image_path_iterator"]))
            value.savefig(paths[-1], dpi=100)
    return figure_rst(paths, gallery_conf["src_dir"])


def _shrink(app, exception):
    """Store the pictures of the built pages with 256 colours, a third of the size.

    Those of the cards lose their white margins.
    """
    for path in Path(app.outdir, "_images").glob("sphx_glr_*.png"):
        with Image.open(path) as picture:
            if picture.mode != "P":
                drawn = picture.convert("RGB")
                if path.stem.endswith("_thumb"):
                    drawn = drawn.crop(ImageChops.invert(drawn).getbbox())
                small = drawn.quantize(256, dither=Image.Dither.NONE)
                small.save(path, optimize=True)


def setup(app):
    app.connect("build-finished", _shrink)
    return {"parallel_read_safe": False}
