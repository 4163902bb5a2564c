"""A surface in parts: the same map as in one, whatever the planes cut, and the same refusals."""

import json
import os
import re
import shutil
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path

import meshes
import numpy as np
import pytest
from commands import invoke, start
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from benchmarks.measure.faults import children
from cdcp_igl import MapError, MeshError, check, disk_map, partition, parts_map
from cdcp_igl.arrays import as_complex
from cdcp_igl.datasets import spherical_cap
from cdcp_igl.io import write_map
from cdcp_igl.solve.solvers import SOLVERS


def bumpy(V):
    """The surface without symmetry, so that one face is the most central."""
    return V + 0.05 * np.sin(3 * V[:, [1, 2, 0]] + [1, 2, 3])


def bulb():
    """Nearly a whole sphere: all of the boundary is near the south pole."""
    V, F, _ = spherical_cap(10, angle=165)
    return bumpy(V), F


def scroll():
    """A sheet rolled up: planes cut it into parts of many pieces."""
    x, y, F = meshes.cells(18, 36)
    t = x / 4
    V = np.column_stack([(1 + t / 9) * np.cos(t), (1 + t / 9) * np.sin(t), y / 3])
    return bumpy(V), F


SURFACES = {
    "grid": meshes.grid(14, 18),
    "cap": (bumpy(spherical_cap(12)[0]), spherical_cap(12)[1]),
    "bulb": bulb(),
    "scroll": scroll(),
    "small": meshes.grid(),
    "plane": (meshes.grid(14, 18)[0][:, :2], meshes.grid(14, 18)[1]),
}


WRITING = ("check", "factor", "center", "trace", "extension", "mobius", "certificate")  # phases


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "parts"


def arrays_of(folder):
    """Read the parts that have faces."""
    numbers = json.loads((folder / "parts.json").read_text())["parts"]
    return [dict(np.load(folder / f"part-{p}.npz")) for p in numbers]


def pieces(F):
    pairs = F.ravel(), np.roll(F, 1, axis=1).ravel()
    return connected_components(coo_matrix((np.ones(F.size), pairs), shape=(F.max() + 1,) * 2))[0]


# What the planes may do to a surface, in so many parts, and whether they do: by the parts, their
# vertices on seams and on the boundary, and the corners of the central face.
TRAPS = {
    ("small", 32): {
        "parts of one face": lambda x: 1 in map(len, x["F"]),
        "empty parts": lambda x: len(x["F"]) < 32,
        "parts without inside": lambda x: any(
            np.isin(some, [*x["seams"], *x["loop"]]).all() for some in x["vertices"]
        ),
        "seams through the boundary": lambda x: np.isin(x["seams"], x["loop"]).any(),
        "the center on a seam": lambda x: np.isin(x["center"], x["seams"]).all(),
    },
    ("bulb", 2): {
        "the boundary in one part": lambda x: any(
            np.isin(x["loop"], some).all() for some in x["vertices"]
        )
    },
    ("scroll", 4): {"a fold cut in pieces": lambda x: max(map(pieces, x["F"])) > 1},
}
NUMBERS = (
    *("distortion.mean", "distortion.sd", "distortion.max", "distortion_of_free_faces.mean"),
    *("conformality.excess", "conformality.stretch"),
)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        *[("grid", 1), ("cap", 2), ("plane", 8), *TRAPS],
        *(pytest.param(name, 32, marks=pytest.mark.slow) for name in ("scroll", "bulb", "grid")),
    ],
)
def test_the_same_map(name, parts, folder):
    V, F = SURFACES[name]
    expected = disk_map(V, F, refine=0)
    result = parts_map(partition((V, F), folder, parts))
    np.testing.assert_allclose(result.uv, expected.uv, atol=1e-10)
    assert result.valid
    assert result.center == expected.center
    for number in map(attrgetter, NUMBERS):
        assert number(result) == pytest.approx(number(expected), rel=1e-9)
    found = {key: [x[key] for x in arrays_of(folder)] for key in ("F", "vertices", "row")}
    seams = [some[row >= 0] for some, row in zip(found["vertices"], found["row"], strict=True)]
    found |= {"seams": np.concatenate(seams), "loop": expected.mesh.loop}
    found["center"] = F[expected.center.face]
    for trap, is_there in TRAPS.get((name, parts), {}).items():
        assert is_there(found), trap


