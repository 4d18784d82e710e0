"""The proxy of deploy/: its own configuration, run on loopback in front of a service."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

Address = tuple[str, int]
CONFIGURATION = Path(__file__).resolve().parents[2] / "deploy" / "proxy" / "nginx.conf"


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def nginx() -> str:
    """The program; skips the test where there is none."""
    found = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    if found is None:
        pytest.skip("needs nginx (Debian: nginx-light)")
    return found


@contextmanager
def proxied(
    behind: Address, folder: Path, *others: Address, seconds: int = 1, rate: int = 20
) -> Iterator[Address]:
    """The address of a proxy in front of a service, with all that it writes in a folder.

    `others` are further replicas of the service.

    A client may say which address it has, in X-Client. The times are `seconds` where 10 are
    deployed, and an address may ask `rate` times a second where 20 are.
    """
    program, port = nginx(), free_port()
    text = CONFIGURATION.read_text()
    servers = [f"server {host}:{port_behind};" for host, port_behind in (behind, *others)]
    text = text.replace("server service:8000;", " ".join(servers))
    text = text.replace("rate=20r/s", f"rate={rate}r/s")
    text = text.replace("listen 8080", f"listen 127.0.0.1:{port}").replace("/tmp/", f"{folder}/")
    text = text.replace("/dev/stdout", str(folder / "access.log"))
    whose = "set_real_ip_from 127.0.0.1; real_ip_header X-Client;"
    text = text.replace("server_tokens off;", f"server_tokens off; {whose}")
    text = re.sub(r"(client_\w+_timeout|lingering_time) 10s", rf"\1 {seconds}s", text)
    if os.geteuid() == 0:
        # Else its workers are nobody's, who may not write into this folder.
        text = f"user root;\n{text}"
    (folder / "nginx.conf").write_text(text)
    command = [program, "-p", folder, "-c", folder / "nginx.conf", "-g", "daemon off;"]
    errors = folder / "error.log"
    with errors.open("wb") as stderr:
        process = subprocess.Popen(command, stderr=stderr)
    try:
        pause = threading.Event()
        while not _listens(port):
            assert process.poll() is None, errors.read_text()
            pause.wait(0.05)
        yield "127.0.0.1", port
    finally:
        process.terminate()
        process.wait(30)


def _listens(port: int) -> bool:
    with closing(socket.socket()) as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
