"""Clients by their addresses behind proxies, and by their keys."""

import http.client
import logging
import re
from contextlib import closing

import httpx2
import pytest
from starlette.responses import PlainTextResponse

from service.http.access.keys import Entry, KeysError, hash_of, new_key
from service.http.access.keys import toml_entry as written
from service.http.access.origins import Origins
from service.http.app import create_app
from service.http.problems import Checked
from service.settings import Settings
from tests.support.live import GLB, local, obeying, served


@pytest.mark.parametrize(
    ("proxies", "forwarded", "address"),
    [
        ("", "192.0.2.9", "127.0.0.1"),
        ("10.0.0.0/8", "192.0.2.9", "127.0.0.1"),
        ("127.0.0.0/8", "192.0.2.9", "192.0.2.9"),
        # The client's own word, then what two proxies saw.
        ("127.0.0.0/8,10.0.0.3", "198.51.100.1, 192.0.2.9, 10.0.0.3", "192.0.2.9"),
        ("127.0.0.1", "[2001:db8::1]:4711", "2001:db8::1"),
    ],
)
def test_only_a_named_proxy_is_believed(proxies, forwarded, address, caplog):
    with (
        caplog.at_level(logging.INFO),
        served(workers=1, proxies=proxies) as where,
        httpx2.Client(base_url=f"http://{where[0]}:{where[1]}") as client,
    ):
        client.get("/healthz", headers={"X-Forwarded-For": forwarded})
    lines = [record.fields for record in caplog.records if record.name == "pns.request"]
    assert [line["client"] for line in lines] == [address]


# Keys

KEY = "pns_studio_" + "k" * 43
OTHER = "pns_farm_" + "f" * 43


@pytest.fixture(scope="module")
def keys_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("keys") / "keys.toml"
    entries = [
        Entry(name="studio", hash=hash_of(KEY)),
        Entry(name="farm", hash=hash_of(OTHER), faces_per_minute=4000),
    ]
    path.write_text("\n\n".join(map(written, entries)))
    return path


@pytest.fixture(scope="module")
def client(keys_file):
    with obeying(keys_file=keys_file) as opened:
        yield opened


def bearer(key):
    return {"Authorization": f"Bearer {key}"}


