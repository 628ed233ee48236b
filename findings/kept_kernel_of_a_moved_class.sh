#!/usr/bin/env bash
# Numba 0.68.1: a kernel kept on disk cannot be compiled again once the class of an argument has moved.
#
# Behaviour: with cache=True, Numba looks at the date of the function's own file alone, and unpickles the whole index of
# what it has kept before it does so. The index names the classes of named-tuple arguments. If such a class has
# moved to another module since (a new version of a package, installed over the old one), every call raises
# AttributeError or ModuleNotFoundError, though the index would have been thrown away or could be made again.
# Seen: a function of a named tuple is called and kept; the tuple's class moves; the next process raises.
# Way round: clear __pycache__ of what was installed before, or catch the error around the cache's load and flush it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numba==0.68.1 numpy==2.4.6
cd "$folder"
class='from typing import NamedTuple


class Pair(NamedTuple):
    a: float
    b: float
'
echo "$class" >old_home.py
printf 'from numba import njit\n\n\n@njit(cache=True)\ndef total(pair):\n    return pair.a + pair.b\n' >kernels.py
cat >first.py <<'PY'
from kernels import total
from old_home import Pair

print("first:", total(Pair(1.0, 2.0)))
PY
cat >second.py <<'PY'
import numba
from kernels import total
from new_home import Pair

print("numba", numba.__version__)
try:
    print("after the move:", total(Pair(1.0, 2.0)))
    raise SystemExit("the behaviour has changed")
except ModuleNotFoundError as error:
    print("after the move:", type(error).__name__, error)
PY
venv/bin/python first.py
mv old_home.py new_home.py
rm -f __pycache__/old_home*
venv/bin/python second.py
