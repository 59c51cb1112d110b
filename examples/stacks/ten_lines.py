import json
import sys

uses = ["q", "limits"]
print(json.dumps({"protocol": 1, "uses": uses, "output": "velocity"}), flush=True)
setup = json.loads(sys.stdin.readline())
for line in sys.stdin:
    now = json.loads(line)
    velocity = [-0.1 * angle for angle in now["q"]]
    print(json.dumps({"velocity": velocity}), flush=True)
