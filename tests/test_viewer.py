"""The page in which a surface turns beside its disk: what is in it, and driven in Chromium."""

import gzip
import json
import re
from base64 import b64decode
from itertools import pairwise

import numpy as np
import pytest
from browser import SOFTWARE_WEBGL, chromium
from matplotlib.image import imread
from meshes import grid

import cdcp_igl

webdriver = pytest.importorskip("selenium.webdriver")
ui = pytest.importorskip("selenium.webdriver.support.ui")
OFFLINE = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}


@pytest.fixture(scope="module")
def bumps():
    V, F, _ = cdcp_igl.datasets.spherical_cap(30, angle=90)
    V = V * (1 + 0.15 * np.sin(4 * V[:, :1]) * np.cos(3 * V[:, 1:2]))
    return V, F, cdcp_igl.disk_map(V, F)


@pytest.fixture(scope="module")
def page(bumps, tmp_path_factory):
    V, _, result = bumps
    texture = np.clip(0.5 + 0.5 * result.bake(V, size=64), 0, 1)
    path = tmp_path_factory.mktemp("view") / "map.html"
    fields = {"height": V[:, 2], "x < y": np.where(V[:, 0] < 0, np.nan, V[:, 0])}
    return result.view(path, fields=fields, texture=texture, title="Bumps & <hollows>")


def contents(html):
    """What the browser unpacks, unpacked here."""
    about = json.loads(re.search(r'json" id="about">(.*?)</script>', html, re.DOTALL)[1])
    data = re.search(r'id="data">(.*?)</script>', html, re.DOTALL)[1]
    planes = np.frombuffer(gzip.decompress(b64decode(data)), np.uint8).reshape(4, -1)
    z = np.ascontiguousarray(planes.T).view("<u4").ravel().astype(np.int64)
    differences, arrays, at = (z >> 1) ^ -(z & 1), {}, 0
    for name, length in about["arrays"]:
        arrays[name] = np.cumsum(differences[at : at + length])
        at += length
    assert at == len(differences)
    return about, arrays


# -- what is in it ---------------------------------------------------------------------


def test_a_sphere_is_shown_as_one_without_the_seam_of_its_texture():
    V, F, _ = cdcp_igl.datasets.spheroid(2, 2)
    result = cdcp_igl.sphere_map(V, F)
    about, arrays = contents(result.view_html())
    ball = np.column_stack([arrays[f"ball {k}"] for k in range(3)]) / 32767.5 - 1
    assert about["planes"] == ["Sphere"]
    assert abs(ball - result.points[arrays["vertexOrder"]]).max() < 1e-4
    assert len(arrays["cut"]) == 0


def test_the_data_are_the_map_to_16_bits(bumps, page):
    V, F, result = bumps
    about, arrays = contents(page.read_text(encoding="utf-8"))
    vertices, faces = arrays["vertexOrder"], arrays["faceOrder"]
    assert (np.sort(vertices) == np.arange(len(V))).all()
    given = vertices[arrays["faces"].reshape(-1, 3)]
    first = np.argmax(given == F[faces][:, :1], axis=1)[:, None]
    assert (np.take_along_axis(given, (first + np.arange(3)) % 3, 1) == F[faces]).all()
    assert abs(drawn(about, arrays)[1] - result.uv[vertices]).max() <= 0.5001 / 32767.5
    size = np.ptp(V, axis=0).max()
    P = np.column_stack([arrays[c] for c in "xyz"]) / 65535 * size + V.min(axis=0)
    assert abs(P - V[vertices]).max() <= 0.5001 / 65535 * size
    rim = vertices[arrays["rim"].reshape(-1, 2)]
    loop = result.mesh.loop
    expected = np.column_stack([loop, np.roll(loop, -1)])
    assert sorted(map(tuple, rim)) == sorted(map(tuple, expected))
    assert len(arrays["cut"]) == 0
    for name in (coloring["array"] for coloring in about["colorings"] if "array" in coloring):
        assert 0 <= arrays[name].min() <= arrays[name].max() <= 255


def test_edges_that_lie_in_one_place_are_cuts():
    V, F = grid(5, 5)
    result = cdcp_igl.surface_map(V, np.delete(F, 9, axis=0), fill=False)
    _, arrays = contents(result.view_html())
    order = arrays["vertexOrder"]
    given = result.cut.vertex_index
    rim, cut = (given[order[arrays[name].reshape(-1, 2)]] for name in ("rim", "cut"))
    assert len(rim) == 16 + 3
    found = {tuple(sorted(edge)) for edge in cut.tolist()}
    assert found == set(map(tuple, result.cut.edges.tolist()))
    assert len(cut) == 2 * len(found) > 0


