"""Settings: from the environment, from the constructor, and within their range."""

from ipaddress import ip_network
from pathlib import Path

import pytest
from pydantic import ValidationError

from service.options import Limits
from service.settings import Settings


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("host", "0.0.0.0", "0.0.0.0"),
        ("port", "8080", 8080),
        ("prefix", "/tools/pns", "/tools/pns"),
        ("body", "8MiB", 8 * 2**20),
        ("job_seconds", "7.5", 7.5),
        ("keys_file", "/keys.toml", Path("/keys.toml")),
        ("proxies", "10.0.0.0/8, 192.0.2.1", (ip_network("10.0.0.0/8"), ip_network("192.0.2.1"))),
        (
            "cors_origins",
            "https://a.example,http://[::1]:80",
            ("https://a.example", "http://[::1]:80"),
        ),
        ("providers", "CUDAExecutionProvider, B", ("CUDAExecutionProvider", "B")),
        ("hosts", "pns.example, *.A.example", ("pns.example", "*.a.example")),
    ],
)
def test_read_from_the_environment(name, text, value, monkeypatch):
    monkeypatch.setenv(f"PNS_{name.upper()}", text)
    assert getattr(Settings(), name) == value


def test_job_limits_are_the_settings():
    limits = Settings(faces=10, memory=20, json_items=30).job_limits()
    assert (limits.max_faces, limits.max_memory_bytes, limits.max_json_items) == (10, 20, 30)
    assert Settings().job_limits() == Limits()


SECONDS = [name for name in Settings.model_fields if name.endswith("_seconds")]
EMPTY = "it is empty: leave it out, or name something"


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        *((name, 0, "") for name in ("body", "faces", "levels", "json_items", "workers")),
        *((name, 0, "") for name in ("connections", *SECONDS)),
        *((name, -1, "") for name in ("memory", "queue", "upload_seconds")),
        *((name, value, "") for name in SECONDS for value in ("inf", "nan", "-inf", "1e999")),
        *((name, 65536, "") for name in ("port", "metrics_port")),
        ("levels", 7, ""),
        ("body", "large", ""),
        # Of which one client may have three quarters: its largest body would never come.
        ("bodies", 1, ""),
        ("proxies", "localhost", "'localhost' does not appear to be an IPv4 or IPv6 network"),
        ("proxies", "10.0.0.1/8", "10.0.0.1/8 has host bits set"),
        ("cors_origins", "a.example", "'a.example' is no origin, such as https://a.example:8443"),
        *(("cors_origins", f"https://a.example/{path}", "is no origin") for path in ("", "page")),
        # Of which a beginning reads, and more than the kernel counts.
        *(("body", value, "is no size, such as 1.5GiB") for value in ("1,5GiB", "1e-3")),
        ("memory", "4,5GiB", "'4,5GiB' is no size, such as 1.5GiB"),
        ("memory", "16EiB", ""),
        # As an unset variable of a shell leaves them: as a host it would be every address.
        *((name, "", EMPTY) for name in ("host", "metrics_host", "hosts", "model", "keys_file")),
        *(("hosts", name, f"{name!r} is no host name") for name in ("g:80", "a*.example", "a/b")),
        *(("prefix", p, "") for p in ("/", "tools", "/tools/", '/"onload', "//other.example")),
    ],
)
def test_out_of_range_is_refused_in_plain_words(name, value, says):
    with pytest.raises(ValidationError, match=name) as refused:
        Settings(**{name: value})
    (error,) = refused.value.errors()
    assert says in error["msg"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("PNS_BODDY", "there is no setting PNS_BODDY; is it PNS_BODY?"),
        ("pns_job_second", "is it PNS_JOB_SECONDS?"),
        ("PNS_X", "there is no setting PNS_X"),
        ("PNS_FOO", "PNS_FOO: unset it, or set PNS_IGNORE_UNKNOWN=1"),
    ],
)
def test_a_misspelt_setting_is_refused(name, text, monkeypatch):
    monkeypatch.setenv(name, "1")
    with pytest.raises(ValidationError) as refused:
        Settings()
    assert text in str(refused.value)


@pytest.mark.parametrize(("name", "passes"), [("FOO", True), ("BODDY", False), ("JOB_FOO", False)])
def test_another_programs_variable_passes_where_it_is_said_to(name, passes, monkeypatch):
    """What resembles a setting never does."""
    monkeypatch.setenv("PNS_IGNORE_UNKNOWN", "1")
    monkeypatch.setenv(f"PNS_{name}", "1")
    if passes:
        assert Settings().ignore_unknown
        return
    with pytest.raises(ValidationError, match=name):
        Settings()
