"""FreeSurfer's files and GIFTI: read, mapped, written, read again; parts, and the way back."""

import gzip
import json
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


def test_without_nibabel_it_says_what_to_install(pial, monkeypatch):
    monkeypatch.setitem(sys.modules, "nibabel", None)
    with pytest.raises(MissingExtra, match=r"cdcp_igl\[neuro\]"):
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
