"""The free floor of a layer in a recording, without movable things."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from crowdsim.errors import RecordingError
from crowdsim.recording.columns import RecordedFile
from crowdsim.recording.header import LayerRecord, SolidRecord


def free_floor(recording: RecordedFile, layer: str | None, movables: Sequence[SolidRecord]) -> shapely.MultiPolygon:
    """Return the free floor of ``layer`` (None: the ground layer), minus footprints of ``movables`` that stand in it.

    Raises
    ------
    RecordingError
        If there is no such layer, or the file was written before free floors were stored.
    """
    header = recording.header
    if not header.walkable:
        raise RecordingError(
            f"{recording.path} was written before free floors were kept; run the scenario again to the end"
        )
    names = [each.name for each in header.layers]
    if layer is not None and layer not in names:
        raise RecordingError(f"{recording.path} has no layer '{layer}'; there are: {', '.join(names)}")
    number = 0 if layer is None else names.index(layer)
    # The ground layer contains the obstacles of all layers, so movables of all layers count there.
    blocked = header.layers if number == 0 else (header.layers[number],)
    taken = [shapely.from_wkt(solid.footprint) for solid in movables if any(_is_in(solid, each) for each in blocked)]
    free = shapely.from_wkt(header.walkable[number])
    left = shapely.difference(free, shapely.union_all(taken)) if taken else free
    return shapely.MultiPolygon([part for part in shapely.get_parts(left) if part.geom_type == "Polygon"])


def _is_in(solid: SolidRecord, layer: LayerRecord) -> bool:
    """Return whether a solid stands in a layer: whether some of its heights are in the layer's band."""
    # A layer of a single height.
    if layer.low == layer.high:
        return solid.bottom <= layer.low < solid.top
    return solid.bottom < layer.high and solid.top > layer.low
