"""What ``swarm vehicle`` does: one simulated vehicle as a process, until Ctrl-C."""

import hashlib
import re
import sys
import threading
from pathlib import Path

from deploy.flying.warmup import rehearse_vehicle
from deploy.process.news import working
from deploy.process.signals import stop_on_signals
from sim.indoor.content.scene import check
from sim.vehicle.quadrotor import Weather
from sim.vehicle.rooms import Room
from sim.vehicle.server import LOCAL_OFFSET, Options, run
from swarm.errors import ConfigError, NetworkError


def read_key(path: Path) -> bytes:
    """The signing key in a file: 64 hexadecimal digits, or a passphrase (its SHA-256, as MAVProxy).

    Raises:
        ConfigError: the file cannot be read, or holds nothing.
    """
    try:
        text = path.read_text(encoding="utf-8-sig").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f'signing key "{path}" cannot be read: {error}') from error
    if not text:
        raise ConfigError(f'signing key "{path}" is empty: expected a passphrase or 64 hex digits')
    if re.fullmatch(r"[0-9a-fA-F]{64}", text):
        return bytes.fromhex(text)
    return hashlib.sha256(text.encode()).digest()


def read_wind(text: str) -> Weather:
    """``NORTH,EAST[,GUSTS]`` in m/s: where the air goes, and how much it varies.

    Raises:
        ConfigError: it is none of that.
    """
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in {2, 3} or not all(abs(n) <= 30 for n in numbers):
        raise ConfigError(f'wind "{text}": expected NORTH,EAST or NORTH,EAST,GUSTS in m/s')
    north, east, gusts = (*numbers, 0.0)[:3]
    return Weather((north, east, 0.0), abs(gusts))


def run_vehicle(options: Options) -> None:
    """Run the vehicle until a signal tells it to stop.

    Raises:
        ConfigError: there is no such scene or start.
        NetworkError: its port is taken.
    """
    world = None
    try:
        if options.scene is not None:
            check(options.scene, options.start)
        with working("making the vehicle ready"):
            if options.scene is not None:
                world = Room(options.scene, options.start)
            rehearse_vehicle(world)
    except (ValueError, OSError, ImportError) as error:
        raise ConfigError(str(error)) from None

    stop = threading.Event()

    def ready(port: int) -> None:
        stop_on_signals(stop)
        kind = "TCP" if options.tcp else "UDP"
        where = f"listens on {kind} port {port}"
        if not options.tcp:
            where += f", sends to {options.host}:{options.port}"
        pace = f"speed {options.speed:g}"
        if options.lockstep is not None:
            pace = f"lockstep {options.lockstep:g} s"
        if options.scene is not None:
            pace += f", in {options.scene}"
        print(
            f"vehicle {options.system} ({options.flavour.name}, {pace}) {where}",
            file=sys.stderr,
            flush=True,
        )

    try:
        run(options, stop, ready, world)
    except OSError as error:
        listens = options.port if options.tcp else options.local_port
        listens = options.port + LOCAL_OFFSET if listens is None else listens
        raise NetworkError(
            f"vehicle {options.system} cannot listen on port {listens}: {error.strerror or error}"
        ) from error
