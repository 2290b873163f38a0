"""The agent's side flies our vehicles, PX4- and ArduPilot-flavoured, over real UDP and TCP."""

import io
import math
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from agent.errors import RefusedError, TakenOverError, VehicleError
from agent.vehicle import Limits, Timing, Vehicle
from sim.vehicle.dialect import mavlink
from sim.vehicle.flavours import ARDUPILOT, PX4, Flavour
from sim.vehicle.server import Options
from tests.integration.vehicles import HOST, free_port, vehicle

pytestmark = pytest.mark.integration
SPEED = 2.0  # PX4 lets half a second of a loaded machine pass before it misses set points
KEY = b"0123456789abcdef0123456789abcdef"


@pytest.fixture(params=[PX4, ARDUPILOT], ids=lambda flavour: flavour.name)
def flavour(request: pytest.FixtureRequest) -> Flavour:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture
def options(flavour: Flavour) -> Iterator[Options]:
    with vehicle(Options(flavour=flavour, system=3, speed=SPEED)) as running:
        yield running


def until(
    drone: Vehicle,
    condition: Callable[[], bool],
    what: str,
    each: Callable[[], None] = lambda: None,
    seconds: float = 40.0,
) -> None:
    """Do something every 50 ms until a condition holds."""
    end, pause = time.monotonic() + seconds, threading.Event()
    while not condition():
        assert time.monotonic() < end, f"{what}: {drone.state}"
        each()
        pause.wait(0.05)


def near(drone: Vehicle, x: float, y: float, z: float) -> bool:
    return math.dist(drone.state.position, (x, y, z)) < 0.3


def test_a_whole_flight(options: Options) -> None:
    tape = io.BytesIO()
    with Vehicle(f"udpin:{HOST}:{options.port}", record=tape) as drone:
        assert drone.dialect.name == options.flavour.name
        assert drone.system == 3
        drone.take_off(2.0)
        assert drone.state.landed is False
        until(
            drone,
            lambda: near(drone, 3, 1, -2.5),
            "position",
            lambda: drone.fly_to(3, 1, -2.5, 1.0),
        )
        until(
            drone,
            lambda: abs(drone.state.attitude[2] - 1.0) < 0.1,
            "heading",
            lambda: drone.fly_to(3, 1, -2.5, 1.0),
        )
        until(
            drone,
            lambda: abs(drone.state.velocity[1] + 1.0) < 0.1,
            "velocity",
            lambda: drone.fly_at(0.0, -1.0, 0.0, 1.0),
        )
        until(  # the nose points 1 rad from north: ahead is (cos 1, sin 1)
            drone,
            lambda: math.dist(drone.state.velocity[:2], (math.cos(1), math.sin(1))) < 0.15,
            "body frame",
            lambda: drone.fly_ahead(1.0, 0.0, 0.0, 0.0),
        )
        until(drone, lambda: math.hypot(*drone.state.velocity) < 0.05, "coasts to a stop")
        drone.hold()
        with pytest.raises(VehicleError, match="expected take_off or resume first"):
            drone.fly_at(0.0, 0.0, 0.0, 0.0)
        with pytest.raises(VehicleError, match="is in the air: expected it on the ground"):
            drone.take_off(2.0)
        drone.resume()  # the way back to set points
        until(
            drone,
            lambda: drone.state.velocity[0] > 0.9,
            "velocity again",
            lambda: drone.fly_at(1.0, 0.0, 0.0, 1.0),
        )
        drone.land()
        assert not drone.state.armed
        with pytest.raises(VehicleError, match="expected take_off or resume first"):
            drone.fly_at(0.0, 0.0, 0.0, 0.0)
    stamp = struct.unpack(">Q", tape.getvalue()[:8])[0]
    assert abs(stamp / 1e6 - time.time()) < 300
    assert tape.getvalue()[8] == 0xFD


def break_off(
    options: Options, timing: Timing, limits: Limits, each: Callable[[Vehicle], None]
) -> str:
    """Fly until safety ends it; the drone must then land by itself.  The reason."""
    with Vehicle(f"udpin:{HOST}:{options.port}", timing, limits) as drone:
        drone.take_off(2.0)
        until(drone, lambda: drone.broken_off is not None, "safety", lambda: _try(each, drone))
        until(drone, lambda: not drone.state.armed, "landing")
        with pytest.raises(VehicleError, match="flight broken off"):
            drone.fly_at(0.0, 0.0, 0.0, 0.0)
        assert drone.broken_off is not None
        return drone.broken_off


