"""FreeSurfer's files and GIFTI: read, mapped, written, read again; parts, and the way back."""

import gzip
import json
import pickle
import re
import struct
import sys
from contextlib import suppress
from pathlib import Path

import nibabel
import numpy as np
import pytest
from batches import invoke as invoke_batch
from commands import invoke
from nibabel.freesurfer import read_geometry, write_annot, write_geometry, write_morph_data

import cdcp_igl
from cdcp_igl.errors import Defect
from cdcp_igl.extras import MissingExtra
from cdcp_igl.io import read_mesh, read_patch, read_values

V, F, _ = cdcp_igl.datasets.spheroid(4)
V = V.astype(np.float32).astype(float)  # as these files have them
VOLUME = {
    "head": np.array([2, 0, 20]),
    "valid": "1  # volume info valid",
    "filename": "orig.mgz",
    "volume": np.array([256, 256, 256]),
    "voxelsize": np.ones(3),
    "xras": np.array([-1.0, 0, 0]),
    "yras": np.array([0, 0, -1.0]),
    "zras": np.array([0, 1.0, 0]),
    "cras": np.array([1.5, 2, -3]),
}
UPPER = V[:, 2] > 0.2 * V[:, 2].max()
META = {"AnatomicalStructurePrimary": "CortexLeft", "GeometricType": "Anatomical"}


def gifti(*arrays, labels=None):
    image = nibabel.gifti.GiftiImage(meta=nibabel.gifti.GiftiMetaData({"Subject": "s1"}))
    for data, intent in arrays:
        meta = nibabel.gifti.GiftiMetaData(META)
        image.add_gifti_data_array(nibabel.gifti.GiftiDataArray(data, intent=intent, meta=meta))
    for key, name in (labels or {}).items():
        label = nibabel.gifti.GiftiLabel(key)
        label.label = name
        image.labeltable.labels.append(label)
    return image


SURFACE = gifti((V.astype(np.float32), 1008), (F.astype(np.int32), 1009))
TURNED = gifti((F.astype(np.int32), 1009), (V.astype(np.float32), 1008))  # faces come first


@pytest.fixture
def pial(tmp_path):
    """A surface of FreeSurfer that knows the volume it is from."""
    write_geometry(tmp_path / "lh.pial", V, F, "a stamp", VOLUME)
    return tmp_path / "lh.pial"


@pytest.fixture
def surf_gii(tmp_path):
    SURFACE.to_filename(tmp_path / "lh.pial.surf.gii")
    return tmp_path / "lh.pial.surf.gii"


def test_all_that_hold_the_surface_are_read_alike(pial, surf_gii, tmp_path):
    packed, turned = tmp_path / "lh.gii.gz", tmp_path / "faces_first.gii"
    packed.write_bytes(gzip.compress(surf_gii.read_bytes()))
    TURNED.to_filename(turned)
    renamed = tmp_path / "any.name"  # its first bytes tell
    renamed.write_bytes(pial.read_bytes())
    for given in (pial, surf_gii, packed, turned, renamed):
        positions, faces = read_mesh(given)
        assert np.array_equal(positions, V)
        assert np.array_equal(faces, F)
    expected = cdcp_igl.sphere_map(V, F).points
    assert np.array_equal(cdcp_igl.sphere_map(SURFACE).points, expected)


def test_quads_are_split_as_freesurfer_does(tmp_path):
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    count = b"\x00\x00\x04" + b"\x00\x00\x01"
    quad = b"".join(struct.pack(">i", k)[1:] for k in range(4))
    data = b"\xff\xff\xfd" + count + np.array(corners, ">f4").tobytes() + quad
    (tmp_path / "lh.orig").write_bytes(data)
    positions, faces = read_mesh(tmp_path / "lh.orig")
    assert np.array_equal(positions, corners)
    assert faces.tolist() == [[0, 1, 3], [2, 3, 1]]


