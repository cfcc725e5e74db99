"""The first run says that it compiles, later ones do not."""

import os
from pathlib import Path

import linework.kernels
from linework.cli.startup import _KERNEL_OF, announce_compilation, is_compiled
from linework.methods.kinds import ALL_KINDS


def test_compiled_is_what_is_no_older_than_its_source(tmp_path):
    module, cache = tmp_path / "follow.py", tmp_path / "__pycache__"
    module.touch()
    assert not is_compiled(module)
    cache.mkdir()
    (cache / "follow_other.x-1.py311.nbi").touch()
    (cache / "follow.cpython-311.pyc").touch()
    assert not is_compiled(module)
    index = cache / "follow.follow_all-245.py311.nbi"
    index.touch()
    assert is_compiled(module)
    os.utime(index, (1, 1))
    assert not is_compiled(module)


def test_one_line_where_kernels_are_missing(tmp_path, monkeypatch, capsys):
    for name in set(_KERNEL_OF.values()):
        assert (Path(linework.kernels.__path__[0]) / f"{name}.py").exists()
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.py").touch()
    assert set(_KERNEL_OF) == {*ALL_KINDS, "trajectory"}  # what extract and locate come to
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(linework.kernels, "__path__", [str(tmp_path)])
    announce_compilation(ALL_KINDS, quiet=True)
    assert capsys.readouterr().err == ""
    announce_compilation(ALL_KINDS, quiet=False)
    assert capsys.readouterr().err == "first run: compiling once, about half a minute\n"
    (tmp_path / "cables/__pycache__").mkdir()
    (tmp_path / "cables/__pycache__/fit.robust_line-20.py311.nbi").touch()
    announce_compilation(["cable"], quiet=False)
    assert capsys.readouterr().err == ""
    announce_compilation(["cable", "barrier"], quiet=False)
    assert capsys.readouterr().err.startswith("first run")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    announce_compilation(ALL_KINDS, quiet=False)
    assert capsys.readouterr().err == ""
