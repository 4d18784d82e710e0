"""Clients by their addresses behind proxies, and by their keys."""

import asyncio
import base64
import hashlib
import http.client
import logging
import re
import threading
from contextlib import closing

import httpx2
import pytest
from starlette.responses import PlainTextResponse

from service.http.access import bearer as bearer_layer
from service.http.access.bearer import KEPT_FREE, MOST_WAITING, WRONG_A_MINUTE, Bearer
from service.http.access.keys import Entry, Keyring, KeysError, hash_of, matches, new_key, read_keys
from service.http.access.keys import toml_entry as written
from service.http.access.origins import Origins
from service.http.app import create_app
from service.settings import Settings
from tests.support import stand_in_jobs as jobs
from tests.support.live import local, served

GLB = {"Content-Type": "model/gltf-binary"}


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


def test_a_forged_address_is_in_no_line(caplog):
    with caplog.at_level(logging.INFO), served(workers=1) as where:
        connection = http.client.HTTPConnection(*where, timeout=600)
        with closing(connection):
            connection.request("GET", "/healthz", headers={"X-Forwarded-For": "203.0.113.77"})
            connection.getresponse().read()
    assert [record.fields["client"] for record in caplog.records if record.name == "pns.request"]
    assert "203.0.113.77" not in caplog.text


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
    settings = Settings(workers=1, keys_file=keys_file)
    app = create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up)
    with local(app, raise_server_exceptions=False) as opened:
        yield opened


def bearer(key):
    return {"Authorization": f"Bearer {key}"}


def test_a_key_is_kept_as_a_salted_hash():
    key = new_key("studio")
    assert len(key) == len("pns_studio_") + 43
    first, second = hash_of(key), hash_of(key)
    assert first != second
    assert matches(key, first)
    assert matches(key, second)
    assert not matches(key + "x", first)
    assert not matches(key, first[:-1] + ("A" if first[-1] != "A" else "Q"))
    assert not matches(key, "scrypt$nonsense")


def test_the_hash_is_scrypts():
    """RFC 7914, the third test vector, cut to our length: another implementation agrees."""
    digest = hashlib.scrypt(
        b"pleaseletmein", salt=b"SodiumChloride", n=16384, r=8, p=1, maxmem=2**26, dklen=64
    )
    assert digest.hex().startswith("7023bdcb3afd7348461c06cd81fd38eb")
    assert hash_of("pleaseletmein", salt=b"SodiumChlorideXX").split("$")[1:4] == ["14", "8", "1"]


