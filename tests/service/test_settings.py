"""Every setting: from the environment, from the constructor, and within its range."""

from ipaddress import ip_network
from pathlib import Path

import pytest
from pydantic import ValidationError

from service.options import Limits
from service.settings import Settings

EXAMPLES = {
    "ignore_unknown": ("true", True),
    "host": ("0.0.0.0", "0.0.0.0"),
    "port": ("8080", 8080),
    "prefix": ("/tools/pns", "/tools/pns"),
    "model": ("/models/mine.onnx", "/models/mine.onnx"),
    "body": ("8MiB", 8 * 2**20),
    "faces": ("1000", 1000),
    "levels": ("3", 3),
    "memory": ("2GiB", 2 * 2**30),
    "json_items": ("500", 500),
    "workers": ("3", 3),
    "queue": ("0", 0),
    "client_requests": ("3", 3),
    "job_seconds": ("7.5", 7.5),
    "connections": ("100", 100),
    "proxies": ("10.0.0.0/8, 192.0.2.1", (ip_network("10.0.0.0/8"), ip_network("192.0.2.1"))),
    "keys_file": ("/keys.toml", Path("/keys.toml")),
    "cors_origins": (
        "https://a.example,http://[::1]:80",
        ("https://a.example", "http://[::1]:80"),
    ),
    "providers": (
        "CUDAExecutionProvider, CPUExecutionProvider",
        ("CUDAExecutionProvider", "CPUExecutionProvider"),
    ),
    "hosts": ("pns.example, *.A.example", ("pns.example", "*.a.example")),
    "metrics_host": ("0.0.0.0", "0.0.0.0"),
    "metrics_port": ("9000", 9000),
    "keep_alive_seconds": ("4", 4),
    "upload_seconds": ("20", 20),
    "idle_seconds": ("2.5", 2.5),
    "stall_seconds": ("5", 5),
    "drain_seconds": ("9", 9),
    "faces_per_minute": ("1000", 1000),
}


def test_every_setting_has_an_example_here():
    assert set(EXAMPLES) == set(Settings.model_fields)


@pytest.mark.parametrize("name", EXAMPLES)
def test_read_from_the_environment(name, monkeypatch):
    text, value = EXAMPLES[name]
    monkeypatch.setenv(f"PNS_{name.upper()}", text)
    assert getattr(Settings(), name) == value


def test_job_limits_are_the_settings():
    limits = Settings(faces=10, memory=20, json_items=30).job_limits()
    assert (limits.max_faces, limits.max_memory_bytes, limits.max_json_items) == (10, 20, 30)
    assert Settings().job_limits() == Limits()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", 65536),
        ("body", 0),
        ("body", "large"),
        ("faces", 0),
        ("levels", 0),
        ("levels", 7),
        ("memory", -1),
        ("json_items", 0),
        ("workers", 0),
        ("queue", -1),
        # Of which one client may have three quarters: its largest body would never come.
        ("idle_seconds", 0),
        ("job_seconds", 0),
        ("upload_seconds", -1),
        ("stall_seconds", 0),
        ("drain_seconds", 0),
        ("keep_alive_seconds", 0),
        ("answer_seconds", 0),
        ("connections", 0),
        ("proxies", "10.0.0.1/8"),
        ("proxies", "localhost"),
        ("cors_origins", "https://a.example/"),
        ("cors_origins", "https://a.example/page"),
        ("cors_origins", "a.example"),
        ("metrics_port", 65536),
        # As an unset variable of a shell leaves them: as a host it would be every address.
        ("host", ""),
        ("metrics_host", ""),
        ("model", ""),
        ("keys_file", ""),
        # Of which a beginning reads.
        ("body", "1,5GiB"),
        ("body", "1e-3"),
        # More than the kernel counts.
        ("memory", "16EiB"),
        ("bodies", 1),
    ],
)
def test_out_of_range_is_refused(name, value):
    with pytest.raises(ValidationError, match=name):
        Settings(**{name: value})


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("proxies", "localhost", "'localhost' does not appear to be an IPv4 or IPv6 network"),
        ("proxies", "10.0.0.1/8", "10.0.0.1/8 has host bits set"),
        ("cors_origins", "a.example", "'a.example' is no origin, such as https://a.example:8443"),
        ("memory", "4,5GiB", "'4,5GiB' is no size, such as 1.5GiB"),
        ("host", "", "it is empty: leave it out, or name something"),
        ("hosts", "", "it is empty: leave it out, or name something"),
        *(("hosts", name, f"{name!r} is no host name") for name in ("g:80", "a*.example", "a/b")),
    ],
)
def test_what_is_refused_is_told_in_plain_words(name, value, says):
    with pytest.raises(ValidationError) as refused:
        Settings(**{name: value})
    (error,) = refused.value.errors()
    assert (error["loc"][0], says in error["msg"]) == (name, True)


SECONDS = [name for name in Settings.model_fields if name.endswith("_seconds")]


@pytest.mark.parametrize("value", ["inf", "nan", "-inf", "Infinity", "1e999"])
@pytest.mark.parametrize("name", SECONDS)
def test_a_time_without_end_is_refused(name, value, monkeypatch):
    monkeypatch.setenv(f"PNS_{name.upper()}", value)
    with pytest.raises(ValidationError, match=name):
        Settings()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("PNS_BODDY", "there is no setting PNS_BODDY; is it PNS_BODY?"),
        ("pns_job_second", "is it PNS_JOB_SECONDS?"),
        ("PNS_X", "there is no setting PNS_X"),
    ],
)
def test_a_misspelt_setting_is_refused(name, text, monkeypatch):
    monkeypatch.setenv(name, "1")
    with pytest.raises(ValidationError) as refused:
        Settings()
    assert text in str(refused.value)


def test_another_programs_variable_passes_where_it_is_said_to(monkeypatch):
    monkeypatch.setenv("PNS_FOO", "1")
    with pytest.raises(ValidationError, match="PNS_FOO: unset it, or set PNS_IGNORE_UNKNOWN=1"):
        Settings()
    monkeypatch.setenv("PNS_IGNORE_UNKNOWN", "1")
    assert Settings().ignore_unknown


@pytest.mark.parametrize("name", ["PNS_BODDY", "PNS_JOB_FOO"])
def test_what_resembles_a_setting_never_passes(name, monkeypatch):
    monkeypatch.setenv("PNS_IGNORE_UNKNOWN", "1")
    monkeypatch.setenv(name, "1")
    with pytest.raises(ValidationError, match=name):
        Settings()
