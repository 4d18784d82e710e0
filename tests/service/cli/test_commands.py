"""Models by name or file, help, settings, keys, and the other options."""

import json
import re
import signal
import socket
import subprocess
import sys

import msgspec
import pytest

from pns_common.model.file import DEFAULT_MODEL, bundled_models, load_model
from service import cli
from service.__main__ import main
from service.gltf.read.container import read_glb, write_glb
from service.http.access import keys
from service.meshfiles.example import part_glb
from tests.service.cli.trees import FACES, tree_of, tree_of_bytes
from tests.support.networks import default_model_bytes


@pytest.mark.parametrize(
    ("lost", "error", "text"),
    [
        ("pns_common.gone", ModuleNotFoundError, "no module"),
        ("service.gone", ModuleNotFoundError, "no module"),
        ("typer", SystemExit, "typer is missing: pip install"),
    ],
)
def test_only_what_others_make_can_be_missing(monkeypatch, lost, error, text):
    def loses_a_module():
        raise ModuleNotFoundError("no module", name=lost)

    monkeypatch.setattr(cli, "main", loses_a_module)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(error, match=text):
        main()


def test_every_command_hears_sigterm_from_its_start():
    """As the first process of a container it has no default, and is killed ten seconds later."""
    # What libraries do around imports that may fail.
    code = """
import signal
from service import __main__, cli

def imports():
    try:
        signal.raise_signal(signal.SIGTERM)
    except BaseException:
        pass

cli.main = imports
__main__.main()
"""
    ended = subprocess.run([sys.executable, "-c", code], check=False)
    assert ended.returncode == 128 + signal.SIGTERM


def test_neither_the_commands_nor_their_help_import_torch(tmp_path):
    code = (
        "import sys\n"
        "import service.cli, service.http.server\n"
        "assert not {'numpy', 'onnxruntime', 'trimesh'} & set(sys.modules)\n"
        "import service.meshfiles.convert, service.meshfiles.example\n"
        "import service.workers.jobs, service.model_info\n"
        "assert 'torch' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def test_a_model_is_a_name_or_a_file_and_the_name_wins(pns, tmp_path, part_file):
    (tmp_path / "paper").write_bytes(default_model_bytes(0))
    asks = "subdivide part.glb -o out.glb --report r.json --model"

    def told(*more):
        assert pns(*asks.split(), *more).code == 0
        return json.loads((tmp_path / "r.json").read_text())

    for given, features in (("paper", "paper-5"), ("./paper", "directed-28")):
        report = told(given)
        assert (report["model"], report["model_hash"]) == ("paper", load_model(given).hash)
        assert load_model(given).card.features == features
    assert "vertex_rule" in report["levels"][0]
    assert told("./paper", "--scheme", "loop")["model"] is None


def test_help_has_everyday_options_first_and_says_which_numbers_are_taken(pns):
    said = pns("subdivide", "--help").out
    for taken in ("1 to 6", "0 to 0.01"):
        assert taken in " ".join(said.replace("│", " ").split())
    order = ("Everyday", "--output", "--levels", "--crease", "--scheme", "Files", "--to")
    order += ("Research", "--map", "--budget", "--reference-length", "--diagnostics")
    # At the beginning of a row: options name others in their words.
    places = [re.search(rf"^[╭│][─ *]*{word}\b", said, re.MULTILINE).start() for word in order]
    assert places == sorted(places)


def test_info_lists_models_and_shows_a_card(pns):
    listed = pns("info").out.splitlines()
    assert set(bundled_models(companions=True)) <= {line.partition(" ")[0] for line in listed}
    assert [line.partition(" ")[0] for line in listed if " * " in line] == [DEFAULT_MODEL]
    shown, model = pns("info", "paper").out, load_model("paper")
    percent = model.card.metrics["ridge-held-out"]["distance_near"]["percent"]
    for said in (model.hash, str(model.card.budget), model.card.features, f"{percent:.4g}"):
        assert said in shown


def test_a_gltf_is_read_with_the_files_of_its_own_folder(pns, tmp_path):
    container = read_glb(part_glb())
    tree = msgspec.json.decode(container.text)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "part.bin").write_bytes(bytes(container.binary or b""))
    for uri, code in (("part.bin", 0), ("other.bin", 1), ("../part.bin", 1)):
        tree["buffers"][0]["uri"] = uri
        (tmp_path / "in" / "part.gltf").write_bytes(msgspec.json.encode(tree))
        done = pns("subdivide", "in/part.gltf", "-o", "out.glb", "--scheme", "loop")
        assert done.code == code
        assert len(done.err.splitlines()) == 1
    assert "buffers" in tree_of(tmp_path / "out.glb")


