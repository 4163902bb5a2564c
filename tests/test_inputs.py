"""What people have in their hands: meshes of other libraries, files, seams, mistakes."""

import base64
import io
import json
import re
from types import SimpleNamespace

import meshes
import numpy as np
import pytest
import surfaces
import trimesh

import cdcp_igl
from cdcp_igl.io import read_mesh, read_polygons, write_map

V, F = meshes.grid(4, 5)
V[:, 0] -= 0.8 * V[:, 1]  # a square is cut along its shorter diagonal
F = F.reshape(2, -1, 3).swapaxes(0, 1).reshape(-1, 3)  # the two halves of a square in succession
W, G = surfaces.sphere(4, 6)
QUADS = np.column_stack([F[::2], F[1::2, 2]])
CHART = cdcp_igl.cut(W, G)


def cells(*blocks):
    return [SimpleNamespace(type=kind, data=np.array(data)) for kind, data in blocks]


def flat(*polygons):
    return np.array([number for row in polygons for number in (len(row), *row)])


def npz(faces):
    np.savez(file := io.BytesIO(), V=V, F=faces)
    return file.getvalue()


def gltf(positions, corners, mode=4, **node):
    """A scene of one mesh, in half the size, in text."""
    data = np.asarray(positions, "<f4").tobytes() + np.asarray(corners, "<u2").tobytes()
    views = [{"buffer": 0, "byteLength": 12 * len(positions)}]
    views.append({"buffer": 0, "byteOffset": 12 * len(positions), "byteLength": 2 * len(corners)})
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": len(corners), "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    scene = {
        **{"asset": {"version": "2.0"}, "accessors": accessors, "bufferViews": views},
        **{"buffers": [{"byteLength": len(data), "uri": uri}]},
        "meshes": [{"primitives": [primitive]}],
        "nodes": [{"children": [1], "scale": [0.5] * 3}, {"mesh": 0, **node}],
    }
    return json.dumps(scene).encode()


ROW = [0, 5, 1, 6, 2, 7, 3, 8, 4, 9]  # of the grid, as a strip
STRIP = [[ROW[k + k % 2], ROW[k + 1 - k % 2], ROW[k + 2]] for k in range(8)]
PLY_STRIP = (
    "ply\nformat ascii 1.0\nelement vertex 10\nproperty double x\nproperty double y\n"
    "property double z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    + "\n".join(" ".join(map(str, row)) for row in V[:10].tolist())
    + f"\n10 {' '.join(map(str, ROW))}\n"
)
OFF = f"OFF {len(V)} {len(F)} 0 " + " ".join(map(str, [*V.ravel(), *flat(*F)]))
OBJ = "".join("v {} {} {}\n".format(*row) for row in V.tolist())
OBJ += "".join(f"f {' '.join(map(str, row + 1))}\n" for row in QUADS)
TURN = [0, 0, 0.6, 0.8]  # a quaternion: the angle whose half has the cosine 0.8
TURNED = V @ [[0.28, 0.96, 0], [-0.96, 0.28, 0], [0, 0, 1]]
SCENE = trimesh.Scene()
ROTATION = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # by which the scene has the mesh turned
SCENE.add_geometry(
    trimesh.Trimesh(V, F, process=False), transform=np.pad(ROTATION, (0, 1)) + np.diag([0, 0, 0, 1])
)