@pytest.mark.parametrize("name", ["", "-a", "A", "a_b", "a" * 64, "a b", 'a"'])
def test_a_name_is_plain(name):
    with pytest.raises(KeysError, match="a name is"):
        new_key(name)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "there is no"),
        ("key = 1", "entries are .*key"),
        ("[[key]]\nname = 'a'\nhash = 'plain'", "PNS_KEYS_FILE: .* entry 1: hash"),
        ("[[key]]\nname = 'A'\nhash = 'plain'", "name"),
        ("[[keys]]\nname = 'a'", "keys is not known"),
        ("ENTRY\ncolour = 1", "colour"),
        ("not toml", "keys.toml"),
        ("ENTRY\nENTRY", "two entries have one hash"),
        ("[[key]]\nname = 'a'\nhash = 'scrypt$24$8$1$SALT$DIGEST'", "asks for too much"),
        ("ENTRY\nfaces_per_minute = inf", "faces_per_minute"),
        ("ENTRY\nfaces_per_minute = 0", "faces_per_minute"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_at_start(tmp_path, text, reason):
    entry = written(Entry(name="a", hash=hash_of("x")))
    text = text.replace("ENTRY", entry).replace("SALT", "s" * 22).replace("DIGEST", "d" * 43)
    path = tmp_path / "keys.toml"
    path.write_text(text)
    with pytest.raises(KeysError, match=reason):
        create_app(Settings(workers=1, keys_file=path))


def test_a_file_that_is_not_there_is_refused_at_start(tmp_path):
    with pytest.raises(KeysError, match="No such file"):
        read_keys(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_refused_at_start(tmp_path):
    path = tmp_path / "keys.toml"
    path.write_bytes(b"# Schl\xfcssel\n")
    with pytest.raises(KeysError, match=r"keys\.toml: .*utf-8"):
        read_keys(path)


def test_while_a_key_is_replaced_both_are_keys_of_one_client(tmp_path, caplog):
    path = tmp_path / "keys.toml"
    fresh, other = "pns_studio_" + "n" * 43, "pns_studio_" + "o" * 43
    entries = [Entry(name="studio", hash=hash_of(key)) for key in (KEY, fresh)]
    path.write_text("\n\n".join(map(written, entries)))
    settings = Settings(workers=1, keys_file=path)
    app = create_app(settings, job=jobs.obey, measure=jobs.measure, warm_up=jobs.no_warm_up)
    with local(app) as client:
        handed_in = client.post("/jobs", content=b"echo", headers=GLB | bearer(KEY))
        job = f"/jobs/{handed_in.json()['id']}"
        assert client.get(job, headers=bearer(fresh)).status_code == 200
        assert client.get(job, headers=bearer(other)).status_code == 401
    # Without the old entry its key is no key.
    assert Keyring(entries[1:]).find(KEY, "studio") is None
    assert Keyring(entries[1:]).find(fresh, "studio") == entries[1]


def test_what_costs_something_needs_a_key(client):
    for method, path in ("POST", "/subdivide"), ("GET", "/nothing"), ("POST", "/jobs"):
        answer = client.request(method, path, content=b"x", headers=GLB)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == 'Bearer realm="pns"'
        assert answer.json()["code"] == "unauthorized"
    for path in "/healthz", "/docs", "/openapi.json", "/models", "/":
        assert client.get(path).status_code == 200, path


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
    assert statuses == [401, 401, 421]


@pytest.mark.parametrize("scheme", ["Bearer", "bearer", "BEARER "])
def test_the_bearer_of_a_key_is_served(client, scheme):
    headers = GLB | {"Authorization": f"{scheme} {KEY}"}
    assert client.post("/subdivide", content=b"x", headers=headers).content == b"x"


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
def test_a_wrong_key_is_refused_wherever_it_is_sent(keys_file, authorization):
    settings = Settings(workers=1, keys_file=keys_file)
    app = create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up)
    client = local(app)
    headers = {"Authorization": authorization}
    assert client.get("/healthz", headers=headers).status_code == 401
    assert KEY not in client.get("/healthz", headers=headers).text


def test_guessing_ends_for_the_name_that_is_guessed_and_locks_out_no_other(keys_file):
    settings = Settings(workers=1, keys_file=keys_file)
    client = local(create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up))
    assert client.get("/healthz", headers=bearer(KEY)).status_code == 200
    wrong = [
        client.get("/healthz", headers=bearer(f"pns_studio_{n:043d}")).status_code
        for n in range(WRONG_A_MINUTE + 2)
    ]
    assert wrong == [401] * WRONG_A_MINUTE + [429] * 2
    refused = client.get("/healthz", headers=bearer(f"pns_studio_{99:043d}"))
    assert (refused.status_code, refused.json()["code"]) == (429, "too-many-wrong-keys")
    assert int(refused.headers["retry-after"]) >= 1
    # One that was right stays right, and another that was not seen yet is checked.
    assert client.get("/healthz", headers=bearer(KEY)).status_code == 200
    assert client.get("/healthz", headers=bearer(OTHER)).status_code == 200


async def status_of(layer, key, address):
    """Return the status that a key gets."""
    said = []

    async def send(message):
        said.append(message.get("status"))

    headers = [(b"authorization", f"Bearer {key}".encode())]
    scope = {"type": "http", "headers": headers, "path": "/jobs", "client": (address, 1)}
    await layer(scope, None, send)
    return said[0]


def wrong_key_from(layer, address, name="x"):
    """Return the status that a wrong key gets."""
    return asyncio.run(status_of(layer, f"pns_{name}_{'w' * 43}", address))


def test_a_site_of_ipv6_guesses_no_more_than_its_subscribers_may():
    layer = Bearer(PlainTextResponse("never"), [])
    # Each from a /64 of its own, within one /56.
    said = [wrong_key_from(layer, f"2001:db8:0:{n:x}::1") for n in range(4 * WRONG_A_MINUTE + 1)]
    assert said == [401] * 4 * WRONG_A_MINUTE + [429]
    assert wrong_key_from(layer, "2001:db8:1::1") == 401


def test_places_for_checks_are_kept_for_addresses_that_sent_no_wrong_key(monkeypatch):
    layer = Bearer(PlainTextResponse("never"), [])
    guessers = [f"192.0.2.{number}" for number in range(MOST_WAITING)]
    for address in guessers:
        assert wrong_key_from(layer, address) == 401
    layer._waiting.update(guessers[: MOST_WAITING - KEPT_FREE])
    assert wrong_key_from(layer, guessers[-1]) == 503
    assert wrong_key_from(layer, "198.51.100.1") == 401