def test_a_sphere_is_written_as_freesurfer_has_it_with_its_volume(pial, tmp_path):
    result = cdcp_igl.sphere_map(pial)
    result.save(tmp_path / "lh.sphere")
    points, faces, volume = read_geometry(tmp_path / "lh.sphere", read_metadata=True)
    assert np.array_equal(faces, F)
    assert np.array_equal(points, (100 * result.points).astype(np.float32))
    for key, value in VOLUME.items():
        assert np.array_equal(volume[key], value)
    once = (tmp_path / "lh.sphere").read_bytes()
    result.save(tmp_path / "lh.sphere")
    assert (tmp_path / "lh.sphere").read_bytes() == once


def test_gifti_keeps_what_the_file_had(surf_gii, tmp_path):
    result = cdcp_igl.sphere_map(surf_gii)
    for name in ("lh.sphere.surf.gii", "lh.sphere.surf.gii.gz"):
        result.save(tmp_path / name)
        image = nibabel.load(tmp_path / name)
        points, faces = (array.data for array in image.darrays)
        assert np.array_equal(points, (100 * result.points).astype(np.float32))
        assert np.array_equal(faces, F)
        assert image.meta["Subject"] == "s1"
        assert dict(image.darrays[0].meta) == META | {"GeometricType": "Spherical"}


def test_a_part_knows_the_rows_of_the_whole(pial, tmp_path):
    part = cdcp_igl.submesh(pial, vertices=UPPER)
    same = cdcp_igl.submesh(V, F, without=np.flatnonzero(~UPPER))
    assert np.array_equal(part.F, same.F)
    assert np.array_equal(V[part.vertex_index], part.V)
    assert np.array_equal(F[part.face_index], part.vertex_index[part.F])
    result = cdcp_igl.free_map(part)
    left_out = f"{len(V) - len(part.V):,} of {len(V):,} vertices"
    assert dict(result.summary()[1])["left out"] == left_out
    assert result.report()["vertices_left_out"] == result.left_out == len(V) - len(part.V)
    assert f"({left_out} left out)" in str(cdcp_igl.check(part))
    assert "left out" not in f"{cdcp_igl.free_map(*part[:2])}{cdcp_igl.check(*part[:2])}"
    uv = result.to_given(result.uv)
    assert np.array_equal(uv[part.vertex_index], result.uv)
    assert np.isnan(np.delete(uv, part.vertex_index, axis=0)).all()
    labels = np.arange(len(part.V))
    carried = result.to_given(labels)
    assert carried.dtype == labels.dtype
    assert set(carried[~UPPER]) == {-1}
    assert not result.to_given(labels > 3)[~UPPER].any()
    with pytest.raises(ValueError, match="vertices were mapped"):
        result.to_given(labels[1:])

    result.save(tmp_path / "lh.upper.patch.flat")
    vertices, positions, border = read_patch(tmp_path / "lh.upper.patch.flat")
    assert np.array_equal(vertices, part.vertex_index)
    assert np.array_equal(positions[:, :2], result.uv.astype(np.float32))
    assert not positions[:, 2].any()
    assert np.array_equal(np.flatnonzero(border), np.sort(result.mesh.loop))
    again = cdcp_igl.submesh(V, F, vertices=vertices)
    assert np.array_equal(again.F, part.F)
    for name in ("flat_lh.gii", "lh.flat"):
        result.save(tmp_path / name)
        positions, faces = read_mesh(tmp_path / name)
        assert np.array_equal(faces, F[part.face_index])
        assert len(positions) == len(V)
        assert np.array_equal(positions[vertices, :2], result.uv.astype(np.float32))


def patch_of_a_surface(file, n, faces):
    """Read a flat patch as its users do, record by record: positions, faces, which are border.

    A patch names its vertices only, from 1 and with a minus at the border; its faces are those of
    the surface that have no other corners. So do FreeSurfer's read_patch.m and pycortex read it.
    """
    with file.open("rb") as opened:
        version, count = struct.unpack(">2i", opened.read(8))
        records = [struct.unpack(">i3f", opened.read(16)) for _ in range(count)]
        assert (version, opened.read()) == (-1, b"")
    side, points = np.zeros(n), np.full((n, 3), np.nan)
    for vertex, *place in records:
        side[abs(vertex) - 1], points[abs(vertex) - 1] = np.sign(vertex), place
    return points, [face for face in faces.tolist() if side[face].all()], side < 0


