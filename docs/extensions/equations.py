"""Equations with the numbers of the paper, as MathML, and links to them from docstrings.

A labelled equation, ``:label: eq-18``, is shown and referred to as (18). MathML needs no
script and no fonts from elsewhere.
"""

import re
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

LABEL = re.compile(r"^:label: (eq-[\w-]+)$", re.MULTILINE)
CITED = re.compile(r"(?<=\()?\beqs?\. \(\d+\)(?:(?:-|, |,? and )\(\d+\))*")


def number(label):
    """Return the number of an equation: eq-2-5 is 2–5."""
    return label.removeprefix("eq-").replace("-", "–")


def _inline(self, node):
    self.body.append(convert(node.astext(), display="inline"))
    raise nodes.SkipNode


def _display(self, node):
    self.body.append(self.starttag(node, "div", CLASS="math"))
    self.body.append(convert(node.astext(), display="block"))
    if node.get("label"):
        self.body.append(f'<span class="eqno">({number(node["label"])})</span>')
    self.body.append("</div>\n")
    raise nodes.SkipNode


def _use_the_papers_numbers(app, doctree):
    domain = app.env.domains["math"]
    for node in doctree.findall(nodes.math_block):
        if label := node.get("label"):
            domain.equations[label] = (app.env.docname, number(label))


def _link_equations(app, what, name, obj, options, lines):
    def link(cited):
        return re.sub(
            r"\((\d+)\)",
            lambda n: f":eq:`eq-{n[1]}`" if f"eq-{n[1]}" in app.env.known_equations else n[0],
            cited[0],
        )

    lines[:] = [CITED.sub(link, line) for line in lines]


def _find_equations(app):
    app.env.known_equations = {
        label
        for page in Path(app.srcdir, "theory").glob("*.md")
        for label in LABEL.findall(page.read_text(encoding="utf-8"))
    }


def setup(app):
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.config.html_math_renderer = "mathml"
    app.connect("builder-inited", _find_equations)
    app.connect("doctree-read", _use_the_papers_numbers)
    app.connect("autodoc-process-docstring", _link_equations, priority=900)
    return {"parallel_read_safe": False}
