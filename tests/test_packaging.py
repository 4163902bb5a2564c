"""What describes the package in several places says the same in all of them."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import cdcp_igl

ROOT = Path(__file__).parents[1]
# As conda-forge calls them: libigl is its C++ library there, matplotlib brings a desktop toolkit.
CONDA_NAMES = {"libigl": "igl", "matplotlib": "matplotlib-base"}


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def recipe():
    """The recipe of the conda package, its variables filled in."""
    text = (ROOT / "recipe" / "recipe.yaml").read_text("utf-8")
    values = yaml.safe_load(text)["context"]
    return yaml.safe_load(
        re.sub(r"\$\{\{ (\w+) \}\}", lambda match: values.get(match[1], match[0]), text)
    )


def test_the_version_is_the_same_everywhere(recipe):
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == cdcp_igl.__version__
    assert recipe["package"]["version"] == cdcp_igl.__version__
    assert cdcp_igl.__version__ in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_the_conda_package_needs_what_the_wheel_needs(project, recipe):
    extras = project["project"]["optional-dependencies"]
    wanted = [*project["project"]["dependencies"], *extras["cli"], *extras["data"], *extras["plot"]]
    expected = {f"python {project['project']['requires-python']}"}
    for requirement in wanted:
        name, bound = requirement.split(" ", 1)
        expected.add(f"{CONDA_NAMES.get(name, name)} {bound.replace(' ', '')}")
    assert set(recipe["requirements"]["run"]) == expected
    assert set(project["build-system"]["requires"]) < set(recipe["requirements"]["host"])
