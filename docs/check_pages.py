"""Open the built pages in a browser, wide and as on a phone, and look for what does not fit.

    python docs/check_pages.py docs/build/html

A page that is wider than the screen, an equation that is cut, a picture of the gallery that is
too small to see, an empty table, words of what is still to come, and text that is hard to read, by
day or by night, are complaints. Without
Chromium and its driver nothing is checked; with CDCP_IGL_REQUIRE_BROWSER=1 that is an error.
"""

import os
import shutil
import sys
from pathlib import Path

WIDTHS = {1280: 900, 400: 800}  # of the screen, and heights
LEAST = 200  # pixels across a picture in the gallery
LEGIBLE = 4.5  # contrast of text, level AA of WCAG 2
NOT_YET = ("not measured yet", "coming soon", "TODO")
LISTINGS = ("_modules", "_static", "_downloads", "tests")  # of code

LOOK = """
const [least, words, gallery] = arguments, found = [], page = document.documentElement;
const text = document.querySelector("article") || document.body;
const name = e => e.id || e.getAttribute("src") || e.textContent.trim().slice(0, 30) || e.tagName;
const all = (what, of = text) => [...of.querySelectorAll(what)];
const shown = e => e.getClientRects().length > 0;
if (page.scrollWidth > innerWidth) {
    const wide = all("*").filter(e => e.getBoundingClientRect().right > innerWidth + 1);
    found.push(`is ${page.scrollWidth} pixels wide: ${wide.slice(-1).map(name)}`);
}
for (const e of all("div.math, span.math"))
    if (e.scrollWidth > e.clientWidth + 1 && shown(e)) found.push(`cuts an equation, ${name(e)}`);
for (const e of gallery ? all("img") : []) {
    const across = Math.round(e.getBoundingClientRect().width);
    if (shown(e) && across < least) found.push(`has a picture of ${across} pixels: ${name(e)}`);
}
for (const e of all("table"))
    if (!all("td", e).some(cell => cell.textContent.trim() || cell.firstElementChild))
        found.push(`has an empty table, ${name(e)}`);
for (const word of words) if (text.innerText.includes(word)) found.push(`says "${word}"`);
return found;
"""

CONTRAST = """
const [least, scheme] = arguments, found = [];
document.documentElement.dataset.theme = scheme;
const channels = color => color.match(/[\\d.]+/g).map(Number);
const light = color => channels(color).slice(0, 3).map(c => c / 255)
    .map(c => c > 0.04045 ? ((c + 0.055) / 1.055) ** 2.4 : c / 12.92)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0.05);
const paper = e => {
    const color = e ? getComputedStyle(e).backgroundColor : "rgb(255, 255, 255)";
    return (channels(color)[3] ?? 1) > 0.5 ? color : paper(e.parentElement);
};
const words = e => [...e.childNodes].filter(n => n.nodeType == 3).map(n => n.data).join("").trim();
for (const e of document.body.querySelectorAll("article *")) {
    if (!words(e) || !e.getClientRects().length || e.closest("svg")) continue;
    const both = [light(getComputedStyle(e).color), light(paper(e))];
    const ratio = Math.max(...both) / Math.min(...both);
    if (ratio < least) found.push(`contrast ${ratio.toFixed(1)}: ${words(e).slice(0, 30)}`);
}
return found;
"""


def browser():
    """Start Chromium without a window; None where there is none."""
    programs = shutil.which("chromium"), shutil.which("chromedriver")
    if None in programs:
        return None
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    for argument in ("headless=new", "disable-gpu", "no-sandbox", "disable-dev-shm-usage"):
        options.add_argument(f"--{argument}")
    # The layout needs no scripts, and surfaces would begin to turn.
    off = {"profile.managed_default_content_settings.javascript": 2}
    options.add_experimental_option("prefs", off)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(programs[1]))


def complaints(root, driver):
    """Yield a sentence for each thing that is wrong."""
    root = root.resolve()
    for path in sorted(root.rglob("*.html")):
        here = path.relative_to(root)
        if set(LISTINGS) & set(here.parts):
            continue
        driver.get(path.as_uri())
        for width, height in WIDTHS.items():
            screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
            for said in driver.execute_script(LOOK, LEAST, NOT_YET, here.parts[0] == "gallery"):
                yield f"{here}, {width} pixels: {said}"
        for scheme in ("light", "dark"):
            for said in driver.execute_script(CONTRAST, LEGIBLE, scheme):
                yield f"{here}, {scheme}: {said}"


def main():
    """Print the complaints; exit code 1 if there are any."""
    driver = browser()
    if driver is None:
        sys.stdout.write("No chromium or chromedriver: the pages were not looked at.\n")
        sys.exit(os.environ.get("CDCP_IGL_REQUIRE_BROWSER") == "1")
    try:
        found = list(complaints(Path(sys.argv[1]), driver))
    finally:
        driver.quit()
    sys.stdout.write("".join(f"{line}\n" for line in found) or "All pages fit.\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