def _try(each: Callable[[Vehicle], None], drone: Vehicle) -> None:
    try:
        each(drone)
    except VehicleError:
        assert drone.broken_off is not None


QUICK = Timing(policy=0.5, hold=0.5)


def test_a_stale_policy_ends_in_a_landing(options: Options) -> None:
    assert "policy stale" in break_off(options, QUICK, Limits(), lambda drone: None)


def test_nan_ends_in_a_landing(options: Options) -> None:
    reason = break_off(options, QUICK, Limits(), lambda drone: drone.fly_at(math.nan, 0, 0, 0))
    assert "not a number" in reason


def test_the_fence_ends_in_a_landing(options: Options) -> None:
    limits = Limits(fence=1.0, margin=0.5)
    reason = break_off(options, QUICK, limits, lambda drone: drone.fly_at(1.5, 0, 0, 0))
    assert "fence" in reason


def test_a_low_battery_ends_in_a_landing(options: Options) -> None:
    reason = break_off(
        options, QUICK, Limits(battery=0.999), lambda drone: drone.fly_at(0, 0, 0, 0)
    )
    assert "battery" in reason


def choose(drone: Vehicle, mode: tuple[int, int]) -> None:
    """What a ground station sends when its pilot picks a mode."""
    drone._talk.send(
        mavlink.MAVLink_command_long_message(
            drone.system, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, *mode, 0, 0, 0, 0
        )
    )


def test_what_a_pilot_chooses_is_left_alone_until_it_is_given_back(options: Options) -> None:
    """RTL is flown to its end, to the rotors' standstill; HOLD is given back and flown on from."""
    with Vehicle(f"udpin:{HOST}:{options.port}") as drone:
        drone.take_off(2.0)
        hold, rtl = drone.dialect.hold, (4, 5) if drone.dialect.name == "px4" else (6, 0)
        choose(drone, hold)
        until(drone, lambda: drone.taken_over is not None, "it is noticed")
        assert drone.dialect.name_of(hold) in str(drone.taken_over) and not drone.ours
        with pytest.raises(TakenOverError, match="is not ours to fly"):
            drone.fly_at(1.0, 0.0, 0.0, 0.0)
        with pytest.raises(TakenOverError, match="is not ours to fly"):
            drone.land()
        until(
            drone,
            lambda: drone.taken_over is None,
            "it is given back",
            lambda: choose(drone, drone.dialect.guided),
        )
        drone.await_control()
        until(
            drone,
            lambda: drone.state.velocity[0] > 0.9,
            "flown again",
            lambda: drone.fly_at(1.0, 0.0, 0.0, 0.0),
        )
        choose(drone, rtl)
        until(drone, lambda: drone.taken_over is not None, "it is noticed again")
        modes = set()
        until(
            drone,
            lambda: not drone.state.armed,
            "it comes home by itself",
            lambda: modes.add(drone.dialect.mode(drone.state.custom_mode)),
        )
        assert drone.broken_off is None
        assert modes <= {rtl, drone.dialect.land, drone.dialect.hold}
        assert rtl in modes
        with pytest.raises(VehicleError, match="was landed by its pilot"):
            drone.await_control()


def test_a_second_sortie_has_its_fence_around_its_own_place_of_take_off(options: Options) -> None:
    """Also for the companion that takes over there, when the one that took off has died."""
    where, limits = f"udpin:{HOST}:{options.port}", Limits(fence=5.0, speed=3.0)
    with Vehicle(where) as drone:
        drone.take_off(2.0)
        until(
            drone,
            lambda: near(drone, 12, 0, -2),
            "a place beyond the fence",
            lambda: drone.fly_to(12, 0, -2, 0.0),
        )
        drone.land()
    with Vehicle(where, limits=limits) as drone:
        drone.take_off(2.0)
    with Vehicle(where, limits=limits) as drone:
        assert drone.take_over()
        assert drone._helm.home == pytest.approx((12, 0, 0), abs=0.6)
        until(
            drone,
            lambda: near(drone, 14, 0, -2),
            "it flies",
            lambda: drone.fly_to(14, 0, -2, 0.0),
        )
        assert drone.broken_off is None
        drone.land()


