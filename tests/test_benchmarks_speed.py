"""Times of surfaces that move."""

import meshes
import pytest

from benchmarks.measure.cases import Limits, run
from benchmarks.measure.machine import describe
from benchmarks.measure.methods import METHODS, TABLE
from benchmarks.measure.models import Model
from benchmarks.records.results import Measured
from benchmarks.records.store import Work
from benchmarks.write.report import as_markdown
from benchmarks.write.sections import tables

METHOD = "cdcp sequence"


def test_a_sequence_is_measured_beside_single_maps(tmp_path):
    grid = Model("grid", lambda: meshes.grid(20, 30))
    options = {"table": TABLE, "limits": Limits(60, 4000), "work": Work(tmp_path)}
    measured = Measured(run("speed", [grid], {METHOD: METHODS[METHOD]}, **options))
    (record,) = measured.sections["speed"].records
    moved, afresh = record.case.seconds, record.case.details["seconds"]["afresh"]
    assert record.ok
    assert min(moved, afresh) > 0
    (table,) = (table for table in tables(measured) if table.id == "sequences")
    (row,) = table.rows
    assert row[0].text == "grid"
    assert [cell.value for cell in row[2:]] == pytest.approx(
        [afresh, moved, moved / afresh, 1 / moved]
    )
    machine = describe(1) | {"time_limit": 60, "memory_limit": 4000, "commands": {}}
    assert f"{moved / afresh:.2f}" in as_markdown(machine, measured)
