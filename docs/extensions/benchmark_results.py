"""Gather the reports of the benchmarks, one a machine, for the page that includes them."""

from pathlib import Path

NONE_YET = "This checkout has no measured results. `python -m benchmarks` writes them.\n"


def _gather(app):
    results = Path(app.srcdir).parent / "benchmarks" / "results"
    reports = sorted(results.glob("*.md"))
    page = [
        f"## {report.stem}\n\n"  # in place of the first line, which is the title
        f"```{{include}} /../benchmarks/results/{report.name}\n"
        ":start-line: 1\n:heading-offset: 1\n```\n"
        for report in reports
    ]
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "benchmarks.md").write_text("\n".join(page) or NONE_YET, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _gather)
    return {"parallel_read_safe": False}