# One object in place of V and F, and the disk that it is; or the surface, and how many disks.
DISKS = {
    "trimesh": (trimesh.Trimesh(V, F, process=False), V, F),
    "a scene of trimesh": (SCENE, V @ ROTATION.T, F),
    "LaPy": (SimpleNamespace(v=V, t=F), V, F),
    "nilearn": (SimpleNamespace(coordinates=V, faces=F), V, F),
    "Open3D": (SimpleNamespace(vertices=V.tolist(), triangles=F.tolist()), V, F),
    "PyVista": (SimpleNamespace(points=V, faces=flat(*F)), V, F),
    "PyVista, polygons": (SimpleNamespace(points=V, faces=flat(*QUADS[:6], *F[12:])), V, F),
    "PyVista, a grid": (SimpleNamespace(points=V, cells=flat(*QUADS), celltypes=[9] * 12), V, F),
    "meshio": (
        SimpleNamespace(
            points=V, cells=cells(("line", [[0, 1]]), ("triangle", F[:4]), ("quad", QUADS[2:]))
        ),
        *(V, F),
    ),
    "a tuple": ((V, F), V, F),
    "a tuple with quads": ((V, QUADS), V, F),
    "a tuple with polygons": ((V.tolist(), [*QUADS[:6].tolist(), *F[12:].tolist()]), V, F),
    "a tuple with arrays": ((V, list(F)), V, F),
    "a cut": (CHART, CHART.V, CHART.F),
    "quads.obj": (OBJ, V, F),
    "quads.npz": (npz(QUADS), V, F),
    "stream.off": (OFF, V, F),
    "strip.ply": (PLY_STRIP, V[:10], STRIP),
    "triangles.gltf": (gltf(2 * V, F.ravel()), V.astype("f4"), F),
    "turned.gltf": (gltf(2 * V, F.ravel(), rotation=TURN), TURNED, F),
    "mirrored.gltf": (gltf(2 * V, F.ravel(), scale=[-1, 1, 1]), V * [-1, 1, 1], F[:, ::-1]),
    "strip.gltf": (gltf(2 * V[:10], ROW, mode=5), V[:10].astype("f4"), STRIP),
    "fan.gltf": (gltf(2 * V[[0, 1, 6, 5]], range(4), 6), V[[0, 1, 6, 5]], [[0, 1, 2], [0, 2, 3]]),
    "quads.vtk": (cells(("quad", QUADS)), V, F),
    "triangles.vtu": (cells(("triangle", F)), V, F),
}
SURFACES = {
    "soup": surfaces.soup(W, G),
    "seams": (CHART.V, CHART.F),
    "soup.gltf": gltf(surfaces.soup(W, G)[0], range(G.size)),
}
REFUSED = {
    "an array": (V, "is no surface"),
    "nothing": (None, "NoneType is no surface"),
    "an empty scene": (trimesh.Scene(), "V has shape (0, 3)"),
    "tensors": (SimpleNamespace(vertex={}, triangle={}, to_legacy=None), "to_legacy()"),
    "tetrahedra": (
        SimpleNamespace(points=V, cells=flat(range(4)), celltypes=[10], extract_surface=None),
        "extract_surface()",
    ),
    "tetrahedra of meshio": (
        SimpleNamespace(points=V, cells=cells(("tetra", [[0, 1, 2, 3]]))),
        "There are no faces",
    ),
    "strips": (SimpleNamespace(points=V, faces=flat(), n_strips=1), "triangulate()"),
    "a cloud": (SimpleNamespace(vertices=V), "no faces"),
    "no rows": ((V, None), "not a rectangular array"),
    "rows and numbers": ((V, [[0, 1, 2], 3]), "fewer than three corners"),
    "cut off": (SimpleNamespace(points=V, faces=flat(*F)[:-1]), "F has shape"),
    "transposed": ((V.T, F.T), "transpose it, V.T"),
    "empty.obj": ("", "no vertices were found"),
    "binary.obj": ("\x01\x02\n", "no vertices were found"),
    "cloud.obj": (OBJ.partition("f")[0], "There are no faces"),
    "own child.gltf": (gltf(V, F.ravel(), children=[1]), "a node is a child of two others"),
}


def put(folder, name, what):
    """The object itself, or the path of a file with it."""
    path = folder / name
    if path.suffix in (".vtk", ".vtu"):
        meshio = pytest.importorskip("meshio")
        meshio.Mesh(V, [(block.type, block.data) for block in what]).write(path)
    elif isinstance(what, str | bytes):
        path.write_bytes(what if isinstance(what, bytes) else what.encode())
    else:
        return what
    return path


@pytest.mark.parametrize("name", DISKS)
def test_what_people_have(tmp_path, name):
    what, V, F = DISKS[name]
    mesh = cdcp_igl.disk_map(put(tmp_path, name, what)).mesh
    np.testing.assert_allclose(mesh.V, V, atol=1e-6)
    np.testing.assert_array_equal(mesh.F, F)


