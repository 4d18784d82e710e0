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


def test_a_model_is_a_name_or_a_file_and_the_name_wins(pns, tmp_path, part_file):
    (tmp_path / "paper").write_bytes(default_model_bytes(0))
    report = tmp_path / "r.json"
    for given, features in (("paper", "paper-5"), ("./paper", "directed-28")):
        command = f"subdivide part.glb -o out.glb --model {given} --report r.json"
        assert pns(*command.split()).code == 0
        told = json.loads(report.read_text())
        assert told["model"] == "paper"
        assert told["model_hash"] == load_model(given).hash
        assert load_model(given).card.features == features
    assert "vertex_rule" in told["levels"][0]
    loop = "subdivide part.glb -o out.glb --scheme loop --model ./paper --report r.json"
    assert pns(*loop.split()).code == 0
    assert json.loads(report.read_text())["model"] is None


def test_help_says_which_numbers_are_taken(pns):
    said = " ".join(pns("subdivide", "--help").out.replace("│", " ").split())
    for taken in ("1 to 6", "0 to 0.01"):
        assert taken in said


def test_help_has_everyday_options_first(pns):
    said = pns("subdivide", "--help").out
    order = ("Everyday", "--output", "--levels", "--crease", "--scheme", "Files", "--to")
    order += ("Research", "--map", "--budget", "--reference-length", "--diagnostics")
    # At the beginning of a row: options name others in their words.
    places = [re.search(rf"^[╭│][─ *]*{word}\b", said, re.MULTILINE).start() for word in order]
    assert places == sorted(places)


def test_info_lists_models_and_shows_a_card(pns):
    listed = pns("info").out.splitlines()
    assert set(bundled_models(companions=True)) <= {line.partition(" ")[0] for line in listed}
    assert [line.partition(" ")[0] for line in listed if " * " in line] == [DEFAULT_MODEL]
    shown = pns("info", "paper").out
    model = load_model("paper")
    assert model.hash in shown
    assert str(model.card.budget) in shown
    assert model.card.features in shown
    percent = model.card.metrics["ridge-held-out"]["distance_near"]["percent"]
    assert f"{percent:.4g}" in shown


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


def test_a_gltf_is_read_with_the_files_of_its_own_folder(pns, tmp_path):
    container = read_glb(part_glb())
    tree = msgspec.json.decode(container.text)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "part.bin").write_bytes(bytes(container.binary or b""))
    source = tmp_path / "in" / "part.gltf"
    for uri, code in (("part.bin", 0), ("other.bin", 1), ("../part.bin", 1)):
        tree["buffers"][0]["uri"] = uri
        source.write_bytes(msgspec.json.encode(tree))
        done = pns("subdivide", "in/part.gltf", "-o", "out.glb", "--scheme", "loop")
        assert done.code == code
        assert len(done.err.splitlines()) == 1
    assert "buffers" in tree_of(tmp_path / "out.glb")


@pytest.mark.parametrize("compress", ["draco", "meshopt"])
def test_compressed_files_are_written_and_read(pns, part_file, compress):
    assert (
        pns(
            "subdivide", "part.glb", "-o", "packed.glb", "--levels", "1", "--compress", compress
        ).code
        == 0
    )
    assert tree_of(part_file.with_name("packed.glb"))["extensionsRequired"]
    done = pns("subdivide", "packed.glb", "-o", "again.obj", "--levels", "1")
    assert done.code == 0
    assert f"{16 * FACES:,} triangles" in done.err


