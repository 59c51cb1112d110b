"""The protocol of docs/stacks.md for a class; the standard library is enough.

Copy this file beside a program of your own, or let Python find it beside the adapters. It runs in
any environment: it imports nothing of vsconstraints.
"""

import json
import math
import os
import sys
import time

PROTOCOL = 1

try:  # several times faster than json, where it is installed
    from msgspec.json import decode, encode
except ImportError:
    decode = json.loads

    def encode(message):
        """Return a message as JSON in bytes."""
        return json.dumps(message).encode()


class NoAnswer(Exception):
    """There is no command for this period; the message is the reason."""


def serve(stack):
    """Answer a comparison until it closes the standard input.

    ``stack`` has ``name``, ``uses`` and ``output``, and the methods ``start(setup)`` and
    ``step(now)``, which returns n numbers or raises :class:`NoAnswer`. What it prints goes to the
    standard error, since the standard output is for answers alone.
    """
    answers = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = sys.stderr

    def say(message):
        os.write(answers, encode(message) + b"\n")

    say({"protocol": PROTOCOL, "name": stack.name, "uses": stack.uses, "output": stack.output})
    setup = sys.stdin.buffer.readline()
    if not setup:
        return
    stack.start(decode(setup))
    for line in sys.stdin.buffer:
        now = decode(line)
        begun = time.perf_counter()
        try:
            command = [float(number) for number in stack.step(now)]
            # a solver's NaN is no answer, and reaches no arm
            if not all(map(math.isfinite, command)):
                raise NoAnswer("the answer is not finite")
            reply = {stack.output: command}
        except NoAnswer as error:
            reply = {"no_answer": str(error)}
        reply["t"] = now["t"]
        reply["compute_s"] = time.perf_counter() - begun
        say(reply)
