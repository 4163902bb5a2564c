"""Look for broken links and anchors in the built pages, and for what other sites would serve or
only this machine has.

    python docs/check_links.py docs/build/html

Links to other sites are fine for a reader to follow; scripts, styles, fonts and pictures must
all be here.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

CHECKOUT = Path(__file__).resolve().parents[1]
LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src"}
STYLE_URL = re.compile(r"(?:url\(\s*['\"]?|@import\s+['\"])((?:https?:)?//[^'\")]+)")


class Page(HTMLParser):
    """The anchors, links and loaded files of a page."""

    def __init__(self, path):
        super().__init__()
        self.anchors, self.links, self.loaded = {""}, [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if given.get(LOADED.get(tag, "")):
            self.loaded.append(given[LOADED[tag]])


def complaints(root):
    """Yield a sentence for each thing that is wrong."""
    root = root.resolve()
    pages = {
        path: Page(path) for path in sorted(root.rglob("*.html")) if "_static" not in path.parts
    }
    if not pages:
        yield f"{root} has no pages"
    for path, page in pages.items():
        here = path.relative_to(root)
        if str(CHECKOUT) in path.read_text(encoding="utf-8"):
            yield f"{here} names {CHECKOUT}, a folder of the machine that built it"
        for link in page.links + page.loaded:
            url = urlsplit(link)
            if url.scheme or url.netloc:
                if link in page.loaded and url.scheme != "data":
                    yield f"{here} loads {link}"
                continue
            target = (path.parent / unquote(url.path)).resolve() if url.path else path
            if not target.is_file():
                yield f"{here} links to {link}, which is no file"
            elif target in pages and unquote(url.fragment) not in pages[target].anchors:
                yield f"{here} links to {link}, which has no such anchor"
    for path in sorted(root.rglob("*.css")):
        for link in STYLE_URL.findall(path.read_text(encoding="utf-8")):
            yield f"{path.relative_to(root)} loads {link}"


def main():
    """Print the complaints; exit code 1 if there are any."""
    found = list(complaints(Path(sys.argv[1])))
    sys.stdout.write("".join(f"{line}\n" for line in found) or "No broken links.\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