def test_a_file_of_keys_that_cannot_be_used_ends_it(pns, tmp_path, monkeypatch):
    monkeypatch.setenv("PNS_KEYS_FILE", str(tmp_path / "none.toml"))
    code, _, err = pns("serve", "--port", "0")
    assert code == 1
    assert err.splitlines()[-1].startswith("pns: ")
    assert "none.toml" in err


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"PNS_BODDY": "1MiB"}, "there is no setting PNS_BODDY; is it PNS_BODY?\n"),
        ({"PNS_MODEL": "nope"}, "PNS_MODEL (or --model): model nope: "),
        ({"PNS_PROVIDERS": "Foo"}, "PNS_PROVIDERS: providers = ('Foo',): "),
        ({"PNS_IGNORE_UNKNOWN": "maybe"}, "PNS_IGNORE_UNKNOWN: "),
        ({"PNS_HOSTS": "pns.example,a b"}, "PNS_HOSTS: 'a b' is no host name"),
    ],
)
def test_a_setting_that_cannot_be_used_ends_it_by_name(pns, monkeypatch, settings, said):
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    code, _, err = pns("serve", "--port", "0")
    assert code != 0
    assert err.startswith(f"pns: {said}")
    assert len(err.splitlines()) == 1


def test_a_port_that_is_taken_ends_it_in_one_line(pns):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, out, err = pns("serve", "--port", str(port))
    assert (code, out) == (1, "")
    assert err.startswith("pns: Address already in use")
    assert f"{port}" in err
    assert err.count("\n") == 1


def test_a_host_that_is_none_ends_it_in_one_line(pns):
    code, out, err = pns("serve", "--host", "300.0.0.1", "--port", "0")
    assert (code, out) == (1, "")
    assert "300.0.0.1" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("its_own", [False, True])
def test_a_place_for_metrics_that_cannot_be_had_ends_it_by_name(pns, monkeypatch, its_own):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        if its_own:
            taken.close()
        monkeypatch.setenv("PNS_METRICS_PORT", str(port))
        code, _, err = pns("serve", "--port", str(port) if its_own else "0")
    hint = "give a PNS_METRICS_PORT that is free, and not PNS_PORT"
    text = f"pns: metrics on 127.0.0.1:{port}: Address already in use; {hint}\n"
    assert (code, err) == (1, text)


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


def test_a_key_of_an_impossible_name_is_refused(pns):
    code, out, err = pns("key", "Studio")
    assert (code, out) == (1, "")
    assert "a name is 1 to 63 of" in err


def test_a_files_name_cannot_speak_to_the_terminal(pns):
    code, _, err = pns("subdivide", "\x1b[31mred\x9b.glb", "-o", "out.glb")
    assert code != 0
    assert "\\x1b[31mred\\x9b.glb" in err
    assert err.replace("\n", "").isprintable()


def test_what_a_file_holds_cannot_speak_to_the_terminal(pns, tmp_path):
    tree = tree_of_bytes(part_glb())
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["attributes"]["_\x1b[31mRED"] = primitive["attributes"]["POSITION"]
    binary = read_glb(part_glb()).binary
    (tmp_path / "red.glb").write_bytes(write_glb(msgspec.json.encode(tree), [binary], []))
    code, _, err = pns("subdivide", "red.glb", "-o", "out.obj")
    assert code == 0
    assert "attribute _\\x1b[31mRED dropped" in err
    assert err.replace("\n", "").isprintable()


@pytest.mark.parametrize("more", [[], ["--dry-run"]])
def test_a_library_s_names_cannot_speak_to_the_terminal(pns, tmp_path, more):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "\x1b[31mred\n.obj").write_text("bad")
    (tmp_path / "in" / "\x1b[31mplain.glb").write_bytes(part_glb())
    arguments = ["--scheme", "loop", "--workers", "1", "--report", "r.jsonl", *more]
    _, _, err = pns("batch", "in", "out", *arguments)
    assert "\\x1b[31mred\\n.obj: " in err
    assert err.replace("\n", "").isprintable()


def test_an_error_names_the_file_that_it_is_in(pns, tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n")
    outcome = pns("subdivide", "bad.obj", "-o", "out.obj")
    assert outcome.code == 1
    assert outcome.err.startswith("pns: bad.obj: line 3 ")


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
    failed = [line for line in outcome.out.splitlines() if line.startswith("FAIL")]
    assert len(failed) == 1
    assert "PNS_FOO" in failed[0]
    assert "self-test" in outcome.out.splitlines()[-1]