def test_another_reader_has_the_same_patch(pial, tmp_path):
    part = cdcp_igl.submesh(pial, vertices=UPPER)
    result = cdcp_igl.free_map(part, keep="lengths")
    result.save(tmp_path / "lh.upper.flat.patch.3d")
    points, faces, border = patch_of_a_surface(tmp_path / "lh.upper.flat.patch.3d", len(V), F)
    assert np.array_equal(faces, F[part.face_index])
    np.testing.assert_array_equal(points[:, :2], result.to_given(result.uv.astype(np.float32)))
    assert set(points[part.vertex_index, 2]) == {0}
    assert set(np.flatnonzero(border)) == set(part.vertex_index[result.mesh.loop])
    one, other, third = points[faces].transpose(1, 0, 2)
    assert (
        np.cross(other - one, third - one)[:, 2] > 0
    ).all()  # none is flipped in single precision


def test_a_surface_with_faces_first_and_nothing_at_its_border(tmp_path):
    """As hippocampi unfolded by hippunfold are: positions that it could not find are NaN."""
    lower = cdcp_igl.submesh(V, F, without=UPPER)
    lost = cdcp_igl.DiskMapper(*lower[:2]).mesh.loop[[0, 1, 7]]
    W = lower.V.astype(np.float32)
    W[lost] = np.nan
    image = gifti((lower.F.astype(np.int32), 1009), (W, 1008))
    image.to_filename(tmp_path / "sub_inner.surf.gii")
    cleaned = cdcp_igl.clean(tmp_path / "sub_inner.surf.gii")
    assert "with a NaN" in cleaned.changes[0]
    result = cdcp_igl.disk_map(cleaned)
    uv = result.to_given(result.uv)
    assert result.valid
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(uv[:, 0])), np.sort(lost))
    result.save(tmp_path / "sub_flat.surf.gii")
    flat, faces = read_mesh(tmp_path / "sub_flat.surf.gii")
    assert len(flat) == len(W)
    assert np.array_equal(faces, lower.F[cleaned.face_index])


def test_what_is_cleaned_after_it_was_parted_knows_the_rows_of_the_whole(pial, tmp_path):
    hole = int(np.flatnonzero(UPPER)[V[UPPER, 2].argmax()])
    part = cdcp_igl.submesh(pial, vertices=UPPER & (np.arange(len(V)) != hole))
    cleaned = cdcp_igl.clean(part)
    assert cleaned.changes == ("filled 1 hole",)
    assert cleaned.n_given == len(V)
    rows = cleaned.vertex_index >= 0
    assert np.array_equal(V[cleaned.vertex_index[rows]], cleaned.V[rows])
    result = cdcp_igl.disk_map(cleaned)
    uv = result.to_given(result.uv)
    assert np.isnan(uv[hole]).all()
    result.save(tmp_path / "lh.cap.patch.3d")
    vertices, positions, border = read_patch(tmp_path / "lh.cap.patch.3d")
    assert np.array_equal(positions[:, :2], uv[vertices].astype(np.float32))
    assert border[np.isin(vertices, F[(hole == F).any(axis=1)])].all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "either vertices"),
        ({"vertices": UPPER, "without": UPPER}, "either vertices"),
        ({"vertices": UPPER[1:]}, "truth value for each"),
        ({"vertices": [0.5]}, "not float64"),
        ({"without": [-1]}, r"0\.\."),
        ({"vertices": [len(V)]}, r"0\.\."),
    ],
)
def test_parts_that_are_none(options, said):
    with pytest.raises(ValueError, match=said):
        cdcp_igl.submesh(V, F, **options)


def test_a_part_without_faces():
    with pytest.raises(cdcp_igl.MeshError) as caught:
        cdcp_igl.submesh(V, F, vertices=[0, 1])
    assert isinstance(caught.value.defects[0], Defect)


