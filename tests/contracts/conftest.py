"""Random motions, for all tests of this folder."""

from __future__ import annotations

import pytest
from motions import random_motion_of


@pytest.fixture(scope="session")
def random_motion():
    """The function `random_motion_of`."""
    return random_motion_of
