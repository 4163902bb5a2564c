"""What Windows lacks, hidden here: modules of POSIX and functions of `os`."""

import json

from commands import start

WITHOUT = """
import sys
for name in ("resource", "fcntl", "termios", "tty", "pwd", "grp", "pty"):
    sys.modules[name] = None
import os
for name in ("chown", "getuid", "geteuid", "mkfifo", "fork", "O_NONBLOCK", "killpg", "getpgid"):
    delattr(os, name)
import shutil
shutil._use_fd_functions = False  # as there; else rmtree asks for O_NONBLOCK
"""

IMPORT_ALL = """
import importlib, json, pkgutil
import cdcp_igl
names = [m.name for m in pkgutil.walk_packages(cdcp_igl.__path__, "cdcp_igl.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(json.dumps(names))
"""

MAP = """
from cdcp_igl import datasets, disk_map
from cdcp_igl.io import read_mesh, write_map
V, F, _ = datasets.spherical_cap(6)
from concurrent.futures import ThreadPoolExecutor
from cdcp_igl import batch
for name in ("a.npz", "a.obj", "a.glb", "a.obj"):
    write_map(name, V, F, disk_map(V, F))
assert (read_mesh("a.npz")[0] == V).all()
assert len(batch("a.npz", "maps", executor=ThreadPoolExecutor(1)).done) == 1
print(sorted(os.listdir()))
"""


def test_every_module_is_imported_and_maps_are_made_and_written(tmp_path):
    done = start("-c", WITHOUT + IMPORT_ALL + MAP, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names, files = done.stdout.splitlines()
    assert "cdcp_igl.solve.with_cvxopt" in json.loads(names)
    assert files == "['a.glb', 'a.npz', 'a.obj', 'maps']"
