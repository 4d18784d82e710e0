"""Who may ask: clients by address behind proxies and by key, what they share, and other origins."""

import asyncio
import http.client
import logging
import re
from contextlib import ExitStack, closing

import httpx2
import pytest
from fastapi import Request
from starlette.responses import PlainTextResponse

from service.errors import BusyError
from service.http.access.clients import (
    Client,
    FacesBudget,
    OverBudgetError,
    Places,
    TooManyRequestsError,
    client_of,
)
from service.http.access.keys import Entry, KeysError, hash_of, new_key
from service.http.access.keys import toml_entry as written
from service.http.access.origins import Origins
from service.http.app import create_app
from service.http.problems import Checked
from service.settings import Settings
from tests.support.live import GLB, local, obeying, served


def clients_in(caplog):
    """Who asked, by the journal."""
    return [record.fields["client"] for record in caplog.records if record.name == "pns.request"]


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
    with caplog.at_level(logging.INFO), served(workers=1, proxies=proxies) as where:
        httpx2.get(f"http://{where[0]}:{where[1]}/healthz", headers={"X-Forwarded-For": forwarded})
    assert clients_in(caplog) == [address]


def request(address, **state):
    return Request({"type": "http", "client": address, "state": state, "headers": []})


@pytest.mark.parametrize(
    ("address", "client"),
    [
        ("192.0.2.7", "address:192.0.2.7"),
        ("::ffff:192.0.2.7", "address:192.0.2.7"),
        # A provider hands out whole /64 networks.
        ("2001:db8:1:2:3:4:5:6", "address:2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::1", "address:2001:db8:1:2::/64"),
        ("testclient", "address:testclient"),
    ],
)
def test_who_sends_no_key_is_the_client_of_its_address(address, client):
    settings = Settings(faces_per_minute=77)
    assert client_of(request((address, 1)), settings) == Client(client, 77)
    assert client_of(request(None), settings) == Client("address:", 77)
    named = Client("key:mine", 5)
    assert client_of(request((address, 1), client=named), settings) is named


# What clients share


def test_a_client_has_so_many_places_and_all_together_so_many():
    places = Places(4, own=2)
    with ExitStack() as held:
        for client in "aabb":
            held.enter_context(places.held(client))
        with pytest.raises(TooManyRequestsError, match="as many as one client may") as own:
            held.enter_context(places.held("a"))
        assert (own.value.status, own.value.retry_after) == (429, 2)
        with pytest.raises(BusyError, match="4 requests") as full:
            held.enter_context(places.held("c"))
        assert full.value.status == 503
    assert places.taken == {}
    with places.held("a"):
        assert places.taken == {"a": 1}


@pytest.mark.anyio
async def test_a_slow_reader_gives_its_place_to_a_client_who_holds_less():
    """Two addresses that hardly read their answers would else close the service."""
    places, ended = Places(4, own=3), []

    async def takes(client):
        end = asyncio.timeout(None)
        with places.held(client), places.taking(client, end):
            try:
                async with end:
                    await asyncio.sleep(60)
            except TimeoutError:
                ended.append(client)

    slow = [asyncio.create_task(takes(client)) for client in "aaab"]
    await asyncio.sleep(0)
    with pytest.raises(BusyError), places.held("b"), places.held("b"), places.held("b"):
        pass
    with places.held("honest"):
        await asyncio.sleep(0.01)
    assert ended == ["a"] * 2
    for task in slow:
        task.cancel()
    await asyncio.gather(*slow, return_exceptions=True)


def test_a_budget_refills_evenly_and_a_job_may_leave_a_debt():
    now = [0.0]
    budget, client = FacesBudget(lambda: now[0]), Client("a", 60)
    budget.check(client)
    budget.charge(client, 90)
    with pytest.raises(OverBudgetError) as over:
        budget.check(client)
    assert (over.value.status, over.value.retry_after) == (429, 31)
    budget.check(Client("b", 60))
    now[0] = 30.5
    budget.check(client)
    unbounded = Client("c", None)
    budget.charge(unbounded, 10**9)
    budget.check(unbounded)


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
    # As `printf %s KEY | sha256sum` writes it: FIPS 180's first example.
    of_abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert hash_of("abc") == f"sha256:{of_abc}"
    for name in ("", "-a", "A", "a_b", "a" * 64, "a b", 'a"'):
        with pytest.raises(KeysError, match="a name is"):
            new_key(name)


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