def test_a_stray_sender_and_a_new_port_do_not_lose_the_vehicle(options: Options) -> None:
    """Somebody else's datagrams, first and often; then the router comes back on another port."""
    stray = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    router, out = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    stop, port = threading.Event(), free_port()
    router.bind((HOST, options.port))  # where the vehicle sends
    assert options.local_port is not None
    home, ways = (HOST, options.local_port), [out]

    def relay() -> None:
        while not stop.is_set():
            stray.sendto(b"hello", (HOST, port))
            for source, target in ((router, None), (ways[-1], home)):
                source.settimeout(0.005)
                try:
                    data = source.recv(65_536)
                except OSError:
                    continue
                if target is None:
                    ways[-1].sendto(data, (HOST, port))
                else:
                    router.sendto(data, target)

    out.bind((HOST, 0))
    thread = threading.Thread(target=relay, daemon=True)
    thread.start()
    try:
        with Vehicle(f"udpin:{HOST}:{port}") as drone:
            ways.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            ways[-1].bind((HOST, 0))
            until(drone, lambda: time.monotonic() - drone.state.heartbeat_at < 1.0, "still heard")
            drone._talk.command("send its version", mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
    finally:
        stop.set()
        thread.join(5)
        for each in (stray, router, *ways):
            each.close()


def test_the_vehicle_holds_when_set_points_stop(options: Options) -> None:
    """The agent dies in full flight; the vehicle stands still, and the next agent goes on."""
    with Vehicle(f"udpin:{HOST}:{options.port}") as drone:
        assert not drone.take_over()
        drone.take_off(2.0)
        until(
            drone,
            lambda: drone.state.velocity[0] > 0.9,
            "velocity",
            lambda: drone.fly_at(1.0, 0.0, 0.0, 0.0),
        )
    with Vehicle(f"udpin:{HOST}:{options.port}") as witness:
        until(witness, lambda: math.hypot(*witness.state.velocity) < 0.05, "hold")
        assert witness.state.armed
        assert witness.state.position[2] == pytest.approx(-2.0, abs=0.4)
        assert witness.take_over()
        until(
            witness,
            lambda: witness.state.velocity[1] > 0.9,
            "velocity again",
            lambda: witness.fly_at(0.0, 1.0, 0.0, 0.0),
        )
        witness.set_mode(witness.dialect.land)
    with (
        Vehicle(f"udpin:{HOST}:{options.port}") as another,
        pytest.raises(VehicleError, match="flown by somebody else"),
    ):
        another.take_over()


def test_lost_telemetry_is_noticed(flavour: Flavour) -> None:
    with vehicle(Options(flavour=flavour, speed=SPEED)) as running:
        drone = Vehicle(f"udpin:{HOST}:{running.port}").__enter__()
        drone.take_off(2.0)
    try:
        until(
            drone,
            lambda: drone.broken_off is not None,
            "safety",
            lambda: _try(lambda d: d.fly_at(0.0, 0.0, 0.0, 0.0), drone),
        )
        assert "telemetry stale" in str(drone.broken_off)
    finally:
        drone.close()


def test_a_refusal_says_why_in_one_line(options: Options) -> None:
    with Vehicle(f"udpin:{HOST}:{options.port}", Timing(ready=1.0)) as drone:
        with pytest.raises(VehicleError, match="take-off to 1000 m: expected"):
            drone.take_off(1000.0)
        with pytest.raises(RefusedError, match=r"refuses to go there.*not flying") as refusal:
            here = mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, 0, math.nan, math.nan, 490.0
            drone._talk.command("go there", *here)
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("speaks_first", ["udpout", "tcp"])
def test_other_connections_and_signing(speaks_first: str) -> None:
    with vehicle(Options(tcp=speaks_first == "tcp", key=KEY, speed=SPEED)) as running:
        port = running.port if running.tcp else running.local_port
        where = f"{speaks_first}:{HOST}:{port}"
        with Vehicle(where, key=KEY) as drone:
            drone.take_off(1.5)
            drone.land()
        short = replace(Timing(), connect=1.5, command=1.5)
        with pytest.raises(VehicleError), Vehicle(where, short, key=b"x" * 32):
            raise AssertionError("a wrong key was believed")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("udpin:nowhere", "expected udpin:HOST:PORT"),
        ("smoke:127.0.0.1:1", "expected udpin:HOST:PORT"),
        ("tcp:127.0.0.1:70000", "expected 1 to 65535"),
        ("tcp:127.0.0.1:1", "cannot be opened"),
        ("serial:/dev/nothing-here:57600", "cannot be opened"),
        ("udpin:127.0.0.1:21999", "sends nothing: no autopilot within 0.3 s"),
    ],
)
def test_a_connection_that_leads_nowhere(text: str, words: str) -> None:
    with pytest.raises(VehicleError, match=words), Vehicle(text, Timing(connect=0.3)):
        raise AssertionError("connected to nothing")