def test_of_a_key_of_256_random_bits_a_hash_is_kept():
    first, second = new_key("studio"), new_key("studio")
    assert first != second
    assert len(first) == len("pns_studio_") + 43
    for name in ("", "-a", "A", "a_b", "a" * 64, "a b", 'a"'):
        with pytest.raises(KeysError, match="a name is"):
            new_key(name)
    # As `printf %s KEY | sha256sum` writes it: FIPS 180's first example.
    of_abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert hash_of("abc") == f"sha256:{of_abc}"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "key: Field required; it holds"),
        ("key = []", "key: .* 1 item"),
        ("[[key]]\nname = 'a'\nhash = 'plain'", r"PNS_KEYS_FILE: .* key\.1\.hash"),
        ("[[key]]\nname = 'A'\nhash = 'plain'", "name"),
        ("[[keys]]\nname = 'a'", r"holds \[\[key\]\]"),
        ("ENTRY\ncolour = 1", "colour"),
        ("not toml", "keys.toml"),
        ("# Schl\xfcssel\n", r"keys\.toml: .*utf-8"),
        ("ENTRY\nENTRY", "two entries have one hash"),
        ("ENTRY\nfaces_per_minute = inf", "faces_per_minute"),
        ("ENTRY\nfaces_per_minute = 0", "faces_per_minute"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_at_start(tmp_path, text, reason):
    entry = written(Entry(name="a", hash=hash_of("x")))
    path = tmp_path / "keys.toml"
    path.write_text(text.replace("ENTRY", entry), encoding="latin-1")
    with pytest.raises(KeysError, match=reason):
        create_app(Settings(workers=1, keys_file=path))


def test_while_a_key_is_replaced_both_are_keys_of_one_client(tmp_path, caplog):
    path = tmp_path / "keys.toml"
    fresh, other = "pns_studio_" + "n" * 43, "pns_studio_" + "o" * 43
    entries = [Entry(name="studio", hash=hash_of(key)) for key in (KEY, fresh)]
    path.write_text("\n\n".join(map(written, entries)))
    with obeying(keys_file=path) as client:
        statuses = [
            client.post("/subdivide", content=b"echo", headers=GLB | bearer(key)).status_code
            for key in (KEY, fresh, other)
        ]
        assert statuses == [200, 200, 401]
    # Without the old entry its key is no key.
    path.write_text(written(entries[1]))
    client = obeying(keys_file=path)
    statuses = [client.get("/limits", headers=bearer(key)).status_code for key in (KEY, fresh)]
    assert statuses == [401, 200]


def test_what_costs_something_needs_a_key(client):
    for method, path in ("POST", "/subdivide"), ("GET", "/nothing"), ("POST", "/report"):
        answer = client.request(method, path, content=b"x", headers=GLB)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == 'Bearer realm="pns"'
        assert answer.json()["code"] == "unauthorized"
    for path in "/healthz", "/docs", "/openapi.json", "/models", "/":
        assert client.get(path).status_code == 200, path
    for scheme in ("Bearer", "bearer", "BEARER "):
        headers = GLB | {"Authorization": f"{scheme} {KEY}"}
        assert client.post("/subdivide", content=b"x", headers=headers).content == b"x"


def test_limits_are_those_of_the_key_that_is_sent(client):
    def told(**headers):
        return client.get("/limits", headers=headers).json()["faces_per_minute"]

    assert told() == Settings().faces_per_minute
    assert told(**bearer(KEY)) is None
    assert told(**bearer(OTHER)) == 4000


def test_a_target_with_a_host_needs_a_key_whatever_its_path(keys_file):
    with (
        served(workers=1, keys_file=keys_file) as where,
        closing(http.client.HTTPConnection(*where, timeout=600)) as connection,
    ):
        statuses = []
        for target in ("http://localhost/healthz", "http://localhost/nothing", "http://b/healthz"):
            connection.request("GET", target)
            answer = connection.getresponse()
            answer.read()
            statuses.append(answer.status)
    assert statuses == [401, 401, 400]


@pytest.mark.parametrize(
    "authorization",
    [
        "Bearer",
        "Basic cG5zOnBucw==",
        "Bearer nonsense",
        f"Bearer {KEY[:-1]}",
        f"Bearer {KEY[:-1]}K",
        f"Bearer {KEY.replace('studio', 'farm')}",
        f"Bearer {KEY.replace('studio', 'nobody')}",
        f"Bearer {KEY}, Bearer {KEY}",
        f"Bearer {KEY}x",
    ],
)
def test_a_wrong_key_is_refused_wherever_it_is_sent_and_locks_nobody_out(client, authorization):
    for _ in range(40):
        answer = client.get("/healthz", headers={"Authorization": authorization})
        assert answer.status_code == 401
    assert KEY not in answer.text
    # However many came from its address and of its name.
    assert client.get("/healthz", headers=bearer(KEY)).status_code == 200


def test_the_routes_see_the_name_of_the_key(client, caplog):
    with caplog.at_level(logging.INFO):
        client.get("/healthz", headers=bearer(OTHER))
    (line,) = [record.fields for record in caplog.records if record.name == "pns.request"]
    assert line["client"] == "key:farm"
    assert OTHER not in caplog.text


EVERYBODY, NO_PROXY = ["everybody: no PNS_KEYS_FILE"], "no PNS_PROXIES are set"


@pytest.mark.parametrize(
    ("with_keys", "settings", "open_to", "without_proxy"),
    [
        (True, {}, ["the bearers of 2 keys"], False),
        (False, {}, [], False),
        (False, {"host": "0.0.0.0"}, EVERYBODY, True),
        (False, {"host": "::", "proxies": "10.0.0.1"}, EVERYBODY, False),
    ],
)
def test_the_service_says_at_start_to_whom_it_is_open_and_what_it_leaves_to_a_proxy(
    keys_file, with_keys, settings, open_to, without_proxy, caplog
):
    keys = {"keys_file": keys_file} if with_keys else {}
    with caplog.at_level(logging.INFO), obeying(**keys, **settings):
        pass
    assert re.findall(r"open to (.*?)(?: is set)?$", caplog.text, re.M) == open_to
    assert (NO_PROXY in caplog.text) is without_proxy


# Other origins


@pytest.mark.parametrize(("origins", "named"), [("", False), ("https://a.example", True)])
def test_no_other_origin_may_ask_unless_it_is_named(keys_file, origins, named):
    client = obeying(cors_origins=origins, keys_file=keys_file)
    headers = {"Origin": "https://a.example"}
    answer = client.get("/healthz", headers=headers).headers
    assert answer.get("access-control-allow-origin") == ("https://a.example" if named else None)
    assert ("X-Request-ID" in answer.get("access-control-expose-headers", "")) is named
    headers["Access-Control-Request-Method"] = "POST"
    headers["Access-Control-Request-Headers"] = (
        "Authorization, Content-Type, If-None-Match, traceparent, tracestate, X-Request-ID"
    )
    assert client.options("/healthz", headers=headers).status_code == (200 if named else 405)
    other = client.get("/healthz", headers={"Origin": "https://b.example"})
    assert "access-control-allow-origin" not in other.headers


@pytest.mark.parametrize(
    ("sent", "origins", "status"),
    [
        # What a browser says of a form on another page, of another host of this site, of a file.
        ({"Sec-Fetch-Site": "cross-site", "Origin": "https://a.example"}, "", 403),
        ({"Sec-Fetch-Site": "same-site", "Origin": "https://a.example"}, "", 403),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "null"}, "", 403),
        # To a host without TLS it says less.
        ({"Origin": "http://a.example"}, "", 403),
        ({"Origin": "null"}, "", 403),
        ({"Origin": "http://["}, "", 403),
        # Its own page, behind a proxy that passes on the host without its port, or as it is.
        ({"Sec-Fetch-Site": "same-origin", "Origin": "https://pns.example"}, "", 200),
        ({"Origin": "http://pns.example:8080", "Host": "pns.example"}, "", 200),
        ({"Origin": "http://[::1]:8080", "Host": "[::1]:8000"}, "", 200),
        # Named origins, and who is no browser.
        ({"Sec-Fetch-Site": "cross-site", "Origin": "https://a.example"}, "https://a.example", 200),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "https://b.example"}, "https://a.example", 403),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "https://b.example"}, "*", 200),
        ({}, "", 200),
    ],
)
def test_a_form_of_another_origin_is_refused_before_its_work(sent, origins, status):
    asked = []

    async def app(scope, receive, send):
        asked.append(scope["method"])
        await PlainTextResponse("done")(scope, receive, send)

    settings = Settings(cors_origins=origins, hosts="pns.example")
    client = local(Checked(app, Origins(settings).check), base_url="http://pns.example")
    assert client.post("/report", headers=sent).status_code == status
    assert asked == ["POST"] * (status == 200)
    assert client.get("/models", headers=sent).status_code == 200
    if status == 403 and not origins:
        whole = obeying().post("/report", headers=sent, files={"file": ("a.glb", b"glTF")})
        assert (whole.status_code, whole.json()["code"]) == (403, "foreign-origin")