def test_few_keys_wait_for_their_check_and_the_next_is_told_to_come_back(monkeypatch):
    let_go = threading.Event()

    class Slow(Keyring):
        def find(self, key, name):
            assert let_go.wait(600)
            return super().find(key, name)

    def refused(number):
        return status_of(layer, f"pns_x_{number:043d}", f"192.0.2.{number}")

    async def scenario():
        waiting = [asyncio.create_task(refused(number)) for number in range(MOST_WAITING + 1)]
        for _ in range(3):  # nothing is awaited on the way to a refusal
            await asyncio.sleep(0)
        ended = [task.done() for task in waiting]
        let_go.set()
        assert ended == [False] * MOST_WAITING + [True]
        assert await asyncio.gather(*waiting) == [401] * MOST_WAITING + [503]
        # Those that waited are gone: there is room again.
        assert await refused(100) == 401

    monkeypatch.setattr(bearer_layer, "Keyring", Slow)
    layer = Bearer(PlainTextResponse("never"), [])
    asyncio.run(scenario())


def test_a_first_burst_with_one_key_waits_for_its_one_check(monkeypatch):
    checks, let_go = [], threading.Event()

    class Slow(Keyring):
        def find(self, key, name):
            checks.append(name)
            assert let_go.wait(600)
            return super().find(key, name)

    async def scenario():
        layer = Bearer(PlainTextResponse("served"), [entry])
        burst = [asyncio.create_task(status_of(layer, KEY, "192.0.2.1")) for _ in range(200)]
        await asyncio.sleep(0.05)
        # Who leaves ends the check for nobody else.
        burst.pop(0).cancel()
        let_go.set()
        assert await asyncio.gather(*burst) == [200] * 199
        assert await status_of(layer, KEY, "192.0.2.1") == 200

    entry = Entry(name="studio", hash=hashed_by(KEY, 4))
    monkeypatch.setattr(bearer_layer, "Keyring", Slow)
    asyncio.run(scenario())
    assert checks == ["studio"]


def hashed_by(key, log_n):
    digest = hashlib.scrypt(key.encode(), salt=b"s" * 16, n=2**log_n, r=8, p=1, dklen=32)
    texts = (base64.urlsafe_b64encode(data).decode().rstrip("=") for data in (b"s" * 16, digest))
    return f"scrypt${log_n}$8$1$" + "$".join(texts)


def test_a_check_costs_the_same_whoever_is_named_and_however_it_is_hashed(tmp_path, monkeypatch):
    entries = [
        Entry(name="studio", hash=hashed_by(KEY, 4)),
        Entry(name="farm", hash=hashed_by(OTHER, 6)),
        Entry(name="mill", hash=hashed_by("another", 6)),
    ]
    path = tmp_path / "keys.toml"
    path.write_text("\n\n".join(map(written, entries)))
    settings = Settings(workers=1, keys_file=path)
    client = local(create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up))
    scrypt, costs = hashlib.scrypt, []

    def counted(*arguments, n, r, p, **others):
        costs.append((n, r, p))
        return scrypt(*arguments, n=n, r=r, p=p, **others)

    monkeypatch.setattr(hashlib, "scrypt", counted)
    wrong = [f"pns_{name}_" + "w" * 43 for name in ("studio", "farm", "mill", "nobody")]
    for key, status in [*((key, 401) for key in wrong), (KEY, 200), (OTHER, 200)]:
        assert client.get("/healthz", headers=bearer(key)).status_code == status
        assert sorted(costs) == [(2**4, 8, 1), (2**6, 8, 1)]
        costs.clear()


def test_the_routes_see_the_name_of_the_key(client, caplog):
    with caplog.at_level(logging.INFO):
        client.get("/healthz", headers=bearer(OTHER))
    (line,) = [record.fields for record in caplog.records if record.name == "pns.request"]
    assert line["client"] == "key:farm"
    assert OTHER not in caplog.text


@pytest.mark.parametrize(
    ("with_keys", "host", "said"),
    [
        (True, "127.0.0.1", ["the bearers of 2 keys"]),
        (False, "0.0.0.0", ["everybody: no PNS_KEYS_FILE"]),
        (False, "127.0.0.1", []),
    ],
)
def test_the_service_says_at_start_to_whom_it_is_open(keys_file, with_keys, host, said, caplog):
    settings = Settings(workers=1, host=host, keys_file=keys_file if with_keys else None)
    app = create_app(settings, job=jobs.obey, warm_up=jobs.no_warm_up)
    with caplog.at_level(logging.INFO), local(app):
        pass
    assert re.findall(r"open to (.*?)(?: is set)?$", caplog.text, re.M) == said


