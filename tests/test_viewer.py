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
ActionBuilder = pytest.importorskip(
    "selenium.webdriver.common.actions.action_builder"
).ActionBuilder
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


def told(html):
    """What the page says of itself."""
    return json.loads(re.search(r'json" id="about">(.*?)</script>', html, re.DOTALL)[1])


def contents(html, k=0):
    """What the browser unpacks of a result, unpacked here."""
    scene = told(html)["scenes"][k]
    data = re.search(r'id="data">(.*?)</script>', html, re.DOTALL)[1].splitlines()[k]
    planes = np.frombuffer(gzip.decompress(b64decode(data)), np.uint8).reshape(4, -1)
    z = np.ascontiguousarray(planes.T).view("<u4").ravel().astype(np.int64)
    differences, arrays, at = (z >> 1) ^ -(z & 1), {}, 0
    for name, length in scene["arrays"]:
        arrays[name] = np.cumsum(differences[at : at + length])
        at += length
    assert at == len(differences)
    return scene, arrays


# -- what is in it ---------------------------------------------------------------------


def test_a_sphere_is_shown_as_one_without_the_seam_of_its_texture():
    V, F, _ = cdcp_igl.datasets.spheroid(2, 2)
    result = cdcp_igl.sphere_map(V, F)
    about, arrays = contents(result.view_html())
    ball = np.column_stack([arrays[f"{c} ball"] for c in "uvw"]) / 32767.5 - 1
    assert about["panels"] == ["Sphere"]
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
    P = np.column_stack([arrays[f"{c} 0"] for c in "xyz"]) / 65535 * size + V.min(axis=0)
    assert abs(P - V[vertices]).max() <= 0.5001 / 65535 * size
    rim = vertices[arrays["rim"].reshape(-1, 2)]
    loop = result.mesh.loop
    expected = np.column_stack([loop, np.roll(loop, -1)])
    assert sorted(map(tuple, rim)) == sorted(map(tuple, expected))
    assert len(arrays["cut"]) == 0
    colorings = {c["name"]: c for c in told(page.read_text(encoding="utf-8"))["colorings"]}
    height, missing = colorings["height"], arrays[colorings["x < y"]["array"]] == -1
    values = height["from"] + (height["to"] - height["from"]) * arrays["field height"] / 65535
    assert abs(values - V[vertices, 2]).max() < 1e-4
    assert (missing == (V[vertices, 0] < 0)).all()
    assert 0 <= arrays["angle 0"].min() <= arrays["angle 0"].max() <= 255


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
    uv = np.column_stack([arrays["u 0"], arrays["v 0"]]) / 32767.5 - 1
    (drawn_map,) = about["maps"]
    return arrays["vertexOrder"], drawn_map["middle"] + drawn_map["scale"] * uv


def test_several_disks_are_laid_out():
    V, F = grid(9, 12)
    F = np.vstack([F, F + len(V)])
    F[5] = F[5, ::-1]  # a face that was turned over
    V, F = np.vstack([V, V + 20]), np.vstack([[[0, 0, 1], F[7]], F])  # two are left out
    result = cdcp_igl.surface_map(V, F, outline="disk")
    page = result.view_html()
    about, arrays = contents(page)
    rows = np.flatnonzero(result.face_chart >= 0)
    assert len(rows) == len(F) - 2
    assert sorted(arrays["faceOrder"]) == list(rows)
    assert about["maps"][0]["spin"] == 0
    order, uv = drawn(about, arrays)
    given = order[arrays["faces"].reshape(-1, 3)]
    assert (np.sort(given) == np.sort(F[arrays["faceOrder"]])).all()
    expected = np.empty((len(V), 2))
    expected[F[rows]] = result.packed()[rows]
    used = np.unique(arrays["faces"])
    assert abs(uv - expected[order])[used].max() < 1e-4
    colorings = {c["name"]: c for c in told(page)["colorings"]}
    assert colorings["angle error"]["high"] < result.distortion.max  # no face counts as flipped
    assert colorings["charts"]["labels"] == ["0", "1"]
    of_corners = arrays["charts"][arrays["faces"].reshape(-1, 3)]
    assert (of_corners == result.face_chart[arrays["faceOrder"]][:, None]).all()


