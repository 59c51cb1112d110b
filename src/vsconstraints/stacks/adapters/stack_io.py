"""The protocol of docs/stacks.md for a class, with the standard library alone.

Copy this file beside a program of your own, or let Python find it beside the adapters. It runs in
any environment: it imports nothing of vsconstraints.
"""

import json
import math
import os
import sys
import time

PROTOCOL = 1


class NoAnswer(Exception):
    """There is no command for this period; the message is the reason."""


def serve(stack):
    """Answer a comparison until it closes the standard input.

    ``stack`` has ``name``, ``uses`` and ``output``, and the methods ``start(setup)`` and
    ``step(now)``, which returns n numbers or raises :class:`NoAnswer`. What it prints goes to the
    standard error, since the standard output is for answers alone.
    """
    answers = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    os.dup2(2, 1)
    sys.stdout = sys.stderr

    def say(message):
        answers.write(json.dumps(message) + "\n")

    say({"protocol": PROTOCOL, "name": stack.name, "uses": stack.uses, "output": stack.output})
    setup = sys.stdin.readline()
    if not setup:
        return
    stack.start(json.loads(setup))
    for line in sys.stdin:
        now = json.loads(line)
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
