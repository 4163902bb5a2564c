"""Methods that fail, for runs in processes of their own."""

import os
import signal
import time

import numpy as np

from cdcp_igl import cdcp, disk_map
from cdcp_igl.reference import Method, harmonic
from cdcp_igl.reference.case import Timed


def kills_itself(*asked):
    os.kill(os.getpid(), signal.SIGSEGV)


def raises_two_lines(V, F):
    raise RuntimeError("boom | pipe\nnewline")


def not_finite(V, F):
    uv = cdcp(V, F)
    uv[len(uv) // 2] = np.nan
    return uv


def flipped(V, F):
    return cdcp(V, F) * [1, -1]


def nothing(V, F):
    return None


def too_short(V, F):
    return cdcp(V, F)[1:]


def listed(V, F):
    return cdcp(V, F).tolist()


def complex_numbers(V, F):
    return cdcp(V, F) @ [1, 1j]


def flattens_the_surface(V, F):
    uv = harmonic(V, F)
    V[:], F[:] = np.pad(uv, ((0, 0), (0, 1))), F[::-1].copy()
    return uv


def hangs(*asked):
    time.sleep(600)


def hog(V, F):
    hoard = []
    while True:
        hoard.append(np.ones(1 << 20))
        time.sleep(0.002)


METHODS = {
    "kills itself": Method(kills_itself, "disk", ""),
    "raises two lines": Method(raises_two_lines, "disk", ""),
    "not finite": Method(not_finite, "disk", ""),
    "free, not finite": Method(not_finite, "free", ""),
    "flipped": Method(flipped, "disk", ""),
    "nothing": Method(nothing, "free", ""),
    "too short": Method(too_short, "free", ""),
    "list": Method(listed, "disk", ""),
    "complex": Method(complex_numbers, "disk", ""),
    "flattens the surface": Method(flattens_the_surface, "disk", ""),
    "hangs": Method(hangs, "disk", ""),
    "hog": Method(hog, "disk", ""),
    "phases": Method(disk_map, "disk", ""),
    "clock": Method(lambda V, F: Timed(42, {"half": 21}), "none", ""),
}
