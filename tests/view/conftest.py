"""A browser without a window and without a network, driven through a pipe (Chrome DevTools Protocol)."""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import time
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

PATIENCE = 60.0
"""Seconds for any answer, on a machine that has other work."""
COMMAND = ["chromium", "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
           "--host-resolver-rules=MAP * ~NOTFOUND", "--disable-background-networking", "--no-first-run", "--hide-scrollbars"]


class Browser:
    def __init__(self, profile: Path) -> None:
        (from_us, self._write), (self._read, to_us) = os.pipe(), os.pipe()

        def connect() -> None:  # where the browser expects its pipe; by way of numbers that none of the two can have
            for given, over, wanted in ((from_us, 1003, 3), (to_us, 1004, 4)):
                os.dup2(given, over)
            for over, wanted in ((1003, 3), (1004, 4)):
                os.dup2(over, wanted)

        self._process = subprocess.Popen([*COMMAND, f"--user-data-dir={profile}"], preexec_fn=connect, close_fds=False,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(from_us)
        os.close(to_us)
        self._buffer, self._last, self.events = b"", 0, []

    def call(self, method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        self._last += 1
        message = {"id": self._last, "method": method, "params": parameters} | ({"sessionId": session} if session else {})
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._last:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._read], [], [], PATIENCE)
            part = os.read(self._read, 1 << 20) if ready else b""
            assert part, "the browser does not answer"
            self._buffer += part
        text, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(text)

    def open(self, file: Path, wishes: str = "still", size: tuple[int, int] = (900, 640), dark: bool = False) -> Page:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        page = Page(self, self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"])
        page.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        for domain in ("Runtime", "Log", "Network"):
            page.call(f"{domain}.enable")
        page.call("Page.navigate", url=f"{file.as_uri()}#{wishes}")
        page.wait("document.querySelector('#linkdyn-view')?.dataset.arrows !== undefined")
        return page

    def close(self) -> None:
        self.call("Browser.close")
        self._process.wait(timeout=PATIENCE)
        os.close(self._write)
        os.close(self._read)


class Page:
    """A tab."""

    def __init__(self, browser: Browser, session: str) -> None:
        self.browser, self.session = browser, session

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        return self.browser.call(method, self.session, **parameters)

    def value(self, expression: str) -> Any:
        """Of an expression of JavaScript in the page; ``root`` is the inside of the view."""
        code = f"(() => {{ const root = document.querySelector('#linkdyn-view')?.shadowRoot; return ({expression}); }})()"
        answer = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression: str) -> None:
        end = time.monotonic() + PATIENCE
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression}: not in time; {self.complaints}"
            time.sleep(0.05)

    @property
    def state(self) -> dict[str, str]:
        """What the view tells of its last picture."""
        return self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => "
                          "done({...document.querySelector('#linkdyn-view').dataset}))))")

    def picture(self) -> np.ndarray:
        """(height, width, 3) bytes of what is seen."""
        data = base64.b64decode(self.call("Page.captureScreenshot")["data"])
        return np.asarray(Image.open(BytesIO(data)).convert("RGB")).astype(int)

    @property
    def complaints(self) -> list[str]:
        """Errors and warnings on the console, exceptions, and requests beyond the file itself."""
        found = []
        for event in self.browser.events:
            if event.get("sessionId") != self.session:
                continue
            method, told = event["method"], event["params"]
            if method == "Runtime.exceptionThrown" or method == "Log.entryAdded":
                found.append(str(told))
            if method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
                found.append(str(told["args"]))
            if method == "Network.requestWillBeSent" and not told["request"]["url"].startswith(("file:", "data:", "blob:")):
                found.append(told["request"]["url"])
        return found


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    found = Browser(tmp_path_factory.mktemp("browser"))
    yield found
    found.close()
