"""Sources of a batch: manifests, globs and folders, here and behind URLs."""

import errno
import json
import os
import socket
import sys
import threading
import tracemalloc
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from rich.console import Console

from service.errors import InvalidParameter
from service.scale.batch import run_batch
from service.scale.job import SKIPPED, Row
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


@pytest.mark.parametrize("ending", ["txt", "csv", "jsonl", "parquet"])
def test_manifests_name_files_beside_them(tmp_path, ending):
    library(tmp_path, ["x/a.obj", "b.obj"])
    names = ["x/a.obj", "b.obj"]
    manifest = tmp_path / f"list.{ending}"
    if ending == "parquet":
        arrow = pytest.importorskip("pyarrow", reason="the extra [ray] is not installed")
        parquet = pytest.importorskip("pyarrow.parquet")
        parquet.write_table(arrow.table({"path": names, "size": [1, 2]}), manifest)
    else:
        manifest.write_text(
            {
                "txt": "# two files\nx/a.obj\n\nb.obj\n",
                "csv": "size,path\n1,x/a.obj\n2,b.obj\n",
                "jsonl": "".join(json.dumps({"path": name}) + "\n" for name in names),
            }[ending]
        )
    assert refined(batch_of(tmp_path, manifest)).counts == {"done": 2}
    assert set(hashes(tmp_path / "out")) == set(names)


def test_a_glob_takes_what_it_matches(tmp_path):
    library(tmp_path / "in", ["a.obj", "b/c.obj", "b/e.obj"])
    listing = items_of(f"{tmp_path}/in/b/*.obj", KINDS)
    assert [item.relative for item in listing()] == ["c.obj", "e.obj"]


@pytest.mark.parametrize("source", ["in [v2]", "in [v2]/a?.obj", "in [v2]/*.txt"])
def test_what_is_there_is_no_glob_whatever_its_name(tmp_path, source):
    library(tmp_path / "in [v2]", ["a?.obj"])
    (tmp_path / "in [v2]" / "*.txt").write_text("a?.obj\n")
    listing = items_of(f"{tmp_path}/{source}", KINDS)
    assert [item.relative for item in listing()] == ["a?.obj"]


@pytest.mark.parametrize("source", ["in", "in/**/*.obj"])
def test_what_macos_keeps_beside_files_is_no_mesh(tmp_path, source):
    library(tmp_path / "in", ["b/c.obj", "b/._c.obj", "__MACOSX/b/._c.obj"])
    listing = items_of(f"{tmp_path}/{source}", KINDS)
    assert [item.relative for item in listing()] == ["b/c.obj"]


@pytest.mark.parametrize("source", ["in", "list.txt"])
def test_two_colons_in_a_name_make_no_url_of_it(tmp_path, source):
    library(tmp_path / "in", ["rig::body.obj"])
    (tmp_path / "list.txt").write_text("in/rig::body.obj\n")
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


@pytest.mark.parametrize(
    "line", ["../../up.obj", "/etc/passwd.obj", "a/../../../b.obj", "memory://x/c.obj"]
)
def test_no_manifest_leads_a_result_out_of_its_folder(tmp_path, line):
    manifest = tmp_path / "list.txt"
    manifest.write_text(f"{line}\n")
    (item,) = items_of(str(manifest), KINDS)()
    assert not item.relative.startswith(("/", ".."))
    assert "/../" not in item.relative


def test_a_driver_holds_no_row_of_a_long_manifest(tmp_path):
    count = 5000
    with (tmp_path / "list.txt").open("w") as file:
        file.writelines(f"folder/file-{number}.obj\n" for number in range(count))
    batch = batch_of(tmp_path, tmp_path / "list.txt", dry=True)

    def skipped(tasks):
        return ([Row(task.url, task.output, SKIPPED)] for task in tasks)

    with Path(os.devnull).open("w") as nowhere:
        tracemalloc.start()
        try:
            summary = run_batch(batch, skipped, Console(file=nowhere))
            assert tracemalloc.get_traced_memory()[1] < 500_000
        finally:
            tracemalloc.stop()
    assert summary.counts == {"skipped": count}


@pytest.mark.parametrize("text", ["size\n1\n", "path\n\n"])
def test_a_manifest_without_paths_is_told(tmp_path, text):
    (tmp_path / "list.csv").write_text("other\nx\n" if text == "size\n1\n" else text)
    listing = items_of(str(tmp_path / "list.csv"), KINDS)
    if text == "size\n1\n":
        with pytest.raises(InvalidParameter):
            list(listing())
    else:
        assert list(listing()) == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("list.jsonl", b'{"path": "a.obj"}\n{'),
        ("list.jsonl", b"[1]\n"),
        ("list.csv", b"\xff\xfe\x00"),
        ("list.parquet", b"no parquet"),
    ],
)
def test_a_manifest_that_is_none_is_told(tmp_path, name, text):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="the extra [ray] is not installed")
    (tmp_path / name).write_bytes(text)
    with pytest.raises(InvalidParameter, match=name):
        list(items_of(str(tmp_path / name), KINDS)())


def test_a_file_that_is_neither_mesh_nor_manifest_is_told(tmp_path):
    (tmp_path / "list.lst").write_text("a.obj\n")
    with pytest.raises(InvalidParameter, match="a manifest's name ends in"):
        items_of(str(tmp_path / "list.lst"), KINDS)


def test_a_parquet_manifest_needs_a_column_of_paths_and_what_reads_it(tmp_path, monkeypatch):
    arrow = pytest.importorskip("pyarrow", reason="the extra [ray] is not installed")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(arrow.table({"size": [1]}), tmp_path / "list.parquet")
    with pytest.raises(InvalidParameter, match="no column 'path'"):
        list(items_of(str(tmp_path / "list.parquet"), KINDS)())
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(InvalidParameter, match=r"pns-subdivision\[ray\]"):
        list(items_of(str(tmp_path / "list.parquet"), KINDS)())


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
    # Over HTTP, a text that holds links could be taken for a folder.
    (tmp_path / "served" / "list.txt").write_text(f"b/c.obj\n{web}/a.obj\n")
    made = refined(batch_of(tmp_path, f"{web}/list.txt"))
    assert made.counts == {"done": 2}
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


def test_a_file_that_a_manifest_names_twice_is_refined_once(tmp_path):
    library(tmp_path, ["a.obj", "b.obj"])
    (tmp_path / "list.txt").write_text("a.obj\nb.obj\n./a.obj\n")
    assert refined(batch_of(tmp_path, tmp_path / "list.txt")).counts == {"done": 2}


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