@pytest.mark.parametrize(
    ("settings", "says"),
    [({}, False), ({"host": "0.0.0.0"}, True), ({"host": "::", "proxies": "10.0.0.1"}, False)],
)
def test_the_service_says_at_start_what_it_leaves_to_a_proxy(settings, says, caplog):
    app = create_app(Settings(workers=1, **settings), job=jobs.obey, warm_up=jobs.no_warm_up)
    with local(app):
        pass
    assert ("no PNS_PROXIES are set" in caplog.text) is says


# Other origins


def cross(client, method="GET", **headers):
    return client.request(method, "/healthz", headers={"Origin": "https://a.example"} | headers)


def test_no_other_origin_may_ask_unless_it_is_named():
    with local(create_app(Settings(workers=1), warm_up=jobs.no_warm_up)) as client:
        assert "access-control-allow-origin" not in cross(client).headers
        assert cross(client, "OPTIONS").status_code == 405


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
        ({"Origin": "null", "Host": ""}, "", 403),
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

    named = Settings(cors_origins=origins).cors_origins
    client = local(Origins(app, named, ("*",)), base_url="http://pns.example")
    assert client.post("/jobs", headers=sent).status_code == status
    assert asked == ["POST"] * (status == 200)
    assert client.get("/models", headers=sent).status_code == 200


@pytest.mark.parametrize(
    ("settings", "host", "status"),
    [
        # A page whose name was made to lead here has one origin and host (DNS rebinding).
        ({}, "evil.example", 421),
        ({}, "evil.example:8000", 421),
        ({}, "", 421),
        ({}, "localhost.evil.example", 421),
        ({}, "127.0.0.1.evil.example", 421),
        ({}, "localhost", 200),
        ({}, "pns.localhost:8000", 200),
        ({}, "127.0.0.1:8000", 200),
        ({}, "[::1]:8000", 200),
        # Elsewhere than on loopback, or behind a proxy, any; or those that are listed.
        ({"host": "0.0.0.0"}, "pns.example", 200),
        ({"proxies": "192.0.2.1"}, "pns.example", 200),
        ({"hosts": "pns.example, *.pns.example"}, "PNS.example", 200),
        ({"hosts": "pns.example, *.pns.example"}, "a.pns.example:443", 200),
        ({"hosts": "pns.example, *.pns.example"}, "localhost", 421),
        ({"host": "0.0.0.0", "hosts": "pns.example"}, "evil.example", 421),
    ],
)
def test_only_the_names_of_the_service_are_served(settings, host, status):
    app = create_app(Settings(workers=1, **settings), warm_up=jobs.no_warm_up)
    sent = {"Host": host, "Origin": f"http://{host}"}
    assert local(app).get("/healthz", headers=sent).status_code == status


@pytest.mark.parametrize("hosts", ["http://a.example", "a.example:80", "a*.example", "a/b"])
def test_what_is_no_host_is_refused_at_start(hosts):
    with pytest.raises(ValueError, match="no host name"):
        Settings(hosts=hosts)


def test_the_service_refuses_such_a_form():
    with local(create_app(Settings(workers=1), warm_up=jobs.no_warm_up)) as client:
        form = {"files": {"file": ("a.glb", b"glTF")}}
        answer = client.post("/jobs", headers={"Sec-Fetch-Site": "cross-site"}, **form)
        assert (answer.status_code, answer.json()["code"]) == (403, "foreign-origin")


def test_no_answer_is_for_a_browser_to_guess():
    with served(workers=1) as address, closing(http.client.HTTPConnection(*address)) as client:
        for method, path in (("POST", "/subdivide"), ("GET", "/"), ("GET", "/none")):
            client.request(method, path, b"<html>", GLB)
            answer = client.getresponse()
            answer.read()
            assert answer.headers.get_all("x-content-type-options") == ["nosniff"], path


def test_a_named_origin_may(keys_file):
    settings = Settings(workers=1, cors_origins="https://a.example", keys_file=keys_file)
    client = local(create_app(settings, warm_up=jobs.no_warm_up))
    answer = cross(client)
    assert answer.headers["access-control-allow-origin"] == "https://a.example"
    assert "X-Request-ID" in answer.headers["access-control-expose-headers"]
    asks = {"Access-Control-Request-Method": "POST"}
    asks["Access-Control-Request-Headers"] = (
        "Authorization, Content-Type, If-None-Match, traceparent, tracestate, X-Request-ID"
    )
    assert cross(client, "OPTIONS", **asks).status_code == 200
    other = client.get("/healthz", headers={"Origin": "https://b.example"})
    assert "access-control-allow-origin" not in other.headers
