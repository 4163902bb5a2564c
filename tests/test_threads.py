"""Maps in threads of the caller, and in processes that are forked beside them."""

import os
import subprocess
import sys
from textwrap import dedent

import pytest


def run(code, **environment):
    """Run a program, which prints "done" at its end, with two threads of BLAS."""
    done = subprocess.run(
        [sys.executable, "-c", dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"} | environment,
    )
    assert done.stdout == "done\n", done.stderr


def test_maps_are_the_same_in_any_thread():
    """To the last bit, and the caller's number of threads stays."""
    run("""
        from concurrent.futures import ThreadPoolExecutor
        import numpy as np
        from threadpoolctl import threadpool_info
        from cdcp_igl import datasets, disk_map
        from cdcp_igl.solve.solvers import SOLVERS

        def uv(case):
            (V, F, _), solver = case
            return disk_map(V, F, solver=solver).uv

        surfaces = [datasets.square(50), datasets.spherical_cap(55), datasets.paraboloid(50, 3)]
        cases = [(surface, solver) for surface in surfaces for solver in SOLVERS]
        serial = [uv(case) for case in cases]
        before = [pool["num_threads"] for pool in threadpool_info()]
        with ThreadPoolExecutor(8) as threads:
            for expected, found in zip(serial, threads.map(uv, cases), strict=True):
                np.testing.assert_array_equal(found, expected)
        assert [pool["num_threads"] for pool in threadpool_info()] == before
        print("done")
    """)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.parametrize("solver", ["scikit-sparse", "cvxopt"])
def test_a_process_may_be_forked_while_another_thread_maps(solver):
    code = """
        import os, threading, time
        from threadpoolctl import threadpool_info
        from cdcp_igl import datasets
        from cdcp_igl.solve.factored import FactoredSurface
        from cdcp_igl.surface.mesh import DiskMesh

        def factor(resolution):
            return FactoredSurface.of(DiskMesh(*datasets.paraboloid(resolution)[:2])).delaunay

        def beside():
            while True:
                factor(40)

        factor(4)
        before = [pool["num_threads"] for pool in threadpool_info()]
        threading.Thread(target=beside, daemon=True).start()
        for k in range(8):
            time.sleep(0.007 * k)
            child = os.fork()
            if child == 0:
                factor(8)
                os._exit([pool["num_threads"] for pool in threadpool_info()] != before)
            assert os.waitpid(child, 0)[1] == 0
        print("done", flush=True)
        os._exit(0)
    """
    run(code, CDCP_IGL_SOLVER=solver)
