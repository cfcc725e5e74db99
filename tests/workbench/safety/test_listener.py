"""Where the workbench listens."""

import socket

import pytest

from linework.errors import MachineError
from linework.workbench.server.serve import HOST, listener_at, usual_port


def test_a_survey_has_the_same_port_each_time(tmp_path):
    assert usual_port(tmp_path / "a" / ".." / "b") == usual_port(tmp_path / "b") != usual_port(tmp_path / "c")


def test_the_usual_port_or_any_other(tmp_path):
    usual = usual_port(tmp_path)
    with listener_at(0, usual) as first, listener_at(0, usual) as second:
        assert first.getsockname() == (HOST, usual)
        assert second.getsockname()[0] == HOST
        assert second.getsockname()[1] != usual


def test_a_port_that_was_asked_for_and_is_taken_is_refused(tmp_path):
    with socket.create_server((HOST, 0)) as taken:
        number = taken.getsockname()[1]
        with pytest.raises(MachineError, match=f"port={number}: the port is taken"):  # noqa: SIM117
            with listener_at(number, usual_port(tmp_path)):
                pass