def test_the_file_is_small(real_mesh):
    """At most 1.5 MiB for 50,000 vertices, even in disorder."""
    V, F = real_mesh("human_face_17157")
    order = np.random.default_rng(0).permutation(len(V))
    V, F = V[order], np.argsort(order)[F]
    assert len(cdcp_igl.disk_map(V, F).view_html()) < 1.5 * 2**20 * len(V) / 50_000


def test_a_page_needs_nothing(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"https?://|@import|src=\"(?!data:)|url\(", text)
    assert "<h1>Bumps &amp; &lt;hollows&gt;</h1>" in text


def test_without_a_path_it_opens_in_the_browser(bumps, monkeypatch, tmp_path):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    path = bumps[2].view()
    assert opened == [path.as_uri()]
    assert path.is_relative_to(tmp_path)


def test_what_is_no_image_is_no_texture(bumps, tmp_path):
    _, _, result = bumps
    (tmp_path / "a.txt").touch()
    with pytest.raises(ValueError, match=r"'a\.txt' is no image"):
        result.view_html(texture=tmp_path / "a.txt")
    with pytest.raises(FileNotFoundError):
        result.view_html(texture=tmp_path / "none.png")


def drawn(about, arrays):
    """Of the vertices that the page has: which they are, and where the map is drawn."""
    uv = np.column_stack([arrays["u0"], arrays["v0"]]) / 32767.5 - 1
    return arrays["vertexOrder"], about["middle"] + about["scale"] * uv


def test_several_disks_are_laid_out():
    V, F = grid(9, 12)
    F = np.vstack([F, F + len(V)])
    F[5] = F[5, ::-1]  # a face that was turned over
    V, F = np.vstack([V, V + 20]), np.vstack([[[0, 0, 1], F[7]], F])  # two are left out
    result = cdcp_igl.surface_map(V, F, outline="disk")
    about, arrays = contents(result.view_html())
    rows = np.flatnonzero(result.face_chart >= 0)
    assert len(rows) == len(F) - 2
    assert sorted(arrays["faceOrder"]) == list(rows)
    assert about["spins"] == [0]
    order, uv = drawn(about, arrays)
    given = order[arrays["faces"].reshape(-1, 3)]
    assert (np.sort(given) == np.sort(F[arrays["faceOrder"]])).all()
    expected = np.empty((len(V), 2))
    expected[F[rows]] = result.packed()[rows]
    used = np.unique(arrays["faces"])
    assert abs(uv - expected[order])[used].max() < 1e-4
    error = next(c for c in about["colorings"] if c["name"] == "angle error")
    assert error["high"] < result.distortion.max  # no face counts as flipped


def test_a_rectangle_is_laid_out():
    V, F = grid(9, 12)
    rectangle = cdcp_igl.rectangle_map(V, F, [0, 11, 107, 96])
    about, arrays = contents(rectangle.view_html())
    assert about["spins"] == [0]
    order, uv = drawn(about, arrays)
    assert abs(uv - rectangle.uv[order]).max() < 1e-4


# -- in the browser --------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    driver = chromium(*SOFTWARE_WEBGL)
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser, page):
    browser.set_window_size(1000, 700)
    browser.execute_cdp_cmd("Network.enable", {})
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", OFFLINE)
    browser.get(page.as_uri())
    wait(browser)
    yield browser
    assert browser.get_log("browser") == []


def wait(browser):
    ui.WebDriverWait(browser, 30).until(
        lambda driver: driver.execute_script("return document.body.dataset.state")
    )
    settle(browser)


def settle(browser):
    """Two frames: the drawing that was asked for is on the screen."""
    browser.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")


def find(browser, selector):
    return browser.find_element("css selector", selector)


def readout(browser):
    """What is said of the point under the pointer, and its face."""
    element = find(browser, "#readout")
    return element.text, element.get_attribute("data-face")


def shown(browser, selector):
    settle(browser)
    return find(browser, selector).screenshot_as_png


def point_at(browser, panel, x, y):
    """Move the pointer to a place given from the middle of a panel; what is said of it."""
    webdriver.ActionChains(browser, duration=0).move_to_element_with_offset(
        find(browser, f"#{panel}"), round(x), round(y)
    ).perform()
    settle(browser)
    return readout(browser)


def in_window(browser, panel, x, y):
    """A place given from the middle of a panel, in the window."""
    box = find(browser, f"#{panel}").rect
    return {"x": box["x"] + box["width"] / 2 + x, "y": box["y"] + box["height"] / 2 + y}


def scale(browser, panel, zoom):
    """Pixels to the unit, and the size of the panel."""
    box = find(browser, f"#{panel}").rect
    return zoom * min(box["width"], box["height"]) / 2


