"""The cluster of a batch: valid, restricted, and its commands are ones that exist."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import typer

from service.cli import app
from service.settings import Settings

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "deploy"
COMPOSE = yaml.safe_load((DEPLOY / "ray" / "compose.yaml").read_text())
JOB = yaml.safe_load((DEPLOY / "kubernetes" / "batch.yaml").read_text())
CLUSTER = JOB["spec"]["rayClusterSpec"]
PODS = {
    "submitter": JOB["spec"]["submitterPodTemplate"],
    "head": CLUSTER["headGroupSpec"]["template"],
    "worker": CLUSTER["workerGroupSpecs"][0]["template"],
}


def parsed(command):
    """The parameters of a command line of ours."""
    group = typer.main.get_command(app)
    name, *arguments = shlex.split(command)[1:]
    context = group.commands[name].make_context(name, arguments)
    return context.params


def test_the_job_is_a_command_that_goes_on_where_it_stopped():
    given = parsed(JOB["spec"]["entrypoint"])
    assert given["address"] == "auto"
    mounts = PODS["head"]["spec"]["containers"][0]["volumeMounts"]
    kept = {mount["mountPath"] for mount in mounts if mount["name"] == "data"}
    assert str(given["report"].parent) in kept


# What a RayJob is around its pods, which are the validator's to look at below: the fields that we
# use, and what they may hold. Kubernetes drops a field that a resource does not know, in silence.
# Source: KubeRay's API reference, ray.io/v1, types RayJobSpec, RayClusterSpec, HeadGroupSpec and
# WorkerGroupSpec; there `rayStartParams` maps text to text, numbers are of 32 bits.
FIELDS = {
    "job": {
        "entrypoint": str,
        "backoffLimit": int,
        "shutdownAfterJobFinishes": bool,
        "ttlSecondsAfterFinished": int,
        "submitterPodTemplate": dict,
        "rayClusterSpec": dict,
    },
    "cluster": {"rayVersion": str, "headGroupSpec": dict, "workerGroupSpecs": list},
    "head": {"rayStartParams": dict, "template": dict},
    "workers": {
        "groupName": str,
        "replicas": int,
        "minReplicas": int,
        "maxReplicas": int,
        "rayStartParams": dict,
        "template": dict,
    },
}
# Without these the API server refuses the job.
REQUIRED = {
    "job": set(),
    "cluster": {"headGroupSpec"},
    "head": {"rayStartParams", "template"},
    "workers": {"groupName", "minReplicas", "maxReplicas", "rayStartParams", "template"},
}
OUTER = {
    "job": JOB["spec"],
    "cluster": CLUSTER,
    "head": CLUSTER["headGroupSpec"],
    "workers": CLUSTER["workerGroupSpecs"][0],
}


@pytest.mark.parametrize("name", OUTER)
def test_around_its_pods_the_job_is_one_that_kuberay_knows(name):
    values, kinds = OUTER[name], FIELDS[name]
    assert set(values) <= set(kinds)
    assert REQUIRED[name] <= set(values)
    for field, value in values.items():
        assert type(value) is kinds[field], field
    for key, value in values.get("rayStartParams", {}).items():
        assert (type(key), type(value)) == (str, str)


def test_the_job_is_named_and_counts_its_workers():
    assert (JOB["apiVersion"], JOB["kind"]) == ("ray.io/v1", "RayJob")
    assert {"name", "generateName"} & set(JOB["metadata"])
    assert len(CLUSTER["workerGroupSpecs"]) == 1
    workers = OUTER["workers"]
    assert 0 <= workers["minReplicas"] <= workers["replicas"] <= workers["maxReplicas"] < 2**31
    # The time to live is heeded only where the cluster is shut down.
    assert JOB["spec"]["shutdownAfterJobFinishes"]
    assert JOB["spec"]["ttlSecondsAfterFinished"] >= 0


@pytest.mark.parametrize("name", PODS)
def test_each_pod_is_valid(name, tmp_path):
    tool = ROOT / ".venv-clients" / "bin" / "kubernetes-validate"
    program = str(tool) if tool.exists() else shutil.which("kubernetes-validate")
    if program is None:
        pytest.skip("needs kubernetes-validate (requirements/clients.txt)")
    # The validator knows no RayJob; what runs are pods.
    pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": name}, **PODS[name]}
    (tmp_path / "pod.yaml").write_text(yaml.safe_dump(pod))
    command = [program, "--strict", str(tmp_path / "pod.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", PODS)
def test_each_pod_fits_the_restricted_standard_and_hears_of_no_services(name):
    spec = PODS[name]["spec"]
    assert spec["securityContext"]["runAsNonRoot"] is True
    assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert spec["automountServiceAccountToken"] is False
    # Beside the service, whose name makes variables that would be settings, or look like some.
    assert spec["enableServiceLinks"] is False
    for container in spec["containers"]:
        context = container["securityContext"]
        assert context["allowPrivilegeEscalation"] is False
        assert context["capabilities"] == {"drop": ["ALL"]}
        assert {"memory"} <= set(container["resources"]["limits"])


def test_compose_has_a_head_and_two_workers_that_nobody_outside_reaches():
    services = COMPOSE["services"]
    assert "--head" in services["head"]["command"]
    assert "--address=head:6379" in services["worker"]["command"]
    assert services["worker"]["deploy"]["replicas"] == 2
    assert COMPOSE["networks"]["inside"]["internal"] is True
    for service in services.values():
        assert "ports" not in service
        assert service["cap_drop"] == ["ALL"]
        assert service["read_only"] is True
        assert service["environment"]["RAY_AUTH_MODE"] == "token"


def test_the_script_of_processes_is_a_shell_script():
    subprocess.run(["sh", "-n", str(DEPLOY / "ray" / "processes.sh")], check=True)


def test_what_is_set_around_a_command_of_ours_does_not_make_it_refuse_to_start():
    """`pns` refuses a PNS_… that is no setting; what these files read is set in its shell."""
    texts = [path.read_text() for path in DEPLOY.rglob("*") if path.is_file()]
    read = {name for text in texts for name in re.findall(r"\$\{?(\w+)", text)}
    assert {"RAY_PORT", "RAY_AUTH_TOKEN"} <= read
    settings = {f"PNS_{name.upper()}" for name in Settings.model_fields}
    assert {name for name in read if name.startswith("PNS_")} <= settings


def test_the_cluster_is_of_the_ray_that_is_pinned():
    pins = (ROOT / "constraints.txt").read_text().splitlines()
    assert f"ray=={CLUSTER['rayVersion']}" in pins
