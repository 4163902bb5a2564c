"""Gather the reports of the benchmarks: a page for each of their sections."""

import re
from pathlib import Path

LONG = 100  # lines of a section, above which a page shows no rows: they are in the report itself
NONE_YET = "This checkout has no measured results. `python -m benchmarks` writes them.\n"


def _sections(text):
    """Title and text of each, the first without a title of its own."""
    first, *others = re.split(r"^## ", text, flags=re.MULTILINE)
    yield "What was measured on", first.partition("\n")[2]
    for section in others:
        title, _, body = section.partition("\n")
        yield title, body


def _gather(app):
    results = Path(app.srcdir).parent / "benchmarks" / "results"
    generated = Path(app.srcdir, "generated", "benchmarks")
    generated.mkdir(parents=True, exist_ok=True)
    index = []
    for report in sorted(results.glob("*.md")):
        texts = [report.read_text(encoding="utf-8")]
        figures = results / report.stem / "README.md"
        if figures.exists():
            there = f"](/../benchmarks/results/{report.stem}/"
            text = figures.read_text(encoding="utf-8")
            texts.append(re.sub(r"(!\[[^]]*)\]\(", rf"\1{there}", text))
        index.append(f"## {report.stem}\n\n```{{toctree}}\n:maxdepth: 1\n")
        for k, (title, body) in enumerate(s for text in texts for s in _sections(text)):
            if body.count("\n") > LONG:
                file = f"`benchmarks/results/{report.name}`"
                body = body.partition("\n|")[0] + f"\n\nThe rows are in {file}.\n"
            if body.strip():
                page = generated / f"{report.stem}-{k:02}.md"
                page.write_text(f"# {title}\n{body}", encoding="utf-8")
                index.append(f"/generated/benchmarks/{page.stem}")
        index.append("```\n")
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "benchmarks.md").write_text("\n".join(index) or NONE_YET, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _gather)
    return {"parallel_read_safe": False}