def test_a_rectangle_is_laid_out():
    V, F = grid(9, 12)
    rectangle = cdcp_igl.rectangle_map(V, F, [0, 11, 107, 96])
    about, arrays = contents(rectangle.view_html())
    assert about["maps"][0]["spin"] == 0
    order, uv = drawn(about, arrays)
    assert abs(uv - rectangle.uv[order]).max() < 1e-4


def test_each_map_says_how_good_it_is(bumps):
    V, F, result = bumps
    folded = result.uv * np.where(result.uv[:, :1] < 0.5, 1, -1)
    lscm = cdcp_igl.reference.lscm(V, F)
    page = result.view_html(beside={"LSCM": lscm, "folded": folded})
    facts = [made["facts"] for made in contents(page)[0]["maps"]]
    for uv, said in zip((result.uv, lscm, folded), facts, strict=True):
        certificate = cdcp_igl.certify(V, F, uv)
        assert f"mean {cdcp_igl.angle_distortion(V, F, uv).mean():.3g}°" in said
        assert f"area {certificate.areas.sd:.3g} " in said
        assert said.endswith("· valid") == certificate.valid
    assert facts[2].endswith("NOT VALID")
    assert '"facts"><' not in page  # the header has what the maps share


def test_labels_have_borders_between_their_faces():
    V, F, _ = cdcp_igl.datasets.square(9)
    label = np.where(V[:, 0] < 0, 7, np.where(V[:, 1] < 0, 3, 20))
    page = cdcp_igl.free_map(V, F).view_html(fields={"part": (label, {3: "south", 7: "west"})})
    _, arrays = contents(page)
    (coloring,) = (c for c in told(page)["colorings"] if c["name"] == "part")
    assert coloring["labels"] == ["south", "west", "20"]
    faces = arrays["faces"].reshape(-1, 3)
    colour = np.median(arrays["field part"][faces], axis=1)
    sides = {}
    for face, corners in enumerate(faces):
        for k in range(3):
            sides.setdefault(frozenset((corners[k], corners[k - 1])), []).append(colour[face])
    expected = {edge for edge, of in sides.items() if len(set(of)) == 2}
    assert {frozenset(edge) for edge in arrays["edges of field part"].reshape(-1, 2)} == expected
    assert len(expected) > 10


def test_a_slider_of_what_is_kept(bumps):
    V, F, _ = bumps
    first = cdcp_igl.free_map(V, F)
    page = first.view_html(keep=[0.1, "lengths"])
    about, arrays = contents(page)
    assert [made["step"] for made in about["maps"]] == ["angles", "0.1", "lengths (0.5)"]
    assert len(about["panels"]) == 1
    expected = first.continued(keep=0.1).continued(keep="lengths").uv[arrays["vertexOrder"]]
    uv = np.column_stack([arrays["u 2"], arrays["v 2"]]) / 32767.5 - 1
    last = about["maps"][2]
    assert abs(last["middle"] + last["scale"] * uv - expected).max() < 1e-4 * last["scale"]
    with pytest.raises(ValueError, match="needs a map of disk_map or free_map"):
        cdcp_igl.rectangle_map(V, F, first.mesh.loop[[0, 9, 18, 27]]).view_html(keep=[0.5])


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
    actions = ActionBuilder(browser, duration=0)
    place = in_window(browser, panel, x, y)
    actions.pointer_action.move_to_location(round(place["x"]), round(place["y"]))
    actions.perform()
    settle(browser)
    return readout(browser)


def in_window(browser, panel, x, y):
    """A place given from the middle of a panel, in the window."""
    middle = browser.execute_script(
        """const box = document.getElementById(arguments[0]).getBoundingClientRect();
        return [(box.left + box.right) / 2, (box.top + box.bottom) / 2]""",
        panel,
    )
    return {"x": middle[0] + x, "y": middle[1] + y}


