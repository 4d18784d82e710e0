"""The reference names every setting, and shows what GET /models answers."""

import json
import re
import shutil
import socket
import subprocess
import threading
from dataclasses import asdict
from pathlib import Path

import pytest

from pns_common import load_model
from service.errors import ServiceError
from service.http import routes  # noqa: F401  (every error's class)
from service.http.openapi import Progress
from service.http.server import HEAD_BYTES
from service.http.watch.journal import GONE
from service.settings import Settings
from service.workers.models import ModelEntry
from tests.support.live import served

ROOT = Path(__file__).resolve().parents[2]
SETTINGS, PAGE = (
    (ROOT / "docs" / "reference" / f"{name}.md").read_text() for name in ("settings", "http")
)
DOCKERFILE = (ROOT / "Dockerfile").read_text()


@pytest.mark.parametrize("name", sorted(Settings.model_fields))
def test_every_setting_is_on_the_page(name):
    assert f"`PNS_{name.upper()}`" in SETTINGS


@pytest.mark.parametrize(("name", "value"), re.findall(r"PNS_([A-Z_]+)=(\S+)", DOCKERFILE))
def test_what_the_container_has_otherwise_is_on_the_page(name, value):
    default = Settings.model_fields[name.lower()].default
    (row,) = re.findall(rf"^\|[^|]*`PNS_{name}`.*", SETTINGS, re.MULTILINE)
    container = re.findall(r"\(container: ([^)]*)\)", row)
    assert value == str(default) or value in container[0].split(", ")


def test_the_list_of_models_has_the_fields_of_the_example():
    models, _ = examples()
    assert all(set(entry) <= set(ModelEntry.model_fields) for entry in models)


def test_the_example_of_a_model_is_true_of_it():
    ((said, *_), _) = examples()
    model = load_model(said["name"])
    true = {"hash": f"{model.hash[:4]}…", "size": model.size} | asdict(model.card)
    # Of these it has the beginnings.
    assert said.pop("training").items() <= true.pop("training").items()
    assert said.pop("metrics").keys() == true.pop("metrics").keys()
    assert said.items() <= (true | {"name": model.name, "default": False}).items()


def test_the_example_of_progress_has_its_fields():
    _, progress = examples()
    assert set(progress) == set(Progress.model_fields)


def errors(cls=ServiceError):
    """Yield the statuses of the service's errors."""
    yield cls.status
    for kind in cls.__subclasses__():
        yield from errors(kind)


def test_every_status_of_an_error_is_on_the_page():
    listed = {
        int(status)
        for row in re.findall(r"^\| ([\d, ]+) \|", PAGE, re.MULTILINE)
        for status in row.split(",")
    }
    # 499 is of those who are gone, for the log alone.
    assert (set(errors()) | {405}) - {GONE} <= listed
    assert f"status {GONE}" in PAGE
    assert f"{HEAD_BYTES // 1024} KiB" in PAGE


def examples():
    return [json.loads(text) for text in re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)]


def test_the_python_example_reads_a_stream_and_notices_one_that_is_cut_off():
    (code,) = re.findall(r"```python\n(import contextlib.*?)```", PAGE, re.DOTALL)
    example = {"__name__": "example"}
    exec(code, example)
    with served(workers=1) as (host, port):
        parts = list(example["refine"](host, port, "/subdivide", b"echo"))
        assert parts[-2:] == [("file", b"echo"), ("report", b"echo")]
        ((name, problem),) = [
            part
            for part in example["refine"](host, port, "/subdivide", b"die")
            if part[0] != "progress"
        ]
        assert (name, json.loads(problem)["code"]) == ("problem", "worker-died")
    # A service that ends in the middle.
    with socket.create_server(("127.0.0.1", 0)) as listening:
        ending = threading.Thread(target=ends_early, args=(listening,))
        ending.start()
        with pytest.raises(EOFError):
            list(example["refine"](*listening.getsockname(), "/subdivide", b"echo"))
        ending.join()


def ends_early(listening):
    """Answer with half a stream."""
    connection, _ = listening.accept()
    with connection:
        connection.recv(2**16)
        head = "HTTP/1.1 200 OK\r\nContent-Type: multipart/mixed; boundary=b\r\n\r\n"
        part = "--b\r\nContent-Description: progress\r\n\r\n{}"
        connection.sendall((head + part).encode())


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_javascript_example_reads_a_stream_too(tmp_path):
    (code,) = re.findall(r"```js\n(.*?)```", PAGE, re.DOTALL)
    script = tmp_path / "example.mjs"
    script.write_text(
        code + "\nconst seen = [];\n"
        "await refine(process.argv[2], 'echo', (name, bytes) =>"
        " seen.push(name === 'progress' ? name : name + ':' + new TextDecoder().decode(bytes)));\n"
        "console.log(JSON.stringify(seen));\n"
    )
    with served(workers=1) as (host, port):
        command = ["node", str(script), f"http://{host}:{port}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)[-2:] == ["file:echo", "report:echo"]
