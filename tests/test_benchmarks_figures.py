"""The pictures of the benchmarks."""

import numpy as np
import pytest
from benchmark_commands import MACHINE, MEANS, SECONDS, record, typical
from matplotlib.text import Text

from benchmarks.records.record import EDGES
from benchmarks.records.results import Measured, NotMeasured, growth
from benchmarks.write.figures import PLOTS, surfaces
from benchmarks.write.figures.accuracy import histograms, table_1
from benchmarks.write.figures.cost import STACK, factorizations, phases, seconds, seconds_growth
from benchmarks.write.figures.many import performance_profiles
from benchmarks.write.figures.style import HATCHES, MOST, STYLES, model_name
from benchmarks.write.pages import write_pages
from benchmarks.write.sections import cases
from benchmarks.write.table import markdown
from cdcp_igl import datasets
from cdcp_igl.plot.scene import Scene
from cdcp_igl.steps.phases import PHASES


def test_distortion_is_painted_where_it_is():
    V, F, _ = datasets.square(10)
    uv = V[:, :2].copy()
    uv[V[:, 0] > 0, 0] *= 3  # the right half is stretched
    scene = Scene(V, F, 40)
    light = scene.distortion(uv, 40)[..., :3].sum(axis=2, dtype=float)
    assert light[10:30, 25:35].mean() > 1.5 * light[10:30, 5:15].mean()


# -- charts ----------------------------------------------------------------------------

MODELS = {"small": 20_000, "large": 80_000, "largest": 320_000}


def failure(model, method, section="tables"):
    return record(model, method, section, outcome="crashed: SIGSEGV", n=MODELS[model])


def measured(*extra):
    """All methods on all models; fdcp fails on the large one."""
    records = [
        failure(model, method)
        if (model, method) == ("large", "fdcp")
        else typical(model, method, section, n=n, repeat=repeat)
        for model, n in MODELS.items()
        for method in SECONDS
        for section, repeat in (("tables", 0), ("speed", 0), ("speed", 1))
    ]
    return Measured([*records, *extra])


def line(axes, method):
    return next(one for one in axes.lines if one.get_label() == STYLES[method].label)


def test_numbers_are_drawn_where_they_belong():
    axes = table_1(measured()).axes[0]
    for method in ("cdcp", "ldcp", "harmonic"):
        np.testing.assert_allclose(line(axes, method).get_xdata(), MEANS[method])
    assert [text.get_text() for text in axes.get_yticklabels()] == [
        "small  20,000",
        "large  80,000",
        "largest  320,000",
    ]


def test_a_failure_is_drawn_as_such():
    axes = table_1(measured()).axes[0]
    np.testing.assert_array_equal(np.isnan(line(axes, "fdcp").get_xdata()), [False, True, False])
    assert [text.get_text() for text in axes.texts] == ["no map"]
    y = axes.texts[0].get_position()[1]
    assert y == line(axes, "fdcp").get_ydata()[1]


def test_times_are_multiples_of_a_factorization_of_the_same_model():
    axes = factorizations(measured()).axes[0]
    np.testing.assert_allclose(line(axes, "cdcp").get_xdata(), 2)
    np.testing.assert_allclose(line(axes, "harmonic").get_xdata(), 1)


def test_the_phases_add_up():
    axes = phases(measured()).axes[0]
    assert {name for names, _ in STACK.values() for name in names} == set(PHASES)
    widths = np.array([[bar.get_width() for bar in bars] for bars in axes.containers])
    np.testing.assert_allclose(widths.sum(axis=0), 2)
    assert len({bars[0].get_hatch() for bars in axes.containers}) == len(HATCHES)


def test_histograms_show_densities():
    panel = histograms(measured()).axes[0]
    for stairs in panel.patches:
        density, edges, _ = stairs.get_data()
        assert (density * np.diff(edges)).sum() == pytest.approx(100)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.2])
def test_growth_is_the_exponent(exponent):
    n = np.array([100.0, 20_000, 40_000, 90_000, 1e6])
    values = 3e-5 * n**exponent
    values[0] = 17  # too small to count
    assert growth(n, values) == pytest.approx((exponent, 3e-5))
    assert np.isnan(growth(n[:3], values[:3])).all()
    assert growth(n, np.append(values[:-1], np.nan))[0] == pytest.approx(exponent)


def test_what_was_not_measured_says_by_what_it_would_be():
    nothing = Measured([])
    for plot in PLOTS:
        with pytest.raises(NotMeasured, match=r"run: python -m benchmarks (tables|speed|ablation)"):
            plot.draw(nothing)


def test_where_everything_failed_a_chart_says_so():
    records = [
        failure(model, method, section)
        for model in MODELS
        for method in SECONDS
        for section in ("tables", "speed")
    ]
    of_failures = Measured(records)
    for draw in (plot.draw for plot in PLOTS if plot.draw.__module__ != surfaces.__name__):
        with pytest.raises(NotMeasured, match=r"failed|no method has|not measured yet"):
            draw(of_failures)


def measured_means(count, methods):
    """Methods, and on how many of the surfaces each was run."""
    numbers = {"sd": 1.0, "flips": 0, "seconds": 1.0}
    return Measured(
        record(f"surface {k}", method, n=100 + k, mean=1.0 + k, **numbers)
        for method, run in methods.items()
        for k in range(min(run, count))
    )


def test_a_profile_has_the_methods_that_were_run_everywhere():
    """One that was run on a few would look like one that fails on the others."""
    figure = performance_profiles(measured_means(5, {"cdcp": 5, "fdcp": 5, "ldcp": 4}))
    assert figure.axes[0].get_legend_handles_labels()[1] == ["FDCP", "CDCP"]


@pytest.mark.parametrize(
    "draw", [histograms, table_1, seconds, seconds_growth, performance_profiles]
)
def test_a_method_of_ones_own_is_in_the_figures_of_the_tables(draw):
    figure = draw(measured(*(typical(model, "mine:own", n=n) for model, n in MODELS.items())))
    assert any("mine:own" in text.get_text() for text in figure.findobj(Text))


def test_very_many_surfaces_are_not_drawn_one_by_one():
    many = measured_means(MOST + 1, {"cdcp": MOST + 1})
    for draw in (histograms, table_1, surfaces.images):
        with pytest.raises(NotMeasured, match=f"more than {MOST}"):
            draw(many)


# -- names of surfaces -----------------------------------------------------------------


def named(*names):
    return [record(name, "harmonic", histogram=[1] * len(EDGES)) for name in names]


def test_names_are_told_apart_and_paths_stay_as_they_are():
    names = ("left_ear_100", "a_b", "a b", "/tmp/my_scans/ear.obj")
    table = cases(Measured(named(*names)).sections["tables"])
    assert [row[0].text for row in table.rows] == ["left ear", *names[1:]]
    assert model_name(names[-1], 100) == "/tmp/my_scans/ear.obj  100"


def test_a_bar_in_a_name_is_no_column():
    table = markdown(cases(Measured(named("a|b")).sections["tables"]))
    assert r"| a\|b | 100 |" in table


def test_each_surface_has_a_page_of_its_own(tmp_path):
    V, F, _ = datasets.ellipse(3)
    measured = Measured(named("a_b", "a b"), lambda mesh: (V, F))
    write_pages(tmp_path, MACHINE, measured, [], lambda model: None)
    assert {page.name for page in tmp_path.glob("a*.html")} == {"a_b.html", "a~20b.html"}
