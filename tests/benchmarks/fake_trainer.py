"""Stands in for benchmarks/train_sb3.py: what it does is in the variable FAKE_TRAINER.

`rate-R` trains R steps a second for each environment; `fails` tells a reason, `dies` a last word
only, `silent` nothing, `killed` ends by a signal, `hangs` starts a child and waits, `odd` tells
rates that are none.
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
if what == "fails":
    print("the engine crashed", file=sys.stderr)
    print(json.dumps({"envs": number, "failed": "EOFError: no message, while training"}))
    sys.exit(1)
if what == "dies":
    sys.exit("no such scenario")
if what == "silent":
    sys.exit(3)
if what == "killed":
    os.kill(os.getpid(), signal.SIGKILL)
if what == "hangs":
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    Path(os.environ["FAKE_CHILD"]).write_text(str(child.pid))
    time.sleep(60)
if what == "odd":
    print(json.dumps({"rates": ["many", 3]}))
    sys.exit()
assert what is not None
rate = float(what.partition("-")[2]) * number
print("a line before")
print(
    json.dumps(
        {
            "envs": 0,
            "rates": [rate, 3 * rate, 2 * rate],
            "parameters": 123,
            "threads": 1,
            "device": "cpu",
            "versions": {"python": "3"},
            "creation_seconds": 0.5,
            "compile_seconds": 1.5,
            "base_bytes": 2**30,
            "memory_bytes": 2**30 + number * 2**20,
            "shared_memory_bytes": number * 2**20,
        }
    )
)
