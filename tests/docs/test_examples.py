"""Every example of the gallery runs by itself, without a warning, in an empty folder."""

import runpy
import warnings
from pathlib import Path

import matplotlib as mpl
import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "docs" / "examples").glob("*/*.py"))


def name(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@pytest.mark.parametrize("example", EXAMPLES, ids=name)
def test_example_runs(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    from matplotlib import pyplot as plt

    plt.close("all")
    # A window is what a user wants at the end, and what a test cannot have
    warnings.filterwarnings("ignore", message="FigureCanvasAgg is non-interactive", category=UserWarning)
    try:
        runpy.run_path(str(example), run_name="__main__")
        assert plt.get_fignums(), "an example without a picture"
    finally:
        plt.close("all")


def test_there_is_an_example_for_what_users_ask_for():
    topics = {path.parent.name for path in EXAMPLES}
    assert topics == {"first_steps", "methods", "own_steps", "exchange"}
    assert len(EXAMPLES) >= 15


@pytest.mark.parametrize("example", EXAMPLES, ids=name)
def test_an_example_is_a_page(example):
    """It has a title, explains itself in text cells, and asks nothing of the network."""
    text = example.read_text(encoding="utf-8")
    _, title, underline = text.splitlines()[:3]
    assert underline == "=" * len(title)
    assert text.count("\n# %%") >= 2
    assert not any(word in text for word in ("urllib", "requests", "http.client", "socket"))
