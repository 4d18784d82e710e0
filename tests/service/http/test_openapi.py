"""The description of the service, and the clients that generators make of it."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

import httpx2
import pytest

from service.gltf.read.container import read_glb
from service.http.app import create_app
from service.meshfiles.example import part_glb
from service.options import Options
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


def test_choices_on_the_page_are_those_of_the_options():
    page = (ROOT / "docs" / "reference" / "http.md").read_text()
    for name, hint in get_type_hints(Options).items():
        if get_origin(hint) is Literal:
            row = re.search(rf"\| `{name}` \| (.*) \|", page)
            assert row
            assert {*re.findall("`([a-z-]+)`", row[1])} == {*get_args(hint)}, name


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


def run(*command, folder):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def described(document, tmp_path):
    """A folder with the description and a file to send."""
    (tmp_path / "openapi.json").write_text(json.dumps(document))
    (tmp_path / "part.glb").write_bytes(part_glb())
    return tmp_path


def test_the_generated_python_client_works(described, address):
    tool = generator()
    # Formatting what was made is for people.
    (described / "config.yml").write_text("post_hooks: []\n")
    options = "generate --path openapi.json --config config.yml --meta none"
    run(tool, *options.split(), "--output-path", "generated", folder=described)
    client = SUPPORT / "python_client.py"
    files = "part.glb", "refined.glb"
    said = run(tool.with_name("python"), client, described, address, *files, folder=described)
    seen = json.loads(said)
    check(seen, described / "refined.glb")
    # The bytes alone, without a form around them.
    assert seen["raw"] is True


def test_the_generated_typescript_client_works(described, address):
    node_tools.install()
    (described / "node_modules").symlink_to(node_tools.FOLDER / "node_modules")
    (described / "package.json").write_text('{"type": "module"}')
    (described / "client.mts").write_bytes((node_tools.FOLDER / "client.mts").read_bytes())
    tools = described / "node_modules" / ".bin"
    options = "--strict --target es2022 --module nodenext --lib es2022 --types node --skipLibCheck"
    options += " --rewriteRelativeImportExtensions client.mts"
    made = "openapi.json", "--output", "openapi.d.ts"
    run(tools / "openapi-typescript", *made, folder=described)
    run(tools / "tsc", *options.split(), folder=described)
    said = run("node", "client.mjs", address, "part.glb", "refined.glb", folder=described)
    check(json.loads(said), described / "refined.glb")
