"""Stands in for both programs of benchmarks/training/compare.py: what it does is in FAKE_TRAINER.

`rate-R` trains R steps a second for each environment; `dies` leaves a last word only, `silent`
nothing, `killed` ends by a signal, `hangs` starts a child and waits, `odd` tells rates that are
none. With `4:rate-5,8:dies` it depends on the number of environments.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

arguments = dict(zip(sys.argv[1::2], sys.argv[2::2], strict=False))
number, kind = int(arguments["--envs"]), os.environ["FAKE_TRAINER"]
what = dict(part.split(":") for part in kind.split(",")).get(str(number)) if ":" in kind else kind
assert what is not None
if what == "dies":
    sys.exit("no such scenario")
if what == "silent":
    sys.exit(3)
if what == "killed":
    os.kill(os.getpid(), signal.SIGKILL)
if what == "hangs":
    # As an engine of ViZDoom is called.
    waits = [sys.executable, "-c", "import time; time.sleep(60)", "+viz_instance_id", "abc"]
    Path(os.environ["FAKE_CHILD"]).write_text(str(subprocess.Popen(waits).pid))
    time.sleep(60)
rates = ["many", 3]
if what != "odd":
    rate = float(what.partition("-")[2]) * number
    rates = [rate, 3 * rate, 2 * rate]
row = {"rates": rates, "parameters": 123, "versions": {"python": "3"}, "device": "cpu"}
row |= {"creation_seconds": 0.5, "compile_seconds": 1.5, "memory_bytes": number * 2**20}
Path(arguments["--json"]).write_text(json.dumps({"rows": [row]}))