def test_values_of_all_kinds(tmp_path):
    n, depth = len(V), V[:, 2].astype(np.float32)
    areas, names = (UPPER + 1).astype(np.int32), {1: "below", 2: "above"}
    write_morph_data(tmp_path / "lh.sulc", depth)
    colours = np.array([[0, 0, 0, 0, 0], [1, 2, 3, 0, 197121], [4, 5, 6, 0, 394500]])
    write_annot(tmp_path / "lh.a.annot", areas, colours, ["none", "below", "above"], False)
    rows = np.flatnonzero(UPPER)
    lines = [f"{row} 0 0 0 0" for row in rows]
    (tmp_path / "lh.top.label").write_text("\n".join(["#!ascii label", str(len(rows)), *lines]))
    image = nibabel.MGHImage(depth.reshape(n, 1, 1), np.eye(4))
    nibabel.save(image, tmp_path / "lh.thick.mgh")
    gifti((depth, 2005)).to_filename(tmp_path / "lh.shape.gii")
    gifti((depth, 2001), (2 * depth, 2001)).to_filename(tmp_path / "lh.func.gii")
    gifti((areas, 1002), labels=names).to_filename(tmp_path / "lh.label.gii")
    for name in ("lh.sulc", "lh.thick.mgh", "lh.shape.gii"):
        values, none = read_values(tmp_path / name, n)
        assert np.array_equal(values, depth)
        assert none == {}
    assert np.array_equal(read_values(tmp_path / "lh.func.gii")[0], np.c_[depth, 2 * depth])
    assert np.array_equal(read_values(tmp_path / "lh.top.label", n).values, UPPER)
    for name in ("lh.a.annot", "lh.label.gii"):
        labels, given = read_values(tmp_path / name)
        assert np.array_equal(labels, areas)
        assert {k: given[k] for k in (1, 2)} == names
    with pytest.raises(ValueError, match="not for 7"):
        read_values(tmp_path / "lh.sulc", 7)
    with pytest.raises(ValueError, match="n is needed"):
        read_values(tmp_path / "lh.top.label")
    with pytest.raises(cdcp_igl.MeshError, match=f"names vertex {rows.max():,}"):
        read_values(tmp_path / "lh.top.label", 5)


def cut_off(data):
    yield from (data[: int(share * len(data))] for share in (0.001, 0.01, 0.3, 0.7, 0.98))


def miscounted(data):
    """With a count that is negative, or too large."""
    start = data.find(b"\n\n", 3) + 2 if data[:3] == b"\xff\xff\xfe" else 4
    for count in (-1, 1 << 30) if data[:1] == b"\xff" else ():
        yield data[:start] + struct.pack(">i", count) + data[start + 4 :]


def changed(data):
    """In one byte, or without it."""
    rng = np.random.default_rng(0)
    for place in rng.integers(0, min(len(data), 400), 10).tolist():
        yield data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :]
        yield data[:place] + data[place + 1 :]


@pytest.mark.parametrize("kind", ["lh.pial", "a.surf.gii", "a.gii.gz", "lh.sulc", "lh.x.patch.3d"])
def test_damage_is_told(kind, pial, surf_gii, tmp_path):
    """A MeshError that names the file, or the file is read: nothing else, and in no long time."""
    write_morph_data(tmp_path / "lh.sulc", V[:, 2])
    cdcp_igl.free_map(cdcp_igl.submesh(V, F, vertices=UPPER)).save(tmp_path / "lh.x.patch.3d")
    (tmp_path / "a.surf.gii").write_bytes(surf_gii.read_bytes())
    (tmp_path / "a.gii.gz").write_bytes(gzip.compress(surf_gii.read_bytes()))
    readers = {"lh.sulc": read_values, "lh.x.patch.3d": read_patch}
    path, read = tmp_path / kind, readers.get(kind, read_mesh)
    whole = path.read_bytes()
    for data in (*cut_off(whole), *miscounted(whole)):
        path.write_bytes(data)
        with pytest.raises(cdcp_igl.MeshError, match=path.name):
            read(path)
    for data in changed(whole):
        path.write_bytes(data)
        with suppress(cdcp_igl.MeshError):
            read(path)


