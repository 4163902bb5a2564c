"""The command `python -m benchmarks surfaces`, and the bound that it shows."""

import meshes
import numpy as np
import pytest
import surfaces
from benchmark_commands import benchmarks, refused

import cdcp_igl
from benchmarks.measure.any_surface import least_distortion


def test_a_row_for_each_surface_by_class(tmp_path):
    _, V, F, _ = meshes.NASTY["Moebius strip"]
    mesh = {
        "handles_torus": surfaces.torus(),
        "loops_tube": surfaces.tube(n=8),
        "loops_strip": (V, F),
    }
    for name, (V, F) in mesh.items():
        np.savez(tmp_path / f"{name}.npz", V=V, F=F)
    shown = benchmarks("surfaces", tmp_path)
    assert shown.exit_code == 0
    assert shown.stdout.index("## handles") < shown.stdout.index("## loops")
    assert "| loops_strip | 18 | refused: The surface is one-sided" in shown.stdout
    assert "| handles_torus | 96 | 1 | yes | " in shown.stdout


def test_surfaces_that_are_missing_are_told_with_what_to_do(tmp_path, monkeypatch):
    for command in ("surfaces", "punctures"):
        assert "'/nope' does not exist" in refused(command, "/nope")
    for command in ("surfaces", "punctures"):
        assert "give another folder" in refused(command, tmp_path)
    monkeypatch.delenv("CDCP_IGL_DATA", raising=False)
    assert "set CDCP_IGL_DATA to a folder" in refused("surfaces")
    monkeypatch.setenv("CDCP_IGL_DATA", "/nope")
    for command in (["surfaces"], ["tables"], ["tables", "--models", "nefertiti_299"]):
        assert "'/nope' is no folder: set it" in refused(*command)


@pytest.mark.parametrize(
    "mesh", [surfaces.torus(), surfaces.sphere(), surfaces.tube(), meshes.fan()]
)
def test_no_map_is_below_the_bound(mesh):
    for refine in (0, 5):
        result = cdcp_igl.surface_map(*mesh, refine=refine)
        assert 0 < least_distortion(result) <= result.distortion.mean


def test_the_bound_of_a_fan_is_its_angle_defect():
    V, F = meshes.fan()
    result = cdcp_igl.surface_map(V, F)
    angles = cdcp_igl.libigl.angles(V, F)
    around = angles[:, 0].sum()
    rim = np.bincount(F[:, 1:].ravel(), angles[:, 1:].ravel())
    expected = abs(2 * np.pi - around) + np.maximum(rim - np.pi, 0).sum()
    assert least_distortion(result) == pytest.approx(np.degrees(expected) / F.size)
