"""The page is served under its own names, to pages of its own, and a hostile frame costs one line."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest
import zstandard

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.view.frames import MOST_LINES
from collision_monitor.view.own_hosts import OwnHosts
from collision_monitor.view.player import Player
from collision_monitor.view.server import LOOPBACK, start_server, stop_server
from collision_monitor.view.view import View

pytest.importorskip("viser")

NAME = "a secret robot"


@pytest.fixture
def page() -> Iterator[Any]:
    server = start_server(LOOPBACK, 0, ["proxy.example"])
    server.scene.add_label("/names/1", NAME)
    yield server
    stop_server(server)


def answer(port: int, *lines: str) -> str:
    """The first line of the answer to a request with these headers."""
    with socket.create_connection((LOOPBACK, port), timeout=10) as connection:
        connection.sendall("\r\n".join(["GET / HTTP/1.1", *lines, "", ""]).encode())
        return connection.makefile("r", encoding="latin-1").readline()


def dial(port: int, **options: Any) -> Any:
    import viser
    from websockets.sync.client import connect

    protocol = f"viser-v{viser.__version__}"
    return connect(f"ws://{LOOPBACK}:{port}", subprotocols=[protocol], max_size=None, proxy=None, **options)  # type: ignore[list-item]


OWN = ("127.0.0.1:{}", "localhost:{}", "LOCALHOST:{}", "127.0.0.1", "[::1]:{}", "localhost:9000", "proxy.example")
FOREIGN = (
    "evil.example:{}",
    "127.0.0.1.evil.example:{}",
    "localhost.evil.example",
    "192.168.1.7:{}",
    "",
    "a b",
    "[::1",
    "127.0.0.1:x",
)


@pytest.mark.parametrize("host", OWN)
def test_the_page_is_served_under_its_own_names(page: Any, host: str) -> None:
    assert " 200 " in answer(page.get_port(), f"Host: {host.format(page.get_port())}")


@pytest.mark.parametrize("host", FOREIGN)
def test_a_foreign_host_is_refused(page: Any, host: str, capfd: pytest.CaptureFixture[str]) -> None:
    """By DNS rebinding a site lets its own name lead to this machine."""
    assert " 403 " in answer(page.get_port(), f"Host: {host.format(page.get_port())}")
    assert "view: refused a request for the host" in capfd.readouterr().err
    assert " 403 " in answer(page.get_port())
    assert " 403 " in answer(page.get_port(), "Host: localhost", "Host: evil.example")


def names_in(connection: Any) -> bool:
    """Whether the page's labels arrive."""
    try:
        return any(NAME.encode() in unpacked(connection.recv(timeout=10)) for _ in range(20))
    except TimeoutError:
        return False


def unpacked(data: bytes) -> bytes:
    """A frame is two lengths, and messages packed by zstd."""
    size = int.from_bytes(data[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(data[16 : 16 + size], max_output_size=1 << 24)


@pytest.mark.parametrize("origin", [None, "http://127.0.0.1:{}"])
def test_the_page_itself_gets_the_scene(page: Any, origin: str | None) -> None:
    port = page.get_port()
    with dial(port, origin=origin and origin.format(port)) as connection:
        assert names_in(connection)


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://127.0.0.1.evil.example:{}",
        "http://localhost:{}",
        "http://127.0.0.1:1",
        "null",
        "file://",
        "",
    ],
)
def test_a_page_of_another_site_gets_nothing(page: Any, origin: str, capfd: pytest.CaptureFixture[str]) -> None:
    """Browsers let every site open a websocket to this machine."""
    from websockets.exceptions import InvalidStatus

    port = page.get_port()
    with pytest.raises(InvalidStatus, match="403"):
        dial(port, additional_headers={"Origin": origin.format(port)})
    assert "view: refused a request of a page of" in capfd.readouterr().err


