"""Cached kernels live exactly as long as the sources they were made from."""

from __future__ import annotations

import os

from fabricusd.kernel_cache import forget_stale_kernels


def package(tmp_path):
    cache = tmp_path / "appearance" / "__pycache__"
    cache.mkdir(parents=True)
    (tmp_path / "appearance" / "lobes.py").write_text("x = 1")
    (cache / "thread.kernel.nbi").write_text("")
    (cache / "thread.kernel.1.nbc").write_text("")
    return cache


def test_kernels_of_unknown_age_are_thrown_away_and_later_ones_kept(tmp_path):
    cache = package(tmp_path)
    assert forget_stale_kernels(tmp_path)
    assert list(cache.iterdir()) == []
    (cache / "thread.kernel.nbi").write_text("")
    assert not forget_stale_kernels(tmp_path)
    assert len(list(cache.iterdir())) == 1


def test_a_change_in_any_source_throws_every_kernel_away(tmp_path):
    cache = package(tmp_path)
    forget_stale_kernels(tmp_path)
    (cache / "thread.kernel.nbi").write_text("")
    source = tmp_path / "appearance" / "lobes.py"
    os.utime(source, (1, 1))
    assert forget_stale_kernels(tmp_path)
    assert list(cache.iterdir()) == []
