"""The promises of the documentation, and the test that keeps each of them."""

from __future__ import annotations

import re

import pytest
from tests.campaign.faults import is_there
from tests.scenes.places import ROOT

#: (page, heading): the beginning of each promise below the heading, and a test of it.
PROMISES = {
    ("docs/formats.md", "What every output guarantees"): {
        "Heights and the full, compound CRS": "tests/files/vectors/test_vectors.py::test_round_trip",
        "An output appears complete or not at all": "tests/files/test_full_disk.py::test_full_disk",
        "An output is never a file that the command reads": "tests/commands/faults/test_outputs.py::test_no_command_replaces_what_it_reads",
        "Two runs that write one file or folder": "tests/commands/faults/test_outputs.py::test_of_two_simulations_into_one_folder_one_ends_well",
        "The same input and settings give": "tests/laws/test_splitting.py::test_workers_change_not_a_byte",
        "A damaged file, or a tile that fails": "tests/commands/faults/test_bad_input.py::test_a_damaged_file_among_good_ones",
    },
    ("docs/conventions.md", "Failures"): {
        "An error is one line on stderr": "tests/commands/faults/test_process.py::test_an_error_is_one_line",
        "Exit codes": "tests/commands/test_failures.py::test_the_exit_code_and_one_line",
        "An existing output is not touched": "tests/commands/faults/test_bad_input.py::test_the_output_exists",
        "Data goes to stdout": "tests/commands/faults/test_process.py::test_the_main_job_as_a_user_runs_it",
    },
    ("docs/reliability.md", "Reliability"): {
        "One line per error": "tests/commands/faults/test_process.py::test_an_error_is_one_line",
        "Whole outputs": "tests/files/test_full_disk.py::test_full_disk",
        "Counts balance": "tests/commands/faults/test_points.py::test_header_lies_are_refused_in_little_memory",
        "A guarded decoder": "tests/files/las/test_decoder.py::test_what_kills_the_parallel_decoder_is_decoded_alone",
        "Resuming": "tests/commands/test_resume.py::test_a_killed_run_goes_on_to_the_same_bytes",
    },
}


def promises_of(page: str, heading: str) -> list[str]:
    """Return the beginnings of the items below a heading."""
    text = (ROOT / page).read_text(encoding="utf-8")
    part = re.split(rf"^#+ {re.escape(heading)}$", text, flags=re.M)[1]
    part = re.split(r"^#+ ", part, flags=re.M)[0]
    return [item.replace("**", "") for item in re.findall(r"^- (.*)$", part, re.M)]


@pytest.mark.parametrize(("page", "heading"), PROMISES)
def test_every_promise_has_a_test(page, heading):
    kept = PROMISES[page, heading]
    promised = promises_of(page, heading)
    assert promised
    without = [item for item in promised if not any(item.startswith(start) for start in kept)]
    assert without == []
    assert [start for start in kept if not any(item.startswith(start) for item in promised)] == []
    assert [test for test in kept.values() if not is_there(test, ())] == []
