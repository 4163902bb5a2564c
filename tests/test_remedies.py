"""Every row of the table of defects: a call is refused, its remedy done, and then it is not."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import meshes
import numpy as np
import pytest
import surfaces
from batches import batch
from commands import invoke
from test_seams import depth_image, edges_of, tube

import cdcp_igl
from cdcp_igl import annulus_map, clean, cut, disk_map, sphere_map, surface_map
from cdcp_igl.defects import DEFECTS, IN_SHELL
from cdcp_igl.io import read_texture, write_map
from cdcp_igl.surface.mesh import DiskMesh

V, F = meshes.grid()
# What the names in the remedies stand for, of a surface and the call that has refused it.
IN_PYTHON = {
    "clean": lambda given, call: call(clean(given)),
    "close": lambda given, call: call(clean(given, close=True)),
    "sew": lambda given, call: call(clean(given, fill=False)),
    "cut": lambda given, call: call(cut(given)),
    "surface_map": lambda given, _: surface_map(given),
    "disk_map": lambda given, _: disk_map(given),
    "sphere_map": lambda given, _: sphere_map(given),
    "annulus_map": lambda given, _: annulus_map(given),
    "batch": lambda given, _: batch(given, given.parent / "maps"),
}
BY_HAND = {"from_1", "with_path"}
ONTO = {sphere_map: ["--sphere"], annulus_map: ["--annulus"]}


class Case(NamedTuple):
    """What a call refuses, and what is given when the remedy has been followed by hand."""

    given: Any
    mended: Any = None
    call: Callable = disk_map
    names: tuple = ()  # in the remedy, if not all are for this case
    then: Callable | None = None  # what maps it when it is cleaned, if not the call
    shell: tuple = ("map",)  # the command; none if there is no such file, or readers see to it


def nasty(name, mended=None, **more):
    _, W, G, _ = meshes.NASTY[name]
    return Case((np.asarray(W), np.asarray(G)), mended, **more)


def without(surface, faces):
    """The surface without some faces, and without vertices that no face uses then."""
    used, rows = np.unique(np.delete(surface[1], faces, axis=0), return_inverse=True)
    return surface[0][used], rows.reshape(-1, 3)


def of_two(call):
    return lambda given: call(*given) if isinstance(given, tuple) else call(given)


def bowl():
    W, G = surfaces.sphere(12, 16)
    return without((W, G), W[G].mean(axis=1)[:, 2] > 0.3)


def unmeasured():
    P, unseen = depth_image()
    P[unseen] = 0
    faces = tube(14, 12)[1]
    return Case(
        (P.reshape(-1, 3), faces), clean((np.where(P == 0, np.nan, P).reshape(-1, 3), faces))
    )


def collapsed():
    """Two neighbours at one place, and the surface in which they are one."""
    W, G = V.copy(), F[~((F == 20).any(axis=1) & (F == 21).any(axis=1))]
    W[20] = W[21]
    return Case((W, F), without((W, np.where(G == 20, 21, G)), []))


def ring_with_ear():
    W, G, _ = meshes.ear_at_a_hole()
    mended = without((W, G), [np.flatnonzero((G == 19).any(axis=1))[0]])
    return Case((W, G), mended, annulus_map, then=disk_map)


def files(folder):
    """Files by name, and of each one that is as it should be."""
    good = folder / "good.obj"
    write_map(good, V, F, V[:, :2] / 8)
    text = {
        "scan.xyz": "0 0 0",
        "none.off": "\n",
        "pointer.obj": "version https://git-lfs.github.com/spec/v1\n",
        "short.off": "3 1 0\n",
        "few.obj": good.read_text() + "f 1 2\n",
    }
    for name, content in text.items():
        (folder / name).write_text(content)
    (folder / "scans").mkdir()
    (folder / "scans" / "a.obj").write_text(good.read_text())
    (folder / "bare.obj").write_text(re.sub("(?m)^vt.*\n|/[0-9]+", "", good.read_text()))
    return good


def parted(folder):
    good, bad = (cdcp_igl.partition((V, F), folder / name, parts=2) for name in ("good", "bad"))
    (folder / "bad" / "parts.json").write_text("{")
    return Case(bad, good, cdcp_igl.parts_map)


def cases_in(folder):
    """Cases of each row of the table."""
    good = files(folder)
    scan = SimpleNamespace(points=V, cells=[], celltypes=[10], extract_surface=lambda: (V, F))
    cells = [SimpleNamespace(type="triangle", data=F)]
    inside = DiskMesh(V, F).interior
    path = F[np.isin(F, inside).all(axis=1)][0, :2].tolist()
    flat = np.hstack([np.full((len(F), 1), 3), F]).ravel()
    band = meshes.NASTY["Moebius strip"][1:3]
    egg = surfaces.sphere(4, 6)
    ring = meshes.NASTY["annulus"][1:3]
    uv = np.asarray(V[:, :2])
    return {
        "not numeric": [Case((V.astype(str), F), (V, F), shell=())],
        "shape of V": [nasty("four columns", (V, F))],
        "shape of V, of a mesh": [
            Case(V[1:], 2 * V, lambda W: cdcp_igl.DiskMapper(V, F).moved(W).map(), shell=()),
        ],
        "shape of V, transposed": [Case((V.T, F.T), (V, F))],
        "shape of F": [Case((V, F[:, :2]), (V, F))],
        "shape of F, empty": [Case((V, F[:0]), (V, F))],
        "shape of F, flat": [
            Case((V, flat), SimpleNamespace(points=V, faces=flat), of_two(disk_map), shell=())
        ],
        "not numeric, cells": [
            Case((V, cells), SimpleNamespace(points=V, cells=cells), of_two(disk_map), shell=())
        ],
        "no surface": [Case(V, (V, F), shell=()), Case(None, good, shell=())],
        "no surface, but another": [Case(scan, scan.extract_surface(), shell=())],
        "V and F swapped": [Case((F, V), (V, F))],
        "non-finite coordinate": [nasty("NaN", (V, F))],
        "non-finite coordinate, of a map": [
            Case(uv * np.nan, uv, lambda f: cdcp_igl.angle_distortion(V, F, f), shell=())
        ],
        "points without data": [unmeasured()],
        "index out of range": [nasty(n, (V, F)) for n in ("index n", "negative index")],
        "index out of range, from 1": [Case((V, F + 1), (V, F), shell=())],
        "indices from 1": [
            Case((np.vstack([V[::-1], [9, 9, 9]]), len(V) - F), (V[::-1], len(V) - 1 - F))
        ],
        "fractional index": [nasty("fraction", (V, F))],
        "repeated corner": [
            Case((V, np.vstack([F, [[0, 0, 1]]])), (V, F)),
            nasty("repeated corner"),
        ],
        "unreferenced vertex": [nasty("unreferenced", (V, F))],
        "duplicate face": [nasty("a face twice", (V, F)), nasty("a face twice, reversed")],
        "degenerate face": [collapsed()],
        "non-manifold edge": [nasty("three pages")],
        "not orientable": [Case(band, cut(*band, path=[0, 9]))],
        "inconsistent orientation": [nasty("reversed face", (V, F))],
        "several components": [
            nasty("two components"),
            nasty("hanging tetrahedron"),
            nasty("bow tie"),
        ],
        "several components, coinciding": [nasty("split vertices")],
        "non-manifold vertex": [
            nasty("boundary vertices merged"),
            nasty("interior vertices merged"),
        ],
        "closed surface": [nasty("closed")],
        "closed surface, with handles": [Case(surfaces.torus())],
        "boundary": [
            Case(bowl(), None, sphere_map, ("close", "disk_map")),
            Case(ring, None, sphere_map, ("close", "annulus_map")),
        ],
        "several boundary loops": [nasty("annulus")],
        "one boundary loop": [Case(tube(), None, annulus_map)],
        "face on the inner circle": [ring_with_ear()],
        "edge across the inner circle": [
            Case(meshes.edge_across_a_hole()[:2], None, annulus_map, then=disk_map)
        ],
        "handle": [nasty("handle")],
        "nothing left": [
            Case((0 * V, F), (V, F), lambda given: disk_map(clean(given)), shell=("map", "--clean"))
        ],
        "not an edge": [
            Case([path[0], len(V) - 1], path, lambda steps: cut(V, F, path=steps), shell=())
        ],
        "not an edge, but a pair": [
            Case([[0, len(V) - 1]], [path], lambda edges: surface_map(V, F, seams=edges), shell=())
        ],
        "no way for a cut": [
            Case(
                edges_of(egg[1]),
                edges_of(egg[1])[:2],
                lambda edges: surface_map(*egg, forbidden=edges),
                shell=(),
            )
        ],
        "too few corners": [Case(folder / "few.obj", good)],
        "unreadable file": [Case(folder / "scan.xyz", good)],
        "unreadable file, a folder": [Case(folder / "scans", folder / "scans" / "a.obj")],
        "unreadable file, empty": [Case(folder / "none.off", good)],
        "unreadable file, a pointer": [Case(folder / "pointer.obj", good)],
        "unreadable file, damaged": [Case(folder / "short.off", good)],
        "unreadable file, without a map": [
            Case(
                folder / "bare.obj",
                good,
                lambda file: cdcp_igl.certify(*read_texture(file)),
                shell=("certify",),
            )
        ],
        "unreadable file, of parts": [parted(folder)],
    }


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return cases_in(tmp_path_factory.mktemp("remedies"))


def written(folder, given):
    if isinstance(given, Path):
        return given
    np.savez(folder / "surface.npz", V=given[0], F=given[1])
    return folder / "surface.npz"


@pytest.mark.parametrize("row", DEFECTS)
def test_the_remedy_leads_out(row, table):
    said, name = DEFECTS[row], row.partition(", ")[0]
    named = set(re.findall(r"\{(\w+)\}", said.call))
    assert {call for case in table[row] for call in case.names or named} == named
    for case in table[row]:
        calls = set(case.names or named) - BY_HAND
        assert calls or case.mended is not None
        with pytest.raises(cdcp_igl.MeshError) as raised:
            case.call(case.given)
        assert (raised.value.defect, raised.value.remedy) == (name, said.remedy)
        made = [IN_PYTHON[call](case.given, case.then or case.call) for call in calls]
        made += [] if case.mended is None else [case.call(case.mended)]
        for result in made:
            assert getattr(result, "valid", True)
            assert not getattr(result, "failed", ())


@pytest.mark.parametrize(("call", "loops"), [(sphere_map, 1), (annulus_map, 1), (annulus_map, 2)])
def test_a_handle_is_named_before_the_loops(call, loops):
    """To close or to sew would not do."""
    V, F = surfaces.torus()
    with pytest.raises(cdcp_igl.MeshError) as raised:
        call(V, np.delete(F, [0, 100][:loops], axis=0))
    assert raised.value.defect == "handle"


@pytest.mark.parametrize("row", DEFECTS)
def test_in_the_shell_the_remedy_leads_out(row, table, tmp_path):
    said = DEFECTS[row]
    for case in table[row]:
        if not case.shell:
            continue
        command, *options = case.shell
        options += ONTO.get(case.call, [])
        source = written(tmp_path, case.given)
        out = [tmp_path / ("out.npy" if row.endswith("parts") else "out.npz"), "--force"]
        out = out if command == "map" else []
        refused = invoke(command, *options, source, *out)
        assert refused.exit_code == 2
        assert said.remedy_in_shell in " ".join(refused.output.split())
        named = set(case.names or re.findall(r"\{(\w+)\}", said.call))
        for call in named - BY_HAND:
            words = IN_SHELL[call].split()[1:]
            where = tmp_path / ("maps" if call == "batch" else "out.npz")
            assert invoke(*words, source, where, "--force").exit_code == 0
        if case.mended is not None:
            source = written(tmp_path, case.mended)
            assert invoke(command, *options, source, *out).exit_code == 0