def test_values_and_what_is_not_packed_are_no_surface(surf_gii, tmp_path):
    gifti((V[:, 2].astype(np.float32), 2005)).to_filename(tmp_path / "lh.shape.gii")
    with pytest.raises(cdcp_igl.MeshError, match="readable gii file: it holds values, and no surf"):
        read_mesh(tmp_path / "lh.shape.gii")
    (tmp_path / "a.gii.gz").write_bytes(surf_gii.read_bytes())
    with pytest.raises(cdcp_igl.MeshError, match="readable gii file: it is not packed by gzip"):
        read_mesh(tmp_path / "a.gii.gz")


def test_a_patch_is_no_surface_by_itself(tmp_path):
    file = tmp_path / "lh.x.patch.flat"
    cdcp_igl.free_map(cdcp_igl.submesh(V, F, vertices=UPPER)).save(file)
    with pytest.raises(cdcp_igl.MeshError, match="which has no faces"):
        read_mesh(file)


def test_a_surface_that_was_cut_has_no_one_place_for_a_vertex(tmp_path):
    with pytest.raises(ValueError, match="one place for each vertex"):
        cdcp_igl.surface_map(V, F).save(tmp_path / "flat.gii")
    assert list(tmp_path.iterdir()) == []


def pinched():
    """Vertices above a plane but for a hole that meets the rim at one, which `clean` splits."""
    keep = V[:, 2] > -0.4 * V[:, 2].max()
    near = [np.unique(F[(v == F).any(axis=1)]) for v in range(len(V))]
    rim = {v for v in np.flatnonzero(keep) if not keep[near[v]].all()}
    for v in sorted(rim):
        for x in near[v]:
            if keep[x] and x not in rim and not any(y in rim and y != v for y in near[x]):
                keep[x] = False
                return keep
    raise AssertionError


def islet():
    """All vertices but those around one face, whose own corners `clean` splits or leaves out."""
    face = F[V[F, 2].mean(axis=1).argmax()]
    keep = ~np.isin(np.arange(len(V)), F[np.isin(F, face).sum(axis=1) == 2])
    keep[face] = True
    return keep


DOUBLED = {
    "split": lambda surface: cdcp_igl.clean(cdcp_igl.submesh(surface, vertices=pinched())),
    "islet": lambda surface: cdcp_igl.clean(cdcp_igl.submesh(surface, vertices=islet())),
    "cut": cdcp_igl.cut,
    "a part, cut": lambda surface: cdcp_igl.cut(
        cdcp_igl.submesh(surface, vertices=abs(V[:, 2]) < 0.8 * V[:, 2].max())
    ),
}


def doubled_rows(part):
    rows, count = np.unique(part.vertex_index[part.vertex_index >= 0], return_counts=True)
    return rows[count > 1]