@pytest.mark.parametrize("compress", ["draco", "meshopt"])
def test_compressed_files_are_written_and_read(pns, part_file, compress):
    packed = f"subdivide part.glb -o packed.glb --levels 1 --compress {compress}"
    assert pns(*packed.split()).code == 0
    assert tree_of(part_file.with_name("packed.glb"))["extensionsRequired"]
    done = pns("subdivide", "packed.glb", "-o", "again.obj", "--levels", "1")
    assert done.code == 0
    assert f"{16 * FACES:,} triangles" in done.err


# `pns serve`

USED = "Address already in use"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"PNS_BODDY": "1MiB"}, "there is no setting PNS_BODDY; is it PNS_BODY?\n"),
        ({"PNS_MODEL": "nope"}, "PNS_MODEL (or --model): model nope: "),
        ({"PNS_PROVIDERS": "Foo"}, "PNS_PROVIDERS: providers = ('Foo',): "),
        ({"PNS_IGNORE_UNKNOWN": "maybe"}, "PNS_IGNORE_UNKNOWN: "),
        ({"PNS_HOSTS": "pns.example,a b"}, "PNS_HOSTS: 'a b' is no host name"),
        ({"PNS_KEYS_FILE": "none.toml"}, ""),
        ({"PNS_HOST": "300.0.0.1"}, ""),
        ({"PNS_PORT": "TAKEN"}, f"{USED}"),
        (
            {"PNS_METRICS_PORT": "TAKEN"},
            f"metrics on 127.0.0.1:TAKEN: {USED}; give a PNS_METRICS_PORT that is free",
        ),
        (
            {"PNS_PORT": "FREE", "PNS_METRICS_PORT": "FREE"},
            f"metrics on 127.0.0.1:FREE: {USED}; give a PNS_METRICS_PORT that is free, and not",
        ),
    ],
)
def test_a_setting_that_cannot_be_used_ends_it_in_one_line(pns, monkeypatch, settings, said):
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        socket.create_server(("127.0.0.1", 0)) as free,
    ):
        ports = {"TAKEN": taken, "FREE": free}
        ports = {word: str(each.getsockname()[1]) for word, each in ports.items()}
        free.close()
        for name, value in ({"PNS_PORT": "0"} | settings).items():
            monkeypatch.setenv(name, ports.get(value, value))
        code, out, err = pns("serve")
    for word, port in ports.items():
        said = said.replace(word, port)
    assert code != 0
    assert out == ""
    assert err.startswith(f"pns: {said}")
    assert said or any(value in err for value in settings.values())
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("budget", [5e6, 1234567.0, 0.1, 1e16])
def test_a_key_and_its_entry(pns, tmp_path, budget):
    code, entry, fresh = pns("key", "studio", "--faces-per-minute", f"{budget!r}")
    assert code == 0
    file = tmp_path / "keys.toml"
    file.write_text(entry)
    (kept,) = keys.read_keys(file)
    assert (kept.name, kept.faces_per_minute) == ("studio", budget)
    assert kept.hash == keys.hash_of(fresh.strip())
    assert fresh.strip() not in entry


# Nothing speaks to the terminal


def red_glb():
    tree = tree_of_bytes(part_glb())
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["_\x1b[31mRED"] = primitive["attributes"]["POSITION"]
    return write_glb(msgspec.json.encode(tree), [read_glb(part_glb()).binary], [])


BATCH = "batch in out --scheme loop --workers 1 --report r.jsonl"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["subdivide", "\x1b[31mred\x9b.glb", "-o", "out.glb"], "\\x1b[31mred\\x9b.glb"),
        (["subdivide", "red.glb", "-o", "out.obj"], "attribute _\\x1b[31mRED dropped"),
        (BATCH.split(), "\\x1b[31mred\\n.obj: "),
        ([*BATCH.split(), "--dry-run"], "\\x1b[31mred\\n.obj: "),
    ],
    ids=["a name", "what a file holds", "a library's names", "before it is refined"],
)
def test_names_and_contents_cannot_speak_to_the_terminal(pns, tmp_path, arguments, says):
    (tmp_path / "red.glb").write_bytes(red_glb())
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "\x1b[31mred\n.obj").write_text("bad")
    (tmp_path / "in" / "\x1b[31mplain.glb").write_bytes(part_glb())
    err = pns(*arguments).err
    assert says in err
    assert err.replace("\n", "").isprintable()


# `pns doctor`


def test_the_doctor_finds_this_machine_well(pns):
    outcome = pns("doctor")
    assert outcome.code == 0, outcome.out
    lines = outcome.out.splitlines()
    assert all(line.startswith("ok ") for line in lines)
    assert {"pns", "numpy", "kernels", "models", "self-test"} <= {line.split()[1] for line in lines}


def test_the_doctor_goes_on_after_what_is_wrong_and_ends_with_1(pns, monkeypatch):
    monkeypatch.setenv("PNS_FOO", "1")
    outcome = pns("doctor")
    assert outcome.code == 1
    (failed,) = [line for line in outcome.out.splitlines() if line.startswith("FAIL")]
    assert "PNS_FOO" in failed
    assert "self-test" in outcome.out.splitlines()[-1]
