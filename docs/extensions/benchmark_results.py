"""Gather the reports of the benchmarks: a page for each of their sections."""

import re
from pathlib import Path

NONE_YET = "This checkout has no measured results. `python -m benchmarks` writes them.\n"
SHORT = "In short"


def _sections(text):
    """Title and text of each; what comes before them stands on the first page."""
    title, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    first, _, body = title.partition("\n")
    if body.strip():
        yield first.removeprefix("# "), body
    for section in sections:
        head, _, body = section.partition("\n")
        yield head, body


def _anchor(title):
    """What links to a section of a report end with."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def _report(report):
    """Return the heading of a report, and its sections with those of its figures."""
    text = report.read_text(encoding="utf-8")
    texts, figures = [text], report.with_suffix("") / "README.md"
    if figures.exists():
        there = f"](/../benchmarks/results/{report.stem}/"
        drawn = figures.read_text(encoding="utf-8").partition("\n## ")  # without its heading
        texts.append(re.sub(r"(!\[[^]]*)\]\(", rf"\1{there}", "".join(drawn[1:])))
    found = [section for text in texts for section in _sections(text) if section[1].strip()]
    return text.partition("\n")[0].removeprefix("# "), found


def _gather(app):
    results = Path(app.srcdir).parent / "benchmarks" / "results"
    generated = Path(app.srcdir, "generated", "benchmarks")
    generated.mkdir(parents=True, exist_ok=True)
    index, answers = [], []
    for report in sorted(
        results.glob("*.md"), key=lambda path: ("standard" not in path.stem, path)
    ):
        heading, sections = _report(report)
        at = {
            title: f"/generated/benchmarks/{report.stem}-{_anchor(title)}" for title, _ in sections
        }

        def linked(body, at=at):
            pages = {f"](#{_anchor(title)})": f"]({page}.md)" for title, page in at.items()}
            for link, page in pages.items():
                body = body.replace(link, page)
            return body

        index.append(f"### {heading}\n\n```{{toctree}}\n:maxdepth: 1\n")
        for title, body in sections:
            if title == SHORT:
                answers.append(f"## {heading}\n{linked(body)}")
                continue
            page = generated / f"{Path(at[title]).name}.md"
            page.write_text(f"# {title}\n{linked(body)}", encoding="utf-8")
            index.append(at[title])
        index.append("```\n")
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "benchmarks.md").write_text("\n".join(index) or NONE_YET, encoding="utf-8")
    (parts / "benchmarks_short.md").write_text("\n".join(answers[:1]) or NONE_YET, encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _gather)
    return {"parallel_read_safe": False}