def mark(browser, panel):
    """Where the ring is, from the middle of the panel."""
    return np.array(
        browser.execute_script(
            """const mark = document.querySelector(`#${arguments[0]} .mark`);
            if (mark.hidden) return null;
            const [a, b] = [mark, mark.parentElement].map((e) => e.getBoundingClientRect());
            return [a.left + a.right - b.left - b.right, b.top + b.bottom - a.top - a.bottom].map(
                (x) => x / 2)""",
            panel,
        )
    )


def drag(browser, panel, dx, dy):
    actions = webdriver.ActionChains(browser, duration=50)
    actions.move_to_element(find(browser, f"#{panel}")).click_and_hold()
    actions.move_by_offset(dx, dy).release().perform()
    settle(browser)


def test_hovering_marks_the_face_that_invert_finds(opened, bumps, page):
    V, F, result = bumps
    about, _ = contents(page.read_text())
    turn = np.exp(1j * about["spins"][0])
    middle = (V.min(axis=0) + V.max(axis=0)) / 2
    radius = np.linalg.norm(V - middle, axis=1).max()
    home = np.reshape(about["home"], (3, 3))
    for face in result.invert([[0.1, 0.2], [-0.55, 0.3], [0.2, -0.8]])[0]:
        z = complex(*result.uv[F[face]].mean(axis=0))
        there = scale(opened, "plane", 0.92) * z * turn
        _, marked = point_at(opened, "plane", there.real, -there.imag)
        # The pointer stands on whole pixels: where that is in the disk.
        at = complex(round(there.real), round(there.imag)) / scale(opened, "plane", 0.92) / turn
        _, barycentric = result.invert([at.real, at.imag])
        assert marked == str(face)
        assert abs(mark(opened, "plane") - [round(there.real), round(there.imag)]).max() < 1
        seen = (barycentric @ V[F[face]] - middle) @ home.T / radius
        assert abs(mark(opened, "surface") - scale(opened, "surface", 0.95) * seen[:2]).max() < 1.5
    # And from the surface: the face under the pointer is there.
    for x, y in ((60, -40), (-50, 70)):
        found = int(point_at(opened, "surface", x, y)[1])
        corners = scale(opened, "surface", 0.95) * ((V[F[found]] - middle) @ home.T / radius)[:, :2]
        assert (corners.min(axis=0) - 1 < [x, -y]).all()
        assert (corners.max(axis=0) + 1 > [x, -y]).all()
        u, v = result.uv[F[found]].mean(axis=0)
        disk = scale(opened, "plane", 0.92) * complex(u, v) * turn
        assert abs(mark(opened, "plane") - [disk.real, disk.imag]).max() < 8
    assert point_at(opened, "plane", -scale(opened, "plane", 1) + 3, 0)[1] is None


def test_a_drag_turns_the_surface_and_only_moves_the_disk(opened):
    before = point_at(opened, "surface", 0, 0)
    drag(opened, "surface", 80, 20)
    point_at(opened, "surface", 0, 1)
    assert point_at(opened, "surface", 0, 0) != before
    before = point_at(opened, "plane", 0, 0)
    drag(opened, "plane", 40, 0)
    assert point_at(opened, "plane", 40, 0) == before
    assert point_at(opened, "plane", 0, 0) != before


def test_the_wheel_zooms_at_the_pointer(opened):
    before, far = point_at(opened, "plane", 60, 30), shown(opened, "#plane")
    wheel = {"type": "mouseWheel", "deltaX": 0, "deltaY": -900}
    opened.execute_cdp_cmd("Input.dispatchMouseEvent", wheel | in_window(opened, "plane", 60, 30))
    assert shown(opened, "#plane") != far
    point_at(opened, "plane", 61, 30)
    assert point_at(opened, "plane", 60, 30) == before


def test_every_colouring_differs_and_says_its_scale(opened):
    names = [button.text for button in opened.find_elements("css selector", "#colorings button")]
    assert names == [
        *("texture", "height", "x < y"),  # what was given comes first
        *("checkerboard", "normals", "angle error", "conformal factor"),
    ]
    seen = []
    for number, name in enumerate(names, 1):
        find(opened, "body").send_keys(str(number))
        seen.append((shown(opened, "#surface"), shown(opened, "#plane")))
        legend = find(opened, "#legend")
        assert legend.is_displayed() == (name not in ("normals", "checkerboard", "texture"))
        if name == "angle error":
            assert "°" in legend.text
    for pictures in zip(*seen, strict=True):
        assert len(set(pictures)) == len(names)

    # And a checkerboard gets finer.
    find(opened, "body").send_keys("4")
    coarse = shown(opened, "#surface")
    opened.execute_script(
        "arguments[0].value = 7; arguments[0].dispatchEvent(new Event('input'))",
        find(opened, "#squares"),
    )
    assert shown(opened, "#surface") != coarse
    assert find(opened, "output").text == "128"


