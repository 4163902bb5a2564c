"""Many surfaces: nothing lost, nothing overwritten, nothing done twice."""

import csv
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import igl
import meshes
import numpy as np
import pytest
from batches import batch, contents, lines, write_surfaces, write_torn
from commands import invoke

import cdcp_igl
from cdcp_igl.errors import printable
from cdcp_igl.io import read_mesh, write_map
from cdcp_igl.scale.batching import Record, journal
from cdcp_igl.scale.batching.names import result_names, surface_files


@pytest.fixture
def out(tmp_path):
    return tmp_path / "maps"


# -- what is made ----------------------------------------------------------------------


def test_the_results_are_those_of_a_loop(scans, out):
    made = batch([scans], out, refine=1, mobius="area")
    assert [record.status for record in made.records] == ["done"] * 3
    for record in made.records:
        V, F = read_mesh(record.input)
        expected = cdcp_igl.disk_map(V, F, refine=1, mobius="area")
        with np.load(out / f"{record.name}.npz") as saved:
            np.testing.assert_array_equal(saved["uv"], expected.uv)
        assert (record.mean, record.sd) == (expected.distortion.mean, expected.distortion.sd)
        areas = cdcp_igl.certify(V, F, expected.uv).areas
        assert (record.area_sd, record.texels) == pytest.approx((areas.sd, areas.texels))
        assert (record.vertices, record.faces, record.charts) == (len(V), len(F), 1)
        assert (record.flips, record.conformal) == (0, expected.conformal)
        assert record.boundary == expected.report()["boundary"]["method"]
        assert 20 < record.memory < 2000
    names = sorted(path.name for path in out.iterdir())
    assert names == ["results.jsonl", "summary.csv", *(f"surface_{i:03}.npz" for i in range(3))]


def test_every_surface_has_a_line(scans, tmp_path, out):
    write_torn(scans / "torn.npz")
    (scans / "text.obj").write_text("no surface")
    made = batch([scans, tmp_path / "missing.ply"], out)
    rows = {row["name"]: row for row in lines(out)}
    assert [record.name for record in made.records] == [
        *("surface_000", "surface_001", "surface_002", "text", "torn", "missing")
    ]
    failed = {name: row["error"] for name, row in rows.items() if row["status"] != "done"}
    assert failed == {"torn": "MeshError", "text": "MeshError", "missing": "FileNotFoundError"}
    assert rows["torn"]["vertices"] == len(meshes.grid()[0])
    with (out / "summary.csv").open(newline="") as file:
        assert [row["name"] for row in csv.DictReader(file)] == sorted(rows)
    assert len(made.done) == 3
    assert "3 of 6 surfaces mapped" in str(made)
    assert "2 MeshError" in str(made)


def test_surfaces_are_cleaned(tmp_path, out):
    """The rows of options are those of the file: two vertices and faces are dropped before."""
    V, F = meshes.grid(8, 8)
    folded = np.vstack([[[0, 0, 1], [1, 1, 0]], F + 2])
    np.savez(tmp_path / "folded.npz", V=np.vstack([V[:2] + 9, V]), F=folded)
    for option, row in (("align", 7), ("center", 30)):
        [made] = batch(
            [tmp_path / "folded.npz"], out / option, clean=True, **{option: row + 2}
        ).done
        assert made.changes
        with np.load(out / option / "folded.npz") as saved:
            expected = cdcp_igl.disk_map(V, F, **{option: row}).uv
            np.testing.assert_array_equal(saved["uv"], expected)
            np.testing.assert_array_equal(saved["vertex_index"], np.arange(2, 2 + len(V)))
        [failed] = batch(tmp_path / "folded.npz", out / "1", clean=True, **{option: 1}).failed
        assert failed.error == "ValueError"
        assert failed.message.endswith(" 1, which is not in the cleaned surface")


