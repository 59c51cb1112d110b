"""A controller of an arm of Universal Robots, for the package ur-rtde to speak to:
``universal_robots.py HOST``.

RTDE's messages are those of UR's guide to the protocol. Once in a cycle of 2 ms the program on the
arm looks at the register of commands, as the one does that the package uploads: what was written
there and overwritten is lost. Every line on standard input is an expression of ``arm``, answered in
JSON.
"""

from __future__ import annotations

import json
import re
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

CYCLE = 0.002
COMMAND = "input_int_register_0"
READY = 1
DONE = 2
SPEEDJ = 9
SERVOJ = 11
WATCHDOG = 35
STOP_SCRIPT = 255
KINDS = {
    "D": ("DOUBLE", 1),
    "6D": ("VECTOR6D", 6),
    "3D": ("VECTOR3D", 3),
    "I": ("INT32", 1),
    "6I": ("VECTOR6INT32", 6),
}
KINDS |= {"U": ("UINT32", 1), "L": ("UINT64", 1)}
OWN = {
    "actual_momentum": "D",
    "joint_mode": "6I",
    "payload_inertia": "6D",
    "robot_mode": "I",
    "safety_mode": "I",
}
LETTERS = {"D": "d", "I": "i", "U": "I", "L": "Q"}
SAID = {"is in remote control": "true", "get serial number": "20235501234", "stop": "Stopped"}


def kind(name: str) -> str:
    """What a variable of RTDE is."""
    if name in OWN:
        return OWN[name]
    if "int_register" in name:
        return "I"
    if name.endswith("_bits"):
        return "L" if "digital" in name else "U"
    if name == "runtime_state":
        return "U"
    if name in ("actual_tool_accelerometer", "payload_cog"):
        return "3D"
    if re.match(r"(target|actual)_(q|qd|qdd|current|moment|TCP|joint)|joint_|ft_raw", name):
        return "6D"
    return "D"


def form(names: list[str]) -> str:
    """How values of these names are packed."""
    return ">" + "".join(f"{KINDS[kind(name)][1]}{LETTERS[kind(name)[-1]]}" for name in names)


class Arm:
    """It is where servoJ sends it, at once."""

    def __init__(self, host: str) -> None:
        self.q = [0.1] * 6
        self.t = 0.0
        self.running = False
        self.safety = 1
        self.slider = 1.0
        self.register: dict[str, float] = {}
        self.state = READY
        self.busy = False
        self.carried_out = []
        self.frequency = 0.0
        self.heard = 0.0
        for port, answer in (
            (30004, self.rtde),
            (29999, self.dashboard),
            (30003, self.program),
            (30002, self.program),
        ):
            listening = socket.create_server((host, port))
            threading.Thread(target=self.accept, args=(listening, answer), daemon=True).start()
        threading.Thread(target=self.cycles, daemon=True).start()

    def accept(self, listening: socket.socket, answer: Callable[[socket.socket], None]) -> None:
        while True:
            connection, _ = listening.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self.guarded, args=(answer, connection), daemon=True).start()

    def guarded(self, answer: Callable[[socket.socket], None], connection: socket.socket) -> None:
        with connection, suppress(OSError):
            answer(connection)

    def program(self, connection: socket.socket) -> None:
        while connection.recv(65536):
            self.running = True

    def dashboard(self, connection: socket.socket) -> None:
        connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
        for line in connection.makefile():
            if line.strip() == "stop":
                self.running = False
            said = SAID.get(line.strip(), "URSoftware 5.11.1.108318 (Dec 01 2021)")
            connection.sendall(f"{said}\n".encode())

    def value(self, name: str) -> list[float]:
        known: dict[str, list[float]] = {
            "timestamp": [self.t],
            "actual_q": self.q,
            "runtime_state": [2 if self.running else 1],
            "robot_mode": [7],
            "robot_status_bits": [3 if self.running else 1],
            "safety_status_bits": [self.safety],
            "target_speed_fraction": [self.slider],
            "output_int_register_0": [self.state],
        }
        return known.get(name, [0] * KINDS[kind(name)][1])

    def cycles(self) -> None:
        while True:
            time.sleep(CYCLE)
            self.t += CYCLE
            if self.running:
                self.cycle(int(self.register.get(COMMAND, 0)))

    def cycle(self, command: int) -> None:
        told = [self.register.get(f"input_double_register_{i}", 0.0) for i in range(11)]
        if self.frequency and time.perf_counter() - self.heard > 1.0 / self.frequency:
            self.running = False
            self.frequency = 0.0
        elif command in (SERVOJ, SPEEDJ):
            if not self.carried_out or self.carried_out[-1] != [command, told]:
                self.carried_out.append([command, told])
            self.q = told[:6] if command == SERVOJ else self.q
            self.state = READY
        elif command == 0:
            self.busy = False
            self.state = READY
        elif not self.busy:
            self.carried_out.append([command, told])
            self.busy = True
            self.state = DONE
            if command == WATCHDOG:
                self.frequency = told[0]
                self.heard = time.perf_counter()
            if command == STOP_SCRIPT:
                self.running = False
                self.frequency = 0.0

    def rtde(self, connection: socket.socket) -> None:
        said: list[str] = []
        recipes: list[list[str]] = []
        started = threading.Event()
        turn = threading.Lock()
        stream = connection.makefile("rb")

        def send(letter: bytes, body: bytes) -> None:
            with turn:
                connection.sendall(struct.pack(">H", 3 + len(body)) + letter + body)

        def publish() -> None:
            with suppress(OSError):
                while started.wait():
                    send(
                        b"U",
                        b"\x01"
                        + struct.pack(form(said), *(x for name in said for x in self.value(name))),
                    )
                    time.sleep(CYCLE)

        threading.Thread(target=publish, daemon=True).start()
        while header := stream.read(3):
            letter = header[2:]
            body = stream.read(struct.unpack(">H", header[:2])[0] - 3)
            if letter == b"v":
                send(letter, struct.pack(">4I", 5, 11, 1, 108318))
            elif letter in (b"O", b"I"):
                names = [
                    name for name in body[8 if letter == b"O" else 0 :].decode().split(",") if name
                ]
                if letter == b"O":
                    said[:] = names
                else:
                    recipes.append(names)
                number = 1 if letter == b"O" else len(recipes)
                send(
                    letter,
                    bytes([number]) + ",".join(KINDS[kind(name)][0] for name in names).encode(),
                )
            elif letter == b"U":
                names = recipes[body[0] - 1]
                self.register |= zip(names, struct.unpack(form(names), body[1:]), strict=True)
                self.heard = time.perf_counter()
            else:
                (started.set if letter == b"S" else started.clear)()
                send(letter, b"\x01")


def main() -> None:
    arm: Any = Arm(sys.argv[1])
    print("ready", flush=True)
    for line in sys.stdin:
        print(json.dumps(eval(line, {"arm": arm})), flush=True)


if __name__ == "__main__":
    main()
