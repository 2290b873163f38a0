"""Every environment that `sim` registers keeps Gymnasium's contract and says what it is."""

import re
import subprocess
import sys

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env

from sim import ENTRY_POINTS

HEADINGS = [
    "Description",
    "Observation Space",
    "Action Space",
    "Rewards",
    "Starting State",
    "Episode End",
    "Arguments",
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ENTRY_POINTS)
def test_environment_keeps_its_contract(name: str) -> None:
    env = gymnasium.make(f"sim:{name}")
    check_env(env.unwrapped)
    specification = type(env.unwrapped).__doc__ or ""
    headings = re.findall(r"^ *## (.+)$", specification, flags=re.MULTILINE)
    assert [heading for heading in headings if heading in HEADINGS] == HEADINGS


def test_importing_sim_imports_no_world() -> None:
    code = "import sys, sim; print([name for name in sys.modules if name.startswith('sim.')])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "[]"
