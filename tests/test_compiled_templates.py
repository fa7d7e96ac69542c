"""Compiled templates are kept in the cache folder; what is kept never differs from what the template says."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import jinja2
import pytest
from jinja2.bccache import bc_magic

from ctrlgen.core.compiled_templates import cache_folder, environment
from ctrlgen.numerics.compiled import Compilable, compiler


def rendered(folder: Path, **options: bool) -> str:
    return environment(folder, **options).get_template("page").render(x="<")


def test_a_kept_template_is_used_and_one_with_other_text_or_options_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    page = tmp_path / "page"
    page.write_text("first {{ x }}")
    assert rendered(tmp_path) == "first <"
    (kept,) = (tmp_path / "cache").rglob("*.pyc")

    compiled = list[str]()
    plain = jinja2.Environment.compile
    monkeypatch.setattr(jinja2.Environment, "compile", lambda *a, **k: compiled.append("once") or plain(*a, **k))
    assert rendered(tmp_path) == "first <"
    assert not compiled
    assert rendered(tmp_path, autoescape=True) == "first &lt;"  # the same text and file, another option
    page.write_text("second {{ x }}")
    assert rendered(tmp_path, autoescape=True) == "second &lt;"
    kept.write_bytes(kept.read_bytes()[:40])  # damaged
    assert rendered(tmp_path, autoescape=True) == "second &lt;"
    assert len(compiled) == 3
    assert list((tmp_path / "cache").rglob("*.*")) == [kept]  # a template has one file, and nothing half written stays


def test_a_file_that_is_not_whole_is_not_read_as_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each in turn: bits that flip, other programs' files, a template compiled by jinja2 alone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "page").write_text("first {{ x }}")
    assert rendered(tmp_path) == "first <"
    (kept,) = (tmp_path / "cache").rglob("*.pyc")
    whole = kept.read_bytes()
    other = [b"", b"{}", bc_magic + b"cno_such_module\nname\n.", bc_magic + b"0" * 40, whole[32:]]
    for k in range(0, len(whole), 97):
        other.append(whole[:k] + bytes([whole[k] ^ 0x11]) + whole[k + 1 :])
    for damaged in other:
        kept.write_bytes(damaged)
        assert rendered(tmp_path) == "first <"
        assert kept.read_bytes() == whole


def test_no_cache_folder_or_one_that_cannot_be_written_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    (tmp_path / "page").write_text("{{ x }}")
    assert rendered(tmp_path) == "<"

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder() is None and rendered(tmp_path) == "<"
    if compiler() is not None:
        x = ca.SX.sym("x")
        assert not Compilable(ca.Function("f", [x], [x**2])).spent(1e6, 10_000)  # stays with the virtual machine
    with pytest.raises(jinja2.UndefinedError):
        environment(tmp_path).get_template("page").render()
