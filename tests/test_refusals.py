"""What every function refuses: one table of calls with a bad argument, and what they say."""

from dataclasses import replace

import numpy as np
import pytest
import surfaces
from meshes import grid

import cdcp_igl
from cdcp_igl.surface.mesh import DiskMesh

V, F = grid(9, 11)
DISK = cdcp_igl.disk_map(V, F)
SQUARE = cdcp_igl.datasets.square(4)[:2]
LOOP, INSIDE = DISK.mesh.loop, DISK.mesh.interior[0]
EGG = cdcp_igl.datasets.spheroid(2)[:2]
KNOWN = {
    **{name: getattr(cdcp_igl, name) for name in (*cdcp_igl.__all__, "datasets", "reference")},
    **{"V": V, "F": F, "disk": DISK, "loop": LOOP, "inside": INSIDE},
    **{"egg": EGG, "sphere": cdcp_igl.sphere_map(*EGG), "torus": surfaces.torus()},
    **{"square": SQUARE, "rim": DiskMesh(*SQUARE).loop[::8].tolist()},
    "folded": replace(DISK, certificate=replace(DISK.certificate, flipped=np.array([0]))),
    "atlas": cdcp_igl.surface_map(*surfaces.soup(*SQUARE), merge=False),
    **{"nan": np.nan, "inf": np.inf, "np": np},
}

