"""Points at an address: what is read of them, and every way in which a server can fail."""

from __future__ import annotations

import functools
import shutil
import ssl
import subprocess

import numpy as np
import pytest
from tests.conftest import CRS
from tests.scenes.laser_files import copc_file, drive_file
from tests.scenes.remote_server import file_server

import linework
from linework.errors import ConfigError, InputError, MachineError, MissingPackageError
from linework.files.las.header import read_las_header
from linework.files.remote import copies, reader, requests
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey

pytest.importorskip("obstore")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return a folder with a file of each sort."""
    folder = tmp_path_factory.mktemp("files")
    copc_file(folder / "a.copc.laz", n=4000, n_chunks=8)
    for name, kind in (("new.laz", 6), ("old.laz", 1), ("new.las", 7), ("old.las", 3)):
        drive_file(folder / name, kind, n=4000)
    return folder


@pytest.fixture(scope="module")
def here(files):
    """Return a function that reads a file from the disk, once."""
    return functools.cache(lambda name: read_survey_points(open_survey(files / name, crs=CRS)).points)


@pytest.fixture
def server(files, tmp_path):
    folder = tmp_path / "served"
    shutil.copytree(files, folder)
    with file_server(folder) as served:
        yield served


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """Try as often as ever, with shorter waits; small parts, so that a small file has many."""
    for name, value in (
        ("SILENCE_S", 1.0), ("CONNECT_S", 2.0), ("RETRIES", 3), ("FIRST_WAIT_S", 0.01), ("LONGEST_WAIT_S", 0.05),
    ):  # fmt: skip
        monkeypatch.setattr(requests, name, value)
    monkeypatch.setattr(reader, "BLOCK_BYTES", 2048)
    monkeypatch.setattr(copies, "_PART_BYTES", 4096)
    reader._KEPT.clear()


NAMES = ["a.copc.laz", "new.laz", "old.laz", "new.las", "old.las"]


@pytest.mark.parametrize("fault", ["sound", "flaky", "torn", "bare", "weak", "untagged", "led"])
@pytest.mark.parametrize("name", NAMES)
def test_the_points_are_those_of_the_local_file(server, here, tmp_path, monkeypatch, name, fault):
    monkeypatch.chdir(tmp_path)
    with file_server(server.folder) as other:
        server.other = other.port
        far = read_survey_points(open_survey(server.address(name, fault), crs=CRS))
    near = here(name)
    np.testing.assert_array_equal(far.points.xyz, near.xyz)
    np.testing.assert_array_equal(far.points.intensity, near.intensity)
    np.testing.assert_array_equal(far.points.time_s, near.time_s)
    assert len(far.points) == 4000
    warned = [text for text in far.warnings if "neither ETag nor date" in text]
    assert len(warned) == (fault in ("untagged", "bare"))


def test_an_answer_that_stalls_is_asked_for_again(server):
    header = read_las_header(linework_path(server, "a.copc.laz", "slow"))
    assert header.n_points == 4000


def test_parts_are_asked_for_several_at_once_and_once_each(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    read_survey_points(open_survey(server.address("old.las"), crs=CRS))
    size = (server.folder / "old.las").stat().st_size
    parts = [(first, last) for _, first, last in server.asked if last - first == 4096 or last == size]
    assert len(parts) == len(set(parts)) == -(-size // 4096)
    assert 1 < server.most_at_once <= 8


def test_a_header_takes_a_few_blocks(server):
    path = server.folder / "a.copc.laz"
    n_bytes = copc_file(path, n=20_000, n_chunks=40).stat().st_size
    found, here = read_las_header(linework_path(server, "a.copc.laz")), read_las_header(path)
    assert (found.n_points, found.low, found.columns.keys()) == (20_000, here.low, here.columns.keys())
    assert server.n_sent <= 7 * 2048 < n_bytes / 4


def linework_path(server, name, fault="sound"):
    return open_survey(server.address(name, fault), crs=CRS).point_files[0]


#: Fault, error, and words of its line.
REFUSED = [
    ("missing", InputError, "no such file on the server .HTTP 404."),
    ("gone", InputError, "refuses the request .HTTP 410."),
    ("forbidden", InputError, "no access .HTTP 403."),
    ("unknown", InputError, "no access .HTTP 401."),
    ("whole", InputError, "sends whole files only, no ranges"),
    ("page", InputError, "not a LAS/LAZ file"),
    ("none", InputError, "empty file"),
    ("shifted", InputError, "other bytes than those asked for"),
    ("changing", InputError, "changed while it was read"),
    ("growing", InputError, "changed while it was read"),
    ("broken", MachineError, "the server failed .HTTP 500., also when asked again"),
    ("busy", MachineError, "the server failed .HTTP 503., also when asked again"),
    ("cut", MachineError, "the connection was cut"),
    ("stuck", MachineError, "no answer, or none that continues"),
    ("round", MachineError, "leads on to other addresses"),
]


@pytest.mark.parametrize(("fault", "kind", "words"), REFUSED)
def test_what_fails_is_one_line_with_the_address(server, tmp_path, monkeypatch, fault, kind, words):
    monkeypatch.chdir(tmp_path)
    address = server.address("a.copc.laz", fault)
    with pytest.raises(kind, match=words) as error:
        read_survey_points(open_survey(address, crs=CRS))
    line = str(error.value)
    assert line.startswith(f"{address}: ")
    assert "\n" not in line
    assert len(line) < 400
    assert not list(tmp_path.glob("**/fetched-*"))


def test_a_server_that_is_not_there(server):
    with pytest.raises(MachineError, match="no connection to the server"):
        open_survey("http://127.0.0.1:1/a.laz", crs=CRS)


def test_a_file_that_fails_leaves_the_others(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [server.address("new.laz"), server.address("old.laz", "forbidden")]
    read = read_survey_points(open_survey(names, crs=CRS))
    assert len(read.points) == 4000
    assert [problem.split(": ", 1)[0] for _, problem in read.failures] == [names[1]]


@pytest.mark.parametrize("n", [2, 5, 9])
def test_a_server_lost_in_the_middle_ends_the_run_and_loses_no_file(server, tmp_path, monkeypatch, n):
    monkeypatch.chdir(tmp_path)
    survey = open_survey([server.address("new.las"), server.address("old.las")], crs=CRS)
    server.down_after = len(server.asked) + n
    with pytest.raises(MachineError, match=r"las: the server failed \(HTTP 503\)"):
        read_survey_points(survey)


@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl to make a certificate")
def test_certificates(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost",
         "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", "key.pem", "-out", "cert.pem"],
        check=True, capture_output=True,
    )  # fmt: skip
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain("cert.pem", "key.pem")
    with (
        file_server(server.folder, tls=context) as safe,
        pytest.raises(MachineError, match="its certificate is not trusted"),
    ):
        open_survey(f"https://127.0.0.1:{safe.port}/sound/new.laz", crs=CRS)


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("https://me:geheim@host/a.laz", "holds a user name or a password"),
        ("https://geheim@host/a.laz", "holds a user name or a password"),
        ("https://host/a.laz?X-Amz-Signature=geheim", "may be a signature"),
        ("https://host/a.laz#geheim", "may be a signature"),
        ("https://host/", "names no file"),
        ("s3://bucket", "names no file"),
        ("https://host:port/a.laz", "is not an address"),
        ("https://host/*.laz", "patterns are not matched"),
        ("https://host/a.e57", "suffix '.e57'"),
        ("ftp://host/a.laz", "is not a file on this machine"),
    ],
)
def test_addresses_that_are_refused_before_anything_is_asked(address, words):
    with pytest.raises(InputError, match=words) as error:
        open_survey(address)
    assert "geheim" not in str(error.value)
    assert "://" in str(error.value) or address.startswith("ftp")


def test_a_survey_file_calls_out_only_when_allowed(server, tmp_path):
    (tmp_path / "survey.toml").write_text(
        f'crs = "{CRS}"\n[points]\nfiles = ["{server.address("new.laz")}"]\n'
    )
    with pytest.raises(ConfigError, match=r"is not on this machine\. Give allow_remote=True"):
        open_survey(tmp_path)
    assert server.asked == []
    read = read_survey_points(open_survey(tmp_path, allow_remote=True))
    assert len(read.points) == 4000


def test_without_the_extra_one_line_names_it(monkeypatch):
    monkeypatch.setitem(linework.errors.EXTRAS, "remote", ("points at an address", ("no_such_package",)))
    with pytest.raises(MissingPackageError, match=r"https://host/a.laz: .* pip install 'linework\[remote\]'"):
        open_survey("https://host/a.laz")


def test_fetching_shows_in_the_progress(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = []
    survey = open_survey([server.address("a.copc.laz"), server.address("new.las")], crs=CRS)
    read_survey_points(survey, progress=lambda done, total: told.append((done, total)))
    done = [one for one, _ in told]
    assert done == sorted(done)
    assert {total for _, total in told} == {8000}
    assert done[-1] == 8000
    # Before the first file is decoded, half of its points
    assert any(0 < one < 2000 for one in done) and 2000 in done


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("https://van:s3cret@host/a.laz", "https://van:***@host/a.laz"),
        ("https:/van:s3cret@host/a.laz", "https://van:***@host/a.laz"),
        ("https://van:12345@host/a.laz", "https://van:***@host/a.laz"),
        ("http://127.0.0.1:8080/a.laz", "http://127.0.0.1:8080/a.laz"),
        ("http://host:8080", "http://host:8080"),
        ("s3://bucket/a.laz", "s3://bucket/a.laz"),
        ("postgresql://van:8080@host/lines", "postgresql://van:***@host/lines"),
    ],
)
def test_messages_hide_passwords_but_no_ports(written, shown):
    assert str(InputError("no such file", where=written)).startswith(f"{shown}: no such file")