@pytest.mark.parametrize("kind", DOUBLED)
@pytest.mark.parametrize("made", [cdcp_igl.free_map, lambda part: mapper_of(part).free()])
def test_a_vertex_with_several_places_is_left_out_of_a_patch(kind, made, pial, tmp_path, caplog):
    part = DOUBLED[kind](pial)
    result, doubled = made(part), doubled_rows(part)
    file = tmp_path / "lh.x.patch.flat"
    with caplog.at_level("WARNING", "cdcp_igl"):
        result.save(file)
    points, faces, border = patch_of_a_surface(file, len(V), F)
    there = np.isfinite(points[:, 0])
    assert not there[doubled].any()
    left_out = len(np.unique(part.vertex_index[part.vertex_index >= 0])) - there.sum()
    assert (f"not in lh.x.patch.flat: {left_out} vert" in caplog.text) == (left_out > 0)
    mapped = {frozenset(face) for face in part.vertex_index[part.F].tolist()}
    assert {frozenset(face) for face in faces} <= mapped
    one, other, third = points[faces].transpose(1, 0, 2)
    assert (np.cross(other - one, third - one)[:, 2] > 0).all()
    uv = result.to_given(result.uv)
    assert len(uv) == len(V)
    assert np.isnan(uv[doubled]).all()
    assert np.array_equal(uv[there].astype(np.float32), points[there, :2])
    ends = np.sort(np.vstack([np.roll(faces, k, axis=1)[:, :2] for k in range(3)]), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    assert set(np.flatnonzero(border)) == set(edges[count == 1].ravel())
    height = result.to_given(V[part.vertex_index, 2])  # one value, at however many places
    assert np.array_equal(height[doubled], V[doubled, 2])


def mapper_of(part):
    """A mapper that has been to another process."""
    return pickle.loads(pickle.dumps(cdcp_igl.DiskMapper(part)))


@pytest.mark.parametrize("kind", ["split", "cut"])
@pytest.mark.parametrize("name", ["x.surf.gii", "lh.flat"])
def test_a_surface_that_keeps_its_rows_has_no_two_places(kind, name, pial, tmp_path):
    part = DOUBLED[kind](pial)
    first = str(doubled_rows(part)[0])
    with pytest.raises(ValueError, match=rf"one place for each vertex.*\({first}"):
        cdcp_igl.free_map(part).save(tmp_path / name)
    assert not (tmp_path / name).exists()


def test_the_same_from_the_shell_and_in_a_batch(pial, tmp_path):
    rows = np.flatnonzero(pinched())
    lines = ["#!ascii label", str(len(rows)), *(f"{row} 0 0 0 0" for row in rows)]
    (tmp_path / "lh.some.label").write_text("\n".join(lines))
    which, file = ("--only", "lh.some.label", "--clean", "--free"), tmp_path / "lh.x.patch.flat"
    done = invoke("map", pial, file, *which)
    assert done.exit_code == 0
    assert "not in lh.x.patch.flat: 1 vertex" in " ".join(done.output.split())
    part = DOUBLED["split"](pial)
    assert not np.isin(doubled_rows(part), read_patch(file)[0]).any()
    refused = invoke("map", pial, tmp_path / "x.surf.gii", *which)
    assert refused.exit_code == 2
    assert "one place for each vertex" in " ".join(refused.output.split())
    how = {"free": True, "clean": True, "only": "lh.some.label", "format": "gii"}
    [record] = cdcp_igl.batch([pial], tmp_path / "maps", **how).failed
    assert record.error == "ValueError"
    assert "one place for each vertex" in record.message


def test_what_goes_on_from_a_part_knows_its_rows(tmp_path):
    part = cdcp_igl.submesh(V, F, vertices=UPPER)
    mapper = cdcp_igl.DiskMapper(part)
    made = (
        cdcp_igl.free_map(part).continued(keep="lengths"),
        mapper.map(),
        mapper.moved(part.V * [1, 1, 2]).free(),
        cdcp_igl.disk_map(cdcp_igl.clean(cdcp_igl.cut(part, path=[]))),
    )
    for result in made:
        assert len(result.to_given(result.uv)) == len(V)
        result.save(tmp_path / "lh.x.patch.flat")
        assert np.array_equal(read_patch(tmp_path / "lh.x.patch.flat")[0], part.vertex_index)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint64", "int32", "U3", "float32"])
def test_where_nothing_is_there_is_no_label(dtype):
    part = cdcp_igl.submesh(V, F, vertices=UPPER)
    result = cdcp_igl.free_map(part)
    labels = (np.arange(len(part.V)) % 200).astype(dtype)
    whole = result.to_given(labels)
    assert np.array_equal(whole[part.vertex_index], labels)
    assert not np.isin(np.delete(whole, part.vertex_index), labels).any()


@pytest.mark.parametrize(("dtype", "fill"), [("uint8", -1), ("uint8", 300), ("int64", 0.5)])
def test_a_fill_that_is_none(dtype, fill):
    result = cdcp_igl.free_map(cdcp_igl.submesh(V, F, vertices=UPPER))
    with pytest.raises(ValueError, match="fill="):
        result.to_given(np.zeros(len(result.uv), dtype), fill)


def test_nothing_here_is_not_chosen(pial, tmp_path):
    wall = V[:, 2] < -0.3 * V[:, 2].max()
    named = np.where(V[:, 0] > 0, 1, 2)
    colours = np.array([[0, 0, 0, 0, 0], [1, 2, 3, 0, 197121], [4, 5, 6, 0, 394500]])
    write_annot(tmp_path / "lh.a.annot", np.where(wall, -1, named), colours, ["x", "l", "r"], False)
    write_annot(
        tmp_path / "lh.b.annot", np.where(wall, 1, 2), colours, ["x", "Unknown", "r"], False
    )
    names = {1: "l", 2: "r", 7: "???"}
    for name, nothing in (("c", -3), ("d", 7)):
        image = gifti((np.where(wall, nothing, named).astype(np.int32), 1002), labels=names)
        image.to_filename(tmp_path / f"lh.{name}.label.gii")
    depth = np.where(wall, np.nan, -1.5).astype(np.float32)
    gifti((depth, 2005)).to_filename(tmp_path / "lh.e.shape.gii")
    write_morph_data(tmp_path / "lh.f", depth)
    for name in ("a.annot", "b.annot", "c.label.gii", "d.label.gii", "e.shape.gii", "f"):
        given = f"{{hemi}}.{name}"
        assert np.array_equal(cdcp_igl.io.read_vertices(given, len(V), pial), ~wall)
        assert np.array_equal(cdcp_igl.io.read_vertices(f"{given}:unknown", len(V), pial), wall)
    patch = tmp_path / "lh.x.patch.flat"
    for which in (("--only", "lh.f"), ("--without", "lh.a.annot:unknown")):
        assert invoke("map", pial, patch, "--free", "--force", *which).exit_code == 0
        assert not wall[read_patch(patch)[0]].any()


def test_several_columns_name_no_vertices(pial, tmp_path):
    gifti((V[:, 0].astype(np.float32), 2001), (V[:, 1].astype(np.float32), 2001)).to_filename(
        tmp_path / "lh.run.func.gii"
    )
    with pytest.raises(ValueError, match=r"'lh\.run\.func\.gii' has 2 columns"):
        cdcp_igl.io.read_vertices("lh.run.func.gii", len(V), pial)


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.int64])
def test_zeros_and_ones_are_a_mask_and_no_rows(dtype):
    for option in ("vertices", "without"):
        expected = cdcp_igl.submesh(V, F, **{option: UPPER})
        made = cdcp_igl.submesh(V, F, **{option: UPPER.astype(dtype)})
        assert np.array_equal(made.vertex_index, expected.vertex_index)
        with pytest.raises(ValueError, match="truth value for each"):
            cdcp_igl.submesh(V, F, **{option: UPPER[1:].astype(dtype)})
        with pytest.raises(ValueError, match="labels"):
            cdcp_igl.submesh(V, F, **{option: 3 * UPPER.astype(dtype)})