def whole(browser, panel, x, y):
    """The place nearby where the pointer can stand: on a whole pixel of the window."""
    place, middle = (in_window(browser, panel, *at) for at in ((x, y), (0, 0)))
    return round(place["x"]) - middle["x"], round(place["y"]) - middle["y"]


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
    turn = np.exp(1j * about["maps"][0]["spin"])
    middle = (V.min(axis=0) + V.max(axis=0)) / 2
    radius = np.linalg.norm(V - middle, axis=1).max()
    home = np.reshape(about["shapes"][0]["home"], (3, 3))
    for face in result.invert([[0.1, 0.2], [-0.55, 0.3], [0.2, -0.8]])[0]:
        z = complex(*result.uv[F[face]].mean(axis=0))
        there = scale(opened, "plane", 0.92) * z * turn
        _, marked = point_at(opened, "plane", there.real, -there.imag)
        x, y = whole(opened, "plane", there.real, -there.imag)
        at = complex(x, -y) / scale(opened, "plane", 0.92) / turn  # in the disk
        _, barycentric = result.invert([at.real, at.imag])
        assert marked == str(face)
        assert abs(mark(opened, "plane") - [x, -y]).max() < 1
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
    place = {c: round(at) for c, at in in_window(opened, "plane", 60, 30).items()}
    opened.execute_cdp_cmd("Input.dispatchMouseEvent", wheel | place)
    assert shown(opened, "#plane") != far
    point_at(opened, "plane", 61, 30)
    assert point_at(opened, "plane", 60, 30) == before


def test_a_click_keeps_the_mark_and_escape_lets_go(opened):
    face = point_at(opened, "surface", 20, 10)[1]
    webdriver.ActionChains(opened).click().perform()
    for panel in ("plane", "surface"):
        assert point_at(opened, panel, -40, 40)[1] == face
    there = mark(opened, "plane")
    webdriver.ActionChains(opened).send_keys(webdriver.Keys.ESCAPE).perform()
    point_at(opened, "plane", there[0], -there[1])  # and back
    assert abs(mark(opened, "surface") - [20, -10]).max() < 8


def test_an_axis_goes_up(opened):
    best = shown(opened, "#surface")
    for button in opened.find_elements("css selector", ".up"):
        button.click()
        assert shown(opened, "#surface") != best
        (pressed,) = opened.find_elements("css selector", ".up[aria-pressed=true]")
        assert pressed == button
    button.click()
    assert shown(opened, "#surface") == best


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
    set_to(opened, "#squares", 7, "input")
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
    assert abs(np.subtract(picture.shape[:2], (stage["height"], stage["width"]))).max() <= 1
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
    z *= scale(browser, "plane2", 0.92) * np.exp(
        1j * contents(path.read_text())[0]["maps"][1]["spin"]
    )
    assert abs(mark(browser, "plane2") - [z.real, z.imag]).max() < 8
    seen = set()
    for key in "1234":
        find(browser, "body").send_keys(key)
        seen.add(shown(browser, "#plane2"))
    assert len(seen) == 4
    assert browser.get_log("browser") == []


def set_to(browser, selector, value, event="change"):
    """Change a slider, a number or a choice as a user does; nothing stands in the way of this."""
    browser.execute_script(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event(arguments[2]))",
        *(find(browser, selector), value, event),
    )


