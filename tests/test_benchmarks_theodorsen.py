"""Theodorsen's method, with which the benchmarks compare the geodesic algorithm."""

import numpy as np
import pytest
from test_circle import CURVES, circle, error_up_to_rotation

from benchmarks.theodorsen import theodorsen_map
from cdcp_igl.steps.circle.geodesic import geodesic_map
from cdcp_igl.steps.circle.whiten import whiten_trace


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_it_converges_on_known_curves(curve):
    errors = [
        error_up_to_rotation(theodorsen_map(curve(circle(n).conj())), circle(n)) for n in (100, 400)
    ]
    assert errors[0] < 5e-3
    assert errors[0] / errors[1] > 4 or errors[1] < 1e-10


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES.keys())
def test_the_geodesic_algorithm_agrees_on_polygons(curve):
    z = whiten_trace(curve(circle(300).conj() * np.exp(0.2j * np.sin(3 * np.arange(300)) / 20)))
    assert error_up_to_rotation(geodesic_map(z), theodorsen_map(z)) < 5e-3


def test_it_refuses_what_is_not_star_shaped():
    t = 2 * np.pi * np.arange(400) / 400
    spiral = np.exp(-1j * (t + 2.5 * np.sin(t) ** 2)) * (1.2 + np.cos(t))
    assert theodorsen_map(spiral) is None