@pytest.mark.slow
@settings(max_examples=20)
@given(
    st.sampled_from([2, 4, 16]),
    st.integers(0, 150),
    st.sampled_from(["angle", "area", None]),
    st.sampled_from([None, 3, [0.2, 1, 0.3]]),
    st.integers(-40, 40),
)
def test_the_same_options(tmp_path_factory, parts, center, mobius, align, unit):
    """The central face on a seam, too."""
    V, F = meshes.grid(14, 18)
    V = np.ldexp(V, unit)
    center += 200
    options = {"center": center, "mobius": mobius, "align": align}
    folder = tmp_path_factory.mktemp("options") / "parts"
    try:
        expected = disk_map(V, F, refine=0, **options)
    except (MapError, ValueError):
        return
    if expected.boundary.rejected or expected.straightening.before:
        return
    result = parts_map(partition((V, F), folder, parts), **options)
    np.testing.assert_allclose(result.uv, expected.uv, atol=1e-10)
    assert result.mobius.w == pytest.approx(expected.mobius.w, abs=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_same_map_by_each_solver(solver, folder):
    V, F = SURFACES["cap"]
    result = parts_map(partition((V, F), folder, 4), solver=solver)
    np.testing.assert_allclose(result.uv, disk_map(V, F, refine=0).uv, atol=1e-10)
    assert solver in result.solver


@pytest.mark.parametrize("name", meshes.NASTY)
def test_what_is_no_disk_is_refused_as_by_check(name, folder):
    """Also a non-manifold edge, a face twice or a pinch on a seam, two loops and a handle."""
    _, V, F, _ = meshes.NASTY[name]
    with pytest.raises(MeshError) as refused:
        parts_map(partition((V, F), folder, 8))
    expected = check(V, F).defects
    assert [d.name for d in refused.value.defects] == [d.name for d in expected]
    for mine, theirs in zip(refused.value.defects, expected, strict=True):
        np.testing.assert_array_equal(mine.indices, theirs.indices)


@pytest.mark.parametrize("row", range(0, 100, 9))
def test_a_third_face_at_an_edge_wherever_it_is(row, folder):
    V, F = meshes.grid()
    F = np.vstack([F, [*F[row % len(F), :2], (F[row % len(F), 2] + 20) % len(V)]])
    with pytest.raises(MeshError) as refused:
        parts_map(partition((V, F), folder, 16))
    np.testing.assert_array_equal(refused.value.indices, check(V, F).defects[0].indices)


def test_what_disk_map_rescues_is_refused_with_the_reason(folder):
    with pytest.raises(MapError, match="have a shear in common"):
        parts_map(partition(meshes.TWO_TRIANGLES, folder, 2))
    with pytest.raises(ValueError, match="center must be"):
        parts_map(folder, center="heat")
    with pytest.raises(ValueError, match="align=37 is not a boundary vertex"):
        parts_map(partition(meshes.grid(), folder.with_name("grid"), 2), align=37)


@pytest.mark.parametrize("name", ["parts.json", "part-1.npz", "seams.npz", "map-*/map.json"])
def test_a_damaged_folder(name, folder):
    partition(SURFACES["cap"], folder, 2)
    seen = []
    for _ in range(2):  # the second time, the map is found
        parts_map(folder, progress=lambda phase, done: seen.append((phase, done)))
    assert seen.count(("done", 1.0)) == 2
    if "map" not in name:
        shutil.rmtree(*folder.glob("map-*"))
    [file] = folder.glob(name)
    whole = file.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"\0" * len(whole)):
        file.write_bytes(damaged)
        with pytest.raises(MeshError, match=rf"{file.name}.* Part the surface again"):
            parts_map(folder)


class Stopped(Exception):
    pass


