"""Compose and Kubernetes: valid, restricted, and in step with the service."""

import json
import re
import shutil
import subprocess
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from ipaddress import ip_address, ip_network
from pathlib import Path
from threading import Thread

import pytest

from service.http.result_room import KEPT_SHARE
from service.settings import Settings

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
OBJECTS = list(yaml.safe_load_all((DEPLOY / "kubernetes" / "pns.yaml").read_text()))
BY_KIND = {entry["kind"]: entry for entry in OBJECTS}
DOCKERFILE = (ROOT / "Dockerfile").read_text()
POD = BY_KIND["Deployment"]["spec"]["template"]["spec"]
(CONTAINER,) = POD["containers"]


def test_the_manifests_are_valid():
    tool = ROOT / ".venv-clients" / "bin" / "kubernetes-validate"
    program = str(tool) if tool.exists() else shutil.which("kubernetes-validate")
    if program is None:
        pytest.skip("needs kubernetes-validate (requirements/clients.txt)")
    command = [program, "--strict", str(DEPLOY / "kubernetes" / "pns.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_pod_fits_the_restricted_standard():
    """The controls of the Pod Security Standards' restricted profile that concern this pod."""
    assert POD["securityContext"]["runAsNonRoot"] is True
    assert POD["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert POD["automountServiceAccountToken"] is False
    context = CONTAINER["securityContext"]
    assert context["allowPrivilegeEscalation"] is False
    assert context["readOnlyRootFilesystem"] is True
    assert context["capabilities"] == {"drop": ["ALL"]}
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(POD)
    assert all(set(volume) & {"emptyDir", "secret"} for volume in POD["volumes"])


def test_probes_ask_what_the_service_answers():
    probes = {name: CONTAINER[name]["httpGet"]["path"] for name in CONTAINER if "Probe" in name}
    assert probes == {
        "startupProbe": "/readyz",
        "readinessProbe": "/readyz",
        "livenessProbe": "/healthz",
    }
    ports = {port["name"]: port["containerPort"] for port in CONTAINER["ports"]}
    assert ports == {"http": 8000, "metrics": 9000}


@pytest.mark.parametrize(("status", "healthy"), [(200, True), (503, False)])
@pytest.mark.parametrize("where", ["image", "compose"])
def test_the_health_check_asks_the_container_and_no_proxy(where, status, healthy):
    """Docker names the proxy that it is told of in the environment of its containers."""

    class Service(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(status if self.path == asked else 404)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_):
            pass

    if where == "image":
        asked = "/healthz"
        (text,) = re.findall(r"^HEALTHCHECK.*\\\n +CMD (.*)$", DOCKERFILE, re.MULTILINE)
        python, *arguments = json.loads(text)
    else:
        asked = "/readyz"
        _, python, *arguments = COMPOSE["services"]["service"]["healthcheck"]["test"]
    assert python == "python"
    with HTTPServer(("127.0.0.1", 0), Service) as server:
        Thread(target=server.handle_request, daemon=True).start()
        port = str(server.server_port)
        arguments = [argument.replace("8000", port) for argument in arguments]
        environment = {"PNS_PORT": port, "http_proxy": "http://127.0.0.1:9"}
        done = subprocess.run([sys.executable, *arguments], env=environment, check=False)
    assert (done.returncode == 0) is healthy


@pytest.mark.parametrize("where", ["kubernetes", "compose"])
def test_the_environment_is_made_of_settings(where):
    if where == "compose":
        environment = COMPOSE["services"]["service"]["environment"]
    else:
        environment = {entry["name"]: entry["value"] for entry in CONTAINER["env"]}
    settings = {name.removeprefix("PNS_").lower(): value for name, value in environment.items()}
    assert Settings(**settings).proxies


def test_the_cluster_adds_nothing_to_the_environment():
    """Of a service's name it makes variables: those of pns would be settings, or look like some."""
    assert BY_KIND["Service"]["metadata"]["name"] == "pns"
    assert POD["enableServiceLinks"] is False


def test_a_drain_has_its_time():
    """In a cluster what is sent before the ingress knows that a pod goes meets no closed port."""
    before = CONTAINER["lifecycle"]["preStop"]["exec"]["command"]
    assert before[0] == "sleep"
    assert POD["terminationGracePeriodSeconds"] >= int(before[1]) + Settings().drain_seconds
    grace = COMPOSE["services"]["service"]["stop_grace_period"]
    assert int(grace.removesuffix("s")) >= Settings().drain_seconds


def test_proxies_end_connections_that_rest_before_the_service_does():
    """Else a request meets one that just ends: 502, for nobody may send it again unasked."""
    (seconds,) = re.findall(
        r"^    keepalive_timeout (\d+)s;", (DEPLOY / "proxy" / "nginx.conf").read_text(), re.M
    )
    assert int(seconds) < Settings().keep_alive_seconds
    behind_ingress = {entry["name"]: entry["value"] for entry in CONTAINER["env"]}
    assert float(behind_ingress["PNS_KEEP_ALIVE_SECONDS"]) > 60


def test_only_the_proxy_is_reached_from_outside():
    services = COMPOSE["services"]
    assert "ports" not in services["service"]
    assert set(services["service"]["networks"]) == {"inside"}
    assert COMPOSE["networks"]["inside"]["internal"] is True
    address = services["proxy"]["networks"]["inside"]["ipv4_address"]
    assert services["service"]["environment"]["PNS_PROXIES"] == address
    assert all(port.startswith("127.0.0.1:") for port in services["proxy"]["ports"])


def test_no_address_is_left_to_chance_beside_the_proxys():
    """Docker gives the first free address to whoever starts first, which is not the proxy."""
    network = ip_network(COMPOSE["networks"]["inside"]["ipam"]["config"][0]["subnet"])
    inside = [
        service["networks"]["inside"]["ipv4_address"]
        for service in COMPOSE["services"].values()
        if "inside" in service["networks"]
    ]
    gateway = next(network.hosts())
    assert len({gateway, *map(ip_address, inside)}) == 1 + len(inside)
    assert all(ip_address(address) in network for address in inside)


@pytest.mark.parametrize("name", ["service", "proxy"])
def test_both_run_with_nothing_that_they_do_not_need(name):
    service = COMPOSE["services"][name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert {"mem_limit", "pids_limit"} <= set(service)
    assert "privileged" not in json.dumps(service)


@pytest.mark.parametrize("name", ["service", "proxy"])
def test_who_asks_often_fills_no_disk_with_lines(name):
    """Docker's own driver keeps every line that there ever was."""
    logging = COMPOSE["services"][name]["logging"]
    assert logging["driver"] == "json-file"
    assert {"max-size", "max-file"} <= set(logging["options"])


def test_each_port_of_the_pod_is_for_a_namespace_that_is_named():
    """Whoever may speak to the pod may speak for any client, where its network is the proxies'."""
    policy = BY_KIND["NetworkPolicy"]["spec"]
    assert policy["policyTypes"] == ["Ingress", "Egress"]
    assert "egress" not in policy
    ports = [port["port"] for rule in policy["ingress"] for port in rule["ports"]]
    assert sorted(ports) == ["http", "metrics"]
    for rule in policy["ingress"]:
        (peer,) = rule["from"]
        assert peer["namespaceSelector"]["matchLabels"]["kubernetes.io/metadata.name"]


@pytest.mark.parametrize("name", ["service", "proxy"])
def test_what_lies_in_a_file_system_of_memory_leaves_room_for_the_process(name):
    """It is counted as the container's memory, which is killed when it has more than its limit."""
    service = COMPOSE["services"][name]
    (mounted,) = service["tmpfs"]
    files = mebibytes(mounted.partition("size=")[2].partition(",")[0])
    assert files + 256 <= mebibytes(service["mem_limit"])


@pytest.mark.parametrize("where", ["image", "compose", "kubernetes"])
def test_what_requests_may_hold_fits_into_the_memory_that_there_is(where):
    """The server's bodies, answers and files are not given back where a worker is killed."""
    image = dict(re.findall(r"^ +PNS_([A-Z_]+)=(\S+)", DOCKERFILE, re.MULTILINE))
    service = COMPOSE["services"]["service"]
    (mounted,) = service["tmpfs"]
    environment, files, limit, jobs = {
        "image": ({}, 0, 1024, 1),
        "compose": (
            service["environment"],
            mebibytes(mounted.partition("size=")[2].partition(",")[0]),
            mebibytes(service["mem_limit"]),
            None,
        ),
        "kubernetes": (
            {entry["name"]: entry["value"] for entry in CONTAINER["env"]},
            0,
            mebibytes(CONTAINER["resources"]["limits"]["memory"].lower().removesuffix("i")),
            None,
        ),
    }[where]
    own = {name.removeprefix("PNS_"): value for name, value in environment.items()}
    settings = Settings(**{name.lower(): value for name, value in (image | own).items()}, workers=2)
    of_worker, of_server = map(
        int, re.findall(r"take (\d+) MiB each and the server (\d+)", DOCKERFILE)[0]
    )
    held = (settings.all_bodies + settings.answer_bytes) / 2**20 + files
    working = (jobs or settings.workers) * settings.memory / 2**20
    assert (settings.workers + 1) * of_worker + of_server + held + working <= limit
    # With what is made meanwhile, as the service would say at its start.
    assert not files or settings.result_bytes <= files * KEPT_SHARE * 2**20


def mebibytes(size):
    return int(size[:-1]) * {"m": 1, "g": 1024}[size[-1]]
