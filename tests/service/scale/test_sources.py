"""Sources of a batch: globs, folders and files, here and behind URLs."""

import errno
import os
import socket
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from service.errors import InvalidParameter
from service.scale.sources import items_of
from tests.service.scale.libraries import (
    KINDS,
    TETRAHEDRON,
    batch_of,
    hashes,
    library,
    refined,
    rows,
)


def test_a_glob_takes_what_it_matches(tmp_path):
    library(tmp_path / "in", ["a.obj", "b/c.obj", "b/e.obj"])
    listing = items_of(f"{tmp_path}/in/b/*.obj", KINDS)
    assert [item.relative for item in listing()] == ["c.obj", "e.obj"]


@pytest.mark.parametrize("source", ["in [v2]", "in [v2]/a?.obj"])
def test_what_is_there_is_no_glob_whatever_its_name(tmp_path, source):
    library(tmp_path / "in [v2]", ["a?.obj"])
    listing = items_of(f"{tmp_path}/{source}", KINDS)
    assert [item.relative for item in listing()] == ["a?.obj"]


@pytest.mark.parametrize("source", ["in", "in/**/*.obj"])
def test_what_macos_keeps_beside_files_is_no_mesh(tmp_path, source):
    library(tmp_path / "in", ["b/c.obj", "b/._c.obj", "__MACOSX/b/._c.obj"])
    listing = items_of(f"{tmp_path}/{source}", KINDS)
    assert [item.relative for item in listing()] == ["b/c.obj"]


@pytest.mark.parametrize("source", ["in", "in/rig::body.obj"])
def test_two_colons_in_a_name_make_no_url_of_it(tmp_path, source):
    library(tmp_path / "in", ["rig::body.obj"])
    assert refined(batch_of(tmp_path, tmp_path / source)).counts == {"done": 1}


@pytest.mark.parametrize("source", ["in", "in/**/*.obj"])
def test_results_inside_the_source_are_no_sources(tmp_path, source):
    library(tmp_path / "in", ["a.obj", "refined2/c.obj"])
    (tmp_path / "link").symlink_to(tmp_path / "in")
    for destination in ("in/refined", "link/refined"):
        batch = batch_of(tmp_path, tmp_path / source, destination=str(tmp_path / destination))
        refined(batch)
        assert refined(batch).counts == {"skipped": 2}
    assert set(hashes(tmp_path / "in" / "refined")) == {"a.obj", "refined2/c.obj"}


def test_a_folder_may_lie_inside_that_of_its_results(tmp_path):
    library(tmp_path / "in", ["a.obj"])
    assert refined(batch_of(tmp_path, destination=str(tmp_path))).counts == {"done": 1}


def test_a_file_that_is_no_mesh_is_told(tmp_path):
    (tmp_path / "list.lst").write_text("a.obj\n")
    with pytest.raises(InvalidParameter, match="a file's name ends in"):
        items_of(str(tmp_path / "list.lst"), KINDS)


@pytest.fixture
def web(tmp_path):
    """A folder served over HTTP; its URL."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    folder = library(tmp_path / "served", ["a.obj", "b/c.obj"])
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


@pytest.mark.filterwarnings("ignore")
def test_http_is_a_source(tmp_path, web):
    pytest.importorskip("aiohttp", reason="the extra [ray] is not installed")
    assert refined(batch_of(tmp_path, f"{web}/a.obj")).counts == {"done": 1}
    by_folder = batch_of(
        tmp_path, web, destination=str(tmp_path / "two"), report=tmp_path / "2.jsonl"
    )
    assert refined(by_folder).counts == {"done": 2}
    assert set(hashes(tmp_path / "two").values()) == set(hashes(tmp_path / "out").values())


def test_http_is_no_destination(tmp_path):
    pytest.importorskip("aiohttp", reason="the extra [ray] is not installed")
    library(tmp_path / "in")
    with pytest.raises(InvalidParameter, match="nothing can be written"):
        refined(batch_of(tmp_path, destination="http://127.0.0.1:1/out"))


@pytest.mark.parametrize("source", ["nowhere://x/y", "az-none://a"])
def test_a_url_that_no_file_system_takes_is_told(tmp_path, source):
    with pytest.raises(InvalidParameter, match=source):
        refined(batch_of(tmp_path, source))


@pytest.fixture
def s3(monkeypatch):
    server = pytest.importorskip("moto.server", reason="moto is not installed")
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    running.start()
    yield
    running.stop()


def test_a_folder_that_cannot_be_listed_costs_its_own_files_and_is_told(tmp_path, monkeypatch):
    library(tmp_path / "in", ["a.obj", "private/b.obj", "z.obj"])

    def scandir(path, real=os.scandir):
        if str(path).endswith("private"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return real(path)

    monkeypatch.setattr(os, "scandir", scandir)
    batch = batch_of(tmp_path)
    summary = refined(batch)
    assert summary.counts == {"done": 2, "failed": 1}
    assert summary.failures == [("unreadable-folder", 1)]
    assert sorted(rows(batch)) == ["a.obj", "z.obj"]
    monkeypatch.undo()
    assert refined(batch).counts == {"done": 1, "skipped": 2}


@pytest.mark.filterwarnings("ignore")
def test_s3_is_a_source_and_a_destination(tmp_path, s3):
    import s3fs

    store = s3fs.S3FileSystem(skip_instance_cache=True)
    store.mkdir("meshes")
    store.pipe_file("meshes/in/a.obj", TETRAHEDRON)
    store.pipe_file("meshes/in/b/c.obj", TETRAHEDRON)
    batch = batch_of(tmp_path, "s3://meshes/in", destination="s3://meshes/out")
    assert refined(batch).counts == {"done": 2}
    assert refined(batch).counts == {"skipped": 2}
    local_batch = batch_of(
        tmp_path, library(tmp_path / "in", ["a.obj"]), report=tmp_path / "l.jsonl"
    )
    refined(local_batch)
    assert store.cat_file("meshes/out/b/c.obj") == (tmp_path / "out" / "a.obj").read_bytes()