def test_two_hemispheres_with_fields_and_an_annotation(browser, bumps, tmp_path):
    freesurfer = pytest.importorskip("nibabel.freesurfer")
    V, F, left = bumps
    right = cdcp_igl.disk_map(V * [-1, 1, 1], F[:, ::-1])
    label = (V[:, 0] > 0) + 2 * (V[:, 1] > 0)
    colours = np.arange(16).reshape(4, 4) * [5, 9, 11, 0]
    names = ["unknown", "insula", "cuneus", "a <b>"]
    freesurfer.write_annot(tmp_path / "lh.annot", label, colours, names, fill_ctab=True)
    values, named = cdcp_igl.io.read_values(tmp_path / "lh.annot", len(V))
    x, y, z = np.vstack([V, V * [-1, 1, 1]]).T
    fields = {"depth": z - z.mean(), "angle": np.arctan2(y, x), "gap": np.where(x < 0, np.nan, x)}
    fields["regions"] = np.concatenate([values, values]), named
    path = cdcp_igl.plot.view(
        {"left": left, "right": right},
        tmp_path / "both.html",
        fields=fields,
        beside={"flat": np.column_stack([x, y, 0 * z]), "twice": np.column_stack([x, y, 2 * z])},
    )
    page = path.read_text()
    shapes = contents(page, 1)[0]["shapes"]
    assert [shape["name"] for shape in shapes] == ["Surface", "flat", "twice"]
    assert shapes[0]["home"] == shapes[2]["home"]
    browser.set_window_size(760, 620)  # less to draw
    browser.get(path.as_uri())
    wait(browser)

    def picture(change):
        """What the surface looks like after a change, which it must show."""
        before = shown(browser, "#surface")
        change()
        after = shown(browser, "#surface")
        assert after != before
        return after

    # Colours: those that go both ways around 0, a range, and a threshold that greys all.
    picture(lambda: set_to(browser, "#ramp", "diverging"))
    low, high = (float(find(browser, f"#{end}").get_attribute("value")) for end in ("low", "high"))
    assert low == -high < 0
    picture(lambda: set_to(browser, "#high", high / 3))
    set_to(browser, "#low", 2 * high)  # no range: it stays
    assert float(find(browser, "#low").get_attribute("value")) == low
    grey = picture(lambda: set_to(browser, "#threshold", 100))
    set_to(browser, "#ramp", "viridis")
    assert shown(browser, "#surface") == grey
    picture(lambda: set_to(browser, "#threshold", 0))
    find(browser, "#threshold").send_keys("2")  # a number, and no key for colours
    assert find(browser, "[aria-checked=true][role=radio]").text == "left"
    assert find(browser, "#colorings [aria-checked=true]").text == "depth"
    picture(lambda: find(browser, "body").send_keys("]"))
    set_to(browser, "#ramp", "cyclic")
    ends = [float(find(browser, f"#{end}").get_attribute("value")) for end in ("low", "high")]
    assert np.allclose(np.abs(ends), np.pi, atol=0.05)

    # Labels: lines over all colours, and names under the pointer.
    picture(find(browser, "#borders").click)
    picture(find(browser, "#borders").click)
    picture(lambda: find(browser, "body").send_keys("4"))
    assert find(browser, "#legend li:last-child").text == "a <b>"
    said, face = point_at(browser, "plane", 40, 30)
    assert f"regions {named[int(np.median(label[F[int(face)]]))]}" in said

    # Another shape, and back: the map stays.
    point_at(browser, "surface", 0, 0)
    plane = shown(browser, "#plane")
    for shape in (1, 0):
        picture(lambda shape=shape: set_to(browser, "figcaption select", shape))
    assert shown(browser, "#plane") == plane
    # The other hemisphere, in the same colours.
    picture(lambda: browser.find_elements("css selector", "#scenes button")[1].click())
    assert find(browser, "#colorings [aria-checked=true]").text == "regions"
    assert find(browser, "#facts").text.startswith(f"{len(V):,} vertices")
    said, face = point_at(browser, "plane", 40, 30)
    assert f"regions {named[int(np.median(label[F[int(face)]]))]}" in said
    assert browser.get_log("browser") == []


def test_a_slider_moves_the_map(browser, bumps, tmp_path):
    V, F, _ = bumps
    path = cdcp_igl.free_map(V, F).view(tmp_path / "keep.html", keep=[0.3, 0.9])
    browser.get(path.as_uri())
    wait(browser)
    seen = set()
    for step, name in enumerate(("angles", "0.3", "0.9")):
        set_to(browser, "figcaption input:not([hidden])", step, "input")
        assert f"{name} · mean" in browser.find_elements("css selector", "figcaption")[1].text
        seen.add((shown(browser, "#surface"), shown(browser, "#plane")))
        assert point_at(browser, "plane", 5, 5)[1] is not None
    assert len(seen) == 3
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
    assert not any(
        button.is_displayed() for button in opened.find_elements("css selector", "button")
    )
    assert not find(opened, ".help").is_displayed()


def test_the_report_of_a_batch_fits_a_narrow_window(browser, bumps, tmp_path):
    V, F, _ = bumps
    np.savez(tmp_path / "a_rather_long_name_of_a_surface.npz", V=V, F=F)
    np.savez(tmp_path / "torn.npz", V=V, F=[[0, 1, 9999]])
    page = tmp_path / "page.html"
    cdcp_igl.batch([tmp_path], tmp_path / "maps", report=page)
    metrics = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get(page.as_uri())
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 400
    cells = browser.find_elements("css selector", "td")
    assert len(cells) == 11 + 3
    for cell in cells:
        box = cell.rect
        assert box["x"] + box["width"] <= 400
        assert box["height"] < 80  # no words of one letter a line
    browser.find_elements("css selector", "th button")[1].click()
    assert browser.find_elements("css selector", "th[aria-sort]")
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
