"""The one place of this room that imports pymavlink: MAVLink 2, dialect ``common``.

pymavlink reads its environment when it is imported, so that is set first.
"""

import os
from typing import Any

os.environ.setdefault("MAVLINK20", "1")
os.environ.setdefault("MAVLINK_DIALECT", "common")

from pymavlink.dialects.v20 import common as mavlink

Message = Any  # a message of pymavlink's, or one of codec's hand-packed ones: has the same fields

__all__ = ["Message", "mavlink"]
