"""`import ctrlgen`: which names it gives, and that it is quick."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module

from conftest import ROOT

import ctrlgen


def test_every_public_name_is_listed_and_is_what_its_stub_names():
    assert set(ctrlgen.__all__) == set(dir(ctrlgen)) and {"run", "load_device", "__version__"} <= set(dir(ctrlgen))
    for name in ctrlgen.__all__:
        assert getattr(getattr(ctrlgen, name), "__name__", name) == name


def test_every_public_name_is_in_the_reference(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    page = import_module("reference_pages").python_page()
    told = set(re.findall(r"^\.\. auto\w+:: [\w.]*?(\w+)$", page, re.MULTILINE))
    assert told == set(ctrlgen.__all__) - {"__version__"}


def test_importing_ctrlgen_imports_nothing_that_takes_long():
    told = "import sys, ctrlgen; print(sorted({'casadi', 'numpy', 'pint', 'pydantic', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