def test_without_nibabel_it_says_what_to_install(pial, monkeypatch):
    monkeypatch.setitem(sys.modules, "nibabel", None)
    with pytest.raises(MissingExtra, match=r"pip install '\.\[neuro\]'"):
        read_mesh(pial)
    assert Path(pial).exists()


@pytest.fixture
def study(tmp_path):
    """Two subjects as FreeSurfer lays them out, one of them without its label."""
    for subject in ("one", "two"):
        for folder in ("surf", "label"):
            (tmp_path / subject / folder).mkdir(parents=True)
        for hemi in ("lh", "rh"):
            write_geometry(tmp_path / subject / "surf" / f"{hemi}.pial", V, F, "", VOLUME)
    rows = np.flatnonzero(UPPER)
    lines = ["#!ascii label", str(len(rows)), *(f"{row} 0 0 0 0" for row in rows)]
    for hemi in ("lh", "rh"):
        (tmp_path / "one" / "label" / f"{hemi}.cortex.label").write_text("\n".join(lines))
    labels = (UPPER + 1).astype(np.int32)
    colours = np.array([[0, 0, 0, 0, 0], [1, 2, 3, 0, 197121], [4, 5, 6, 0, 394500]])
    file = tmp_path / "one" / "label" / "lh.aparc.annot"
    write_annot(file, labels, colours, ["none", "wall", "cortex"], False)
    return tmp_path


