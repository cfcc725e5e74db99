"""Where the workbench listens."""

import socket

import pytest

from linework.errors import MachineError
from linework.workbench.server.serve import HOST, listener_at, usual_port


def test_a_survey_has_the_same_port_each_time(tmp_path):
    assert usual_port(tmp_path / "a" / ".." / "b") == usual_port(tmp_path / "b") != usual_port(tmp_path / "c")


def test_the_usual_port_or_any_other(tmp_path):
    # Another program of this machine may hold the port of one survey, but not those of all of them
    for survey in (tmp_path / f"{number}" for number in range(10)):
        with listener_at(0, usual_port(survey)) as first, listener_at(0, usual_port(survey)) as second:
            assert first.getsockname()[0] == second.getsockname()[0] == HOST
            assert second.getsockname()[1] not in (first.getsockname()[1], usual_port(survey))
            if first.getsockname()[1] == usual_port(survey):
                return
    pytest.fail("no survey got its usual port")


def test_a_port_that_was_asked_for_and_is_taken_is_refused(tmp_path):
    with socket.create_server((HOST, 0)) as taken:
        number = taken.getsockname()[1]
        with pytest.raises(MachineError, match=f"port={number}: the port is taken"):  # noqa: SIM117
            with listener_at(number, usual_port(tmp_path)):
                pass
