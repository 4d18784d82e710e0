"""Compose and Kubernetes: valid, restricted, and in step with the service."""

import configparser
import json
import os
import re
import shutil
import subprocess
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from ipaddress import ip_address, ip_network
from pathlib import Path
from threading import Thread

import pytest

from service.settings import Settings

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
OBJECTS = list(yaml.safe_load_all((DEPLOY / "kubernetes" / "pns.yaml").read_text()))
BY_KIND = {entry["kind"]: entry for entry in OBJECTS}
DOCKERFILE = (ROOT / "Dockerfile").read_text()
POD = BY_KIND["Deployment"]["spec"]["template"]["spec"]
PROXY, CONTAINER = POD["containers"]


def test_the_manifests_are_valid():
    file = DEPLOY / "kubernetes" / "pns.yaml"
    tool = ROOT / ".venv-clients" / "bin" / "kubernetes-validate"
    program = str(tool) if tool.exists() else shutil.which("kubernetes-validate")
    if program is None:
        pytest.skip("needs kubernetes-validate (requirements/clients.txt)")
    command = [program, "--strict", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_pod_fits_the_restricted_standard():
    """The controls of the Pod Security Standards' restricted profile that concern this pod."""
    assert POD["securityContext"]["runAsNonRoot"] is True
    assert POD["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert POD["automountServiceAccountToken"] is False
    for container in (PROXY, CONTAINER):
        context = container["securityContext"]
        assert context["allowPrivilegeEscalation"] is False
        assert context["readOnlyRootFilesystem"] is True
        assert context["capabilities"] == {"drop": ["ALL"]}
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(POD)
    assert all(set(volume) & {"emptyDir", "secret", "configMap"} for volume in POD["volumes"])


def test_probes_ask_what_the_service_answers():
    probes = {name: CONTAINER[name]["httpGet"]["path"] for name in CONTAINER if "Probe" in name}
    assert probes == {
        "startupProbe": "/readyz",
        "readinessProbe": "/readyz",
        "livenessProbe": "/healthz",
    }
    ports = {port["name"]: port["containerPort"] for port in CONTAINER["ports"]}
    assert ports == {"service": 8000, "metrics": 9000}
    assert {CONTAINER[name]["httpGet"]["port"] for name in probes} == {"service"}


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
    # An ingress keeps them for a minute.
    (seconds,) = re.findall(
        r"^  keepalive_timeout (\d+)s;", (DEPLOY / "proxy" / "nginx.conf").read_text(), re.M
    )
    assert int(seconds) > 60


def test_the_pods_proxy_leads_to_the_service_beside_it():
    configuration = (DEPLOY / "proxy" / "nginx.conf").read_text()
    ports = {port["name"]: port["containerPort"] for port in CONTAINER["ports"]}
    assert f"server service:{ports['service']};" in configuration
    assert {"ip": "127.0.0.1", "hostnames": ["service"]} in POD["hostAliases"]
    (listens,) = re.findall(r"^    listen (\d+)", configuration, re.M)
    assert PROXY["ports"] == [{"name": "http", "containerPort": int(listens)}]
    (mounted,) = (m["mountPath"] for m in PROXY["volumeMounts"] if m["name"] == "trusted")
    assert f"include {mounted}/*.conf;" in configuration
    environment = {entry["name"]: entry["value"] for entry in CONTAINER["env"]}
    assert environment["PNS_PROXIES"] == "127.0.0.1"
    # It takes nothing away from the service while that finishes what it has.
    before = PROXY["lifecycle"]["preStop"]["exec"]["command"]
    assert int(before[1]) >= 5 + Settings().drain_seconds


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
    """A proxy may speak for any client, so each port is open to the proxies' network alone."""
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
    environment, limit, jobs = {
        "image": ({}, 1024, 1),
        "compose": (
            COMPOSE["services"]["service"]["environment"],
            mebibytes(COMPOSE["services"]["service"]["mem_limit"]),
            None,
        ),
        "kubernetes": (
            {entry["name"]: entry["value"] for entry in CONTAINER["env"]},
            mebibytes(CONTAINER["resources"]["limits"]["memory"].lower().removesuffix("i")),
            None,
        ),
    }[where]
    own = {name.removeprefix("PNS_"): value for name, value in environment.items()}
    settings = Settings(**{name.lower(): value for name, value in (image | own).items()}, workers=2)
    of_worker, of_server = map(
        int, re.findall(r"take (\d+) MiB each and the server (\d+)", DOCKERFILE)[0]
    )
    # A body for each place, and what answers and made files take besides.
    held = (settings.workers + settings.queue) * settings.body / 2**20
    working = (jobs or settings.workers) * settings.memory / 2**20
    assert settings.workers * of_worker + of_server + held + working <= limit


def test_the_proxys_room_holds_all_bodies_that_it_lets_in():
    configuration = (DEPLOY / "proxy" / "nginx.conf").read_text()
    (most,) = re.findall(r"limit_conn all_bodies (\d+);", configuration)
    (mounted,) = COMPOSE["services"]["proxy"]["tmpfs"]
    volumes = {volume["name"]: volume for volume in POD["volumes"]}
    for room in (
        mounted.partition("size=")[2].partition(",")[0],
        volumes["proxy-tmp"]["emptyDir"]["sizeLimit"].lower().removesuffix("i"),
    ):
        assert int(most) * Settings().body / 2**20 <= mebibytes(room)


def test_one_replica_at_a_time_goes():
    labels = BY_KIND["Deployment"]["spec"]["selector"]
    assert BY_KIND["PodDisruptionBudget"]["spec"] == {"maxUnavailable": 1, "selector": labels}
    assert BY_KIND["Deployment"]["spec"]["replicas"] > 1


def test_the_unit_starts(tmp_path):
    """Its command runs in its environment until the service answers."""
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    text = (DEPLOY / "systemd" / "pns.service").read_text()
    unit.read_string(text)
    assert unit["Service"]["ExecStart"] == "/opt/pns/bin/pns serve"
    assert int(unit["Service"]["TimeoutStopSec"]) >= Settings().drain_seconds
    given = [
        pair for line in re.findall(r"^Environment=(.*)$", text, re.M) for pair in line.split()
    ]
    environment = dict(pair.split("=", 1) for pair in given)
    own = {
        name.removeprefix("PNS_").lower(): v for name, v in environment.items() if "PNS_" in name
    }
    assert Settings(**own).port == 8000
    environment |= {"PNS_PORT": "0", "PNS_METRICS_PORT": "0"}
    command = [Path(sys.executable).with_name("pns"), "serve"]
    with subprocess.Popen(
        command, env=os.environ | environment, stdout=subprocess.PIPE, text=True
    ) as process:
        assert "Open http://127.0.0.1:" in process.stdout.readline()
        process.terminate()
        assert process.wait(60) == 0


def mebibytes(size):
    return int(size[:-1]) * {"m": 1, "g": 1024}[size[-1]]
