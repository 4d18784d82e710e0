"""Compose, Kubernetes, Ray and systemd: valid, restricted, and in step with the service."""

import configparser
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from ipaddress import ip_address, ip_network
from pathlib import Path
from threading import Thread

import pytest
import typer

from service.cli import app
from service.settings import Settings

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
DOCKERFILE = (ROOT / "Dockerfile").read_text()
NGINX = (DEPLOY / "proxy" / "nginx.conf").read_text()
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
SERVICES, INSIDE = COMPOSE["services"], COMPOSE["networks"]["inside"]
OBJECTS = list(yaml.safe_load_all((DEPLOY / "kubernetes" / "pns.yaml").read_text()))
BY_KIND = {entry["kind"]: entry for entry in OBJECTS}
POD = BY_KIND["Deployment"]["spec"]["template"]["spec"]
PROXY, CONTAINER = POD["containers"]
VARIABLES = {entry["name"]: entry["value"] for entry in CONTAINER["env"]}
PORTS = {port["name"]: port["containerPort"] for port in CONTAINER["ports"]}
# The cluster of a batch.
RAY = yaml.safe_load((DEPLOY / "ray" / "compose.yaml").read_text())
JOB = yaml.safe_load((DEPLOY / "kubernetes" / "batch.yaml").read_text())
CLUSTER = JOB["spec"]["rayClusterSpec"]
(WORKERS,) = CLUSTER["workerGroupSpecs"]
PODS = {
    "service": POD,
    "submitter": JOB["spec"]["submitterPodTemplate"]["spec"],
    "head": CLUSTER["headGroupSpec"]["template"]["spec"],
    "worker": WORKERS["template"]["spec"],
}


def mebibytes(size):
    size = size.lower().removesuffix("i")
    return int(size[:-1]) * {"m": 1, "g": 1024}[size[-1]]


def room(mounted):
    """The size of a file system of memory, as compose mounts it."""
    return mebibytes(mounted.partition("size=")[2].partition(",")[0])


# Pods


