"""Gather the reports of the benchmarks, one a machine, for the page that includes them."""

import re
from pathlib import Path

NONE_YET = "This checkout has no measured results. `python -m benchmarks` writes them.\n"
# Without the first line, which is the title.
REPORT = (
    "## {name}\n\n```{{include}} /../benchmarks/results/{name}.md\n"
    ":start-line: 1\n:heading-offset: 1\n```\n"
)


def _gather(app):
    results = Path(app.srcdir).parent / "benchmarks" / "results"
    page = []
    for report in sorted(results.glob("*.md")):
        page.append(REPORT.format(name=report.stem))
        figures = results / report.stem / "README.md"
        if figures.exists():
            text = figures.read_text(encoding="utf-8").replace("\n## ", "\n#### ")
            there = f"](/../benchmarks/results/{report.stem}/"
            page.append("##" + re.sub(r"(!\[[^]]*)\]\(", rf"\1{there}", text))
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "benchmarks.md").write_text("\n".join(page) or NONE_YET, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _gather)
    return {"parallel_read_safe": False}