OWN = ("localhost", "pns.localhost:8000", "127.0.0.1:8000", "192.0.2.7", "[::1]:8000")
NAMED = {"hosts": "pns.example, *.pns.example"}


@pytest.mark.parametrize("listens", ["127.0.0.1", "0.0.0.0", "node.example"])
@pytest.mark.parametrize(
    ("settings", "host", "status"),
    [
        # A page whose name was made to lead here has one origin and host (DNS rebinding).
        ({}, "evil.example", 400),
        ({}, "evil.example:8000", 400),
        ({}, "", 400),
        ({}, "[", 400),
        ({}, "localhost.evil.example", 400),
        ({}, "127.0.0.1.evil.example", 400),
        ({"proxies": "192.0.2.1"}, "pns.example", 400),
        (NAMED, "evil.example", 400),
        (NAMED, "PNS.example", 200),
        (NAMED, "a.pns.example:443", 200),
        ({"hosts": "*"}, "evil.example", 200),
        # Nobody else's: probes ask an address, whatever is named.
        *((settings, host, 200) for settings in ({}, NAMED) for host in OWN),
        ({"host": "Node.example"}, "node.example", 200),
    ],
)
def test_only_the_names_of_the_service_are_served(listens, settings, host, status):
    client = obeying(**{"host": listens} | settings)
    sent = {"Host": host, "Origin": f"http://{host}"}
    answer = client.get("/healthz", headers=sent)
    assert answer.status_code == status
    if status != 200:
        assert answer.json()["code"] == "unknown-host"


def test_no_answer_is_for_a_browser_to_guess():
    with served(workers=1) as address, closing(http.client.HTTPConnection(*address)) as client:
        for method, path in (("POST", "/subdivide"), ("GET", "/"), ("GET", "/none")):
            client.request(method, path, b"<html>", GLB)
            answer = client.getresponse()
            answer.read()
            assert answer.headers.get_all("x-content-type-options") == ["nosniff"], path
