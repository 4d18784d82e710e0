"""/docs: from files of the package, under a policy that lets no other host in."""

import re
from pathlib import Path

import pytest

from service.http.app import create_app
from service.http.pages import DOCS as FOLDER
from service.http.pages import DOCS_FILES as FILES
from service.http.pages import MEDIA_TYPES
from service.settings import Settings
from tests.support import stand_in_jobs as jobs
from tests.support.live import local


@pytest.fixture(scope="module")
def client():
    return local(create_app(Settings(workers=1), warm_up=jobs.no_warm_up))


def test_the_page_and_all_that_it_names_are_there(client):
    page = client.get("/docs")
    named = re.findall(r'(?:src|href)="(?!data:)([^"]+)"', page.text)
    assert len(named) == 4
    for path in named:
        assert client.get(f"/{path}").status_code == 200, path


@pytest.mark.parametrize("name", FILES)
def test_nothing_of_another_host_may_run(client, name):
    answer = client.get("/docs" if name == "index.html" else f"/docs/{name}")
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
    assert "unsafe" not in policy
    assert "http" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["content-type"] == MEDIA_TYPES[Path(name).suffix]


def test_what_is_written_here_names_no_host():
    for name in ("index.html", "start.js"):
        assert "//" not in re.sub(r"(?m)^ *//.*$", "", (FOLDER / name).read_text())


def test_a_file_that_is_known_is_not_sent_again(client):
    first = client.get("/docs/swagger-ui.css")
    known = client.get("/docs/swagger-ui.css", headers={"If-None-Match": first.headers["etag"]})
    assert (known.status_code, known.content) == (304, b"")
    plain = client.get("/docs/swagger-ui.css", headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.content == first.content == (FOLDER / "swagger-ui.css").read_bytes()


@pytest.mark.parametrize("name", ["LICENSE", "none", "..%2fpages.py", "%2e%2e/pages.py"])
def test_nothing_else_is_served(client, name):
    assert client.get(f"/docs/{name}").status_code == 404


def test_the_licences_are_with_it():
    names = {path.name for path in FOLDER.iterdir()}
    assert {"LICENSE", "NOTICE", "swagger-ui-bundle.js.LICENSE.txt"} <= names
