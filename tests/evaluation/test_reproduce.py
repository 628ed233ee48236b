"""`piec reproduce` beside committed results: it says what it takes, touches nothing there, and
`--fresh` does all.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from pathlib import Path

import pytest

from evaluation import fresh, reuse
from evaluation.cli import main
from evaluation.comparison import Difference, compare, leaves, summary
from evaluation.records import read_records
from evaluation.reuse import committed_folder, committed_records, origins
from evaluation.studies import eikonal_toy, planar_objectives
from planners import CmaEsPlanner

ROOT = Path(__file__).resolve().parents[2]
AUTHOR = (
    "-c",
    "user.name=Tester",
    "-c",
    "user.email=tester@example.org",
    "-c",
    "commit.gpgsign=false",
)
TOY = "eikonal-toy"
PLANNED = "planar-objectives"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Small results of two studies, as a clone has them."""
    folder = tmp_path_factory.mktemp("clone") / "results"
    for name in (TOY, PLANNED):
        assert main(["reproduce", name, "--smoke", "--out", str(folder)]) == 0
    for cache in ("plans", "rollouts"):  # not committed
        for file in (folder / cache).glob("*"):
            file.unlink()
    return folder


@pytest.fixture
def committed(made, tmp_path, monkeypatch) -> Path:
    """A copy of them that `piec reproduce` takes for the committed ones, with small studies for
    whole ones.
    """
    folder = tmp_path / "clone" / "results"
    shutil.copytree(made, folder)
    monkeypatch.setattr(reuse, "committed_folder", lambda: folder)
    for module in (eikonal_toy, planar_objectives):
        monkeypatch.setattr(module, "Settings", module.Settings.smoke)
    monkeypatch.chdir(tmp_path)
    return folder


@pytest.fixture
def piec(capsys):
    def run(*arguments):
        code = main(["reproduce", *map(str, arguments), "--json"])
        captured = capsys.readouterr()
        return code, json.loads(captured.out), captured.err

    return run


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def tamper(folder: Path, name: str, old: str, new: str) -> None:
    path = folder / name / "records.jsonl"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def forbid_planning(monkeypatch) -> None:
    def refuse(*arguments, **kwargs):
        raise AssertionError("it plans")

    monkeypatch.setattr(CmaEsPlanner, "plan", refuse)


def test_the_default_folder_lies_beside_the_committed_results(committed, piec):
    before = contents(committed)
    code, document, _ = piec(TOY)
    assert code == 0 and contents(committed) == before
    assert (
        document["wrote"][0] == "runs/reproduce/eikonal-toy"
        and Path("runs/reproduce/eikonal-toy/table.md").exists()
    )


def test_what_comes_from_records_is_counted_and_said(committed, capsys):
    assert main(["reproduce", TOY]) == 0
    text = capsys.readouterr().out
    count = len(read_records(committed / TOY / "records.jsonl"))
    made_by = origins(read_records(committed / TOY / "records.jsonl"))
    assert f"{TOY}: {count} of {count} pieces of work from committed records" in text
    assert f"(made by {made_by})" in text and "commit" in made_by
    assert "--fresh does all of it anew" in text
    # only what was done there
    assert read_records(Path("runs/reproduce") / TOY / "records.jsonl") == []


def test_what_is_missing_is_done_and_the_rest_taken(committed, piec):
    path = committed / TOY / "records.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[1:]))
    _, document, _ = piec(TOY)
    counts = document["studies"][TOY]
    assert (counts["pieces"], counts["from_committed"], counts["done"]) == (
        len(lines),
        len(lines) - 1,
        1,
    )
    _, document, _ = piec(TOY)  # and once more: nothing is done twice
    assert document["studies"][TOY]["done"] == 0 and document["studies"][TOY]["from_earlier"] == 1


