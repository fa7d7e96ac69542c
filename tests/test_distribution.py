"""What else names the version, the dependencies or the commands of the package says what pyproject.toml and .ci say."""

from __future__ import annotations

import re
import tomllib

from conftest import ROOT

from ctrlgen import __version__

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
# conda-forge's name of what is `matplotlib` without its graphical back ends
IN_CONDA = {"matplotlib": "matplotlib-base"}


def words(path: str) -> str:
    return (ROOT / path).read_text()


def test_the_recipe_has_the_version_and_the_dependencies_of_the_package():
    recipe = words("recipe/meta.yaml")
    assert f'{{% set version = "{__version__}" %}}' in recipe
    run = recipe.split("  run:\n")[1].split("\n\n")[0]
    listed = dict(re.fullmatch(r"    - ([\w-]+) (\S+)", line).groups() for line in run.splitlines())
    wanted = {"python": PROJECT["requires-python"]}
    for dependency in PROJECT["dependencies"]:
        name, versions = re.fullmatch(r"([\w-]+)(\S+)", dependency).groups()
        wanted[IN_CONDA.get(name, name)] = versions
    assert listed == wanted
    (script,) = PROJECT["scripts"].items()
    assert f"- {script[0]} = {script[1]}\n" in recipe and PROJECT["description"] in recipe


def test_the_container_has_the_version_of_the_package_and_extras_that_it_has():
    container = words("Dockerfile")
    assert f"ARG VERSION={__version__}\n" in container
    assert set(re.findall(r"ctrlgen:(\S+)", container)) == {__version__}
    (extras,) = re.findall(r"none-any\.whl\[([\w,]+)\]", container)
    assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
    (python,) = re.findall(r"FROM python:([\d.]+)-slim", container)
    assert PROJECT["requires-python"] == f">={python}"


def test_the_workflow_runs_what_a_merge_needs_and_begins_with_the_oldest_python():
    workflow = words(".github/workflows/ci.yml")
    assert ".ci/run" in workflow and (ROOT / ".ci/run").is_file()
    assert "make release" in workflow and "\nrelease:\n" in words("Makefile")
    oldest = PROJECT["requires-python"].removeprefix(">=")
    assert re.findall(r'python-version: "([\d.]+)"', workflow) == [oldest]
    (versions,) = re.findall(r"python: \[(.*)\]", workflow)
    assert versions.split(", ")[0] == f'"{oldest}"'
    assert f"Python {versions.split(', ')[0][1:-1]}, " in words("docs/howto/install.md").replace(" and ", ", ")