@pytest.mark.parametrize("name", SURFACES)
def test_loose_triangles_and_seams_are_one_surface(tmp_path, name):
    what = SURFACES[name]
    mesh = put(tmp_path, name, what)
    assert "surface_map" in cdcp_igl.check(mesh).next_step or name == "seams"
    result = cdcp_igl.surface_map(mesh)
    assert (result.valid, len(result.charts)) == (True, 1)
    assert "merged" in result.changes[0]


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_surface_is_told_what_to_do(tmp_path, name):
    what, says = REFUSED[name]
    with pytest.raises(cdcp_igl.MeshError, match=re.escape(says)):
        cdcp_igl.disk_map(put(tmp_path, name, what))


P, T, UV = cdcp_igl.datasets.spherical_cap(4)
CAP = SimpleNamespace(points=P, faces=flat(*T))
CORNERS = cdcp_igl.DiskMapper(P, T).mesh.loop[::6]


@pytest.mark.parametrize(
    ("function", "more"),
    [
        *((f, ()) for f in (cdcp_igl.cdcp, cdcp_igl.DiskMapper, cdcp_igl.check, cdcp_igl.clean)),
        *((f, ()) for f in (cdcp_igl.cut, cdcp_igl.free_map, cdcp_igl.surface_map)),
        *((m.function, ()) for m in cdcp_igl.reference.METHODS.values() if m.boundary != "sphere"),
        (cdcp_igl.cut, (T[0],)),
        (cdcp_igl.rectangle_map, (CORNERS,)),
        (cdcp_igl.angle_distortion, (UV,)),
        (cdcp_igl.area_distortion, (UV,)),
        (cdcp_igl.conformal_factor, (UV,)),
        (cdcp_igl.quasi_conformal_dilatation, (UV,)),
    ],
)
def test_every_function_takes_one_object_in_place_of_two(function, more):
    one, other = (function(*mesh, *more) for mesh in ((CAP,), (P, T)))
    if isinstance(one, tuple | np.ndarray):
        for mine, theirs in zip(one, other, strict=True):
            np.testing.assert_array_equal(mine, theirs)
    else:
        assert str(one).partition("seconds")[0] == str(other).partition("seconds")[0]


def test_it_is_written_with_its_map(tmp_path):
    write_map(tmp_path / "one.obj", CAP, UV)
    write_map(tmp_path / "two.obj", P, T, UV)
    assert (tmp_path / "one.obj").read_bytes() == (tmp_path / "two.obj").read_bytes()


def test_polygons_are_named_and_not_parted(tmp_path):
    quads = SimpleNamespace(points=V, faces=flat(*QUADS, QUADS[3]))
    defect = cdcp_igl.check(quads).defects[0]
    assert (defect.kind, set(defect.indices)) == ("polygons", {12})
    with pytest.raises(cdcp_igl.MeshError, match="polygons 12"):
        cdcp_igl.cdcp(quads)
    path = put(tmp_path, "torus.obj", "")
    write_map(path, *surfaces.torus(), np.zeros((96, 2)))
    expected = cdcp_igl.cut(*read_mesh(path), polygon_of_face=read_polygons(path)[2])
    np.testing.assert_array_equal(cdcp_igl.cut(path).edges, expected.edges)


@pytest.mark.parametrize("function", [cdcp_igl.disk_map, cdcp_igl.surface_map])
def test_an_obj_file_stays_what_it_is(tmp_path, function):
    path, out = put(tmp_path, "quads.obj", "mtllib a.mtl\n" + OBJ), tmp_path / "out.obj"
    result = function(path)
    result.save(out)
    assert len(re.findall(r"^f( \d+/\d+){4}$", out.read_text(), re.MULTILINE)) == len(QUADS)
    assert "mtllib a.mtl" in out.read_text()
    put(tmp_path, "a.mtl", "newmtl a")
    (tmp_path / "maps").mkdir()
    result.save(tmp_path / "maps" / "out.obj")
    named = re.match("mtllib (.*)", (tmp_path / "maps" / "out.obj").read_text())[1]
    assert named == "../a.mtl"
    path.write_text(OBJ.replace("f 1", "f 2", 1))
    with pytest.raises(ValueError, match="has changed"):
        result.save(out)


def test_what_is_written_as_glb_is_read_again(tmp_path):
    result = cdcp_igl.surface_map(W, G)
    result.save(tmp_path / "a.glb")
    V, F = read_mesh(tmp_path / "a.glb")
    np.testing.assert_array_equal(V[F], W.astype("f4")[G])
    assert len(cdcp_igl.surface_map(tmp_path / "a.glb").charts) == 1