def test_committed_plans_are_used(committed, piec, monkeypatch):
    forbid_planning(monkeypatch)
    code, document, _ = piec(PLANNED)
    assert code == 0 and document["studies"][PLANNED]["done"] == 0
    code, document, _ = piec(PLANNED, "--fresh-evaluations")
    counts = document["studies"][PLANNED]
    assert code == 0 and counts["done"] > 0 and counts["compared"]["differ"] == 0
    with pytest.raises(AssertionError, match="it plans"):
        main(["reproduce", PLANNED, "--fresh"])


def test_fresh_plans_and_does_everything_anew_and_compares(committed, piec, capsys):
    before = contents(committed)
    piec(PLANNED)  # leaves copies of the committed plans, which a fresh run must not take
    code, document, _ = piec(PLANNED, "--fresh")
    counts = document["studies"][PLANNED]
    assert code == 0 and counts["done"] == counts["pieces"] > 0 and counts["from_committed"] == 0
    assert counts["compared"]["values"] > 20 and counts["compared"]["differ"] == 0
    assert contents(committed) == before
    assert main(["reproduce", PLANNED, "--fresh"]) == 0  # as one that was stopped: goes on
    text = capsys.readouterr().out
    assert (
        f"{counts['pieces']} of {counts['pieces']} pieces of work from records of an earlier run"
        in text
    )
    assert "are the same" in text


def test_a_tampered_record_shows_as_a_difference(committed, piec, capsys):
    record = read_records(committed / TOY / "records.jsonl")[0]
    true = record["result"]["area"]
    tamper(committed, TOY, f'"area":{true!r}', f'"area":{2 * true!r}')
    code, document, _ = piec(TOY, "--fresh")
    assert code == 0 and document["studies"][TOY]["compared"]["differ"] == 1
    assert main(["reproduce", TOY, "--fresh"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if "| area " in line)
    assert "by 50 %" in row
    with open("runs/reproduce/eikonal-toy/comparison.csv", newline="", encoding="utf-8") as file:
        (differing,) = [row for row in csv.DictReader(file) if float(row["differs"]) > 0]
    assert (float(differing["committed"]), float(differing["yours"])) == (2 * true, true)


def test_a_record_whose_spec_was_edited_is_refused(committed, piec):
    tamper(committed, TOY, '"seed":0', '"seed":1')
    code, document, _ = piec(TOY)
    assert code == 2 and "line 1: its key" in document["error"] and "edited" in document["error"]


def test_what_was_edited_since_the_commit_is_not_taken_for_committed(committed, piec):
    for arguments in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "-m", "first"]):
        subprocess.run(
            ["git", "-C", str(committed), *AUTHOR, *arguments], check=True, capture_output=True
        )
    true = committed_records(committed / TOY)
    star = next(iter(true[0].values()))["result"]["area"]
    tamper(committed, TOY, f'"area":{star!r}', '"area":1234.5')
    code, _, errors = piec(TOY)
    assert code == 0 and "was edited since it was committed" in errors
    assert "1234.5" not in Path("runs/reproduce/eikonal-toy/table.csv").read_text()
    assert committed_records(committed / TOY)[0] == true[0]


def test_recording_anew_is_one_command(committed, piec):
    other = {"commit": None, "modified": None, "digest": "0" * 16}
    lines = []
    for record in read_records(committed / TOY / "records.jsonl"):
        lines.append(json.dumps({**record, "source": other}, separators=(",", ":")) + "\n")
    (committed / TOY / "records.jsonl").write_text("".join(lines))
    code, document, errors = piec(TOY, "--out", committed, "--fresh")
    records = read_records(committed / TOY / "records.jsonl")
    assert code == 0 and len(records) == document["studies"][TOY]["done"] == len(lines)
    assert f"{len(lines)} records of other sources removed" in errors
    assert all(record["source"]["digest"] != other["digest"] for record in records)
    assert not (committed / TOY / "comparison.md").exists()  # nothing to commit
    assert Path("runs/reproduce/eikonal-toy/comparison.md").exists()