def test_the_keyboard_turns_zooms_and_resets(opened):
    surface = find(opened, "#surface")
    pictures = []
    opened.execute_script("arguments[0].focus({focusVisible: true})", surface)
    for key in (webdriver.Keys.SHIFT, webdriver.Keys.ARROW_LEFT, "+", "0"):
        surface.send_keys(key)
        pictures.append(shown(opened, "#surface"))
    assert all(one != other for one, other in pairwise(pictures))
    assert pictures[-1] == pictures[0]


def test_wireframe_reset_and_picture(opened, tmp_path):
    before = shown(opened, "#surface")
    find(opened, "#wireframe").click()
    assert (wires := shown(opened, "#surface")) != before
    drag(opened, "surface", 80, 20)
    find(opened, "#reset").click()
    assert shown(opened, "#surface") == wires
    where = {"behavior": "allow", "downloadPath": str(tmp_path)}
    opened.execute_cdp_cmd("Browser.setDownloadBehavior", where)
    find(opened, "#picture").click()
    (path,) = ui.WebDriverWait(opened, 30).until(lambda _: list(tmp_path.glob("*.png")))
    picture = imread(path)
    stage = find(opened, "#stage").rect
    assert picture.shape[:2] == (int(stage["height"]), int(stage["width"]))
    assert picture.std() > 0.1


def test_a_face_is_marked_on_maps_side_by_side(browser, bumps, tmp_path):
    V, F, result = bumps
    other = 3 * cdcp_igl.reference.lscm(V, F) + 7
    path = result.view(tmp_path / "two.html", beside={"LSCM": other})
    browser.get(path.as_uri())
    wait(browser)
    face = int(point_at(browser, "plane", 20, 30)[1])
    low, high = other.min(axis=0), other.max(axis=0)
    z = complex(*(2 * other[F[face]].mean(axis=0) - low - high) / (high - low).max())
    z *= scale(browser, "plane2", 0.92) * np.exp(1j * contents(path.read_text())[0]["spins"][1])
    assert abs(mark(browser, "plane2") - [z.real, z.imag]).max() < 8
    seen = set()
    for key in "1245":
        find(browser, "body").send_keys(key)
        seen.add(shown(browser, "#plane2"))
    assert len(seen) == 4
    assert browser.get_log("browser") == []


def test_a_touch_marks_and_two_zoom(opened):
    def touch(kind, *points):
        places = [in_window(opened, "plane", *point) | {"id": i} for i, point in enumerate(points)]
        event = {"type": kind, "touchPoints": places}
        opened.execute_cdp_cmd("Input.dispatchTouchEvent", event)

    before = shown(opened, "#plane")
    touch("touchStart", (20, 0))
    touch("touchEnd")
    settle(opened)
    assert readout(opened)[1] is not None
    marked = shown(opened, "#plane")
    assert marked != before
    touch("touchStart", (-30, 0))
    touch("touchStart", (-30, 0), (30, 0))
    touch("touchMove", (-90, 0), (90, 0))
    touch("touchEnd")
    assert shown(opened, "#plane") != marked


def test_a_narrow_window_has_one_panel_above_the_other(opened):
    surface, plane = (find(opened, f"#{name}").rect for name in ("surface", "plane"))
    assert plane["x"] >= surface["x"] + surface["width"]
    metrics = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    settle(opened)
    assert opened.execute_script("return document.documentElement.scrollWidth") <= 400
    surface, plane = (find(opened, f"#{name}").rect for name in ("surface", "plane"))
    assert plane["y"] >= surface["y"] + surface["height"]
    assert min(surface["height"], plane["height"]) > 180
    assert point_at(opened, "plane", 10, 10)[1] is not None
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_in_the_dark_it_is_dark(opened):
    def paper():
        color = find(opened, "body").value_of_css_property("background-color")
        return sum(map(int, re.findall(r"\d+", color)[:3]))

    light, picture = paper(), shown(opened, "#surface")
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    assert paper() < 150 < 600 < light
    assert shown(opened, "#surface") != picture
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_without_webgl_there_is_a_picture(opened, page):
    script = opened.execute_cdp_cmd(
        "Page.addScriptToEvaluateOnNewDocument",
        {"source": "HTMLCanvasElement.prototype.getContext = () => null"},
    )
    opened.get(page.as_uri())
    wait(opened)
    opened.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)
    poster = find(opened, "#poster")
    assert poster.is_displayed()
    assert opened.execute_script("return arguments[0].naturalWidth", poster) > 500
    assert "no WebGL" in readout(opened)[0]
