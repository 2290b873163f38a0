"""Learned policies leave the house and act the same outside."""

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from msgspec.structs import replace

from agent.errors import CheckpointError
from agent.learning.pilot import Form, Pilot
from agent.learning.policies import C3F2, Network
from deploy.policies.export import write_onnx

DRONE = Form(C3F2(compute="float32"), (103, 103, 3), "uint8", 25, critic=True)
VECTOR = Form(Network((8,)), (4,), "float32", 3, critic=False)


def pilot(form: Form) -> Pilot:
    """Random parameters, larger than a beginner's, so that actions differ."""
    random = np.random.default_rng(0)
    theta = form.network().theta.numpy().copy()
    return Pilot(form, theta + random.normal(0, 0.05, theta.size).astype(np.float32))


def observations(form: Form, count: int = 12) -> np.ndarray:
    random = np.random.default_rng(1)
    if form.dtype == "uint8":
        return random.integers(0, 255, (count, *form.shape), np.uint8)
    return random.normal(size=(count, *form.shape)).astype(np.float32)


@pytest.mark.parametrize("form", [DRONE, VECTOR])
def test_a_saved_policy_acts_the_same(tmp_path: Path, form: Form) -> None:
    here, seen = pilot(form), observations(form)
    here.save(tmp_path / "policy.safetensors")
    there = Pilot.load(tmp_path / "policy.safetensors")
    np.testing.assert_array_equal(there.theta, here.theta)
    np.testing.assert_array_equal(there.actions(seen, True), here.actions(seen, True))
    assert len(set(here.actions(seen, greedy=True).tolist())) > 1


def test_a_policy_of_another_machine_flies_on_the_cpu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    here = pilot(VECTOR)
    here.form = replace(VECTOR, policy=Network((8,), device="cuda"))
    here.save(tmp_path / "policy.safetensors")
    there = Pilot.load(tmp_path / "policy.safetensors")
    assert there.form.policy.device == "cpu"
    seen = observations(VECTOR)
    np.testing.assert_array_equal(there.actions(seen, True), here.actions(seen, True))


@pytest.mark.parametrize("form", [DRONE, VECTOR])
def test_onnx_acts_the_same(tmp_path: Path, form: Form) -> None:
    here, seen = pilot(form), observations(form)
    write_onnx(here, tmp_path / "policy.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx")
    (logits,) = session.run(["logits"], {"observations": seen})
    np.testing.assert_array_equal(logits.argmax(1), here.actions(seen, greedy=True))
    (one,) = session.run(["logits"], {"observations": seen[:1]})
    np.testing.assert_allclose(one[0], logits[0], atol=1e-4)


def test_dice_follow_the_policy() -> None:
    here = pilot(VECTOR)
    seen = np.repeat(observations(VECTOR, 1), 20_000, axis=0)
    shares = np.bincount(here.actions(seen, greedy=False), minlength=3) / len(seen)
    choice = here.choose(seen, greedy=False)
    for action in range(3):
        expected = np.exp(choice.log_probs[choice.actions == action][0])
        assert shares[action] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("content", [None, b"", b"not a tensor", b"\x08" + 7 * b"\0" + b"{}      "])
def test_a_bad_file_is_named(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "policy.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CheckpointError, match=r"policy\.safetensors"):
        Pilot.load(path)
