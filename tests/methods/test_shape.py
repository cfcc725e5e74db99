"""What all methods have in common: recordings, kinds, and evidence that is kept on disk."""

import numpy as np
import pytest

from linework.files.output.parts import read_part, write_part
from linework.methods.choose import choose_methods
from linework.methods.kinds import ALL_KINDS, KINDS_OF, RECORDING_OF, kinds_from
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet
from linework.model.sightings import Sightings

METHODS = choose_methods("auto", ALL_KINDS)


def test_the_table_of_kinds_says_what_the_methods_say():
    for name, kinds in KINDS_OF.items():
        own = [method for method in METHODS if method.name == name]
        assert {kind for method in own for kind in method.kinds} == set(kinds)
        assert {method.recording for method in own} == {RECORDING_OF[name]}
    assert kinds_from("points", ALL_KINDS) == ALL_KINDS


def test_a_method_that_is_named_looks_alone():
    (stereo,) = choose_methods("stereo", ("lane_marking",))
    assert (stereo.name, stereo.recording, stereo.kinds) == ("stereo", "pairs", ("lane_marking",))
    assert [method.name for method in choose_methods("auto", ("cable",))] == ["radon"]


@pytest.mark.parametrize("method", METHODS, ids=lambda method: "+".join(method.kinds))
def test_evidence_of_nothing_is_evidence(method):
    assert len(method.evidence.concatenate([])) == 0
    assert len(method.evidence.concatenate([method.evidence.empty()] * 2)) == 0


@pytest.mark.parametrize(
    "evidence",
    [
        BoxSet(centre=np.ones((2, 3)), u=np.array([[1.0, 0.0]] * 2), score=[0.5, 0.6]),
        LineSet.from_lines([np.eye(3)], kind=["cable"], crs="EPSG:25832", source=["ä.laz"]),
        Sightings(xyz=np.ones((1, 3)), pair=[7]),
    ],
    ids=lambda evidence: type(evidence).__name__,
)
def test_evidence_comes_back_from_its_part(tmp_path, evidence):
    one, two = (write_part(evidence, tmp_path / name) for name in ("a.npz", "b.npz"))
    back = read_part(type(evidence), tmp_path / "a.npz", one)
    assert one == two == write_part(back, tmp_path / "c.npz")
    for name in evidence.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(back, name), getattr(evidence, name))
    assert read_part(type(evidence), tmp_path / "a.npz", "0" * 64) is None
