"""TEMPORARY until env lands."""

import shapely
from shapely import LineString
from shapely.ops import substring

from crowdsim.environment.solids import Solid


def wall(name, points, thickness, bottom, top, openings=()):
    line = LineString(points)
    body = line.buffer(thickness / 2, cap_style="flat", join_style="mitre")
    cuts = [
        substring(line, max(0, at - w / 2), min(line.length, at + w / 2)).buffer(
            thickness, cap_style="flat", join_style="mitre"
        )
        for at, w, b, t in openings
    ]
    solid = body - shapely.union_all(cuts) if cuts else body
    out = [Solid(f"{name}", part, bottom, top) for part in shapely.get_parts(solid)]
    for cut, (at, w, b, t) in zip(cuts, openings):
        piece = body & cut
        if b > bottom:
            out.append(Solid(name, piece, bottom, b))
        if t < top:
            out.append(Solid(name, piece, t, top))
    return tuple(out)
