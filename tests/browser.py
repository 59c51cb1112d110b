"""A real browser, driven by its own protocol: what a page does, says and shows."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless=new",
    "--no-sandbox",  # which needs rights that a container does not give
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--remote-debugging-port=0",
    # there is no network
    "--host-resolver-rules=MAP * ~NOTFOUND",
)
PATIENCE = 240.0
"""For a busy machine [s]."""


def program() -> str | None:
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Page:
    """An open page; whatever it complains of is kept."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.number = 0
        self.complaints: list[str] = []
        self.requests: list[str] = []
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **params: Any) -> Any:
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            told = json.loads(self.socket.recv(timeout=PATIENCE))
            if told.get("id") == self.number:
                assert "error" not in told, told["error"]
                return told["result"]
            self._hear(told)

    def _hear(self, told: Any) -> None:
        method = told.get("method")
        params = told.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(str(params["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.complaints.append(
                str([one.get("value") or one.get("description") for one in params["args"]])
            )
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.complaints.append(params["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def open(self, url: str) -> None:
        self.ask("Page.navigate", url=url)

    def value(self, expression: str) -> Any:
        told = self.ask("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    def wait(self, expression: str) -> Any:
        """Until it is true."""
        end = time.monotonic() + PATIENCE
        while not (value := self.value(expression)):
            assert time.monotonic() < end, f"in vain: {expression}; {self.complaints}"
            time.sleep(0.05)
        return value

    def screenshot(self) -> Any:
        """(height, width, 3) of bytes."""
        picture = base64.b64decode(self.ask("Page.captureScreenshot")["data"])
        return np.asarray(Image.open(BytesIO(picture)).convert("RGB"))


@contextmanager
def browser(folder: Path, *flags: str, size: tuple[int, int] = (1000, 800)) -> Iterator[Page]:
    """A browser with an empty page; its files are in a folder."""
    from websockets.sync.client import connect

    found = program()
    assert found is not None
    words = [
        found,
        *FLAGS,
        *flags,
        f"--user-data-dir={folder}",
        f"--window-size={size[0]},{size[1]}",
        "about:blank",
    ]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        file = folder / "DevToolsActivePort"
        end = time.monotonic() + PATIENCE
        while not (file.is_file() and len(file.read_text().split()) == 2):
            assert process.poll() is None, "the browser has ended"
            assert time.monotonic() < end
            time.sleep(0.05)
        port = file.read_text().split()[0]
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
            pages = [one for one in json.load(answer) if one["type"] == "page"]
        with connect(
            pages[0]["webSocketDebuggerUrl"], max_size=None, open_timeout=PATIENCE
        ) as socket:
            yield Page(socket)
    finally:
        process.terminate()
        process.wait(PATIENCE)
