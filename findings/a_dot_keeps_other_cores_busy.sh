#!/usr/bin/env bash
# NumPy 2.4.6 (its wheel's OpenBLAS): after one dot product of a long vector, other cores stay busy for a tenth of a
# second, doing nothing.
#
# Behaviour: `x @ x` of more than about ten thousand numbers is shared among OpenBLAS's threads, which then wait for
# more work in a busy loop. A program that calls it now and then, say to see in one number whether an array is finite,
# so takes the cores that its own threads need: two threads run no faster than one. A sum, or a shorter vector, stays on
# the calling thread.
# Seen on two cores: x of 200,000: the call 0.2 ms, and about 100 ms of CPU time burnt in the 0.2 s of sleep that follow;
# its sum, and a dot of 5,000: less than 1 ms. With OPENBLAS_NUM_THREADS=1 there is none either.
# Way round: sums for long arrays, or one BLAS thread.
set -euo pipefail
[ "$(nproc)" -ge 2 ] || { echo "needs two cores"; exit 1; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6
cat > "$folder/busy.py" <<'PY'
import os
import sys
import time

import numpy as np

x = np.random.default_rng(0).normal(size=200_000)
CALLS = {"dot": lambda: x @ x, "sum": lambda: x.sum(), "short dot": lambda: x[:5000] @ x[:5000]}
burnt = {}
for name, call in CALLS.items():
    call()
    time.sleep(1.0)
    call()
    begin = time.process_time()
    time.sleep(0.2)
    burnt[name] = 1e3 * (time.process_time() - begin)
    print(f"{name}: {burnt[name]:.1f} ms of CPU time in 200 ms of sleep after it")
alone = os.environ.get("OPENBLAS_NUM_THREADS") == "1"
expected = {"dot": not alone, "sum": False, "short dot": False}
sys.exit(0 if {name: ms > 20.0 for name, ms in burnt.items()} == expected else "the behaviour has changed")
PY
echo "as it comes:"
"$folder/venv/bin/python" "$folder/busy.py"
echo "with OPENBLAS_NUM_THREADS=1:"
OPENBLAS_NUM_THREADS=1 "$folder/venv/bin/python" "$folder/busy.py"
