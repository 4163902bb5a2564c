"""
The four steps of the algorithm
===============================

Trace, zipper, harmonic interior, Möbius transformation: each with its own function, in the
order of Algorithm 1. See :doc:`/theory/algorithm` for the equations.
"""

# sphinx_gallery_thumbnail_number = 2
import matplotlib.pyplot as plt
import numpy as np

import cdcp_igl
from cdcp_igl.solve.factored import FactoredSurface, harmonic_extension
from cdcp_igl.steps.center import central_face
from cdcp_igl.steps.circle import whiten_trace
from cdcp_igl.steps.mobius import normalize
from cdcp_igl.steps.trace import conjugate_trace
from cdcp_igl.steps.zipper import geodesic_map
from cdcp_igl.surface.mesh import DiskMesh

V, F, _ = cdcp_igl.datasets.ellipse(24, aspect=1.7)
x, y, _ = V.T
V[:, 2] = 0.9 * np.exp(-6 * ((x - 0.7) ** 2 + y**2)) + 0.5 * np.exp(-9 * ((x + 0.6) ** 2 + y**2))
V[:, 0] *= 1 + 0.35 * y  # no symmetry
height = V[:, 2]

mesh = DiskMesh(V, F)
surface = FactoredSurface.of(mesh)

# %%
# **Step 1.** A dipole on the central face gives the boundary trace: by the conjugate of eq. (18),
# from what flows out through the boundary. The surface is the *outside* of this curve, the
# central face at infinity. Whitening makes it rounder.

tau_c = central_face(surface)
h_B = conjugate_trace(surface, tau_c.face)
white = whiten_trace(h_B)

figure, panels = plt.subplots(1, 3, layout="constrained", figsize=(9, 3))
panels[0].tripcolor(x, y, F, height, shading="gouraud")
panels[0].plot(*V[F[tau_c.face], :2].mean(axis=0), "k*", markersize=9)
panels[0].set_title("surface from above, centre")
for axes, curve, title in zip(panels[1:], (h_B, white), ("trace", "whitened"), strict=True):
    axes.plot(curve.real, curve.imag, color="#00366c", linewidth=1.5)
    axes.set_title(title)
for axes in panels:
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()

# %%
# **Step 2.** The zipper. The first edge opens onto the imaginary axis, and the outside of the
# curve becomes the right half-plane, eq. (1). Then, point after point, the geodesic arc
# from 0 to the next point opens as well, eqs. (2)-(5). The frames show the half-plane as a disk:
# the points that have been zipped lie on its circle, the line is the rest of the curve, and
# the star is infinity, where the central face is. Closing the zipper, eq. (6), makes the
# last frame.


def zip_next(q, tip):
    """Open the arc from 0 to q[tip]: all points, in plain complex arithmetic."""
    c = q[tip]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(
            np.isinf(q), -1j * c.real / c.imag, c.real * q / (abs(c) ** 2 + 1j * c.imag * q)
        )
        t[tip] = 1
        w = np.sqrt(t * t - 1)
    w = np.where((w.real < 0) | ((abs(w.real) < 1e-9) & (w.imag * t.imag < 0)), -w, w)
    w[tip - 1 :: -1] = 1j * abs(w[tip - 1 :: -1].imag) * np.sign(t[tip - 1 :: -1].imag)
    w[tip - 1], w[tip] = 1j, 0
    return w


# The longest edge first. The last entry is the point at infinity.
curve = np.roll(white, -int(abs(np.roll(white, -1) - white).argmax()))
with np.errstate(divide="ignore"):
    q = np.append(np.sqrt((curve - curve[1]) / (curve - curve[0])), 1)
frames = {2: q}
for tip in range(2, len(curve)):
    q = zip_next(q, tip)
    frames[tip + 1] = q

figure, panels = plt.subplots(1, 4, layout="constrained", figsize=(11, 2.9))
n = len(curve)
for axes, zipped in zip(panels, (n // 4, n // 2, 3 * n // 4), strict=False):
    q, base = frames[zipped][:-1], frames[zipped][-1]
    with np.errstate(invalid="ignore"):  # the half-plane as a disk, the base point at 0
        z = np.where(np.isinf(q), 1, (q - base) / (q + base.conjugate()))
    rest = np.append(z[zipped - 1 :], z[0])
    axes.plot(rest.real, rest.imag, color="#00366c", linewidth=1)
    axes.plot(z[:zipped].real, z[:zipped].imag, ".", color="#00366c", markersize=5)
    axes.plot(0, 0, "k*", markersize=9)
    axes.set_title(f"{zipped} of {n} points")
f_B = geodesic_map(white)
panels[3].plot(f_B.real, f_B.imag, ".", color="#00366c", markersize=5)
panels[3].plot(0, 0, "k*", markersize=9)
panels[3].set_title("closed")
for axes in panels:
    axes.add_patch(plt.Circle((0, 0), 1, fill=False, linewidth=0.5, color="gray"))
    axes.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal")
    axes.set_axis_off()
plt.show()

# %%
# **Steps 3 and 4.** The interior is the harmonic extension of the boundary, eq. (10), by the
# same factor; a Möbius transformation, eqs. (19)-(20), lowers what angular distortion is left.

f = harmonic_extension(surface, f_B / f_B[0])
moved, normalization = normalize(mesh, f, "angle")

figure, panels = plt.subplots(1, 2, layout="constrained", figsize=(8, 3.8))
means = []
for axes, z, title in zip(panels, (f, moved), ("harmonic", "after Möbius"), strict=True):
    uv = np.column_stack([z.real, z.imag])
    means.append(cdcp_igl.angle_distortion(V, F, uv).mean())
    axes.tripcolor(*uv.T, F, height, shading="gouraud")
    axes.triplot(*uv.T, F, color="white", linewidth=0.3)
    axes.set_title(f"{title}: {means[-1]:.3f}°")
    axes.set_aspect("equal")
    axes.set_axis_off()
plt.show()

# %%
# :func:`cdcp_igl.disk_map` runs the same functions. (It also puts more points on a boundary
# as short as this one, which the zipper likes, so its map differs in the third digit.)

print(normalization)
result = cdcp_igl.disk_map(V, F)
print(result.distortion)
assert means[1] < means[0]
assert abs(result.distortion.mean - means[1]) < 0.02 * means[1]
