"""Sources of a batch: globs, folders and files, here and behind URLs."""

import errno
import os
import socket
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from fsspec.implementations.local import LocalFileSystem

from service.errors import InvalidParameter
from service.scale.places import Place, place_of
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

MACS = ("b/c.obj", "b/._c.obj", "__MACOSX/b/._c.obj")


@pytest.mark.parametrize(
    ("folder", "names", "source", "taken"),
    [
        ("in", ("a.obj", "b/c.obj", "b/e.obj"), "in/b/*.obj", ["c.obj", "e.obj"]),
        # What is there is no glob whatever its name.
        *(("in [v2]", ("a?.obj",), f"in [v2]{end}", ["a?.obj"]) for end in ("", "/a?.obj")),
        # What macOS keeps beside files is no mesh.
        *(("in", MACS, source, ["b/c.obj"]) for source in ("in", "in/**/*.obj")),
        # Two colons in a name make no URL of it.
        *(("in", ("r::b.obj",), f"in{end}", ["r::b.obj"]) for end in ("", "/r::b.obj")),
    ],
)
def test_a_source_is_a_folder_a_file_or_what_a_glob_matches(tmp_path, folder, names, source, taken):
    library(tmp_path / folder, names)
    listing = items_of(f"{tmp_path}/{source}", KINDS)
    assert [item.relative for item in listing()] == taken


@pytest.mark.parametrize("source", ["in", "in/**/*.obj"])
def test_results_inside_the_source_are_no_sources(tmp_path, source):
    library(tmp_path / "in", ["a.obj", "refined2/c.obj"])
    (tmp_path / "link").symlink_to(tmp_path / "in")
    for destination in ("in/refined", "link/refined"):
        batch = batch_of(tmp_path, tmp_path / source, destination=str(tmp_path / destination))
        refined(batch)
        assert refined(batch).counts == {"skipped": 2}
    assert set(hashes(tmp_path / "in" / "refined")) == {"a.obj", "refined2/c.obj"}
    # A folder may lie inside that of its results.
    over = batch_of(tmp_path, destination=str(tmp_path), report=tmp_path / "over.jsonl")
    assert set(refined(over).counts) == {"done"}


def test_a_file_that_is_no_mesh_is_told(tmp_path):
    (tmp_path / "list.lst").write_text("a.obj\n")
    with pytest.raises(InvalidParameter, match="a file's name ends in"):
        items_of(str(tmp_path / "list.lst"), KINDS)


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


# Elsewhere


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
def test_http_is_a_source_and_no_destination(tmp_path, web):
    pytest.importorskip("aiohttp", reason="the extra [ray] is not installed")
    assert refined(batch_of(tmp_path, f"{web}/a.obj")).counts == {"done": 1}
    two = {"destination": str(tmp_path / "two"), "report": tmp_path / "2.jsonl"}
    assert refined(batch_of(tmp_path, web, **two)).counts == {"done": 2}
    assert set(hashes(tmp_path / "two").values()) == set(hashes(tmp_path / "out").values())
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


@pytest.mark.filterwarnings("ignore")
def test_s3_is_a_source_and_a_destination(tmp_path, s3):
    import s3fs

    store = s3fs.S3FileSystem(skip_instance_cache=True)
    store.mkdir("meshes")
    for name in ("a.obj", "b/c.obj"):
        store.pipe_file(f"meshes/in/{name}", TETRAHEDRON)
    batch = batch_of(tmp_path, "s3://meshes/in", destination="s3://meshes/out")
    assert refined(batch).counts == {"done": 2}
    assert refined(batch).counts == {"skipped": 2}
    here = library(tmp_path / "in", ["a.obj"])
    refined(batch_of(tmp_path, here, report=tmp_path / "l.jsonl"))
    assert store.cat_file("meshes/out/b/c.obj") == (tmp_path / "out" / "a.obj").read_bytes()


class ForeignError(Exception):
    """As the libraries of object stores raise them."""


class Broken:
    """A file system elsewhere that nobody can reach."""

    protocol = "far"

    def unstrip_protocol(self, path):
        return f"far://{path}"

    def __getattr__(self, name):
        def fails(*_, **__):
            raise ForeignError("no route")

        return fails


@pytest.mark.parametrize(
    "act",
    [
        *(Place.read, Place.is_file, Place.is_folder, Place.matches),
        *(lambda place: place.write(b""), lambda place: list(place.files(print))),
    ],
)
def test_an_error_of_a_library_names_its_file_which_is_not_taken_to_be_gone(act):
    place = Place(Broken(), "a/b.obj")
    with pytest.raises(OSError, match="ForeignError: no route") as refused:
        act(place)
    assert refused.value.filename == "far://a/b.obj"
    assert not place.is_gone()


def test_an_error_of_this_machine_is_its_own_and_no_fault_is_taken_for_a_far_one(tmp_path):
    with pytest.raises(IsADirectoryError) as refused:
        place_of(str(tmp_path)).read()
    assert refused.value.errno == errno.EISDIR

    class BrokenHere(LocalFileSystem):
        isfile = isdir = Broken().isfile

    for ask in (Place.is_file, Place.is_folder):
        with pytest.raises(ForeignError):
            ask(Place(BrokenHere(), "a/b.obj"))
