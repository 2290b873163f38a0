"""Names that may stand in a key, and keys read back."""

import pytest

from swarm.errors import ConfigError, PayloadError
from swarm.wire.keys import Keys, check_name


@pytest.mark.parametrize("name", ["a", "drone0", "gridworld-a", "A.b_c-9", "x" * 64])
def test_good_names(name: str) -> None:
    assert check_name("name", name) == name


@pytest.mark.parametrize("name", ["", "a/b", "*", "a b", "-a", "$x", "é", "x" * 65])
def test_bad_names(name: str) -> None:
    with pytest.raises(ConfigError, match="expected 1 to 64 letters"):
        check_name("name", name)


def test_tokens_read_back() -> None:
    assert Keys.token(Keys("s").alive("drone0", "1f")) == ("drone0", "1f")


@pytest.mark.parametrize("key", ["dcpg/**", "**", "dcpg/*/params/*/a", "dcpg/s/params/**", "x/y"])
def test_wild_keys_name_nobody(key: str) -> None:
    with pytest.raises(PayloadError) as told:
        Keys.identity(key)
    assert told.value.cause == "key"
    with pytest.raises(PayloadError):
        Keys.token(key)
    assert not Keys.names(key, "a")
