"""The shares that a fabric may state."""

import pytest

from fabricusd.errors import FabricError
from fabricusd.sides import AZIMUTHS, LENGTHS, POLAR, Sides, spread


def test_shares_are_for_all_directions_for_polar_angles_or_for_both():
    assert LENGTHS == (0, 1, 9, 45)
    assert (spread((0.3,)) == 0.3).all()
    by_angle = tuple(k / 10 for k in range(len(POLAR)))
    assert (spread(by_angle)[:, 1] == by_angle).all()
    both = tuple(k / 50 for k in range(len(POLAR) * len(AZIMUTHS)))
    assert tuple(spread(both)[0]) == both[: len(AZIMUTHS)]


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"gap": (0.1, 0.2)}, "sides gap has 2 shares; it must have 0, 1, 9 or 45"),
        ({"surface": (1.1,)}, "sides surface holds 1.1; it must be from 0 to 1"),
        ({"forward": (float("nan"),)}, "sides forward holds nan"),
        ({"reflected": (0.7,), "transmitted": (0.4,)}, "together are 1.1 .* at most 1"),
    ],
)
def test_what_is_no_share_is_refused(stated, said):
    with pytest.raises(FabricError, match=said):
        Sides(**stated)
