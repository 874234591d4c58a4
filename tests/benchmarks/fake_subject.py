"""Stands in for benchmarks/subjects: its name says what it does.

It tells the variables of JAX. `steady-N` makes N steps a second, by its own account; `dies` ends in
its second chunk; `broken` does not start; `hangs` never says that it has started, `stuck` never
ends its first chunk.
"""

import json
import os
import sys
import time

name = sys.argv[1]
if name == "broken":
    raise ImportError("No module named 'nothing'")
if name == "hangs":
    time.sleep(60)
notes = {name: value for name, value in os.environ.items() if name.startswith("JAX_")}
print(json.dumps({"versions": {"python": "3"}, "notes": notes, "ready_seconds": 0.0}), flush=True)
for number, line in enumerate(sys.stdin):
    if name == "dies" and number:
        sys.exit("the game crashed")
    if name == "stuck":
        time.sleep(60)
    rate = int(name.partition("-")[2].split()[0]) if "-" in name else 1
    seconds = json.loads(line)["seconds"]
    print(json.dumps({"steps": rate * seconds, "seconds": seconds}), flush=True)