def test_while_a_key_is_replaced_both_are_keys_of_one_client(tmp_path):
    path = tmp_path / "keys.toml"
    fresh = "pns_studio_" + "n" * 43
    entries = [Entry(name="studio", hash=hash_of(key)) for key in (KEY, fresh)]
    # Without the old entry its key is no key.
    for kept, wanted in ((entries, [200, 200]), (entries[1:], [401, 200])):
        path.write_text("\n\n".join(map(written, kept)))
        client = obeying(keys_file=path)
        statuses = [client.get("/limits", headers=bearer(key)).status_code for key in (KEY, fresh)]
        assert statuses == wanted


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


def test_limits_and_the_journal_are_those_of_the_key_that_is_sent(client, caplog):
    with caplog.at_level(logging.INFO):
        told = [
            client.get("/limits", headers=headers).json()["faces_per_minute"]
            for headers in ({}, bearer(KEY), bearer(OTHER))
        ]
    assert told == [Settings().faces_per_minute, None, 4000]
    assert clients_in(caplog)[1:] == ["key:studio", "key:farm"]
    assert OTHER not in caplog.text


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


WRONG_KEYS = ["Bearer", "Basic cG5zOnBucw==", "Bearer nonsense", f"Bearer {KEY[:-1]}"]
WRONG_KEYS += [f"Bearer {KEY[:-1]}K", f"Bearer {KEY}x", f"Bearer {KEY}, Bearer {KEY}"]
WRONG_KEYS += [f"Bearer {KEY.replace('studio', name)}" for name in ("farm", "nobody")]


def test_a_wrong_key_is_refused_wherever_it_is_sent_and_locks_nobody_out(client):
    """However many come from the same address and of the same name."""
    for authorization in 12 * WRONG_KEYS:
        answer = client.get("/healthz", headers={"Authorization": authorization})
        assert answer.status_code == 401
        assert KEY not in answer.text
    for key in (KEY, OTHER):
        assert client.get("/healthz", headers=bearer(key)).status_code == 200


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


def foreign(origin, site="cross-site"):
    return {"Sec-Fetch-Site": site, "Origin": origin}


@pytest.mark.parametrize(
    ("sent", "origins", "status"),
    [
        # What a browser says of a form on another page, of another host of this site, of a file.
        (foreign("https://a.example"), "", 403),
        (foreign("https://a.example", "same-site"), "", 403),
        (foreign("null"), "", 403),
        # To a host without TLS it says less.
        *(({"Origin": origin}, "", 403) for origin in ("http://a.example", "null", "http://[")),
        # Its own page, behind a proxy that passes on the host without its port, or as it is.
        (foreign("https://pns.example", "same-origin"), "", 200),
        ({"Origin": "http://pns.example:8080", "Host": "pns.example"}, "", 200),
        ({"Origin": "http://[::1]:8080", "Host": "[::1]:8000"}, "", 200),
        # Named origins, and who is no browser.
        (foreign("https://a.example"), "https://a.example", 200),
        (foreign("https://b.example"), "https://a.example", 403),
        (foreign("https://b.example"), "*", 200),
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


def test_the_service_refuses_such_a_form():
    form = {"files": {"file": ("a.glb", b"glTF")}}
    answer = obeying().post("/report", headers={"Sec-Fetch-Site": "cross-site"}, **form)
    assert (answer.status_code, answer.json()["code"]) == (403, "foreign-origin")


OWN = ("localhost", "pns.localhost:8000", "127.0.0.1:8000", "192.0.2.7", "[::1]:8000")
NAMED = {"hosts": "pns.example, *.pns.example"}
# A page whose name was made to lead here has one origin and host (DNS rebinding).
REBOUND = ("evil.example", "evil.example:8000", "", "[", "localhost.evil.example")


@pytest.mark.parametrize("listens", ["127.0.0.1", "0.0.0.0", "node.example"])
@pytest.mark.parametrize(
    ("settings", "host", "status"),
    [
        *(({}, host, 400) for host in (*REBOUND, "127.0.0.1.evil.example")),
        ({"proxies": "192.0.2.1"}, "pns.example", 400),
        *((NAMED, host, 400) for host in ("evil.example", "evilpns.example")),
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
    answer = client.get("/healthz", headers={"Host": host, "Origin": f"http://{host}"})
    assert answer.status_code == status
    assert status == 200 or answer.json()["code"] == "unknown-host"


def test_no_answer_is_for_a_browser_to_guess():
    with served(workers=1) as address, closing(http.client.HTTPConnection(*address)) as client:
        for method, path in (("POST", "/subdivide"), ("GET", "/"), ("GET", "/none")):
            client.request(method, path, b"<html>", GLB)
            answer = client.getresponse()
            answer.read()
            assert answer.headers.get_all("x-content-type-options") == ["nosniff"], path
