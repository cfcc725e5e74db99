"""The routes as their own description says them, asked for everything it allows and much that it does not (J17)."""

from __future__ import annotations

import subprocess
import sys

from tests.scenes.effort import examples

#: Of each route and phase; all in all some thousand requests, in the quick run a quarter of them.
EXAMPLES = examples(25)
LONGEST_S = 60


def test_no_request_is_a_fault(served):
    """J17: no 5xx, no status that the description does not know, no answer that is not as described."""
    said = subprocess.run(
        [sys.executable, "-m", "schemathesis.cli", "run", f"{served.url}/api/openapi.json",
         "-H", f"Cookie: {served.cookie_header}", "-H", f"Origin: {served.url}",
         "--checks", "not_a_server_error,status_code_conformance,content_type_conformance",
         "--max-time", str(LONGEST_S), "--max-examples", str(EXAMPLES), "--seed", "6", "--no-color", "--generation-database", "none",
         "--request-timeout", "30", "--suppress-health-check", "all", "--max-failures", "10"],
        capture_output=True, text=True, check=False, timeout=300, cwd=served.survey,
    )  # fmt: skip
    assert said.returncode == 0, said.stdout[-6000:] + said.stderr[-2000:]
    assert served.client.get("/api/health").status_code == 200
    assert not [line for line in served.stderr if "fault" in line]
