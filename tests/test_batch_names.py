"""Which surfaces a batch maps, and what the results are called."""

import os
from pathlib import Path

import pytest
from batches import batch, lines, write_surfaces
from commands import invoke

from cdcp_igl.batching.names import result_names, surface_files
from cdcp_igl.errors import printable


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
    with pytest.raises(ValueError, match="folder of the results"):
        surface_files([scans], scans)


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