@pytest.mark.parametrize("name", ["pns.yaml", "submitter", "head", "worker"])
def test_the_manifests_are_valid(name, tmp_path):
    tool = ROOT / ".venv-clients" / "bin" / "kubernetes-validate"
    program = str(tool) if tool.exists() else shutil.which("kubernetes-validate")
    if program is None:
        pytest.skip("needs kubernetes-validate (requirements/clients.txt)")
    file = DEPLOY / "kubernetes" / name
    if name in PODS:
        # The validator knows no RayJob; what runs are pods.
        pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": name}, "spec": PODS[name]}
        file = tmp_path / "pod.yaml"
        file.write_text(yaml.safe_dump(pod))
    command = [program, "--strict", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", PODS)
def test_each_pod_fits_the_restricted_standard_and_hears_of_no_services(name):
    """The controls of the Pod Security Standards' restricted profile that concern these pods."""
    pod = PODS[name]
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert pod["automountServiceAccountToken"] is False
    # Of a service's name a cluster makes variables: those of pns would be settings.
    assert pod["enableServiceLinks"] is False
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(pod)
    for container in pod["containers"]:
        context = container["securityContext"]
        assert context["allowPrivilegeEscalation"] is False
        assert context["capabilities"] == {"drop": ["ALL"]}
        assert name != "service" or context["readOnlyRootFilesystem"] is True
        assert {"memory"} <= set(container["resources"]["limits"])
    if name == "service":
        assert all(set(volume) & {"emptyDir", "secret", "configMap"} for volume in pod["volumes"])
        assert BY_KIND["Service"]["metadata"]["name"] == "pns"


def test_probes_ask_what_the_service_answers():
    probes = {name: CONTAINER[name]["httpGet"] for name in CONTAINER if "Probe" in name}
    paths = {"startupProbe": "/readyz", "readinessProbe": "/readyz", "livenessProbe": "/healthz"}
    assert probes == {name: {"path": path, "port": "service"} for name, path in paths.items()}
    assert PORTS == {"service": 8000, "metrics": 9000}


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
        _, python, *arguments = SERVICES["service"]["healthcheck"]["test"]
    assert python == "python"
    with HTTPServer(("127.0.0.1", 0), Service) as server:
        Thread(target=server.handle_request, daemon=True).start()
        port = str(server.server_port)
        arguments = [argument.replace("8000", port) for argument in arguments]
        environment = {"PNS_PORT": port, "http_proxy": "http://127.0.0.1:9"}
        done = subprocess.run([sys.executable, *arguments], env=environment, check=False)
    assert (done.returncode == 0) is healthy


# Times


def test_a_drain_has_its_time():
    """In a cluster what is sent before the ingress knows that a pod goes meets no closed port."""
    drain = Settings().drain_seconds
    before, proxys = (
        each["lifecycle"]["preStop"]["exec"]["command"] for each in (CONTAINER, PROXY)
    )
    assert before[0] == "sleep"
    assert POD["terminationGracePeriodSeconds"] >= int(before[1]) + drain
    # The proxy takes nothing away from the service while that finishes what it has.
    assert int(proxys[1]) >= 5 + drain
    assert int(SERVICES["service"]["stop_grace_period"].removesuffix("s")) >= drain


def test_proxies_end_connections_that_rest_before_the_service_does():
    """Else a request meets one that just ends: 502, for nobody may send it again unasked."""
    (seconds,) = re.findall(r"^    keepalive_timeout (\d+)s;", NGINX, re.M)
    assert int(seconds) < Settings().keep_alive_seconds
    # An ingress keeps them for a minute.
    (seconds,) = re.findall(r"^  keepalive_timeout (\d+)s;", NGINX, re.M)
    assert int(seconds) > 60


# Who reaches whom


def test_the_pods_proxy_leads_to_the_service_beside_it():
    assert f"server service:{PORTS['service']};" in NGINX
    assert {"ip": "127.0.0.1", "hostnames": ["service"]} in POD["hostAliases"]
    (listens,) = re.findall(r"^    listen (\d+)", NGINX, re.M)
    assert PROXY["ports"] == [{"name": "http", "containerPort": int(listens)}]
    (mounted,) = (m["mountPath"] for m in PROXY["volumeMounts"] if m["name"] == "trusted")
    assert f"include {mounted}/*.conf;" in NGINX
    assert VARIABLES["PNS_PROXIES"] == "127.0.0.1"


def test_only_the_proxy_is_reached_from_outside_at_an_address_of_its_own():
    """Docker gives the first free address to whoever starts first, which is not the proxy."""
    assert "ports" not in SERVICES["service"]
    assert set(SERVICES["service"]["networks"]) == {"inside"}
    assert INSIDE["internal"] is True
    address = SERVICES["proxy"]["networks"]["inside"]["ipv4_address"]
    assert SERVICES["service"]["environment"]["PNS_PROXIES"] == address
    assert all(port.startswith("127.0.0.1:") for port in SERVICES["proxy"]["ports"])
    network = ip_network(INSIDE["ipam"]["config"][0]["subnet"])
    inside = [
        ip_address(service["networks"]["inside"]["ipv4_address"])
        for service in SERVICES.values()
        if "inside" in service["networks"]
    ]
    gateway = next(network.hosts())
    assert len({gateway, *inside}) == 1 + len(inside)
    assert all(address in network for address in inside)


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


def test_one_replica_at_a_time_goes():
    labels = BY_KIND["Deployment"]["spec"]["selector"]
    assert BY_KIND["PodDisruptionBudget"]["spec"] == {"maxUnavailable": 1, "selector": labels}
    assert BY_KIND["Deployment"]["spec"]["replicas"] > 1


# Containers of compose, and room


@pytest.mark.parametrize("name", ["service", "proxy"])
def test_both_run_with_nothing_that_they_do_not_need_and_fill_no_disk(name):
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert {"mem_limit", "pids_limit"} <= set(service)
    assert "privileged" not in json.dumps(service)
    # Docker's own driver keeps every line that there ever was.
    assert service["logging"]["driver"] == "json-file"
    assert {"max-size", "max-file"} <= set(service["logging"]["options"])
    # Files in memory are counted as the container's, which is killed when it has too much.
    (mounted,) = service["tmpfs"]
    assert room(mounted) + 256 <= mebibytes(service["mem_limit"])


COMPOSED = SERVICES["service"]["environment"]


@pytest.mark.parametrize(
    ("environment", "limit", "jobs"),
    [
        ({}, 1024, 1),
        (COMPOSED, mebibytes(SERVICES["service"]["mem_limit"]), None),
        (VARIABLES, mebibytes(CONTAINER["resources"]["limits"]["memory"]), None),
    ],
    ids=["image", "compose", "kubernetes"],
)
def test_what_requests_may_hold_fits_into_the_memory_that_there_is(environment, limit, jobs):
    """The server's bodies, answers and files are not given back where a worker is killed."""
    image = dict(re.findall(r"^ +(PNS_[A-Z_]+)=(\S+)", DOCKERFILE, re.MULTILINE))
    own = {name.removeprefix("PNS_").lower(): v for name, v in (image | environment).items()}
    settings = Settings(**own, workers=2)
    assert not environment or settings.proxies
    (taken,) = re.findall(r"take (\d+) MiB each and the server (\d+)", DOCKERFILE)
    of_worker, of_server = map(int, taken)
    # A body for each place, and what answers and made files take besides.
    held = (settings.workers + settings.queue) * settings.body / 2**20
    working = (jobs or settings.workers) * settings.memory / 2**20
    assert settings.workers * of_worker + of_server + held + working <= limit


def test_the_proxys_room_holds_all_bodies_that_it_lets_in():
    (most,) = re.findall(r"limit_conn all_bodies (\d+);", NGINX)
    (mounted,) = SERVICES["proxy"]["tmpfs"]
    volumes = {volume["name"]: volume for volume in POD["volumes"]}
    for size in (room(mounted), mebibytes(volumes["proxy-tmp"]["emptyDir"]["sizeLimit"])):
        assert int(most) * Settings().body / 2**20 <= size


def test_the_unit_starts():
    """Its command runs in its environment until the service answers."""
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    text = (DEPLOY / "systemd" / "pns.service").read_text()
    unit.read_string(text)
    assert unit["Service"]["ExecStart"] == "/opt/pns/bin/pns serve"
    assert int(unit["Service"]["TimeoutStopSec"]) >= Settings().drain_seconds
    lines = re.findall(r"^Environment=(.*)$", text, re.M)
    environment = dict(pair.split("=", 1) for line in lines for pair in line.split())
    own = {k.removeprefix("PNS_").lower(): v for k, v in environment.items() if "PNS_" in k}
    assert Settings(**own).port == 8000
    environment |= {"PNS_PORT": "0", "PNS_METRICS_PORT": "0"}
    command = [Path(sys.executable).with_name("pns"), "serve"]
    with subprocess.Popen(
        command, env=os.environ | environment, stdout=subprocess.PIPE, text=True
    ) as process:
        assert "Open http://127.0.0.1:" in process.stdout.readline()
        process.terminate()
        assert process.wait(60) == 0


# The cluster of a batch


def test_the_job_is_a_command_that_goes_on_where_it_stopped():
    group = typer.main.get_command(app)
    name, *arguments = shlex.split(JOB["spec"]["entrypoint"])[1:]
    given = group.commands[name].make_context(name, arguments).params
    assert given["address"] == "auto"
    mounts = PODS["head"]["containers"][0]["volumeMounts"]
    kept = {mount["mountPath"] for mount in mounts if mount["name"] == "data"}
    assert str(given["report"].parent) in kept


# What a RayJob is around its pods: the fields that we use, and what they may hold. Kubernetes drops
# a field that a resource does not know, in silence, and refuses a job without those with a star.
# Source: KubeRay's API reference, ray.io/v1, types RayJobSpec, RayClusterSpec, HeadGroupSpec and
# WorkerGroupSpec; there `rayStartParams` maps text to text, numbers are of 32 bits.
FIELDS = {
    "job": "entrypoint:str backoffLimit:int shutdownAfterJobFinishes:bool "
    "ttlSecondsAfterFinished:int submitterPodTemplate:dict rayClusterSpec:dict",
    "cluster": "rayVersion:str headGroupSpec*:dict workerGroupSpecs:list",
    "head": "rayStartParams*:dict template*:dict",
    "workers": "groupName*:str replicas:int minReplicas*:int maxReplicas*:int "
    "rayStartParams*:dict template*:dict",
}
OUTER = dict(zip(FIELDS, (JOB["spec"], CLUSTER, CLUSTER["headGroupSpec"], WORKERS), strict=True))


@pytest.mark.parametrize("name", OUTER)
def test_around_its_pods_the_job_is_one_that_kuberay_knows(name):
    known = [field.split(":") for field in FIELDS[name].split()]
    kinds = {field.removesuffix("*"): kind for field, kind in known}
    needed = {field.removesuffix("*") for field, _ in known if field.endswith("*")}
    values = OUTER[name]
    assert needed <= set(values) <= set(kinds)
    assert {field: type(value).__name__ for field, value in values.items()}.items() <= kinds.items()
    for key, value in values.get("rayStartParams", {}).items():
        assert (type(key), type(value)) == (str, str)


def test_the_job_is_named_and_counts_its_workers():
    assert (JOB["apiVersion"], JOB["kind"]) == ("ray.io/v1", "RayJob")
    assert {"name", "generateName"} & set(JOB["metadata"])
    assert 0 <= WORKERS["minReplicas"] <= WORKERS["replicas"] <= WORKERS["maxReplicas"] < 2**31
    # The time to live is heeded only where the cluster is shut down.
    assert JOB["spec"]["shutdownAfterJobFinishes"]
    assert JOB["spec"]["ttlSecondsAfterFinished"] >= 0
    pins = (ROOT / "constraints.txt").read_text().splitlines()
    assert f"ray=={CLUSTER['rayVersion']}" in pins


def test_compose_has_a_head_and_two_workers_that_nobody_outside_reaches():
    services = RAY["services"]
    assert "--head" in services["head"]["command"]
    assert "--address=head:6379" in services["worker"]["command"]
    assert services["worker"]["deploy"]["replicas"] == 2
    assert RAY["networks"]["inside"]["internal"] is True
    for service in services.values():
        assert "ports" not in service
        assert service["cap_drop"] == ["ALL"]
        assert service["read_only"] is True
        assert service["environment"]["RAY_AUTH_MODE"] == "token"
    subprocess.run(["sh", "-n", str(DEPLOY / "ray" / "processes.sh")], check=True)


def test_what_is_set_around_a_command_of_ours_does_not_make_it_refuse_to_start():
    """`pns` refuses a PNS_… that is no setting; what these files read is set in its shell."""
    texts = [path.read_text() for path in DEPLOY.rglob("*") if path.is_file()]
    read = {name for text in texts for name in re.findall(r"\$\{?(\w+)", text)}
    assert {"RAY_PORT", "RAY_AUTH_TOKEN"} <= read
    settings = {f"PNS_{name.upper()}" for name in Settings.model_fields}
    assert {name for name in read if name.startswith("PNS_")} <= settings
