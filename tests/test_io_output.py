"""Files that appear whole or not at all."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from cdcp_igl.io import write_map
from cdcp_igl.io.output import _MACHINE, remove_stale, whole_file

posix = pytest.mark.skipif(os.name != "posix", reason="not on this system")


def write(path, text="new"):
    with whole_file(path) as unfinished:
        unfinished.write_text(text)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


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


def test_hard_links_are_kept(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("a long text that was there before")
    os.link(one, other)
    write(one)
    assert other.read_text() == "new"
    assert os.path.samefile(one, other)
    assert sorted(os.listdir(tmp_path)) == ["one", "other"]


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="not on this system")
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EOPNOTSUPP])
def test_hard_links_on_a_full_disk(tmp_path, monkeypatch, code):
    """The old text stays; file systems that reserve no space are written as ever."""
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("old")
    os.link(one, other)

    def fail(descriptor, start, size):
        os.truncate(descriptor, size - 1)  # as far as it went
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "posix_fallocate", fail)
    with pytest.raises(OSError, match=str(one)) if code == errno.ENOSPC else nullcontext():
        write(one, "longer")
    assert other.read_text() == ("old" if code == errno.ENOSPC else "longer")
    assert sorted(os.listdir(tmp_path)) == ["one", "other"]


@posix
def test_devices_are_written_to_and_not_replaced(tmp_path):
    link = tmp_path / "a"
    link.symlink_to("/dev/null")
    write(link)
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert os.listdir(tmp_path) == ["a"]


@posix
def test_a_fifo_gets_the_whole_text_and_stays(tmp_path):
    fifo = tmp_path / "a"
    os.mkfifo(fifo)
    with pytest.raises(OSError, match=str(fifo)):  # nobody reads, and nobody is waited for
        write(fifo)
    read = []
    reader = threading.Thread(target=lambda: read.append(fifo.read_text()))
    descriptor = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)  # that it is read is certain
    reader.start()
    write(fifo, "x" * 100_000)
    os.close(descriptor)
    reader.join()
    assert read == ["x" * 100_000]
    assert stat.S_ISFIFO(fifo.stat().st_mode)


@posix
def test_standard_output(tmp_path):
    code = "from tests.test_io_output import write; write('/dev/stdout')"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.stdout, run.stderr) == ("new", "")


def test_names_as_long_as_they_can_be(tmp_path):
    path = tmp_path / ("ü" * 125 + ".json")
    write(path)
    assert path.read_text() == "new"


@pytest.mark.parametrize("make", ["loop", "folder", "missing/a", "file/a"])
def test_errors_are_os_errors_and_name_what_was_asked_for(tmp_path, make):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=str(tmp_path / make)):
        write(tmp_path / make)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder", "loop"]


def full_disk(unfinished):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("body", [full_disk, os.listdir])
def test_errors_of_the_body_name_what_was_asked_for(tmp_path, body):
    def fail():
        with whole_file(tmp_path / "a.b") as unfinished:
            body(unfinished)

    with pytest.raises(OSError, match=r"a\.b'$") as caught:
        fail()
    assert caught.value.filename == str(tmp_path / "a.b")
    assert os.listdir(tmp_path) == []


def test_threads_that_write_one_file_do_not_meet(tmp_path):
    """Whoever reads meanwhile sees what one of them wrote, and never a part of it."""
    path = tmp_path / "a.npz"
    V, F = np.random.default_rng(0).random((300, 3)), np.arange(300).reshape(-1, 3)
    write_map(path, V, F, V[:, :2])
    failures, done = [], threading.Event()

    def keep(action):
        try:
            for _ in range(30):
                action()
        except Exception as error:
            failures.append(error)

    def read():
        while not done.is_set():
            with np.load(path) as saved:
                assert saved["uv"].shape == (300, 2)

    writers = [
        threading.Thread(target=keep, args=[lambda: write_map(path, V, F, V[:, :2])])
        for _ in range(4)
    ]
    reader = threading.Thread(target=keep, args=[read])
    for thread in (*writers, reader):
        thread.start()
    for thread in writers:
        thread.join()
    done.set()
    reader.join()
    assert failures == []
    assert os.listdir(tmp_path) == ["a.npz"]


@posix
def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path):
    code = f"""
from cdcp_igl.io.output import whole_file
with whole_file({str(tmp_path / "a.json")!r}) as unfinished:
    unfinished.write_text("half")
    print(unfinished.name, flush=True)
    input()
"""
    run = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    name = run.stdout.readline().strip()
    assert remove_stale(tmp_path) == []  # it lives
    run.send_signal(signal.SIGKILL)
    run.communicate()
    assert os.listdir(tmp_path) == [name]
    foreign = tmp_path / name.replace(_MACHINE, "somebody")  # another machine's
    foreign.touch()
    assert remove_stale(tmp_path) == [tmp_path / name]
    (tmp_path / name).touch()
    write(tmp_path / "b.json")  # the first time in this folder
    assert sorted(os.listdir(tmp_path)) == [foreign.name, "b.json"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux to tell")
def test_a_process_that_nobody_has_waited_for_is_dead(tmp_path):
    # In a container whose first process does not do so, orphans of a killed batch stay like this.
    code = f"from cdcp_igl.io.output import _created; _created({tmp_path / 'a'!r}, None)"
    ended = subprocess.Popen([sys.executable, "-c", f"from pathlib import PosixPath; {code}"])
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
    os.kill(ended.pid, 0)  # its number is still taken
    (left,) = tmp_path.iterdir()
    assert remove_stale(tmp_path) == [left]
    ended.wait()


@posix
def test_a_number_of_a_process_that_comes_again(tmp_path):
    with whole_file(tmp_path / "a") as unfinished:
        parts = unfinished.name.split("-")
        stale = Path(tmp_path, "-".join([*parts[:3], "00000000", *parts[4:]]))
        stale.touch()
        assert remove_stale(tmp_path) == [stale]


@posix
@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root may write everywhere")
def test_write_protected_files_are_not_replaced(tmp_path):
    path = tmp_path / "a"
    path.touch(0o444)
    with pytest.raises(PermissionError):
        write(path)
