"""`import ctrlgen`: which names it gives, and that it is quick."""

from __future__ import annotations

import subprocess
import sys

import ctrlgen


def test_every_public_name_is_listed_and_is_what_its_stub_names():
    assert set(ctrlgen.__all__) == set(dir(ctrlgen)) and {"run", "load_device", "__version__"} <= set(dir(ctrlgen))
    for name in ctrlgen.__all__:
        assert getattr(getattr(ctrlgen, name), "__name__", name) == name


def test_importing_ctrlgen_imports_nothing_that_takes_long():
    told = "import sys, ctrlgen; print(sorted({'casadi', 'numpy', 'pint', 'pydantic', 'scipy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
