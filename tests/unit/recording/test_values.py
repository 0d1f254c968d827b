"""A dataset that cannot be read is named."""

import h5py
import pytest

from crowdsim.errors import RecordingError
from crowdsim.recording.storage.values import values_of


def test_texts_that_are_not_utf_8_are_named(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        group = file.create_group("agents")
        group.create_dataset("groups", data=[b"\xff\xfe"], dtype=h5py.string_dtype("utf-8"))
        with pytest.raises(RecordingError, match="agents/groups: 'utf-8' codec can't decode"):
            values_of(group, "groups")