@pytest.mark.parametrize(
    "which",
    [
        ("--only", "../label/{hemi}.cortex.label"),
        ("--only", "../label/lh.aparc.annot:cortex"),
        ("--without", "../label/lh.aparc.annot:none,wall"),
    ],
)
def test_a_part_from_the_shell(study, which):
    pial, patch = study / "one" / "surf" / "lh.pial", study / "lh.cap.patch.flat"
    done = invoke("map", pial, patch, "--free", *which, "--report", study / "r.json")
    assert done.exit_code == 0, done.output
    vertices, positions, _ = read_patch(patch)
    assert np.array_equal(vertices, np.unique(F[UPPER[F].all(axis=1)]))
    expected = cdcp_igl.free_map(cdcp_igl.submesh(V, F, vertices=UPPER)).uv
    assert np.array_equal(positions[:, :2], expected.astype(np.float32))
    assert "kept" in json.loads((study / "r.json").read_text())["changes"][0]


def test_a_sphere_from_the_shell_is_as_from_python(study):
    pial, out = study / "one" / "surf" / "lh.pial", study / "lh.sphere"
    assert invoke("map", pial, out, "--sphere").exit_code == 0
    expected = study / "lh.expected"
    cdcp_igl.sphere_map(pial).save(expected)
    assert out.read_bytes() == expected.read_bytes()


def test_a_study_goes_on_where_a_subject_has_no_label(study):
    files = str(study / "*" / "surf" / "?h.pial")
    made = cdcp_igl.batch(files, study / "maps", free=True, only="../label/{hemi}.cortex.label")
    assert len(made.done) == len(made.failed) == 2
    assert {record.error for record in made.failed} == {"FileNotFoundError"}
    for record in made.done:
        assert record.changes[0].startswith("kept")
        assert record.left_out == (~UPPER).sum()
    assert f"{2 * (~UPPER).sum():,} vertices left out, of 2 maps" in str(made)
    with np.load(next((study / "maps").rglob("*.npz"))) as arrays:
        assert np.array_equal(arrays["V"], V[arrays["vertex_index"]])


def test_a_study_from_the_shell(study, monkeypatch):
    """Its journal and its summary say which labels are missing."""
    monkeypatch.chdir(study)
    files = [file.relative_to(study) for file in sorted(study.glob("*/surf/?h.pial"))]
    label = ("--only", "../label/{hemi}.cortex.label")
    done = invoke_batch(*files, "maps", "--sphere", *label, "--clean", "--format", "gii")
    assert done.exit_code == 4
    assert "2 of 4 surfaces mapped" in done.output
    for hemi in ("lh", "rh"):
        assert f"two/surf/{hemi}: FileNotFoundError" in done.output
    lines = map(json.loads, Path("maps", "results.jsonl").read_text().splitlines())
    failed = [line for line in lines if line["status"] == "failed"]
    assert [line["name"] for line in failed] == ["two/surf/lh", "two/surf/rh"]
    for line, hemi in zip(failed, ("lh", "rh"), strict=True):
        assert f"{hemi}.cortex.label" in line["message"]
    points, faces = read_mesh(Path("maps", "one", "surf", "lh.gii"))
    assert np.array_equal(faces, F[UPPER[F].all(axis=1)])
    np.testing.assert_allclose(np.linalg.norm(points[UPPER], axis=1), 100, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("../label/lh.aparc.annot:insula", "has no insula"),
        ("../label/{hemi}.cortex.label", "no {hemi}"),
    ],
)
def test_vertices_that_no_file_names(study, given, said):
    surface = study / "one" / "surf" / "lh.pial"
    if "hemi" in given:
        surface = surface.rename(surface.with_name("left.pial"))
    with pytest.raises(ValueError, match=re.escape(said)):
        cdcp_igl.io.read_vertices(given, len(V), surface)
