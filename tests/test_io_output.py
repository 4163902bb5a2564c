"""Files that appear whole or not at all."""

import os
import signal
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from cdcp_igl.io import write_map
from cdcp_igl.io.output import remove_stale, try_to_write, whole_file

posix = pytest.mark.skipif(os.name != "posix", reason="not on this system")


def write(path, text="new"):
    with whole_file(path) as unfinished:
        unfinished.write_text(text)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_a_failed_body_leaves_the_old_file_alone(tmp_path, error):
    path = tmp_path / "a.json"
    path.write_text("old")

    def write_and_fail():
        with whole_file(path) as unfinished:
            assert unfinished.parent == tmp_path
            assert unfinished.suffix == ".json"
            unfinished.write_text("ne")
            raise error

    with pytest.raises(error):
        write_and_fail()
    try_to_write(path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.json"]


def test_a_full_disk_is_noticed(tmp_path):
    """The old files stay; in a process of its own, whose files have a largest size."""
    paths = [tmp_path / f"a.{suffix}" for suffix in ("glb", "npz", "obj", "ply")]
    for path in paths:
        path.write_text("old")
    code = f"""
import numpy as np, resource
from cdcp_igl.io import write_map
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
V = np.random.default_rng(0).random((999, 3))
for path in {[str(path) for path in paths]}:
    try:
        write_map(path, V, np.arange(999).reshape(-1, 3), V[:, :2])
    except OSError as error:
        print(error.filename)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.split() == [str(path) for path in paths]
    assert [path.read_text() for path in paths] == ["old"] * len(paths)
    assert sorted(tmp_path.iterdir()) == paths


def test_symbolic_links_and_permissions(tmp_path):
    (tmp_path / "link").symlink_to("target")
    write(tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"
    (tmp_path / "usual").touch()
    assert mode(tmp_path / "target") == mode(tmp_path / "usual")


@posix
@pytest.mark.parametrize("before", [0o600, 0o640, 0o755])
def test_modes_are_kept(tmp_path, before):
    path = tmp_path / "a"
    path.touch()
    path.chmod(before)
    with whole_file(path) as unfinished:
        assert mode(unfinished) == before  # nobody else reads it meanwhile
        unfinished.write_text("new")
    assert mode(path) == before
    assert path.read_text() == "new"


@posix
def test_devices_are_written_to_and_not_replaced(tmp_path):
    link = tmp_path / "a"
    link.symlink_to("/dev/null")
    try_to_write(link)
    write(link)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert os.listdir(tmp_path) == ["a"]


@posix
def test_a_pipe_gets_the_text_and_stays(tmp_path):
    pipe = tmp_path / "a"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try_to_write(pipe)
    write(pipe)
    assert os.read(reader, 9) == b"new"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_names_as_long_as_they_can_be(tmp_path):
    path = tmp_path / ("ü" * 125 + ".json")
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize("function", [write, try_to_write])
@pytest.mark.parametrize("make", ["loop", "folder", "missing/a", "file/a"])
def test_errors_are_os_errors_and_name_what_was_asked_for(tmp_path, make, function):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=str(tmp_path / make)):
        function(tmp_path / make)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder", "loop"]


def test_errors_of_the_body_name_what_was_asked_for(tmp_path):
    def fail():
        with whole_file(tmp_path / "a.b") as unfinished:
            os.listdir(unfinished)

    with pytest.raises(OSError, match=r"a\.b'$") as caught:
        fail()
    assert caught.value.filename == str(tmp_path / "a.b")
    assert os.listdir(tmp_path) == []


@posix
@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root may write everywhere")
def test_write_protected_files_are_not_replaced(tmp_path):
    path = tmp_path / "a"
    path.touch(0o444)
    with pytest.raises(PermissionError):
        write(path)


def test_threads_that_write_one_file_do_not_meet(tmp_path):
    """Whoever reads meanwhile sees what one of them wrote, and never a part of it."""
    path = tmp_path / "a.npz"
    V, F = np.random.default_rng(0).random((300, 3)), np.arange(300).reshape(-1, 3)
    write_map(path, V, F, V[:, :2])
    with ThreadPoolExecutor(4) as threads:
        written = [threads.submit(write_map, path, V, F, V[:, :2]) for _ in range(120)]
        while not all(one.done() for one in written):
            with np.load(path) as saved:
                assert saved["uv"].shape == (300, 2)
    assert [one.result() for one in written] == [None] * 120
    assert os.listdir(tmp_path) == ["a.npz"]


# -- what killed processes left -----------------------------------------------------------

WRITER = """
import sys
from cdcp_igl.io.output import whole_file
with whole_file(sys.argv[1]) as unfinished:
    print(unfinished.name, flush=True)
    input()
"""


@posix
def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path):
    command = [sys.executable, "-c", WRITER, str(tmp_path / "a.json")]
    run = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    name = run.stdout.readline().strip()
    remove_stale(tmp_path)
    assert os.listdir(tmp_path) == [name]  # it lives
    run.send_signal(signal.SIGKILL)
    if Path("/proc/self/stat").exists():
        # Until somebody asks how it ended, its number is taken; in a container whose first
        # process does not do so, orphans of a killed batch stay like this.
        os.waitid(os.P_PID, run.pid, os.WEXITED | os.WNOWAIT)
        remove_stale(tmp_path)
        assert os.listdir(tmp_path) == []
    run.communicate()
    parts = name.split("-")
    foreign = "-".join([parts[0], "somebody", *parts[2:]])  # another machine's
    for left in (name, foreign):
        (tmp_path / left).touch()
    write(tmp_path / "b.json")  # the first time in this folder
    assert sorted(os.listdir(tmp_path)) == [foreign, "b.json"]


@posix
def test_a_number_of_a_process_that_comes_again(tmp_path):
    with whole_file(tmp_path / "a") as unfinished:
        parts = unfinished.name.split("-")
        stale = Path(tmp_path, "-".join([*parts[:3], "00000000", *parts[4:]]))
        stale.touch()
        remove_stale(tmp_path)
        assert os.listdir(tmp_path) == [unfinished.name]
