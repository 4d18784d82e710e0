"""The description of the service, and the clients that generators make of it."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import httpx2
import pytest

from service.gltf.read.container import read_glb
from service.http.app import create_app
from service.meshfiles.example import part_glb
from service.settings import Settings
from service.workers.jobs import subdivide
from tests.support import node_tools
from tests.support import stand_in_jobs as jobs
from tests.support.live import local, served, until

ROOT = Path(__file__).resolve().parents[3]
SUPPORT = ROOT / "tests" / "support"


@pytest.fixture(scope="module")
def document():
    app = create_app(Settings(workers=1), warm_up=jobs.no_warm_up)
    return local(app).get("/openapi.json").json()


@pytest.fixture(scope="module")
def address():
    """A server that really refines."""
    with served(subdivide, warm_up=None, workers=1) as (host, port):
        url = f"http://{host}:{port}"
        until(lambda: httpx2.get(f"{url}/readyz").status_code == 200)
        yield url


def operations(document):
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def test_operations_have_names_of_their_own(document):
    names = [operation["operationId"] for _, operation in operations(document)]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch("[a-z]+(_[a-z]+)*", name) for name in names)
    assert {"subdivide", "report", "limits", "models"} <= set(names)


def test_every_route_says_what_it_does_and_stands_on_the_page(document):
    page = (ROOT / "docs" / "reference" / "http.md").read_text()
    for name, operation in operations(document):
        # Without one it is made of the name.
        assert operation["summary"].lower() != operation["operationId"].replace("_", " "), name
        assert f"| `{name}" in page or f", `{name}" in page, name


def test_every_operation_says_what_any_route_may_answer(document):
    problem = {"schema": {"$ref": "#/components/schemas/Problem"}}
    for name, operation in operations(document):
        is_probe = "probes" in operation.get("tags", ())
        assert is_probe or {"401", "429", "503"} <= set(operation["responses"]), name
        assert operation["security"] == ([] if is_probe else [{}, {"key": []}]), name
        for status, answer in operation["responses"].items():
            told = set(answer["headers"])
            assert "X-Request-ID" in told, (name, status)
            assert ("Retry-After" in told) == (status in ("429", "503")), (name, status)
            assert ("WWW-Authenticate" in told) == (status == "401"), (name, status)
            if int(status) >= 400:
                assert answer["content"] == {"application/problem+json": problem}, (name, status)
    assert "HTTPValidationError" not in document["components"]["schemas"]
    assert json.dumps(document).count('"JSON pointer of the offending value"') == 1
    assert document["servers"] == [{"url": "/"}]


def test_every_reference_leads_somewhere(document):
    text = json.dumps(document)
    for name in re.findall(r'"#/components/schemas/(\w+)"', text):
        assert name in document["components"]["schemas"], name


def test_one_operation_has_one_kind_of_answer(document):
    for name, operation in operations(document):
        kinds = operation["responses"]["200"].get("content", {}).values()
        assert len({kind["schema"].get("format", "json") for kind in kinds}) <= 1, name
    file = document["paths"]["/subdivide"]["post"]["responses"]["200"]["content"]
    # Generators take the first that they know.
    assert list(file)[:2] == ["application/octet-stream", "model/gltf-binary"]


def generator():
    """openapi-python-client, from where `make` puts it or from the path."""
    program = ROOT / ".venv-clients" / "bin" / "openapi-python-client"
    program = str(program) if program.exists() else shutil.which("openapi-python-client")
    if program is None:
        pytest.skip("needs openapi-python-client (requirements/clients.txt)")
    return Path(program)


def check(seen, output):
    assert seen["scheme"] in ("loop", "pns")
    assert seen["problem"] == "invalid-parameter"
    assert seen["body_bytes"] == Settings().body
    assert "paper" in seen["models"]
    assert b'"pns"' in read_glb(output.read_bytes()).text


def test_the_generated_python_client_works(document, address, tmp_path):
    tool = generator()
    described = tmp_path / "openapi.json"
    described.write_text(json.dumps(document))
    source, output = tmp_path / "part.glb", tmp_path / "refined.glb"
    source.write_bytes(part_glb())
    config = tmp_path / "config.yml"
    # Formatting what was made is for people.
    config.write_text("post_hooks: []\n")
    command = [tool, "generate", "--path", described, "--config", config, "--meta", "none"]
    made = [*command, "--output-path", tmp_path / "generated"]
    subprocess.run(made, check=True, capture_output=True, cwd=tmp_path)
    python = tool.with_name("python")
    run = [python, SUPPORT / "python_client.py", tmp_path, address, source, output]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    check(seen, output)
    # The bytes alone, without a form around them.
    assert seen["raw"] is True


def test_the_generated_typescript_client_works(document, address, tmp_path):
    node_tools.install()
    (tmp_path / "node_modules").symlink_to(node_tools.FOLDER / "node_modules")
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "openapi.json").write_text(json.dumps(document))
    (tmp_path / "client.mts").write_bytes((node_tools.FOLDER / "client.mts").read_bytes())
    source, output = tmp_path / "part.glb", tmp_path / "refined.glb"
    source.write_bytes(part_glb())
    tools = tmp_path / "node_modules" / ".bin"
    compile_ = "--strict --target es2022 --module nodenext --lib es2022 --types node --skipLibCheck"
    for command in (
        [tools / "openapi-typescript", "openapi.json", "--output", "openapi.d.ts"],
        [tools / "tsc", *compile_.split(), "--rewriteRelativeImportExtensions", "client.mts"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    run = ["node", "client.mjs", address, source, output]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    check(json.loads(done.stdout), output)