def test_a_run_that_was_stopped_goes_on_with_the_same_bits(folder):
    V, F = SURFACES["cap"]
    expected = parts_map(partition((V, F), folder.with_name("other"), 4))
    parts, times = partition((V, F), folder, 4), {}
    for stop in (*WRITING, "repair"):

        def progress(phase, done, stop=stop):
            if phase == stop:
                raise Stopped

        with pytest.raises(Stopped):
            parts_map(parts, progress=progress)
        found = {file: file.stat().st_mtime_ns for file in parts.glob("map-*/e*.npz")}
        assert {**found, **times} == found  # nothing is computed twice
        times = found
    assert times
    np.testing.assert_array_equal(parts_map(parts).uv, expected.uv)
    result, again = parts_map(parts, center=300), parts_map(parts, center=300)
    assert result.report() == again.report()
    assert result.mobius == again.mobius
    np.testing.assert_array_equal(parts_map(parts).uv, expected.uv)
    assert not list(parts.glob("map-*/*.npz"))


@pytest.fixture(scope="module")
def bits(tmp_path_factory):
    """The map of the scroll in eight parts, to the last bit."""
    folder = tmp_path_factory.mktemp("scroll") / "parts"
    return np.asarray(parts_map(partition(SURFACES["scroll"], folder, 8)).uv)


@contextmanager
def dask():
    distributed = pytest.importorskip("distributed")
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(n_workers=2, **options) as cluster:
        yield distributed.Client(cluster)


@pytest.mark.parametrize(
    "executors",
    [
        partial(ThreadPoolExecutor, 2),
        pytest.param(partial(nullcontext, 2), marks=pytest.mark.slow),
        pytest.param(dask, marks=pytest.mark.slow),
    ],
    ids=["threads", "processes", "Dask"],
)
def test_executors_give_the_same_bits(executors, folder, bits):
    parts = partition(SURFACES["scroll"], folder, 8)
    with executors() as executor:
        np.testing.assert_array_equal(parts_map(parts, executor=executor).uv, bits)


def rough_patch(seed):
    """A sheet with a small patch of needles, across which its harmonic map flips faces."""
    rng = np.random.default_rng(seed)
    x, y, F = meshes.cells(40, 50)
    V = np.column_stack([x, y, 0.3 * np.sin(x / 3)])
    V[:, :2] += rng.uniform(-0.2, 0.2, (len(V), 2))
    inside = np.maximum(0, 1 - ((x - 25) / 4) ** 2) * np.maximum(0, 1 - ((y - 20) / 4) ** 2)
    V[:, 2] += 3 * inside * rng.normal(size=len(V))
    V[:, 0] += 1.5 * inside * (y - 20)
    return V, F


@pytest.mark.parametrize("seed", [3, 5])
def test_a_few_flipped_faces_are_repaired_across_seams(seed, folder):
    V, F = rough_patch(seed)
    expected = disk_map(V, F, refine=0)
    assert expected.repair.n_flipped > 0
    result = parts_map(partition((V, F), folder, 8))
    assert result.repair == expected.repair
    np.testing.assert_allclose(result.uv, expected.uv, atol=1e-10)


