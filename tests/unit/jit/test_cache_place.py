"""Where caches are kept, whatever the environment says of the user."""

import os
from pathlib import Path

import pytest

from crowdsim.cache_place import cache_base, temporary_base


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"CROWDSIM_CACHE": "/some/where"}, Path("/some/where")),
        ({"XDG_CACHE_HOME": "/caches", "HOME": "/home/me"}, Path("/caches/crowdsim")),
        ({"XDG_CACHE_HOME": "", "HOME": "/home/me"}, Path("/home/me/.cache/crowdsim")),
        ({"XDG_CACHE_HOME": "caches", "HOME": "/home/me"}, Path("/home/me/.cache/crowdsim")),
    ],
)
def test_relative_and_empty_places_do_not_count(monkeypatch, settings, expected):
    for name in ("CROWDSIM_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    assert cache_base() == expected


def test_a_user_whom_the_system_does_not_know_has_a_temporary_folder(monkeypatch):
    for name in ("CROWDSIM_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 4_000_111)
    assert cache_base() == temporary_base()
    assert temporary_base().is_absolute()
