"""A headless Chromium, driven through its DevTools protocol, with a log of every request that it makes."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from websockets.sync.client import connect

CHROMIUM: Final = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
START = 30.0
"""s for the browser to start, or for a page to show what is expected."""

FLAGS: Final = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-default-apps",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # keeps what Chromium itself asks for on this machine
)


class Browser:
    """One page of a Chromium with an empty profile in `folder`."""

    def __init__(self, folder: Path, width: int = 1280, height: int = 800) -> None:
        assert CHROMIUM is not None
        folder.mkdir(parents=True)
        self._log = folder / "net.json"
        words = (folder / "words").open("w")
        self._process = subprocess.Popen(
            [
                CHROMIUM,
                *FLAGS,
                f"--window-size={width},{height}",
                f"--user-data-dir={folder / 'profile'}",
                f"--log-net-log={self._log}",
                "about:blank",
            ],
            stdout=words,
            stderr=words,
            stdin=subprocess.DEVNULL,
        )
        port_file = folder / "profile" / "DevToolsActivePort"
        until(lambda: port_file.exists() and len(port_file.read_text().split()) == 2)
        port, path = port_file.read_text().split()
        self._socket = connect(f"ws://127.0.0.1:{port}{path}", max_size=None, open_timeout=START)
        self._number = 0
        self._session: str | None = None
        self.texts: list[str] = []
        """What the page wrote to its console."""
        target = next(each for each in self.ask("Target.getTargets")["targetInfos"] if each["type"] == "page")
        attached = self.ask("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        self.ask("Page.enable")
        self.ask("Runtime.enable")

    def ask(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=START))
            if answer.get("method") == "Runtime.consoleAPICalled":
                self.texts.append(" ".join(str(each.get("value", "")) for each in answer["params"]["args"]))
            if answer.get("method") == "Runtime.exceptionThrown":
                self.texts.append(str(answer["params"]["exceptionDetails"]))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def open(self, url: str) -> None:
        self.ask("Page.navigate", url=url)

    def run(self, script: str) -> Any:
        """Evaluate JavaScript in the page and return its value."""
        return self.ask("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    @property
    def text(self) -> str:
        """The text that the page shows."""
        return str(self.run("document.body ? document.body.innerText : ''"))

    def until_shown(self, *parts: str) -> None:
        """Wait until the page shows all these texts."""
        until(lambda: all(part in self.text for part in parts), lambda: f"{parts} in {self.text!r}; {self.texts}")

    def click(self, text: str) -> None:
        """Click the button with this text."""
        script = f"[...document.querySelectorAll('button')].find(b => b.innerText.includes({json.dumps(text)})).click()"
        self.run(script)

    def dismiss_notification(self) -> None:
        """Close the notification that viser shows first."""
        button = "document.querySelector('.mantine-Notification-closeButton')"
        until(lambda: self.run(f"!!{button}"))
        self.run(f"{button}.click()")
        until(lambda: not self.run(f"!!{button}"))

    def press(self, x: float, y: float) -> None:
        """Press and release the mouse at a place of the page (pixels)."""
        self.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def screenshot(self) -> bytes:
        """Return the page as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """End the browser, so that its log is complete."""
        self._session = None
        if self._process.poll() is None:
            try:
                self.ask("Browser.close")
                self._process.wait(10.0)
            except (OSError, TimeoutError, AssertionError, subprocess.TimeoutExpired):
                self._process.kill()
        self._process.wait()
        self._socket.close()

    def requests(self) -> list[str]:
        """Return the addresses that the pages requested, their workers and web sockets too. Only when it is closed.

        Chromium itself also asks for updates and the like. Those requests have no page as their initiator.
        """
        events = json.loads(self._log.read_text())["events"]
        asked = [each["params"] for each in events if "initiator" in each.get("params", {})]
        return [each["url"] for each in asked if each["initiator"] != "not an origin"]


def until(
    condition: Callable[[], Any], what: Callable[[], str] = lambda: "a condition", timeout: float = START
) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, f"expected {what()} within {timeout:g} s"
        time.sleep(0.05)
