"""Chromium without a window, for what is made to be looked at in a browser."""

import os
import shutil

import pytest


def chromium(*arguments):
    """Start it; skip where there is none, fail where there has to be one."""
    programs = shutil.which("chromium"), shutil.which("chromedriver")
    if None in programs:
        if os.environ.get("CDCP_IGL_REQUIRE_BROWSER") == "1":
            pytest.fail("no chromium or chromedriver, and CDCP_IGL_REQUIRE_BROWSER=1")
        pytest.skip("needs chromium and chromedriver on the path (Debian: sh .ci/setup-browser)")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    for argument in ("headless=new", "no-sandbox", "disable-dev-shm-usage", *arguments):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(programs[1]))


SOFTWARE_WEBGL = ("use-gl=angle", "use-angle=swiftshader", "enable-unsafe-swiftshader")
