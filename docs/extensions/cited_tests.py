"""The role ``{test}`` and the pages that show the tests it cites, one for each file of tests.

``{test}`test_cdcp.py::test_table_1``` links to the code of that test, and the code links
back to where it is cited. A citation of a test that does not exist stops the build.
"""

import ast
import re
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxRole

CITATION = re.compile(r"\{test\}`([\w.]+(?:::\w+)+)`")
# In brackets of their own they are notes beside the sentence, which the style makes small.
NOTES = re.compile(r"\s*\(((?:\{test\}`[^`]+`[,\s]*)+)\)")
LABEL = re.compile(r"^\(([\w-]+)\)=$")

HEAD = """# The tests that the pages cite

Written from the test files when these pages were built. Run one with
`python -m pytest tests/FILE::NAME`. Those that take `real_mesh` need the meshes in
`CDCP_IGL_DATA`, see [](/reference/environment.md).

```{toctree}
:maxdepth: 1

"""


def label_of(citation):
    return re.sub(r"\W+", "-", citation).lower()


class TestRole(SphinxRole):
    def run(self):
        reference = pending_xref(
            "",
            nodes.literal(text=self.text.split("::")[-1]),
            refdomain="std",
            reftype="ref",
            reftarget=label_of(self.text),
            refexplicit=True,
            refwarn=True,
            refdoc=self.env.docname,
        )
        return [reference], []


def citations(source):
    """Map each cited test to the labels of the places that cite it."""
    cited = {}
    for page in sorted(Path(source).rglob("*.md")):
        if "generated" in page.parts:
            continue
        place = f"{{doc}}`/{page.relative_to(source).with_suffix('').as_posix()}`"
        for line in page.read_text(encoding="utf-8").splitlines():
            if label := LABEL.match(line):
                place = f"{{ref}}`{label[1]}`"
            for test in CITATION.findall(line):
                places = cited.setdefault(test, [])
                if place not in places:
                    places.append(place)
    return cited


def code_of(tests, citation):
    """Source of a test function, decorators included."""
    file, *names = citation.split("::")
    text = (tests / file).read_text(encoding="utf-8")
    body = ast.parse(text).body
    for name in names:
        found = [node for node in body if getattr(node, "name", None) == name]
        if not found:
            raise ExtensionError(f"the documentation cites {citation}, which does not exist")
        body = found[0].body
    first = min([found[0].lineno, *(d.lineno for d in found[0].decorator_list)])
    return "\n".join(text.splitlines()[first - 1 : found[0].end_lineno])


def _write_pages(app):
    tests = Path(app.srcdir).parent / "tests"
    pages = {}
    for citation, places in sorted(citations(app.srcdir).items()):
        file, _, name = citation.partition("::")
        pages.setdefault(file.removesuffix(".py"), [f"# {file}\n"]).append(
            f"({label_of(citation)})=\n"
            f"## {name.split('::')[-1]}\n\n"
            f"Cited in {', '.join(places)}.\n\n"
            f"```python\n{code_of(tests, citation)}\n```\n"
        )
    folder = Path(app.srcdir, "generated", "tests")
    folder.mkdir(parents=True, exist_ok=True)
    for name, sections in pages.items():
        (folder / f"{name}.md").write_text("\n".join(sections), encoding="utf-8")
    names = "".join(f"tests/{name}\n" for name in pages)
    folder.with_suffix(".md").write_text(f"{HEAD}{names}```\n", encoding="utf-8")


def _as_notes(app, name, source):
    source[0] = NOTES.sub(
        lambda found: "".join(re.findall(r"\{test\}`[^`]+`", found[1])), source[0]
    )


def setup(app):
    app.add_role("test", TestRole())
    app.connect("source-read", _as_notes)
    app.connect("builder-inited", _write_pages)
    return {"parallel_read_safe": False}
