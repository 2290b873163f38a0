"""Commands and their answers, over a wire that answers at once."""

import pytest
from pymavlink.dialects.v20 import common as mavlink

from agent.errors import RefusedError, VehicleError
from agent.vehicle import link as link_module
from agent.vehicle.conversation import Conversation
from agent.vehicle.link import COMPANION, Link
from agent.vehicle.safety import Timing

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
OK, BUSY, DENIED = 0, mavlink.MAV_RESULT_IN_PROGRESS, mavlink.MAV_RESULT_DENIED
TIMING = Timing(command=0.3, retry=0.02, working=5.0)


class Autopilot:
    """Answers COMMAND_LONG number k with ``answers[k]``: results, each addressed to somebody."""

    datagrams = True

    def __init__(self, answers: list[list[tuple[int, int, int]]]) -> None:
        self.answers, self.asked = answers, 0
        self._codec, self._ears = mavlink.MAVLink(None, 1, 1), mavlink.MAVLink(None, 9, 9)
        self._waiting = [mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 3, 3)]

    def receive(self, timeout: float) -> bytes:
        return bytes(self._waiting.pop(0).pack(self._codec)) if self._waiting else b""

    def send(self, data: bytes) -> None:
        for message in self._ears.parse_buffer(bytearray(data)) or ():
            if message.get_type() == "COMMAND_LONG":
                answers = self.answers[min(self.asked, len(self.answers) - 1)]
                self.asked += 1
                self._waiting += [
                    mavlink.MAVLink_command_ack_message(ARM, result, 0, 0, system, component)
                    for result, system, component in answers
                ]

    def believe(self) -> None:
        """There is only one."""

    def close(self) -> None:
        """Nothing to let go of."""


def arm(monkeypatch: pytest.MonkeyPatch, *answers: list[tuple[int, int, int]]) -> Autopilot:
    """Ask to arm; the autopilot as it is then."""
    wire = Autopilot(list(answers))
    monkeypatch.setattr(link_module, "open_connection", lambda text, timeout: wire)
    talk = Conversation(Link("udpin:0.0.0.0:1", 1.0, 0, None, None), TIMING, lambda s, now: None)
    try:
        talk.await_(lambda s: s.heartbeat_at > 0, 5.0, "is not there")
        talk.command("arm", ARM, 1)
    finally:
        talk.close()
    return wire


def test_what_is_in_progress_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (
        arm(monkeypatch, [(BUSY, 1, COMPANION), (BUSY, 1, COMPANION), (OK, 1, COMPANION)]).asked
        == 1
    )


def test_progress_without_an_end_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(VehicleError, match="is still busy with 'arm'"):
        arm(monkeypatch, [(BUSY, 1, COMPANION)])


def test_what_is_not_answered_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert arm(monkeypatch, [], [], [(OK, 0, 0)]).asked == 3


def test_a_refusal_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RefusedError, match="refuses to arm: DENIED"):
        arm(monkeypatch, [(DENIED, 1, COMPANION)])


@pytest.mark.parametrize("to", [(255, 190), (1, 190), (255, COMPANION)])
def test_an_answer_to_somebody_else_is_not_ours(
    monkeypatch: pytest.MonkeyPatch, to: tuple[int, int]
) -> None:
    """A ground station's arming is accepted, and one of its commands refused; ours comes later."""
    assert arm(monkeypatch, [(OK, *to)], [(DENIED, *to)], [(OK, 1, COMPANION)]).asked == 3
