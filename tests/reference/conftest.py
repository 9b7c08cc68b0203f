"""Every kernel call of these tests is tested for arguments of the types that its first call had."""

from __future__ import annotations

import pytest

from fabricusd.kernels.calls import Calls


@pytest.fixture(autouse=True)
def tested_calls(monkeypatch):
    monkeypatch.setattr(Calls, "tested", True)
