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
    "folded": replace(DISK, uv=np.where(np.arange(len(V))[:, None] == INSIDE, 0.5, DISK.uv)),
    **{"nan": np.nan, "inf": np.inf, "np": np},
}

# By what they say, options of `disk_map` and of a mapper.
OPTIONS = {
    "refine must": ("refine=-1", "refine=1.5", "refine='2'"),
    "refine_norm": ("refine_norm=0.9", "refine_norm=2.1", "refine_norm=nan", "refine_norm=True"),
    "refine_seconds": ("refine_seconds=-1", "refine_seconds=nan"),
    "center": ("center=-1", "center=160", "center=3.5", "center=True", "center=None"),
    "center must": ("center='middle'",),
    "align": ("align=12", "align=-1", "align=10**6", "align=[1, 0]", "align='x'"),
    "align must": ("align=[1j, 0, 0]",),
    "mobius": ("mobius='best'",),
    "preset": ("preset='thesis'", "preset='paper', center='centroid'"),
}
# Then all others.
CALLS = {
    "no slope": ("disk_map(V[:, :2], F, align=[0, 0, 1])",),
    "solver must be one of": ("disk_map(None, None, solver=['scipy'])",),
    "not 'umfpack'": ("disk_map(None, None, solver='umfpack')",),
    "not ''": ("DiskMapper(V, F, solver='')",),
    "rows": (
        "DiskMapper(V, F).moved(V[:-1])",
        "disk.interpolate(V[1:], [0, 0])",
        "disk.bake(V[1:])",
    ),
    r"shape \(\d+, 1\)": ("DiskMapper(V, F).moved(V[:, :1])",),
    "face": tuple(f"disk.apply({face}, [1, 0, 0])" for face in ("len(F)", -1, 0.5)),
    "barycentric": ("disk.apply(0, [1, 1, 0])", "disk.apply(0, [1, 0])"),
    "uv": (
        *(f"disk.invert({uv})" for uv in ("[nan, 0]", "[1, 2, 3]", "4")),
        *("sphere.invert([0, 0, 0])", "sphere.invert([1, 0])"),
        *(f"angle_distortion(V, F, disk.uv{part})" for part in ("[:-1]", "[:, [0, 1, 0]]", "[0]")),
    ),
    "must be real": (
        *("disk.pull_back(V * 1j)", "disk.interpolate(V * 1j, [0, 0])", "disk.bake(V * 1j)"),
    ),
    "height": ("disk.pull_back([1, 2])",),
    "side": tuple(f"disk.remesh({side})" for side in (0, -1, 2, "nan")),
    "bijection": ("folded.invert([0, 0])",),
    "size must be at least 1": ("disk.bake(V, size=0)",),
    "landmarks": (
        *(f"disk.register(disk, {bad})" for bad in ("[[0, 0]]", "[[0, 1, 2]] * 2")),
        *(f"disk.register(disk, {bad})" for bad in ("[[0.5, 1]] * 2", "[[1, 2], [1, 3]]")),
        "disk.register(disk, [[0, len(V)], [1, 1]])",
        *(f"sphere.register(sphere, {bad})" for bad in ("[[0, 0]]", "[[0, 1, 2]] * 2")),
        "sphere.register(sphere, [[0, len(egg[0])], [1, 1]])",
    ),
    "field 'f'": tuple(
        f"disk.view_html(fields={{'f': {field}}})" for field in ("V", "V[1:, 0]", "nan * V[:, 0]")
    ),
    "map 'LSCM' has shape": (
        *("disk.view_html(beside={'LSCM': V})", "disk.view_html(beside={'LSCM': disk.uv[1:]})"),
    ),
    "texture": tuple(
        f"disk.view_html(texture=np.full({values}))"
        for values in ("(4, 4), 0", "(4, 4, 3), 2", "(4, 4, 3), nan")
    ),
    "genus 1": ("sphere_map(*torus)",),
    "disk_map maps a surface with one": ("sphere_map(egg[0], egg[1][1:])",),
    "sphere_map maps it": ("disk_map(*egg)", "annulus_map(*egg)"),
    "surface_map": ("annulus_map(*torus)",),
    "an annulus has two": ("annulus_map(V, F)",),
    "mobius must be": ("sphere_map(*egg, mobius='angle')",),
    "align must give": (
        *(
            f"sphere_map(*egg, align={{{a}}})"
            for a in ("999: [1, 0, 0]", "0: [0, 0, 0]", "0: [1, 2]")
        ),
        *("sphere_map(*egg, align={})", "sphere_map(*egg, align=3)"),
    ),
    "unit sphere": ("angle_distortion(*egg, egg[0] + 3)",),
    **{
        name: tuple(f"surface_map(*torus, {name}={value!r})" for value in values)
        for name, values in {
            **{"solver": ["pardiso"], "mobius": ["length"], "refine": [0.5], "center": [3]},
            **{"align": [3], "outline": ["round"], "max_charts": [0], "spread": [-1, np.nan]},
        }.items()
    },
    "for disks": ("surface_map(*torus, outline='free', mobius='area')",),
    "path must be": tuple(
        f"cut(*torus, path={path})"
        for path in ("[0.5, 1.5]", "[[0, 1, 2]]", "[[0, 1], [1]]", "3", "'loop'")
    ),
    "polygon_of_face must say": tuple(
        f"{function}(*egg, polygon_of_face={whole})"
        for function in ("cut", "surface_map")
        for whole in ("[0, 1]", "[[0], [0]]", "'quads'", "[0.0] * len(egg[1])", "3")
    ),
    "corners must": tuple(
        f"rectangle_map(V, F, {corners})" for corners in ("3", "[0, 1, 2]", "[0.0, 1, 2, 3]")
    ),
    "must be boundary vertices": tuple(
        f"rectangle_map(V, F, [*loop[:3], {vertex}])" for vertex in ("inside", "len(V)", "-1")
    ),
    "order of the boundary": tuple(
        f"rectangle_map(V, F, loop[{rows}])"
        for rows in ("[9, 5, 3, 1]", "[1, 3, 9, 5]", "[0, 0, 1, 2]")
    ),
    r"must be \(81,\)": ("free_map(*square, boundary_scale=[1, 2])",),
    "positive and finite": ("free_map(*square, boundary_scale=0 * square[0][:, 0])",),
    "boundary vertices, not 40": ("free_map(*square, corners={40: 6.28})",),
    "boundary vertices": ("free_map(*square, corners={})",),
    "radians .* add up to 360": ("free_map(*square, corners={0: 90, 1: 270})",),
    "only one": (
        "free_map(*square, corners=dict.fromkeys(rim, 1.57), boundary_scale=square[0][:, 0] + 2)",
    ),
    "refine moves the boundary": (
        "free_map(*square, corners={v: np.pi / 2 for v in rim}, refine=3)",
    ),
    "number of steps": ("free_map(V, F, refine=-1)",),
    "not a boundary vertex": ("free_map(V, F, align=inside)",),
    "aspect must be": tuple(f"datasets.ellipse(4, {a})" for a in (-1, 0.5, 1, 8.1, "nan")),
    "angle must be": tuple(f"datasets.spherical_cap(4, {angle})" for angle in (0, 180, 200)),
    "steepness must be": tuple(f"datasets.paraboloid(4, {s})" for s in (0, "inf")),
    "resolution must be at least 1": tuple(
        f"datasets.{name}({n})"
        for name in ("ellipse", "spherical_cap", "paraboloid")
        for n in (0, -1)
    ),
    "mirror_factor": tuple(f"reference.fdcp(V, F, mirror_factor={x})" for x in (-0.1, 1.1, "nan")),
    "pinned": ("reference.ldcp(V, F, pinned=2)",),
    "parts": ("reference.pgcp(V, F, parts=1)",),
}
REFUSED = [
    *((call, says) for says, calls in CALLS.items() for call in calls),
    *(
        (f"{mapped}{option})", says)
        for says, options in OPTIONS.items()
        for option in options
        for mapped in ("disk_map(V, F, ", "DiskMapper(V, F).map(")
    ),
]


@pytest.mark.parametrize(("call", "says"), REFUSED, ids=[call for call, _ in REFUSED])
def test_bad_arguments(call, says):
    with pytest.raises(ValueError, match=says):
        eval(call, KNOWN)