def test_a_fresh_run_keeps_only_what_these_sources_have_made(made, tmp_path, monkeypatch):
    out = tmp_path / "results"
    shutil.copytree(made, out)
    stale = out / "plans" / "contact-default-seed0-00000000.npz"
    vouched = out / "plans" / next(iter((out / PLANNED / "plans").iterdir())).name
    for file in (stale, vouched):
        file.write_bytes(b"")
    assert fresh.clear(out, PLANNED) == 0
    assert vouched.exists() and not stale.exists()
    monkeypatch.setattr(
        fresh.provenance, "source", lambda: {"commit": None, "modified": None, "digest": "later"}
    )
    planned = sum(
        record["spec"]["work"] == "plan" for record in read_records(out / PLANNED / "records.jsonl")
    )
    assert fresh.clear(out, PLANNED, evaluations_only=True) > 0
    assert len(read_records(out / PLANNED / "records.jsonl")) == planned and vouched.exists()
    assert fresh.clear(out, PLANNED) == planned and not vouched.exists()


def test_agents_and_fields_of_other_sources_are_made_anew_and_a_stopped_training_goes_on(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(fresh.provenance, "source", lambda: {"digest": "now"})
    train = {"spec": {"work": "train"}, "source": {"digest": "old"}}
    folders = {name: tmp_path / "agents" / name for name in ("old", "unsaid", "now", "stopped")}
    for name, folder in folders.items():
        folder.mkdir(parents=True)
        about = {} if name == "unsaid" else {"source": {"digest": name}}
        (folder / ("checkpoint.json" if name == "stopped" else "agent.json")).write_text(
            json.dumps(about)
        )
    fields = tmp_path / "study" / "fields"
    fields.mkdir(parents=True)
    for name in ("old", "now"):
        (fields / f"{name}.npz").write_bytes(b"")
        (fields / f"{name}.json").write_text(json.dumps({"source": {"digest": name}}))
    fresh._clear_trained(
        tmp_path, "study", [{**train, "result": {"folder": name}} for name in folders]
    )
    assert [name for name, folder in folders.items() if folder.exists()] == ["now", "stopped"]
    assert sorted(path.name for path in fields.iterdir()) == ["now.json", "now.npz"]


def test_the_committed_results_of_a_clone_are_found_and_their_plans_fit_their_records():
    assert committed_folder() == ROOT / "results"
    for folder in (ROOT / "results").glob("*/plans"):
        records, _ = committed_records(folder.parent)
        named = {r["result"]["file"] for r in records.values() if r["spec"].get("work") == "plan"}
        assert named <= {file.name for file in folder.iterdir()}  # so a fresh clone plans nothing


def test_differences_are_measured_value_by_value():
    nan = float("nan")
    inf = float("inf")
    assert dict(leaves({"a": [1, {"b": None}], "c": "x"})) == {"a[0]": 1, "a[1].b": None, "c": "x"}
    sizes = {
        (1.0, 1.0): 0,
        (nan, nan): 0,
        (inf, inf): 0,
        (1.0, 2.0): 0.5,
        (1, None): inf,
        ("a", "b"): inf,
        (0.0, nan): inf,
    }
    for (a, b), size in sizes.items():
        assert Difference("w", "v", a, b).size == Difference("w", "v", b, a).size == size
    assert Difference("w", "v", True, False).size == inf
    old = {"k": {"spec": {"work": "plan"}, "result": {"cost": 2.0, "gone": 1}}}
    new = {
        "k": {"spec": {"work": "plan"}, "result": {"cost": 1.0}},
        "l": {"spec": {}, "result": {"cost": 3}},
    }
    found = compare(old, new, {"k": "contact, seed 0"})
    assert [(item.work, item.value, item.committed, item.yours) for item in found] == [
        ("plan: contact, seed 0", "cost", 2.0, 1.0),
        ("plan: contact, seed 0", "gone", 1, None),
    ]
    assert "2 of 2 values of 1 pieces" in summary(found)
