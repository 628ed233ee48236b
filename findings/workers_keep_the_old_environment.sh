#!/usr/bin/env bash
# joblib 1.6.0: workers of an earlier Parallel call do not see what os.environ says now.
#
# Behaviour: the default backend keeps its processes for the next Parallel call, and those hold the environment
# they were started with. A variable set between two calls (threads of a library, a path, a switch) reaches the
# parent, and a first call, but not a second one.
# Seen: SWITCH=1, call with 2 workers: all say 1; SWITCH=2, the same call: all say 1; after the executor is shut
# down: all say 2.
# Way round: get_reusable_executor().shutdown(wait=True) after a change, or pass the value to the function.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check joblib==1.6.0
cat >"$folder/told.py" <<'PY'
import os
import sys

import joblib
from joblib.externals.loky import get_reusable_executor


def told():
    """What the workers say."""
    said = joblib.Parallel(n_jobs=2)(joblib.delayed(os.getenv)("SWITCH") for _ in range(8))
    return "".join(sorted(set(said)))


if __name__ == "__main__":
    os.environ["SWITCH"] = "1"
    seen = [told()]
    os.environ["SWITCH"] = "2"
    seen.append(told())
    get_reusable_executor().shutdown(wait=True)
    seen.append(told())
    print(f"joblib {joblib.__version__}")
    print(f"SWITCH=1: {seen[0]}; SWITCH=2, same workers: {seen[1]}; SWITCH=2, new workers: {seen[2]}")
    sys.exit(0 if seen == ["1", "1", "2"] else "the behaviour has changed")
PY
"$folder/venv/bin/python" "$folder/told.py"