def test_names_of_a_server_for_other_machines() -> None:
    hosts = OwnHosts("0.0.0.0", ["Robot.Example"])
    this = socket.gethostname()
    for host in (
        "192.168.1.7:8080",
        "[fe80::1]:8080",
        "localhost:8080",
        f"{this}:8080",
        f"{this}.local",
        "robot.example",
    ):
        assert hosts.refusal({"Host": host}) == "", host
        assert hosts.refusal({"Host": host, "Origin": f"http://{host}"}) == "", host
        assert "of a page" in hosts.refusal({"Host": host, "Origin": "http://evil.example"}), host
    assert "for the host 'evil.example:8080'" in hosts.refusal({"Host": "evil.example:8080"})
    # behind a proxy that gives the page its own host
    assert hosts.refusal({"Host": "localhost:8080", "Origin": "https://robot.example"}) == ""
    for name in ("http://robot.example", "robot.example:80", "", "a b", "user@robot.example"):
        with pytest.raises(InputError, match="--allow-host: expected a name"):
            OwnHosts("0.0.0.0", [name])


def frames() -> list[tuple[bytes | str, str]]:
    """Frames that are no messages of the page, with the line that each costs."""
    import msgspec

    def packed(**fields: Any) -> bytes:
        return msgspec.msgpack.encode(fields)

    camera = {
        "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 1], "fov": 1.0, "near": 0.1, "far": 9.0,
        "image_height": 100, "image_width": 100, "look_at": [0, 0, 0], "up_direction": [0, 0, 1],
    }  # fmt: skip
    return [
        (b"\xff\xfe", "no message"),
        ("text", "no message"),
        (b"", "no message"),
        (packed(type="NoSuchMessage"), "no message"),
        (packed(kind="x"), "no message"),
        (msgspec.msgpack.encode([1, 2]), "no message"),
        (packed(type="ShareUrlRequest"), "a message ShareUrlRequest, which this page does not use"),
        (packed(type="FileTransferPart", source_component_uuid=None, transfer_uuid="x", part_index=0, content=b""), ""),
        (packed(**camera | {"position": [float("nan"), 0, 0]}), "with position (nan, 0.0, 0.0)"),
        (packed(**camera | {"wxyz": [1]}), "with wxyz"),
        (packed(**camera | {"fov": "wide"}), "could not convert"),
        (packed(**camera | {"image_width": 1e300}), "with image_width"),
        (packed(type="GuiUpdateMessage", uuid="x", updates={"update_cb": []}), "with updates {'update_cb': []}"),
        (packed(type="GuiUpdateMessage", uuid="x", updates={"value": float("inf")}), "with updates"),
        (packed(type="GuiUpdateMessage", uuid="x", updates={"value": "x" * 5000}), "with updates"),
        (packed(type="SceneNodeClickMessage", name="/a", instance_index="x", ray_origin=[0, 0, 0],
                ray_direction=[0, 0, 1], screen_pos=[0, 0], modifier=None), "with instance_index 'x'"),
    ]  # fmt: skip


def test_hostile_frames_cost_one_line_each_and_the_page_goes_on(page: Any, capfd: pytest.CaptureFixture[str]) -> None:
    port = page.get_port()
    with dial(port) as connection:
        for frame, words in frames():
            connection.send(frame)
            said = until_said(capfd)
            assert said.count("\n") == 1 and said.startswith("view: refused ") and words in said, said
        assert names_in(connection)
        for _ in range(2 * MOST_LINES):
            connection.send(b"\xff")
        assert names_in(dial(port))
    said = capfd.readouterr().err
    assert len(said.splitlines()) <= MOST_LINES and "further ones are not listed" in said and "Traceback" not in said


def until_said(capfd: pytest.CaptureFixture[str]) -> str:
    import time

    said = ""
    for _ in range(400):
        said += capfd.readouterr().err
        if said.endswith("\n"):
            break
        time.sleep(0.01)
    return said


def test_values_that_no_control_has_cost_one_line(page: Any, capfd: pytest.CaptureFixture[str]) -> None:
    """The loop of the view goes on, whatever a request raises."""
    view = View(page)
    view.requests.put(lambda: [][1])
    view.requests.put(lambda: None)
    view.answer_requests()
    assert capfd.readouterr().err.count("\n") == 1
    player = Player(2.0)
    for time in (float("nan"), float("inf"), -float("inf")):
        player.seek(time)
        assert player.time == 0.0


def test_a_viser_that_cannot_be_guarded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from viser.infra import _infra

    monkeypatch.delattr(_infra, "_message_consumer")
    with pytest.raises(UnsupportedError, match="cannot be guarded"):
        start_server(LOOPBACK, 0)
