"""Where a session goes: a window, a browser, a file, a picture.

Interface: :class:`Output` (what was asked for) and :func:`opened` (a recorder that leads there).
A viewer keeps :data:`MEMORY` and drops its oldest data beyond, so that an hour of four drones stays
under 2 GB with all processes together (``tests/bench/viewer.py``).
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.experimental import ViewerClient

from agent.config.experiment import SwarmFile
from deploy.process.ports import hold_free, is_free
from deploy.viewer.drawing import Scene
from deploy.viewer.recorder import FLUSH, Recorder, StreamBrokenError
from swarm.errors import ConfigError, NetworkError, SwarmError

MEMORY = "1000MB"  # of data in a viewer; it takes some 200 MB beside
BUFFER = "50MB"  # for those who connect later: nobody to a window's server; a browser's has MEMORY
PICTURE_LIMIT = 60.0  # [s] for a picture; without a graphics card it is painted on the processor
NOTICES = 5.0  # [s] for which a viewer shows what it has to say at its start, over the pictures
GUARD = 'read end; kill -- "-$1"'  # a shell that waits until its input closes
NO_DISPLAY = (
    "the viewer needs a display, and there is none: "
    "expected --save FILE.rrd, --web, or --headless --screenshot FILE.png"
)
NO_GRAPHICS = "pictures need Vulkan; on Debian: apt-get install mesa-vulkan-drivers libvulkan1"


@dataclass(frozen=True, slots=True)
class Output:
    """What a user asked for; a window, unless it is something else.

    Attributes:
        save: recording to write, instead of showing anything.
        web: serve the browser's viewer.
        host: name under which browsers reach this machine.
        ports: of the page and of the data.
        headless: a viewer without a window.
        screenshot: PNG to write at the end.
        seconds: how long to watch, whether the swarm is there or not; None: until it ends, or
            where somebody looks, until Ctrl-C.
    """

    save: Path | None = None
    web: bool = False
    host: str = "localhost"
    ports: tuple[int, int] = (9090, 9876)
    headless: bool = False
    screenshot: Path | None = None
    seconds: float | None = None

    def __post_init__(self) -> None:
        if self.save is not None and (self.web or self.headless or self.screenshot):
            raise ConfigError("--save writes a recording and shows nothing: expected it alone")
        if self.web and (self.headless or self.screenshot):
            raise ConfigError("--web has its viewer in the browser: expected no --screenshot")
        if self.headless and self.screenshot is None:
            raise ConfigError("--headless shows nothing: expected --screenshot FILE.png, too")
        if self.save is None and not self.web and not self.headless and not _has_display():
            raise SwarmError(NO_DISPLAY)

    @property
    def stays(self) -> bool:
        """Whether it outlives the swarm: somebody looks, or wants so many seconds of it."""
        return self.seconds is not None or (self.save is None and not self.headless)


@contextmanager
def opened(config: SwarmFile, output: Output) -> Iterator[Recorder]:
    """A recorder that leads to ``output``; a picture is taken at the end.

    Raises:
        ConfigError: a file cannot be written.
        NetworkError: a port is taken.
        SwarmError: the viewer does not start.
    """
    scene = Scene.of(config)
    for file in (output.save, output.screenshot):
        if file is not None:
            _check_writable(file)
    with rr.RecordingStream(f"swarm {config.name}") as stream, ExitStack() as guards:
        viewer = _connect(stream, scene, output, guards)
        try:
            yield Recorder(stream, scene)
            if viewer is not None and output.screenshot is not None:
                stream.flush(timeout_sec=FLUSH)
                _photograph(viewer, output.screenshot)
        except StreamBrokenError:
            stream.disconnect()
            if output.save is not None or output.screenshot is not None:
                raise
            print("the viewer was closed")
        finally:
            if viewer is not None and output.headless:
                stream.disconnect()  # a stream that ends after its viewer complains
                viewer.quit()


def _connect(
    stream: rr.RecordingStream, scene: Scene, output: Output, guards: ExitStack
) -> ViewerClient | None:
    """Connect the stream to where it goes; returns the viewer that was started for it, if any."""
    if output.save is not None:
        stream.save(output.save, default_blueprint=scene.blueprint())
    elif output.web:
        _serve(stream, scene, output)
    else:
        viewer = _spawn(output.headless)
        if output.headless:
            guards.enter_context(_ends_with_us(viewer))
        try:
            stream.connect_grpc(viewer.url, default_blueprint=scene.blueprint())
            stream.flush(timeout_sec=FLUSH)
        except RuntimeError as error:
            stream.disconnect()
            viewer.quit()
            raise SwarmError(f"the viewer does not answer: {error}") from None
        return viewer
    return None


def _serve(stream: rr.RecordingStream, scene: Scene, output: Output) -> None:
    page, data = output.ports
    for port in output.ports:
        if not is_free("0.0.0.0", port):  # noqa: S104  (where Rerun will listen)
            raise NetworkError(f"port {port} is taken: expected another, see --ports")
    origin = f"http://{output.host}:{page}"
    stream.serve_grpc(
        grpc_port=data,
        default_blueprint=scene.blueprint(),
        server_memory_limit=MEMORY,
        cors_allow_origin=[origin],
    )
    rr.serve_web_viewer(web_port=page, open_browser=False)
    print(f"viewer: {origin}/?url=rerun%2Bhttp://{output.host}:{data}/proxy", flush=True)


def _spawn(headless: bool) -> ViewerClient:
    """Start a viewer.

    Raises:
        SwarmError: it does not start.
    """
    beside = Path(sys.executable).with_name("rerun")  # the venv need not be on the PATH
    os.environ.setdefault("RUST_LOG", "off")  # it would show its log to those who look
    try:
        with hold_free("127.0.0.1", 1) as held:
            return ViewerClient.spawn(
                headless=headless,
                port=held.numbers[0],
                memory_limit=MEMORY,
                server_memory_limit=BUFFER,
                hide_welcome_screen=True,
                executable_path=str(beside) if beside.exists() else None,
            )
    except RuntimeError as error:
        raise SwarmError(f"{NO_GRAPHICS if headless else NO_DISPLAY} ({error})") from None


@contextmanager
def _ends_with_us(viewer: ViewerClient) -> Iterator[None]:
    """End a viewer that nobody sees even if we are killed outright.

    A shell of its own session waits for its input to close, which the kernel does when we are gone.
    """
    group = str(viewer._pid)  # nobody else tells; it leads a process group
    guard = subprocess.Popen(
        ["sh", "-c", GUARD, "sh", group], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    try:
        yield
    finally:
        guard.kill()
        guard.communicate()


def _photograph(client: ViewerClient, path: Path) -> None:
    """Write a picture of what the viewer shows; a slow machine may need several tries.

    Raises:
        SwarmError: none of them succeeded.
    """
    time.sleep(NOTICES)
    end = time.monotonic() + PICTURE_LIMIT
    while True:
        try:
            path.write_bytes(client.take_screenshot())
            return
        except (RuntimeError, TimeoutError) as error:
            if time.monotonic() > end:
                raise SwarmError(f"{NO_GRAPHICS} ({error})") from None


def _check_writable(path: Path) -> None:
    try:
        path.open("ab").close()
    except OSError as error:
        raise ConfigError(f'"{path}" cannot be written: {error.strerror}') from None


def _has_display() -> bool:
    """Whether a window can be opened, as far as one can tell without trying."""
    return sys.platform != "linux" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
