"""What arrives while signals are held waits, whichever thread lets it through."""

import os
import signal
import subprocess
import sys

CODE = """
import os, signal, threading, time
from vsconstraints.plugins.processes import Stopped, obey_signals, signal_of, signals_held
obey_signals()
threading.Thread(target=time.sleep, args=(1.0,), daemon=True).start()  # it does not hold signals
done = []
try:
    with signals_held():
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(200):
            time.sleep(0.001)
        done.append("start")
    done.append("after")
except Stopped as stopped:
    print(done, signal_of(stopped))
"""


def test_a_signal_that_another_thread_lets_through_waits():
    done = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, timeout=60, env=os.environ
    )
    assert (done.stdout, done.stderr) == (f"['start'] {int(signal.SIGTERM)}\n", "")
