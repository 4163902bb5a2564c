"""Equations with the numbers of the paper, drawn as SVG, and links to them from docstrings.

A labelled equation, ``:label: eq-18``, is shown and referred to as (18). The pictures need no
script and no fonts, and look the same everywhere.
"""

import re
from html import escape
from pathlib import Path

import ziamath
from docutils import nodes
from places import CITED
from sphinx.ext import autosummary

SIZE = 18  # pixels

ziamath.config.svg2 = False  # no ids that equations of one page would share

LABEL = re.compile(r"^:label: (eq-[\w-]+)$", re.MULTILINE)


def number(label):
    """Return the number of an equation: eq-2-5 is 2–5."""
    return label.removeprefix("eq-").replace("-", "–")


def _svg(latex, **options):
    """Draw an equation in the colour of the text around it."""
    drawn = ziamath.Latex(latex, size=SIZE, color="currentColor", **options)
    label = f'<svg role="img" aria-label="{escape(latex, quote=True)}"'
    return drawn.svg().replace("<svg", label, 1), drawn.getyofst()


def _inline(self, node):
    svg, below = _svg(node.astext(), inline=True)
    self.body.append(f'<span class="math" style="vertical-align: {below:.2f}px">{svg}</span>')
    raise nodes.SkipNode


def _display(self, node):
    self.body.append(self.starttag(node, "div", CLASS="math"))
    self.body.append(_svg(" ".join(node.astext().split()))[0])
    if node.get("label"):
        self.body.append(f'<span class="eqno">({number(node["label"])})</span>')
    self.body.append("</div>\n")
    raise nodes.SkipNode


def _use_the_papers_numbers(app, doctree):
    domain = app.env.domains["math"]
    for node in doctree.findall(nodes.math_block):
        if label := node.get("label"):
            domain.equations[label] = (app.env.docname, number(label))


def _mend_docstring(app, what, name, obj, options, lines):
    """Link the equations, and keep the bars of absolute values out of reStructuredText."""

    def link(cited):
        return re.sub(
            r"\((\d+)\)",
            lambda n: f":eq:`eq-{n[1]}`" if f"eq-{n[1]}" in app.env.known_equations else n[0],
            cited[0],
        )

    for at, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...", "..")):
            outside = CITED.sub(link, line).split("``")
            outside[::2] = [part.replace("|", r"\|") for part in outside[::2]]
            lines[at] = "``".join(outside)


def _find_equations(app):
    app.env.known_equations = {
        label
        for page in Path(app.srcdir, "theory").glob("*.md")
        for label in LABEL.findall(page.read_text(encoding="utf-8"))
    }


def setup(app):
    autosummary.WELL_KNOWN_ABBREVIATIONS += ("eq.", "eqs.")  # do not end the line of a name
    app.add_html_math_renderer("svg", (_inline, None), (_display, None))
    app.config.html_math_renderer = "svg"
    app.connect("builder-inited", _find_equations)
    app.connect("doctree-read", _use_the_papers_numbers)
    app.connect("autodoc-process-docstring", _mend_docstring, priority=900)
    return {"parallel_read_safe": False}
