"""Maps in threads of the caller, and in processes that are forked beside them."""

import os

import pytest
from commands import printed

TWO_THREADS = {"OPENBLAS_NUM_THREADS": "2"}


def test_maps_are_the_same_in_any_thread():
    """To the last bit, and the caller's number of threads stays."""
    code = """
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
        print([pool["num_threads"] for pool in threadpool_info()])
        with ThreadPoolExecutor(8) as threads:
            for expected, found in zip(serial, threads.map(uv, cases), strict=True):
                np.testing.assert_array_equal(found, expected)
        print([pool["num_threads"] for pool in threadpool_info()])
    """
    before, after = printed(code, **TWO_THREADS)
    assert before == after


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.parametrize("solver", ["scikit-sparse", "cvxopt"])
def test_a_process_may_be_forked_while_another_thread_maps(solver):
    code = """
        import os, signal, threading, time
        from threadpoolctl import threadpool_info
        from cdcp_igl import datasets
        from cdcp_igl.solve.factored import FactoredSurface
        from cdcp_igl.surface.mesh import DiskMesh

        def factor(resolution):
            return FactoredSurface.of(DiskMesh(*datasets.paraboloid(resolution)[:2])).delaunay

        def beside():
            while not stop.is_set():
                factor(40)

        def say_settings():
            print(sorted({pool["num_threads"] for pool in threadpool_info()}), flush=True)

        stop = threading.Event()
        thread = threading.Thread(target=beside)
        thread.start()
        for k in range(8):  # the first ones while the solver is loaded
            time.sleep(0.007 * k)
            child = os.fork()
            if child == 0:
                signal.alarm(20)  # ends it if it hangs
                factor(8)
                say_settings()
                os._exit(0)
            assert os.waitpid(child, 0)[1] == 0
        stop.set()
        thread.join()
        say_settings()
    """
    said = printed(code, CDCP_IGL_SOLVER=solver, **TWO_THREADS)
    assert len(said) == 9
    assert len(set(said)) == 1
