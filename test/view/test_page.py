"""The page in a headless Chromium: what is on it, what it requests, and a browser that goes away."""

from __future__ import annotations

import io
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser, until
from played_session import NASTY, STATES, TYPES

from collision_monitor.codec import encode_descriptions
from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session import Recorder, Session
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Points
from collision_monitor.view.page import MOST_HIDDEN, Page
from collision_monitor.view.panel import WIDTH, look_at
from collision_monitor.view.picture import draw
from collision_monitor.view.server import LOOPBACK, start_server, stop_server
from collision_monitor.view.topic_content import TopicContent

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")


class Served:
    """A `collision-monitor view` of a session, on a free port."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self._words = folder / "words"
        with self._words.open("w") as words:
            command = [sys.executable, "-m", "collision_monitor", "view", *arguments, "--port", "0"]
            self.process = subprocess.Popen(command, stdout=words, stderr=words, stdin=subprocess.DEVNULL)
        until(lambda: "http" in self._words.read_text() or self.process.poll() is not None)

    @property
    def words(self) -> str:
        return self._words.read_text()

    @property
    def url(self) -> str:
        found = re.search(r"http://[\d.]+:\d+", self.words)
        assert found is not None, self.words
        return found[0]

    def stop(self) -> int:
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(10.0)


@pytest.fixture
def served(drive: Path, tmp_path: Path) -> Iterator[Served]:
    view = Served(tmp_path, str(drive))
    yield view
    if view.process.poll() is None:
        view.process.kill()
        view.process.wait()


def pixels(png: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def reds(png: bytes) -> int:
    """Number of pixels with the hue of what touches, left of the panel."""
    red, green, blue = np.moveaxis(pixels(png)[:, :480], -1, 0)
    return int(((red > 120) & (red > 2 * green) & (red > 2 * blue)).sum())


def test_forms_that_come_and_go_do_not_pile_up() -> None:
    server = start_server(LOOPBACK, 0)
    page, rng = Page(server, lambda _: None), np.random.default_rng(0)
    for k in range(3 * MOST_HIDDEN):
        scene = TopicContent()
        hull = ObjectDescription(1, ConvexHull(rng.normal(size=(6, 3))), static=True, pose=Pose())
        scan = ObjectDescription(2, Points(rng.normal(size=(9, 3)), 0.1), static=True, pose=Pose())
        scene.take("ObjectDescriptionArray", encode_descriptions(k, "world", [hull, scan], snapshot=True))
        page.show(draw(scene.moment()))
        assert len(page._batches) <= MOST_HIDDEN + 1
    assert page._others["clouds"].points.shape == (9, 3)
    stop_server(server)


@needs_browser
def test_the_camera_looks_at_the_place_that_it_is_sent_to(tmp_path: Path) -> None:
    server = start_server(LOOPBACK, 0)
    browser = Browser(tmp_path / "browser", 1000, 700)
    browser.open(f"http://{LOOPBACK}:{server.get_port()}")
    until(server.get_clients)
    (client,) = server.get_clients().values()
    for place, distance in (((5.0, -40.0, 2.0), 30.0), ((5.0, -40.0, 2.0), 3.0), ((-8.0, 1.0, 0.5), 3.0)):
        look_at(client, place, distance)
        ahead = client.camera.look_at - client.camera.position
        assert np.linalg.norm(ahead) == pytest.approx(distance)
        aside = place - client.camera.look_at  # the place is to the left, in the middle of what the panel leaves free
        half_width = distance * np.tan(0.5 * client.camera.fov) * client.camera.aspect
        assert aside @ np.cross(ahead, (0, 0, 1)) < 0.0 and abs(aside @ ahead) < 1e-6 and abs(aside[2]) < 1e-6
        assert np.linalg.norm(aside) == pytest.approx(half_width * WIDTH / client.camera.image_width)
    browser.close()
    stop_server(server)


@needs_browser
def test_the_page_of_a_session(served: Served, tmp_path: Path) -> None:
    browser = Browser(tmp_path / "first", 900, 700)
    browser.open(served.url)
    browser.until_shown("drive.mcap: 0.00 of 2.98 s", "3 objects", "0 touching", f"{NASTY[:10]}")
    browser.dismiss_notification()  # that WebGL runs in software here
    until(lambda: len(np.unique(pixels(browser.screenshot())[:, :480].reshape(-1, 3), axis=0)) > 20)  # WebGL is ready
    assert reds(browser.screenshot()) < 20
    browser.click("contact ›")
    browser.until_shown("1 touching", "unresolved now")  # they touch to the last bit, so that the bound leaves it open
    browser.click("›")
    browser.until_shown("1 touching", "now, ")
    until(lambda: reds(browser.screenshot()) > 200, lambda: "what touches to be red")
    overview = reds(browser.screenshot())
    browser.click("now, ")  # the row of the pair moves the camera to it
    until(lambda: reds(browser.screenshot()) > 2 * overview, lambda: "the camera to approach the pair")
    until(lambda: browser.press(240, 300) or "(id 1)" in browser.text, lambda: "the clicked object to be named")
    browser.close()
    assert browser.requests() and all(url.startswith(f"ws{served.url[4:]}") for url in browser.requests())

    again = Browser(tmp_path / "again", 900, 700)  # the first one went away
    again.open(served.url)
    again.until_shown("1 touching", "now, ")
    again.click("play")
    again.until_shown("2.98 of 2.98 s", "play")
    again.close()
    assert served.stop() == 0
    assert "Traceback" not in served.words and len(served.words.splitlines()) == 1


@needs_browser
def test_a_session_without_shapes_or_objects_has_a_page(drive: Path, tmp_path: Path) -> None:
    session = Session(drive)
    with Recorder(tmp_path / "bare.mcap", TYPES, session.metadata) as recorder:
        for message in session.messages():
            if message.topic == STATES:
                recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    view = Served(tmp_path, str(tmp_path / "bare.mcap"))
    browser = Browser(tmp_path / "browser", 900, 700)
    browser.open(view.url)
    browser.until_shown("0 objects", "not known: there are no answers", "--replay")
    browser.close()
    assert view.stop() == 0


def test_a_port_in_use_is_refused() -> None:
    pytest.importorskip("viser")
    with socket.socket() as taken:
        taken.bind((LOOPBACK, 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"expected a free port, {port} is in use"):
            start_server(port=port)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "192.0.2.1"])
def test_a_host_of_another_machine_is_refused(host: str) -> None:
    pytest.importorskip("viser")
    with pytest.raises(InputError, match=f"--host: expected .* of this machine, got '{host}'"):
        start_server(host, 0)


def test_without_viser_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(UnsupportedError, match="expected the package viser"):
        start_server()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.mcap"], "nothing there"),
        ([__file__], "expected a session|MCAP"),
        (["--replay"], "expected a session, got none"),
        (["x.mcap", "--port", "70000"], "from 0 to 65535"),
    ],
    ids=["missing", "no session", "replay live", "port"],
)
def test_wrong_arguments_have_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "collision_monitor", "view", *arguments]
    answer = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert answer.returncode == (1 if words == "expected a session|MCAP" or arguments == ["missing.mcap"] else 2)
    assert re.search(words, answer.stderr) and len(answer.stderr.splitlines()) == 1, answer.stderr
