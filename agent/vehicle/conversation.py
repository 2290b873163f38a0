"""The conversation with one vehicle: telemetry in, commands until they are answered.

Interface: :class:`Conversation`.  One thread owns the link: it reads, keeps the newest telemetry,
sends the heartbeat, and every ``timing.stream`` seconds the message that its owner has for it.
Other threads ask and wait here, each with a deadline; what the vehicle refuses becomes one line.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from agent.errors import RefusedError, VehicleError
from agent.vehicle.dialects import mavlink
from agent.vehicle.link import AUTOPILOT, COMPANION, Link, Message
from agent.vehicle.safety import Timing
from agent.vehicle.state import READERS, VehicleState

log = logging.getLogger(__name__)

LOOK = 0.2  # s, how often a condition is looked at while nothing comes

Condition = Callable[[VehicleState], bool]


class Conversation:
    """Talks from its construction until ``close``.

    Args:
        link: closed by ``close``.
        timing: how long to wait.
        steer: what to send now, asked ``timing.stream`` seconds apart with the telemetry and the
            time (``time.monotonic()``), under ``lock``.

    Attributes:
        lock: around what ``steer`` shares with other threads.
        state: the newest telemetry.
        name: what messages call the vehicle.
        ended: why the thread is no more; empty while it lives, and after ``close``.
    """

    def __init__(
        self, link: Link, timing: Timing, steer: Callable[[VehicleState, float], Message | None]
    ) -> None:
        self.lock = threading.Condition()
        self.state = VehicleState()
        self.name = "vehicle"
        self.ended = ""
        self._link, self._timing, self._steer = link, timing, steer
        self._outbox: deque[Message] = deque()
        self._acks: dict[int, int] = {}  # command -> result
        self._texts: deque[tuple[float, str]] = deque(maxlen=20)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="vehicle", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop talking."""
        self._stop.set()
        self._thread.join(5.0)
        self._link.close()

    def pause(self, seconds: float) -> None:
        """Let time pass; the thread goes on."""
        self._stop.wait(seconds)

    def send(self, message: Message) -> None:
        """Send a message soon."""
        self._outbox.append(message)

    def command(self, what: str, id_: int, *params: float) -> None:
        """Send a COMMAND_LONG until it is answered; one that is in progress is not sent again.

        Raises:
            RefusedError: it is refused.
            VehicleError: nobody answers.
        """
        padded = [*params, *[0.0] * (7 - len(params))]
        begun = time.monotonic()
        with self.lock:
            self._acks.pop(id_, None)
        end = begun + self._timing.command
        attempt, working = 0, False
        while (now := time.monotonic()) < end:
            if not working:
                self.send(
                    mavlink.MAVLink_command_long_message(
                        self._link.system, AUTOPILOT, id_, min(attempt, 255), *padded
                    )
                )
                attempt += 1
            with self.lock:
                wait = end - now if working else min(self._timing.retry, end - now)
                self.lock.wait_for(lambda: id_ in self._acks, wait)
                result = self._acks.pop(id_, None)
            if result == mavlink.MAV_RESULT_ACCEPTED:
                return
            if result == mavlink.MAV_RESULT_IN_PROGRESS:
                working, end = True, time.monotonic() + self._timing.command
                end = min(end, begun + self._timing.working)
            elif result is not None:
                raise RefusedError(
                    f"{self.name} refuses to {what}: {_result(result)}{self._said(begun)}"
                )
        seconds = time.monotonic() - begun
        ending = "is still busy with" if working else "does not answer to"
        raise VehicleError(f"{self.name} {ending} {what!r} after {seconds:.0f} s{self.others}")

    @property
    def others(self) -> str:
        """Which other vehicles are on the link, in brackets: perhaps one of them was meant."""
        others = sorted(self._link.heard - {self._link.system})
        return f" (also heard: system {', '.join(map(str, others))})" if others else ""

    @property
    def rival(self) -> bool:
        """Whether another companion computer of the vehicle is on the link."""
        return self._link.rival

    def await_(self, condition: Condition, seconds: float, what: str) -> None:
        """Wait for telemetry that says so.

        Raises:
            VehicleError: it does not within `seconds`; `what` is the predicate of the sentence.
        """
        begun = time.monotonic()
        with self.lock:
            while not condition(self.state):  # of the telemetry, or of the clock
                left = begun + seconds - time.monotonic()
                if left <= 0:
                    break
                self.lock.wait(min(left, LOOK))
            else:
                return
        state = self.state
        missing = []
        if begun - state.heartbeat_at > self._timing.link:
            missing.append("no heartbeat")
        elif time.monotonic() - state.position_at > self._timing.telemetry:
            missing.append("no position")
        if state.prearm_ok is False:
            missing.append("arming checks fail")
        why = f": {', '.join(missing)}" if missing else ""
        raise VehicleError(
            f"{self.name} {what} within {seconds:g} s{why}{self.others}{self._said(begun - 10)}"
        )

    def _said(self, since: float) -> str:
        """What it said lately, in brackets."""
        texts = list(dict.fromkeys(text for at, text in list(self._texts) if at >= since - 1.0))
        return f" ({'; '.join(texts[-3:])})" if texts else ""

    # -- the thread ----------------------------------------

    def _run(self) -> None:
        try:
            self._talk()
        finally:
            if not self._stop.is_set():  # an error of ours: nobody must wait in vain
                self.ended = "the thread of the connection has ended"
                with self.lock:
                    self.lock.notify_all()

    def _talk(self) -> None:
        next_heartbeat = next_tick = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            if now >= next_heartbeat:
                next_heartbeat = now + self._timing.heartbeat
                self._link.send(
                    mavlink.MAVLink_heartbeat_message(
                        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0,
                        mavlink.MAV_STATE_ACTIVE, 3,
                    )
                )  # fmt: skip
            if now >= next_tick:
                next_tick = max(next_tick + self._timing.stream, now)
                with self.lock:
                    message = self._steer(self.state, now)
                if message is not None:
                    self._link.send(message)
            while self._outbox:
                self._link.send(self._outbox.popleft())
            wait = min(next_tick, next_heartbeat) - time.monotonic()
            for message in self._link.receive(min(max(wait, 0.0), 0.02)):
                self._take(message)

    def _is_for_us(self, ack: Message) -> bool:
        """Whether an acknowledgement answers us; MAVLink 1 and old autopilots do not tell."""
        system, component = ack.target_system, ack.target_component
        return system in {0, self._link.system} and component in {0, COMPANION}

    def _take(self, message: Message) -> None:
        """Keep what a message says."""
        kind, now = message.get_type(), time.monotonic()
        with self.lock:
            if kind == "COMMAND_ACK":
                if self._is_for_us(message):
                    self._acks[message.command] = message.result
            elif kind == "STATUSTEXT":
                self._texts.append((now, message.text))
                log.info("%s says: %s", self.name, message.text)
            elif kind in READERS:
                self.state = READERS[kind](self.state, message, now)
            else:
                return
            self.lock.notify_all()


def _result(result: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return str(entry.name).removeprefix("MAV_RESULT_") if entry is not None else f"result {result}"
