"""The wheel holds what a user needs and no more, and README's commands work where it is alone."""

import os
import re
import runpy
import subprocess
import sys
import zipfile
from contextlib import contextmanager
from pathlib import Path

import pytest
import setuptools

from pns_common.model.file import DEFAULT_MODEL
from pns_common.version import VERSION
from tests.support.installed import ROOT, checkout, environment, run

README = (ROOT / "README.md").read_text()
ADDRESS = re.compile(r"running on (http://[\d.]+:\d+)")


@pytest.fixture(scope="module")
def distributions(tmp_path_factory):
    """The source distribution and the wheel."""
    source, out = checkout(tmp_path_factory.mktemp("source")), tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, source)
    (wheel,), (archive,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return archive, wheel


@pytest.fixture(scope="module")
def wheel(distributions):
    return distributions[1]


@pytest.fixture(scope="module")
def library(wheel, tmp_path_factory):
    """Programs of an environment with the library alone."""
    return environment(tmp_path_factory.mktemp("library"), wheel, set())


@pytest.fixture(scope="module")
def service(wheel, tmp_path_factory):
    """Programs of an environment with the service too."""
    return environment(tmp_path_factory.mktemp("service"), wheel, {"service"})


def commands(*programs):
    """README's lines of shell that run one of these programs, without their comments."""
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    plain = [re.sub(r"\s#\s.*|\.venv-\w+/bin/", "", line) for line in lines]
    return [line.strip() for line in plain if line.startswith(programs)]


def test_both_distributions_are_fit_to_publish(distributions):
    out = run(sys.executable, "-m", "twine", "check", "--strict", *distributions)
    assert out.count("PASSED") == 2


def test_the_wheel_holds_two_packages_models_page_and_licence(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {"pns_common/py.typed", "pns_common/kernels/loop.py"}
    wanted |= {"pns_common/kernels/compiled.abi3.so"}
    wanted |= {"pns_service/cli/commands.py", "pns_service/http/routes.py"}
    wanted |= {"pns_service/web/index.html"}
    wanted |= {f"pns_common/models/{name}.onnx" for name in ("paper", DEFAULT_MODEL)}
    assert wanted <= names
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"pns_common", "pns_service"}
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_nothing_of_the_service_is_left_out(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    installed = {n.removeprefix("pns_service/") for n in names if n.startswith("pns_service/")}
    known = run("git", "ls-files", "service", cwd=ROOT).split()
    assert {name.removeprefix("service/") for name in known} - installed == set()


def test_setuptools_takes_no_folder_of_the_service_for_a_forgotten_package(monkeypatch):
    """It warns of each that is none, at every build, and says that it would leave it out."""
    said = {}
    monkeypatch.setattr(setuptools, "setup", lambda **given: said.update(given))
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    known = run("git", "ls-files", "service").split()
    folders = {Path(name).parent.as_posix().replace("/", ".") for name in known}
    assert {f"pns_{folder}" for folder in folders} <= set(said["packages"])


def test_the_library_asks_for_four_packages(wheel, tmp_path):
    (metadata,) = [n for n in zipfile.ZipFile(wheel).namelist() if n.endswith("METADATA")]
    text = zipfile.ZipFile(wheel).read(metadata).decode()
    asked = [line for line in text.splitlines() if line.startswith("Requires-Dist")]
    base = sorted(line.split()[1].partition(">")[0] for line in asked if "extra ==" not in line)
    assert base == ["jaxtyping", "numpy", "onnx", "onnxruntime"]


def test_readmes_python_prints_what_readme_says(tmp_path):
    """In this environment, which has trimesh."""
    (snippet,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    script = tmp_path / "readme.py"
    script.write_text(snippet)
    out = run(sys.executable, script, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert f"It prints `{out.strip()}`" in README


def test_the_library_refines_where_it_is_alone(library, tmp_path):
    code = (
        "from pns_common import Mesh, load_model, pns, refine\n"
        "mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])\n"
        "print(refine(mesh, pns(load_model())))"
    )
    out = run(library / "python", "-c", code, cwd=tmp_path)
    assert out == "Refinement('pns', levels=2, vertices=15, faces=16)\n"


def test_the_command_says_what_to_install_where_the_service_is_not(library, tmp_path):
    done = subprocess.run(
        [library / "pns", "--version"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == 1
    assert "pip install 'pns-subdivision[service]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_command_knows_its_version(service, tmp_path):
    assert run(service / "pns", "--version", cwd=tmp_path) == f"pns {VERSION}\n"


def test_readmes_commands_run(service, tmp_path):
    lines = commands("pns ")
    assert {line.split()[1] for line in lines} >= {"example", "subdivide", "batch"}
    run(service / "pns", "example", "chair.glb", cwd=tmp_path)
    run(service / "pns", "subdivide", "chair.glb", "-o", "chair.obj", "--levels", "1", cwd=tmp_path)
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "chair.glb").write_bytes((tmp_path / "chair.glb").read_bytes())
    for line in lines:
        run("bash", "-ec", f"{service}/{line}", cwd=tmp_path)
    assert (tmp_path / "fine.glb").stat().st_size > (tmp_path / "part.glb").stat().st_size
    assert (tmp_path / "refined" / "chair.glb").exists()


@contextmanager
def serving(service, folder):
    """The address of a server of that environment."""
    command = [service / "pns", "serve", "--port", "0"]
    options = {"stderr": subprocess.PIPE, "text": True, "env": os.environ | {"PNS_WORKERS": "1"}}
    with subprocess.Popen(command, cwd=folder, **options) as process:
        try:
            yield next(told[1] for line in process.stderr if (told := ADDRESS.search(line)))
        finally:
            process.terminate()
            process.stderr.read()


def test_readmes_requests_are_answered(service, tmp_path):
    run(service / "pns", "example", "part.glb", cwd=tmp_path)
    lines = commands("curl ")
    assert lines
    with serving(service, tmp_path) as address:
        for line in lines:
            # A fresh service loads its kernels first; until then it answers 503.
            here = line.replace("http://127.0.0.1:8000", address)
            run(
                "bash",
                "-ec",
                here.replace("curl ", "curl --fail --silent --show-error --retry 9 ", 1),
                cwd=tmp_path,
            )
    assert (tmp_path / "fine.glb").stat().st_size > (tmp_path / "part.glb").stat().st_size