def test_each_surface_in_its_own_format(tmp_path, out):
    V, F = meshes.grid()
    (tmp_path / "scans").mkdir()
    for name in ("a.npz", "b.PLY"):
        write_map(tmp_path / "scans" / name, V, F, V[:, :2])
    igl.writeOFF(str(tmp_path / "scans" / "c.off"), V, F)
    assert batch([tmp_path / "scans"], out, format="same").failed == ()
    assert {path.name for path in out.glob("[abc].*")} == {"a.npz", "b.PLY", "c.obj"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "stl"}, "format"),
        ({"center": "middle"}, "center"),
        ({"jobs": 0}, "jobs"),
        ({"shard": (3, 2)}, "shard"),
        ({"executor": object(), "jobs": 2}, "executor"),
        ({"executor": object(), "time_limit": 1}, "executor"),
        ({"cut": True, "outline": "disk", "center": 3}, "center must be"),
        ({"cut": True, "align": 3}, "must be a direction"),
    ],
)
def test_bad_options(scans, out, options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        cdcp_igl.batch([scans], out, **options)
    assert not out.exists()


# -- going on --------------------------------------------------------------------------


def test_what_is_done_is_not_done_again(scans, out):
    write_torn(scans / "torn.npz")
    first = batch([scans], out)
    before = {path: path.stat().st_mtime_ns for path in out.glob("*.npz")}
    seen = []
    again = batch([scans], out, progress=lambda *counts: seen.append(counts))
    assert seen == [(3, 1, 4)]
    assert [record.line() for record in again.records] == [r.line() for r in first.records]
    assert len(lines(out)) == 4
    assert {path: path.stat().st_mtime_ns for path in out.glob("*.npz")} == before
    assert len(batch([scans], out, retry=True).failed) == 1
    assert len(lines(out)) == 5
    np.savez(scans / "torn.npz", **dict(zip("VF", meshes.grid(), strict=True)))
    # Without `retry`, as it is another surface; and though `results.jsonl` is read later.
    assert batch([scans], out, shard=(1, 1)).failed == ()
    assert batch([scans], out).failed == ()
    assert len(lines(out)) == 5


@pytest.mark.parametrize(
    "change",
    [
        lambda scans, out: (out / "surface_002.npz").unlink(),
        lambda scans, out: (out / "surface_002.npz").write_bytes(b""),
        lambda scans, out: os.utime(scans / "surface_002.npz", ns=(0, 0)),  # written again
    ],
)
def test_what_is_lost_or_may_have_changed_is_made_again(scans, out, change):
    batch([scans], out)
    before = contents(out)
    change(scans, out)
    assert batch([scans], out).failed == ()
    assert contents(out) == before
    assert len(lines(out)) == 4


def test_half_a_line_goes_and_its_surface_is_done_again(scans, out):
    """As a full disk leaves it: the result is not in its place then."""
    batch([scans], out)
    before, last = contents(out), lines(out)[-1]["name"]
    (out / "results.jsonl").write_bytes((out / "results.jsonl").read_bytes()[:-40])
    (out / f"{last}.npz").unlink()
    assert batch([scans], out).failed == ()
    assert contents(out) == before
    assert [line["status"] for line in lines(out)] == ["done"] * 3
    with (out / "results.jsonl").open("a") as file:  # lines of others
        file.write('{"section": "tables"}\n3\n\n{"name": "surface_000"}\n')
    assert len(batch([scans], out).done) == 3


@pytest.mark.parametrize("when", ["before", "meanwhile", "afterwards"])
def test_files_of_others_are_not_overwritten(scans, out, when):
    other = out / "surface_001.npz"

    class Meddling(ThreadPoolExecutor):
        def submit(self, *arguments):
            other.write_bytes(b"thesis")
            return super().submit(*arguments)

    if when == "before":
        out.mkdir()
        other.write_bytes(b"thesis")
    elif when == "afterwards":
        assert batch([scans], out).failed == ()
        other.write_bytes(b"thesis")
    with (Meddling if when == "meanwhile" else ThreadPoolExecutor)(1) as executor:
        [refused] = cdcp_igl.batch([scans], out, executor=executor).failed
    assert (refused.name, refused.error) == ("surface_001", "FileExistsError")
    assert refused.message.startswith(f"{other} is there, and was not made from surface_001.npz")
    assert other.read_bytes() == b"thesis"
    other.unlink()
    assert batch([scans], out).failed == ()  # without `retry`: it is not the surface's fault


def test_results_of_other_options_or_surfaces_are_not_overwritten(scans, out):
    batch([scans], out)
    before, summary = contents(out), (out / "summary.csv").read_bytes()
    made = batch([scans], out, mobius="area")
    assert {record.status for record in made.records} == {"refused"}
    assert (out / "summary.csv").read_bytes() == summary
    meanwhile = batch(write_surfaces(scans / "more", 4), out, mobius="area", shard=(4, 4))
    assert [record.status for record in meanwhile.records] == ["done"]
    rows = (out / "summary.csv").read_text().splitlines()
    assert [row.partition(",")[0] for row in rows[1:]] == [
        *("surface_000", "surface_001", "surface_002", "surface_003")
    ]
    assert rows[1:4] == summary.decode().splitlines()[1:]
    (out / "surface_003.npz").unlink()
    shutil.rmtree(scans / "more")
    np.savez(scans / "surface_000.npz", **dict(zip("VF", meshes.grid(9, 9), strict=True)))
    assert [record.name for record in batch([scans], out).failed] == ["surface_000"]
    assert contents(out) == before


@pytest.mark.parametrize("force", [False, True])
def test_the_surface_is_never_replaced(scans, force):
    before = contents(scans)
    made = batch(sorted(scans.glob("*.npz")), scans, force=force)
    assert {record.status for record in made.records} == {"refused"}
    assert "is the surface itself" in made.records[0].message
    assert contents(scans) == before


def test_by_force_what_is_there_is_replaced(scans, tmp_path, out):
    page = tmp_path / "page.html"
    expected = contents(batch([scans], tmp_path / "expected", mobius="area").folder)
    batch([scans], out)
    (out / "surface_001.npz").write_bytes(b"thesis")
    for file in (out / "summary.csv", page):
        file.write_text("thesis")
    arguments = ("batch", scans, out, "--mobius", "area", "--report", page)
    refused = invoke(*arguments)
    assert (refused.exit_code, refused.stderr[-9:]) == (1, "by force\n")
    assert invoke(*arguments, "--force").exit_code == 0
    assert contents(out) == expected
    assert "thesis" not in page.read_text() + (out / "summary.csv").read_text()
    assert invoke("map", scans / "surface_000.npz", "--out-dir", out, "--force").exit_code == 0


def test_shards_share_the_work(scans, tmp_path, out):
    whole = batch([scans], tmp_path / "whole")
    parts = [batch([scans], out, shard=(i, 2)) for i in (1, 2)]
    assert [[record.name for record in part.records] for part in parts] == [
        ["surface_000", "surface_002"],
        ["surface_001"],
    ]
    assert contents(out) == contents(tmp_path / "whole")
    with (out / "summary.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) == len(whole.done)
    seen = []
    batch([scans], out, progress=lambda *counts: seen.append(counts))
    assert seen == [(3, 0, 3)]


def test_two_batches_in_one_folder(scans, out):
    out.mkdir()
    with journal.Journal(out), pytest.raises(OSError, match="another batch is writing there"):
        batch([scans], out)
    assert len(batch([scans], out).done) == 3


# -- records ---------------------------------------------------------------------------


def test_records_survive_their_file():
    record = Record("a", os.fsdecode(b"/\xe4.obj"), status="failed", message="ä", changes=("One.",))
    again = Record.from_line(record.line())
    assert again.line() == record.line()
    assert (again.input, again.changes) == (record.input, record.changes)
    assert np.isnan(again.mean)
    assert Record.from_line('{"name": "a", "input": "b", "status": "done", "new": 1}').name == "a"
    for line in ("", "{", "[]", "{}", "null", '{"name": "a"'):
        with pytest.raises(ValueError, match=r"no record|Expecting"):
            Record.from_line(line)


# -- which surfaces, and what the results are called -----------------------------------


def test_names_do_not_collide(tmp_path):
    files = ["a/face.obj", "b/face.obj", "b/Face.ply", "b/hand.obj", "face.npz"]
    files += ["hand.obj.off", "c/x.obj", "c/x.ply", "c/x.obj.ply"]
    paths = [tmp_path / file for file in files]
    names = result_names(paths)
    assert names[0] == "a/face"
    assert names[1] == "b/face.obj"
    assert names[3] == "b/hand" or names[3] == "hand"
    assert len({name.casefold() for name in names}) == len(names)
    assert result_names([tmp_path / "one.obj"]) == ["one"]
    assert result_names([]) == []


def test_one_file_is_one_surface_however_it_is_spelled(scans, tmp_path, monkeypatch):
    """And no result of another folder's surface gets out of the folder of the results."""
    mine = write_surfaces(tmp_path / "work" / "scans", 1, rows=9) / "surface_000.npz"
    before, first = mine.read_bytes(), Path("../scans/surface_000.npz")
    monkeypatch.chdir(tmp_path / "work")
    assert surface_files([first, scans / first.name, f"./{first}"], Path("o")) == [
        scans / first.name
    ]
    made = batch(["../scans", "scans", "../work/scans"], "maps")
    assert len(made.done) == 4
    assert len(list(Path("maps").rglob("surface_*.npz"))) == 4
    same = Path("../work/../scans/surface_000.npz")
    done = invoke("map", first, mine, same, "--out-dir", "od")
    assert done.exit_code == 0, done.output
    assert {path.as_posix() for path in Path("od").rglob("*.npz")} == {
        "od/scans/surface_000.npz",
        "od/work/scans/surface_000.npz",
    }
    assert mine.read_bytes() == before
    with pytest.raises(ValueError, match="folder of the results"):
        surface_files(["../scans"], scans)
    Path("link").symlink_to(scans)
    for _ in range(2):  # the second time, there are results below the link
        assert len(batch("link", "link/maps").done) == 3


def test_folders_and_patterns(scans, tmp_path):
    out = scans / "maps"
    (scans / "below" / ".hidden").mkdir(parents=True)
    for name in ("below/a.obj", "below/notes.txt", "below/.b.obj", "below/.hidden/c.obj"):
        (scans / name).touch()
    out.mkdir()
    (out / "surface_000.npz").touch()
    expected = [scans / "below" / "a.obj", *(scans / f"surface_{i:03}.npz" for i in range(3))]
    assert surface_files([scans], out) == expected
    assert surface_files(scans, out) == surface_files(str(scans), out) == expected
    assert surface_files([scans, scans / "surface_002.npz"], out) == expected
    assert surface_files([f"{scans}/*_00[12].npz"], out) == expected[2:4]
    assert surface_files([f"{scans}/**/*.obj"], out) == expected[:1]
    assert surface_files([tmp_path / "missing.obj"], out) == [tmp_path / "missing.obj"]
    for nothing in (f"{scans}/*.stl", out.parent / "below" / ".hidden" / "none*.obj"):
        with pytest.raises(ValueError, match="no surface there"):
            surface_files([nothing], out)


def test_results_that_a_pattern_matches_are_not_mapped(scans):
    out = scans / "maps"
    for _ in range(2):
        assert len(batch(f"{scans}/**/*.npz", out).done) == 3
    assert len(list(out.rglob("*.npz"))) == 3
    assert len(surface_files(f"{out}/*.npz", out)) == 3  # these are meant
    assert len(surface_files(f"{scans}/*.npz", scans)) == 3


def test_loops_of_links_and_names_that_are_too_long(scans, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("loop.obj").symlink_to("loop.obj")
    long = "a" * 300
    odd = ["loop.obj", "loop.obj/a.obj", f"{long}.obj"]
    result = invoke("batch", *odd, scans, "maps")
    assert result.exit_code == 4, result.output
    assert "3 of 6 surfaces mapped" in result.stdout
    for out in (long, "loop.obj"):
        result = invoke("batch", scans, out)
        assert (result.exit_code, result.stderr[:13]) == (1, "Not written: ")


def test_names_that_are_no_text(scans, tmp_path):
    name = os.fsdecode(b"Stra\xdfe 5\n.npz")  # Latin-1
    try:
        (scans / "surface_000.npz").rename(scans / name)
    except OSError:  # a file system that takes UTF-8 only
        pytest.skip("no such names here")
    done = invoke("batch", scans, tmp_path / "maps")
    assert done.exit_code == 0, done.stderr
    assert "Stra\\xdfe 5" in done.stdout
    assert (tmp_path / "maps" / name).exists()
    assert len(batch([scans], tmp_path / "maps").done) == len(lines(tmp_path / "maps")) == 3
    assert "\\xdf" in printable(name)