# Options of `disk_map` and of a mapper, by what they say.
OPTIONS = {
    "refine must": "refine=-1; refine=1.5; refine='2'",
    "refine_norm": "refine_norm=0.9; refine_norm=2.1; refine_norm=nan; refine_norm=True",
    "refine_seconds": "refine_seconds=-1; refine_seconds=nan",
    "center": "center=-1; center=160; center=3.5; center=True; center=None; center='middle'",
    "align": "align=12; align=-1; align=10**6; align=[1, 0]; align='x'; align=[1j, 0, 0]",
    "mobius": "mobius='best'",
    "preset": "preset='thesis'; preset='paper', center='centroid'",
}
# Calls of all others.
CALLS = {
    "no slope": "disk_map(V[:, :2], F, align=[0, 0, 1])",
    "solver must be": "disk_map(None, None, solver=['scipy'])",
    "not 'umfpack'": "disk_map(None, None, solver='umfpack')",
    "not ''": "DiskMapper(V, F, solver='')",
    "rows": "DiskMapper(V, F).moved(V[:-1]); disk.interpolate(V[1:], [0, 0]); disk.bake(V[1:])",
    r"shape \(\d+, 1\)": "DiskMapper(V, F).moved(V[:, :1])",
    "face": "disk.apply(len(F), [1, 0, 0]); disk.apply(-1, [1, 0, 0]); disk.apply(0.5, [1, 0, 0])",
    "barycentric": "disk.apply(0, [1, 1, 0]); disk.apply(0, [1, 0])",
    "uv": (
        "disk.invert([nan, 0]); disk.invert([1, 2, 3]); disk.invert(4); "
        "sphere.invert([0, 0, 0]); sphere.invert([1, 0]); angle_distortion(V, F, disk.uv[:-1]); "
        "angle_distortion(V, F, disk.uv[:, [0, 1, 0]]); angle_distortion(V, F, disk.uv[0])"
    ),
    "must be real": "disk.pull_back(V * 1j); disk.interpolate(V * 1j, [0, 0]); disk.bake(V * 1j)",
    "height": "disk.pull_back([1, 2])",
    "side": "disk.remesh(0); disk.remesh(-1); disk.remesh(2); disk.remesh(nan)",
    "bijection": "folded.invert([0, 0])",
    "size must be at least 1": "disk.bake(V, size=0)",
    "a row for each": "disk.bake(lambda P: 1.0); disk.bake(lambda P: P[1:])",
    "uv has shape": "disk.bake(np.ones((4, 4, 3)), uv=V[1:, :2])",
    "not for a function": "disk.bake(lambda P: P, uv=V[:, :2])",
    "the image has shape": "disk.bake(V, uv=V[:, :2])",
    "no file says": "disk.bake('a.png')",
    "landmarks": (
        "disk.register(disk, [[0, 0]]); disk.register(disk, [[0, 1, 2]] * 2); "
        "disk.register(disk, [[0.5, 1]] * 2); disk.register(disk, [[1, 2], [1, 3]]); "
        "disk.register(disk, [[0, len(V)], [1, 1]]); sphere.register(sphere, [[0, 0]]); "
        "sphere.register(sphere, [[0, 1, 2]] * 2); "
        "sphere.register(sphere, [[0, len(egg[0])], [1, 1]])"
    ),
    "field 'f'": (
        "disk.view_html(fields={'f': V}); disk.view_html(fields={'f': V[1:, 0]}); "
        "disk.view_html(fields={'f': nan * V[:, 0]})"
    ),
    "map 'LSCM' has shape": (
        "disk.view_html(beside={'LSCM': V[:, :1]}); disk.view_html(beside={'LSCM': disk.uv[1:]})"
    ),
    "another name": (
        "disk.view_html(beside={'Disk': disk.uv}); disk.view_html(beside={'Surface': V})"
    ),
    "texture": (
        "disk.view_html(texture=np.full((4, 4), 0)); "
        "disk.view_html(texture=np.full((4, 4, 3), 2)); "
        "disk.view_html(texture=np.full((4, 4, 3), nan))"
    ),
    "genus 1": "sphere_map(*torus)",
    "disk_map maps a surface with one": "sphere_map(V, F)",
    "sphere_map maps it": "disk_map(*egg); annulus_map(*egg)",
    "surface_map": "annulus_map(*torus)",
    "an annulus has two": "annulus_map(V, F)",
    "mobius must be": "sphere_map(*egg, mobius='angle')",
    "align must give": (
        "sphere_map(*egg, align={999: [1, 0, 0]}); sphere_map(*egg, align={0: [0, 0, 0]}); "
        "sphere_map(*egg, align={0: [1, 2]}); sphere_map(*egg, align={})"
    ),
    "unit sphere": "angle_distortion(*egg, egg[0] + 3)",
    "solver": "surface_map(*torus, solver='pardiso')",
    "mobius": "surface_map(*torus, mobius='length')",
    "refine": "surface_map(*torus, refine=0.5)",
    "center": "surface_map(*torus, center=3)",
    "align": "surface_map(*torus, align=3)",
    "outline": "surface_map(*torus, outline='round')",
    "max_charts": "surface_map(*torus, max_charts=0); surface_map(*torus, max_charts=1.5)",
    "must be True or False": (
        "surface_map(*torus, merge='x'); surface_map(*torus, rotate=1); atlas.packed(rotate='x')"
    ),
    "size must be": "surface_map(*torus, size=0); atlas.packed(0.5); atlas.packed(size='large')",
    "padding must be": (
        "surface_map(*torus, padding=-1); atlas.packed(padding=nan); atlas.packed(8, 4); "
        "atlas.packed(padding='wide')"
    ),
    "density must be": (
        "surface_map(*torus, density=0); atlas.packed(density=nan); atlas.packed(density=1e9); "
        "atlas.packed(density='high')"
    ),
    "with a padding of": "atlas.packed(size=40, padding=15)",
    "must be True or False or None": "surface_map(*torus, fill=0.1)",
    "progress must be": (
        "disk_map(V, F, progress=[]); surface_map(*torus, progress=[]); "
        "batch('none', 'none', progress=[]); partition((V, F), 'none', progress=[])"
    ),
    "scale_variation": (
        "surface_map(*torus, scale_variation=-1); surface_map(*torus, scale_variation=nan); "
        "surface_map(*torus, scale_variation=2**70)"
    ),
    "for disks": "surface_map(*torus, outline='free', mobius='area')",
    "path must be": (
        "cut(*torus, path=[0.5, 1.5]); cut(*torus, path=[[0, 1, 2]]); "
        "cut(*torus, path=[[0, 1], [1]]); cut(*torus, path=3); cut(*torus, path='loop')"
    ),
    "polygon_of_face must say": (
        "cut(*egg, polygon_of_face=[0, 1]); cut(*egg, polygon_of_face=[[0], [0]]); "
        "cut(*egg, polygon_of_face=[0.0] * len(egg[1])); "
        "cut(*egg, polygon_of_face=3); surface_map(*egg, polygon_of_face=[0, 1]); "
        "surface_map(*egg, polygon_of_face=[[0], [0]]); "
        "surface_map(*egg, polygon_of_face=[0.0] * len(egg[1])); "
        "surface_map(*egg, polygon_of_face=3)"
    ),
    "corners must": (
        "rectangle_map(V, F, 3); rectangle_map(V, F, [0, 1, 2]); "
        "rectangle_map(V, F, [0.0, 1, 2, 3])"
    ),
    "must be boundary vertices": (
        "rectangle_map(V, F, [*loop[:3], inside]); rectangle_map(V, F, [*loop[:3], len(V)]); "
        "rectangle_map(V, F, [*loop[:3], -1])"
    ),
    "order of the boundary": (
        "rectangle_map(V, F, loop[[9, 5, 3, 1]]); rectangle_map(V, F, loop[[1, 3, 9, 5]]); "
        "rectangle_map(V, F, loop[[0, 0, 1, 2]])"
    ),
    r"must be \(81,\)": "free_map(*square, boundary_scale=[1, 2])",
    "positive and finite": "free_map(*square, boundary_scale=0 * square[0][:, 0])",
    "boundary vertices, not 40": (
        "free_map(*square, corners=dict.fromkeys([40, *rim[1:]], np.pi / 2))"
    ),
    "boundary vertices": "free_map(*square, corners={})",
    "radians .* add up to 360": "free_map(*square, corners={0: 90, 1: 270})",
    "only one": (
        "free_map(*square, corners=dict.fromkeys(rim, 1.57), boundary_scale=square[0][:, 0] + 2)"
    ),
    "refine moves the boundary": "free_map(*square, corners={v: np.pi / 2 for v in rim}, refine=3)",
    "number of steps": "free_map(V, F, refine=-1)",
    "not a boundary vertex": "free_map(V, F, align=inside)",
    "aspect must be": (
        "datasets.ellipse(4, -1); datasets.ellipse(4, 0.5); datasets.ellipse(4, 1); "
        "datasets.ellipse(4, 8.1); datasets.ellipse(4, nan)"
    ),
    "angle must be": (
        "datasets.spherical_cap(4, 0); datasets.spherical_cap(4, 180); "
        "datasets.spherical_cap(4, 200)"
    ),
    "steepness must be": "datasets.paraboloid(4, 0); datasets.paraboloid(4, inf)",
    "resolution must be at least 1": (
        "datasets.ellipse(0); datasets.ellipse(-1); datasets.spherical_cap(0); "
        "datasets.spherical_cap(-1); datasets.paraboloid(0); datasets.paraboloid(-1)"
    ),
    "mirror_factor": (
        "reference.fdcp(V, F, mirror_factor=-0.1); reference.fdcp(V, F, mirror_factor=1.1); "
        "reference.fdcp(V, F, mirror_factor=nan)"
    ),
    "pinned": "reference.ldcp(V, F, pinned=2)",
    "parts": "reference.pgcp(V, F, parts=1)",
}
MAPS = "disk_map(V, F, ", "DiskMapper(V, F).map("
REFUSED = {
    **{call: says for says, calls in CALLS.items() for call in calls.split("; ")},
    **{
        f"{mapped}{option})": says
        for says, options in OPTIONS.items()
        for option in options.split("; ")
        for mapped in MAPS
    },
}


@pytest.mark.parametrize("call", REFUSED)
def test_bad_arguments(call):
    with pytest.raises(ValueError, match=REFUSED[call]):
        eval(call, KNOWN)


@pytest.mark.parametrize("wrong", [10**400, object(), b"x", {"a": object()}, [[0, 1], [1]]])
@pytest.mark.parametrize("name", ["path", "fields", "beside", "texture", "keep", "title"])
def test_what_a_page_cannot_take(name, wrong, tmp_path):
    with pytest.raises(ValueError, match=f"^{name} must be|^keep"):
        DISK.view(**{"path": tmp_path / "page.html", name: wrong})
