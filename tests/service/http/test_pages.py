"""The page and `/docs`: what is sent with their files, and that nothing else of the disk is."""

import gzip
import re
from pathlib import Path

import pytest

from service.http.app import create_app
from service.http.pages import DOCS, DOCS_FILES, DOCS_POLICY, MEDIA_TYPES, PAGE, PAGE_POLICY
from service.settings import Settings
from tests.support.live import local

CLIENT = local(create_app(Settings(workers=1)))
ASSETS = sorted((PAGE / "assets").iterdir())
FILES = ["/", *[f"/assets/{asset.name}" for asset in ASSETS]]
FILES += ["/docs", *[f"/docs/{name}" for name in DOCS_FILES]]
ADDRESS = re.compile(r'(?:src|href)="([^"#]+)"')


@pytest.mark.parametrize("prefix", ["", "/tools/pns"])
def test_the_page_names_only_files_that_are_there(prefix):
    """Relative to itself, or under a prefix from the root of the host."""
    client = local(create_app(Settings(workers=1, prefix=prefix)))
    answer = client.get("/")
    addresses = set(ADDRESS.findall(answer.text))
    assert len(addresses) >= 4
    base = f"{prefix}/" if prefix else ""
    assert addresses <= {f"{base}assets/{path.name}" for path in ASSETS}
    assert (answer.headers["ETag"] == CLIENT.get("/").headers["ETag"]) is not bool(prefix)
    assert client.get("/openapi.json").json()["servers"] == [{"url": prefix or "/"}]


@pytest.mark.parametrize("path", FILES)
def test_every_file_comes_with_the_policy_and_its_type(path):
    answer = CLIENT.get(path)
    assert answer.status_code == 200
    assert answer.headers["Content-Security-Policy"].startswith("default-src 'none'; ")
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    suffix = Path(path).suffix or ".html"
    assert answer.headers["Content-Type"] == MEDIA_TYPES[suffix]


@pytest.mark.parametrize("policy", [PAGE_POLICY, DOCS_POLICY])
def test_a_policy_lets_in_no_inline_script_and_no_foreign_address(policy):
    directives = dict(part.split(" ", 1) for part in policy.split("; "))
    assert directives["default-src"] == directives["frame-ancestors"] == "'none'"
    assert directives["script-src"].removesuffix(" 'wasm-unsafe-eval'") == "'self'"
    assert directives["connect-src"].removesuffix(" blob:") == "'self'"
    assert not re.search(r"https?:|\*|unsafe-inline|'unsafe-eval'", policy)


def test_the_page_is_asked_for_again_and_its_assets_never():
    assert CLIENT.get("/").headers["Cache-Control"] == "no-cache"
    asset = CLIENT.get(f"/assets/{ASSETS[0].name}")
    assert "immutable" in asset.headers["Cache-Control"]
    assert re.search(r"-[0-9A-Za-z]{8}\.\w+$", ASSETS[0].name)


@pytest.mark.parametrize("path", ["/", f"/assets/{ASSETS[0].name}", "/docs/swagger-ui.css"])
def test_a_client_that_has_the_file_gets_no_bytes(path):
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
def test_a_client_that_takes_gzip_gets_it(accepted, packed):
    with CLIENT.stream("GET", "/", headers={"Accept-Encoding": accepted}) as answer:
        assert (answer.headers.get("Content-Encoding") == "gzip") is packed
        sent = b"".join(answer.iter_raw())
    content = gzip.decompress(sent) if packed else sent
    assert content == (PAGE / "index.html").read_bytes()


@pytest.mark.parametrize(
    "name", ["", "nothing.js", "..%2Findex.html", "..%2F..%2Fcli.py", "%2Fetc%2Fpasswd", "LICENSE"]
)
@pytest.mark.parametrize("folder", ["assets", "docs"])
def test_a_file_that_is_none_of_the_pages_is_not_found(folder, name):
    answer = CLIENT.get(f"/{folder}/{name}")
    assert answer.status_code == 404
    assert answer.headers["Content-Type"] == "application/problem+json"


def test_the_first_visit_loads_less_than_350_kb():
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


def test_the_description_and_all_that_it_names_are_there_with_their_licences():
    named = re.findall(r'(?:src|href)="(?!data:)([^"]+)"', CLIENT.get("/docs").text)
    assert len(named) == 4
    for path in named:
        assert CLIENT.get(f"/{path}").status_code == 200, path
    licences = {"LICENSE", "NOTICE", "swagger-ui-bundle.js.LICENSE.txt"}
    assert licences <= {path.name for path in DOCS.iterdir()}
