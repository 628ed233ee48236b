"""The lanes of the suite: what is slow, and what may not be skipped."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SKIPPING = {
    "test_one.py": "import pytest\n\ndef test_passes(): pass\n\n"
    "def test_skips(): pytest.skip('no such machine')\n"
    "\n@pytest.mark.xfail\ndef test_is_known_to_fail(): assert False\n",
    "test_whole_module.py": "import pytest\n\npytest.importorskip('no_such_package')\n\n"
    "def test_it(): pass\n",
    "test_extra.py": "from piec_envs.errors import MissingDependencyError\n\n"
    "def test_needs_an_extra(): raise MissingDependencyError('no_such_package', 'rl')\n",
}


def test_every_entry_of_the_list_of_slow_tests_names_some(request):
    conftest = request.config.pluginmanager.get_plugin(str(ROOT / "tests" / "conftest.py"))
    for entry in conftest.SLOW:
        module, colons, name = entry.partition("::")
        text = (ROOT / module).read_text(encoding="utf-8")
        assert colons and f"def {name.partition('[')[0] or 'test_'}" in text, (
            f"{entry} names no test"
        )


@pytest.mark.parametrize("workers", [[], ["-n", "2"]], ids=["one process", "two workers"])
def test_what_is_skipped_fails_where_nothing_may_be(tmp_path, workers):
    pytest.importorskip("xdist")
    (tmp_path / "conftest.py").write_bytes((ROOT / "tests" / "conftest.py").read_bytes())
    for name, text in SKIPPING.items():
        (tmp_path / name).write_text(text)

    def run(*options):
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--rootdir",
            str(tmp_path),
        ]
        found = subprocess.run(
            [*command, *workers, *options, str(tmp_path)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )
        return found.returncode, found.stdout.splitlines()[-1], found.stdout

    code, last, _ = run()
    assert code == 0 and last.startswith("1 passed, 3 skipped, 1 xfailed")
    code, last, text = run("--no-skips", "--continue-on-collection-errors")
    assert code != 0 and "skipped" not in last and "1 xfailed" in last
    for reason in ("no such machine", "no_such_package", "extra 'rl'"):
        assert reason in text
