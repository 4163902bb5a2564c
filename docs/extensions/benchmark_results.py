"""Gather the reports of the benchmarks, one a machine, for the page that includes them."""

from pathlib import Path

NONE_YET = "This checkout has no measured results. `python -m benchmarks` writes them.\n"
INCLUDE = (
    "```{{include}} /../benchmarks/results/{path}\n"
    ":start-line: 1\n:heading-offset: {offset}\n:relative-images:\n```\n"
)  # without the first line, which is the title


def _gather(app):
    results = Path(app.srcdir).parent / "benchmarks" / "results"
    page = []
    for report in sorted(results.glob("*.md")):
        page.append(f"## {report.stem}\n\n" + INCLUDE.format(path=report.name, offset=1))
        figures = results / report.stem / "README.md"
        if figures.exists():
            path = figures.relative_to(results)
            page.append("### Figures\n\n" + INCLUDE.format(path=path, offset=2))
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "benchmarks.md").write_text("\n".join(page) or NONE_YET, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _gather)
    return {"parallel_read_safe": False}
