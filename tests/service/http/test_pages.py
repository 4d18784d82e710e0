"""The page and `/docs`: what is sent with their files, and that nothing else of the disk is."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from service.http.app import create_app
from service.http.pages import DOCS, DOCS_FILES, MEDIA_TYPES, PAGE, PAGE_POLICY
from service.settings import Settings
from tests.support.live import local

CLIENT = local(create_app(Settings(workers=1)))
ASSETS = sorted((PAGE / "assets").iterdir())
ADDRESS = re.compile(r'(?:src|href)="([^"#]+)"')


def test_the_page_names_only_files_that_are_there_relative_to_itself() -> None:
    addresses = set(ADDRESS.findall(CLIENT.get("/").text))
    assert len(addresses) >= 4
    assert addresses <= {f"assets/{path.name}" for path in ASSETS}


def test_under_a_prefix_the_page_names_its_files_from_the_root_of_the_host() -> None:
    client = local(create_app(Settings(workers=1, prefix="/tools/pns")))
    answer = client.get("/")
    addresses = set(ADDRESS.findall(answer.text))
    assert len(addresses) >= 4
    assert addresses <= {f"/tools/pns/assets/{path.name}" for path in ASSETS}
    assert answer.headers["ETag"] != CLIENT.get("/").headers["ETag"]
    assert client.get("/openapi.json").json()["servers"] == [{"url": "/tools/pns"}]


@pytest.mark.parametrize("prefix", ["/", "tools", "/tools/", '/"onload', "//other.example"])
def test_a_prefix_is_a_path_without_a_slash_at_its_end(prefix: str) -> None:
    with pytest.raises(ValidationError, match="prefix"):
        Settings(prefix=prefix)


@pytest.mark.parametrize("path", ["/", *[f"/assets/{asset.name}" for asset in ASSETS]])
def test_every_file_comes_with_the_policy_and_its_type(path: str) -> None:
    answer = CLIENT.get(path)
    assert answer.status_code == 200
    assert answer.headers["Content-Security-Policy"].startswith("default-src 'none'; ")
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    suffix = Path(path).suffix or ".html"
    assert answer.headers["Content-Type"] == MEDIA_TYPES[suffix]


def test_the_policy_lets_in_no_inline_script_and_no_foreign_address() -> None:
    directives = dict(part.split(" ", 1) for part in PAGE_POLICY.split("; "))
    assert directives["default-src"] == directives["frame-ancestors"] == "'none'"
    assert directives["script-src"] == "'self' 'wasm-unsafe-eval'"
    assert directives["connect-src"] == "'self' blob:"
    assert not re.search(r"https?:|\*|unsafe-inline|'unsafe-eval'", PAGE_POLICY)


def test_the_page_is_asked_for_again_and_its_assets_never() -> None:
    assert CLIENT.get("/").headers["Cache-Control"] == "no-cache"
    asset = CLIENT.get(f"/assets/{ASSETS[0].name}")
    assert "immutable" in asset.headers["Cache-Control"]
    assert re.search(r"-[0-9A-Za-z]{8}\.\w+$", ASSETS[0].name)


@pytest.mark.parametrize("path", ["/", f"/assets/{ASSETS[0].name}", "/docs/swagger-ui.css"])
def test_a_client_that_has_the_file_gets_no_bytes(path: str) -> None:
    tag = CLIENT.get(path).headers["ETag"]
    # A strong one would be the same bytes: it is one for what is compressed and what is not.
    assert tag.startswith('W/"')
    for known in (tag, tag.removeprefix("W/"), f'"other", {tag}', "*"):
        answer = CLIENT.get(path, headers={"If-None-Match": known})
        assert (answer.status_code, answer.content) == (304, b"")
        assert answer.headers["ETag"] == tag
    assert CLIENT.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


@pytest.mark.parametrize(
    ("accepted", "packed"),
    [
        *[("gzip", True), ("br, GZIP", True), ("gzip;q=0.5", True), ("gzip;q=1.0,br;q=0.6", True)],
        *[("gzip;q=0", False), ("gzip; q=0.000", False), ("br", False)],
    ],
)
def test_a_client_that_takes_gzip_gets_it(accepted: str, packed: bool) -> None:
    with CLIENT.stream("GET", "/", headers={"Accept-Encoding": accepted}) as answer:
        assert (answer.headers.get("Content-Encoding") == "gzip") is packed
        sent = b"".join(answer.iter_raw())
    content = gzip.decompress(sent) if packed else sent
    assert content == (PAGE / "index.html").read_bytes()


@pytest.mark.parametrize(
    "name", ["", "nothing.js", "..%2Findex.html", "..%2F..%2Fcli.py", "%2Fetc%2Fpasswd", "."]
)
def test_a_file_that_is_none_of_the_pages_is_not_found(name: str) -> None:
    answer = CLIENT.get(f"/assets/{name}")
    assert answer.status_code == 404
    assert answer.headers["Content-Type"] == "application/problem+json"


def test_head_answers_like_get_without_a_body() -> None:
    assert CLIENT.head("/").headers["ETag"] == CLIENT.get("/").headers["ETag"]
    assert CLIENT.head("/").content == b""


def test_the_first_visit_loads_less_than_350_kb() -> None:
    # The entry and what it imports at once; validator, decoders and readers wait until needed.
    text = {path.name: path.read_text() for path in ASSETS if path.suffix == ".js"}
    (entry,) = [name for name in text if name.startswith("main-")]
    needed, waiting = set[str](), [entry]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting += re.findall(r'(?:from|import)"\./([^"]+\.js)"', text[name])
    needed |= {path.name for path in ASSETS if path.suffix in (".css", ".svg")}
    sizes = [len(gzip.compress((PAGE / "assets" / name).read_bytes())) for name in needed]
    index = len(gzip.compress((PAGE / "index.html").read_bytes()))
    assert len(needed) > 3
    assert sum(sizes) + index < 350_000


def test_the_description_and_all_that_it_names_are_there() -> None:
    named = re.findall(r'(?:src|href)="(?!data:)([^"]+)"', CLIENT.get("/docs").text)
    assert len(named) == 4
    for path in named:
        assert CLIENT.get(f"/{path}").status_code == 200, path


@pytest.mark.parametrize("name", DOCS_FILES)
def test_in_the_description_nothing_of_another_host_may_run(name: str) -> None:
    answer = CLIENT.get("/docs" if name == "index.html" else f"/docs/{name}")
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
    assert not re.search("unsafe|http", policy)
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["content-type"] == MEDIA_TYPES[Path(name).suffix]


def test_what_is_written_for_the_description_names_no_host() -> None:
    for name in ("index.html", "start.js"):
        assert "//" not in re.sub(r"(?m)^ *//.*$", "", (DOCS / name).read_text())


@pytest.mark.parametrize("name", ["LICENSE", "none", "..%2fpages.py", "%2e%2e/pages.py"])
def test_beside_the_description_nothing_is_served(name: str) -> None:
    assert CLIENT.get(f"/docs/{name}").status_code == 404


def test_the_licences_are_with_it() -> None:
    names = {path.name for path in DOCS.iterdir()}
    assert {"LICENSE", "NOTICE", "swagger-ui-bundle.js.LICENSE.txt"} <= names