@pytest.fixture
def disk():
    """Fills the disk: no file can be longer than so many bytes; frees it by -1."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(most):
        resource.setrlimit(resource.RLIMIT_FSIZE, (before[1] if most < 0 else most, before[1]))

    yield fill
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


# NumPy before 2.2 does not close an archive that it could not write.
@pytest.mark.filterwarnings(
    "ignore:Exception ignored in. <function ZipFile:pytest.PytestUnraisableExceptionWarning"
)
def test_after_a_full_disk_it_goes_on_in_each_phase(folder, disk):
    V, F = SURFACES["grid"]
    other = folder.with_name("other")
    disk(700)
    with pytest.raises(OSError, match="other"):
        partition((V, F), other, 2)
    disk(-1)
    parts = partition((V, F), folder, 2)
    for full in WRITING:
        with pytest.raises(OSError, match=r"map-.*np[yz]"):
            parts_map(parts, progress=lambda phase, done, full=full: phase == full and disk(700))
        disk(-1)
    np.testing.assert_array_equal(parts_map(parts).uv, parts_map(partition((V, F), other, 2)).uv)


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["check", "factor", "extension", "certificate"])
def test_a_killed_run_goes_on_with_the_same_bits(phase, folder, bits):
    parts = partition(SURFACES["scroll"], folder, 8)
    killed = start(
        "-c",
        "import os, cdcp_igl\n"
        "def kill(phase, done):\n"
        f"    if phase == {phase!r}: os.kill(os.getpid(), 9)\n"
        f"cdcp_igl.parts_map({str(parts)!r}, executor=2, progress=kill)",
    )
    assert killed.returncode == -signal.SIGKILL
    np.testing.assert_array_equal(parts_map(parts).uv, bits)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="who the workers are")
def test_killed_workers_are_replaced(folder, bits):
    victims = []

    def kill(phase, done):
        pids = children("self")
        if pids and phase in ("factor", "extension", "mobius"):
            victims.append(phase)
            if victims.count(phase) == 1:
                os.kill(pids[0], signal.SIGKILL)

    parts = partition(SURFACES["scroll"], folder, 8)
    np.testing.assert_array_equal(parts_map(parts, executor=2, progress=kill).uv, bits)
    assert {"factor", "extension"} <= {*victims}


@pytest.mark.slow
def test_sources(tmp_path):
    """Arrays, npy files, chunks, a ply file and others are the same surface."""
    V, F = SURFACES["cap"]
    expected = parts_map(partition((V, F), tmp_path / "arrays", 4)).uv
    np.save(tmp_path / "V.npy", V)
    np.save(tmp_path / "F.npy", F.astype(np.int32))
    chunks = tmp_path / "chunks"
    chunks.mkdir()
    for k, (v, f) in enumerate(zip(np.array_split(V, 3), np.array_split(F, 3), strict=True)):
        np.save(chunks / f"V{k}.npy", v)
        np.save(chunks / f"F{k}.npy", f)
    result = disk_map(V, F)
    for suffix in (".ply", ".obj"):
        write_map(tmp_path / f"cap{suffix}", V, F, result)
    sources = [
        (tmp_path / "V.npy", tmp_path / "F.npy"),
        chunks,
        tmp_path / "cap.ply",
        tmp_path / "cap.obj",
    ]
    for k, source in enumerate(sources):
        uv = parts_map(partition(source, tmp_path / f"parts {k}", 4)).uv
        np.testing.assert_array_equal(uv, expected)


def test_a_folder_is_never_replaced(tmp_path):
    source = SURFACES["cap"]
    (tmp_path / "mine").touch()
    with pytest.raises(FileExistsError, match="not empty"):
        partition(source, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]
    with pytest.raises(ValueError, match="power of 2"):
        partition(source, tmp_path / "parts", 3)
    with pytest.raises(FileNotFoundError, match="no V"):
        partition(tmp_path, tmp_path / "parts")
    with pytest.raises(MeshError):
        partition((source[0], source[1] + 1), tmp_path / "parts")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.slow
def test_the_result_is_one_like_others(folder, tmp_path):
    V, F = SURFACES["cap"]
    result = parts_map(partition((V, F), folder, 4))
    for p, part in enumerate(arrays_of(folder)):
        [file] = folder.glob(f"map-*/uv-{p}.npy")
        np.testing.assert_array_equal(np.load(file), result.uv[part["vertices"]])
    result.assemble(tmp_path / "uv.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "uv.npy"), result.uv)
    assert result.report()["vertices"] == len(V)
    assert result.report()["parts"] == 4
    assert re.search(r"469 vertices in 4 parts: valid", str(result))
    expected = {*disk_map(V, F, refine=0).report(flat=True)} - {"kept"}  # lengths, in no parts
    missing = expected.difference(result.report(flat=True))
    assert {name for name in missing if not name.startswith("seconds")} == set()
    for name in ("map.html", "map.png", "map.json"):
        result.save(tmp_path / name)
        assert Path(tmp_path, name).stat().st_size > 1000
    with pytest.raises(ValueError, match=r"written as \.npy"):
        result.save(tmp_path / "map.obj")


def nested(V, F, face, times=8):
    """The surface with triangles in one face, one in another, until they vanish in float32."""
    for _ in range(times):
        i, j, k = F[face]
        middle = V[[i, j, k]].mean(axis=0)
        a, b, c = len(V), len(V) + 1, len(V) + 2
        V = np.vstack([V, middle + (V[[i, j, k]] - middle) / 10])
        F[face] = a, b, c
        ring = [(i, j, b), (i, b, a), (j, k, c), (j, c, b), (k, i, a), (k, a, c)]
        F = np.vstack([F, ring])
    return V, F


def test_what_is_printed_needs_no_folder(folder):
    """Only the coordinates do."""
    V, F = nested(SURFACES["cap"][0], SURFACES["cap"][1].copy(), 100)
    options = {"center": 0, "mobius": None}
    made = parts_map(partition((V, F), folder, 2), **options)
    uv = parts_map(folder, **options).uv
    expected = replace(
        disk_map(V, F, refine=0, **options), _f=as_complex(uv)
    ).lost_in_single_precision()
    assert expected[0] > 0
    read = parts_map(folder, **options)
    shutil.rmtree(folder)
    for result in (made, read):
        assert result.lost_in_single_precision() == pytest.approx(expected)
        assert all(f"{expected[0]} faces" in text for text in (str(result), result._repr_html_()))
        assert result.report()["vertices"] == len(V)
        with pytest.raises(FileNotFoundError, match="lie in its folder"):
            np.asarray(result.uv)
        with pytest.raises(FileNotFoundError, match="lie in its folder"):
            result.assemble(folder.with_name("uv.npy"))


@pytest.mark.slow
def test_what_is_drawn_is_the_surface(folder):
    """By some of its vertices, which cover the disk."""
    V, F, _ = spherical_cap(70)
    image = parts_map(partition((V, F), folder, 2), align=[0, 1, 0]).bake(V, size=64)
    expected = disk_map(V, F, refine=0, align=[0, 1, 0]).bake(V, size=64)
    assert abs(image - expected).mean() < 0.03


@pytest.mark.slow
def test_a_fraction_of_the_memory(real_mesh, tmp_path):
    V, F = real_mesh("gcanyon_216196")
    np.save(tmp_path / "V.npy", V)
    np.save(tmp_path / "F.npy", F)
    partition((tmp_path / "V.npy", tmp_path / "F.npy"), tmp_path / "parts")
    calls = (
        "disk_map(np.load('V.npy'), np.load('F.npy'), refine=0).center.face",
        "parts_map('parts').center.face",
    )
    code = (
        "import numpy as np; from cdcp_igl import *; from cdcp_igl.solve.memory import peak_memory;"
        "disk_map(*datasets.spherical_cap(5)[:2]); start = peak_memory()"
    )
    one, parts = (
        start("-c", f"{code}; print({call}, peak_memory() - start)", cwd=tmp_path).stdout.split()
        for call in calls
    )
    assert one[0] == parts[0]
    assert float(parts[1]) < 0.4 * float(one[1])  # 0.34; the more vertices, the less


@pytest.mark.slow
def test_the_command_line(tmp_path):
    V, F = SURFACES["cap"]
    write_map(tmp_path / "cap.ply", V, F, disk_map(V, F))
    parts, out = tmp_path / "cap", tmp_path / "cap.npy"
    assert invoke("partition", tmp_path / "cap.ply", parts, "--parts", 4).exit_code == 0
    said = invoke("map", parts, out, "--mobius", "area", "--report", tmp_path / "cap.json")
    assert said.exit_code == 0
    assert "469 vertices in 4 parts: valid" in said.output
    np.testing.assert_array_equal(np.load(out), parts_map(parts, mobius="area").uv)
    assert (tmp_path / "cap.json").stat().st_size > 1000
    assert "--force" in invoke("map", parts, out).output
    refused = invoke("map", parts, tmp_path / "other.npy", "--clean", "--refine", 2)
    assert refused.exit_code == 2
    assert "clean, refine: no option of the parts map" in refused.output
    surface = tmp_path / "cap.ply", tmp_path / "cap.obj"
    assert invoke("map", *surface, "--jobs", 2).exit_code == 2
