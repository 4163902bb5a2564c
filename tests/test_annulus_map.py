"""Maps onto rings: moduli that are known, what is filled, and what is refused."""

import numpy as np
import pytest
from commands import invoke
from surfaces import ring, sphere, torus

import cdcp_igl
from cdcp_igl.annulus import certify_ring
from cdcp_igl.surface.mesh import AnnulusMesh


@pytest.mark.parametrize(
    ("profile", "modulus"),
    [
        (lambda s: (0.3**s, 0 * s), np.log(1 / 0.3) / (2 * np.pi)),
        (lambda s: (np.cos(s - 0.2), np.sin(s - 0.2)), None),
        (lambda s: (1 + 0 * s, 2 * s), 1 / np.pi),
        # Half of a torus of revolution: the integral of ds / r, over 2 pi.
        (lambda s: (2 + np.cos(np.pi * s), np.sin(np.pi * s)), 1 / (2 * np.sqrt(3))),
    ],
    ids=["plane", "sphere", "cylinder", "torus"],
)
def test_moduli_converge_at_second_order_within_their_bounds(profile, modulus):
    if modulus is None:  # of a zone of the sphere, by its isometric latitudes
        modulus = np.diff(np.arctanh(np.sin([-0.2, 0.8])))[0] / (2 * np.pi)
    errors, ratios = [], []
    for k in (1, 2, 4):
        V, F, t = ring(8 * k, 20 * k, profile)
        result = cdcp_igl.annulus_map(V, F)
        assert result.conformal
        low, high = result.modulus_bounds
        assert low * (1 - 1e-12) < result.modulus < high * (1 + 1e-12)
        errors.append(abs(result.modulus - modulus))
        z = result.uv[:, 0] + 1j * result.uv[:, 1]
        turned = z * np.exp(-1j * t) if result.mesh.loops[0][0] < len(V) / 2 else z * np.exp(1j * t)
        ratios.append(np.ptp(np.angle(turned / turned[0])))
    assert errors[0] / max(errors[2], 1e-12) > 3.2**2 or errors[0] < 1e-9
    assert ratios[2] < 0.01


def test_long_tubes_have_no_radius_to_speak_of_and_are_still_one_to_one():
    V, F, _ = ring(200, 12, lambda s: (1 + 0 * s, 100 * s))
    result = cdcp_igl.annulus_map(V, F)
    assert result.valid
    assert result.radius < 1e-40


def test_other_loops_are_filled():
    V, F = sphere(12, 20)
    holes = [0, 105, 119, 200]
    open_faces = F[~np.isin(F, holes).any(axis=1)]
    used, faces = np.unique(open_faces, return_inverse=True)
    result = cdcp_igl.annulus_map(V[used], faces.reshape(-1, 3))
    assert result.valid
    assert result.filled == 2
    assert result.uv.shape == (len(used), 2)
    assert len(result._surface()[1]) == len(open_faces)


@pytest.mark.parametrize("name", ["loops_animal_19937", "loops_beetle_19887", "loops_plane_8519"])
def test_real_surfaces(real_mesh, name):
    assert cdcp_igl.annulus_map(*real_mesh(f"any/{name}")).valid


def test_a_certificate_sees_what_is_wrong():
    V, F, _ = ring(4, 12, lambda s: (0.5**s, 0 * s))
    mesh, f = AnnulusMesh(V, F), V[:, 0] + 1j * V[:, 1]
    assert certify_ring(mesh, f, 0.5).valid
    assert not certify_ring(mesh, f, 0.4).valid
    assert not certify_ring(mesh, f.conj(), 0.5).valid
    assert not certify_ring(mesh, f * np.nan, 0.5).valid
    swapped = f.copy()
    swapped[[0, 1]] = f[[1, 0]]
    assert not certify_ring(mesh, swapped, 0.5).valid


def test_on_the_command_line_and_what_is_refused(tmp_path):
    V, F, _ = ring(4, 12, lambda s: (0.5**s, 0 * s))
    source = tmp_path / "ring.obj"
    cdcp_igl.io.write_map(source, V, F, V[:, :2])
    assert "cdcp-igl map --annulus" in invoke("check", source).stdout
    done = invoke("map", "--annulus", source, tmp_path / "ring.glb")
    assert "annulus map of 60 vertices: valid" in done.stdout
    for wrong in ("--clean", "--sphere"):
        assert invoke("map", "--annulus", wrong, source, tmp_path / "x.obj").exit_code == 2
    result = cdcp_igl.annulus_map(V, F)
    assert result.report()["modulus"] == result.modulus
    with pytest.raises(cdcp_igl.MeshError, match="an annulus has two"):
        cdcp_igl.annulus_map(*cdcp_igl.datasets.square(2)[:2])
    with pytest.raises(cdcp_igl.MeshError, match="sphere_map maps it"):
        cdcp_igl.annulus_map(*sphere())
    with pytest.raises(cdcp_igl.MeshError, match="surface_map"):
        cdcp_igl.annulus_map(*torus())
