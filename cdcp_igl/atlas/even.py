"""A component opened to disks whose free outlines have an even scale: nets, slits, parts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from ..errors import MeshError
from ..options import Options
from .cones import Draft, seams
from .cut_graph import Component, fill_holes
from .cut_paths import open_to_disk
from .nets import in_a_plane, net
from .parting import crease_between, narrow_side, parted_by, pieces, shortest_between

# A round of slits is kept if it lowers the scale variation by more than this share, and if the cut
# is no longer than this, by the square root of the area: a longer one parts the component.
GAIN = 0.03
LONGEST = 8.0
# A net is cut along edges that are so long at most, by the square root of the area (all edges of
# a cube, 4.9), and is in so many pieces: where the share FLAT of the edges are in a plane, as they
# are in solids that were triangulated, and else, of closed surfaces.
NETS_OF_PLANES, OTHER_NETS = (8.0, 10), (4.0, 1)
FLAT = 0.25
# The scale of a net varies by rounding only.
EXACT = 1e-6
# Holes are cut to rather than filled where that leaves less than this share of the variation.
WORTH_CUTTING = 0.5
# With so many handles a component is parted before it is cut: laying the cut takes most of the time
# then, and its one disk is parted all the same.
MANY_HANDLES = 16
# So many of the pairs of edges that overlap are looked at to part a net.
MOST_PAIRS = 8


def even_drafts(
    component: Component, options: Options, fill: bool | None, wanted: float, most: float
) -> Iterator[Draft]:
    """Open a component to at most so many disks, none of which overlaps itself if that can be.

    Their scale varies no more than is `wanted`, if that can be.
    """
    filled = component if fill is False else fill_holes(component)
    if wanted == np.inf or filled.topology.euler_characteristic == 1:
        plain = Draft(open_to_disk(filled), options)
        if wanted == np.inf or plain.scale_variation < EXACT:
            yield plain
            return
    may_be_net = not (fill and filled.n_filled)  # which cuts to holes
    if may_be_net and (nets := _likely_nets(component, options, most)):
        yield from nets
        return
    waiting, n_done = [component], 0
    while waiting:  # a part has fewer faces than the whole
        component = waiting.pop()
        room = most - len(waiting) - n_done
        has_many = room > 1 and (component.topology.genus or 0) >= MANY_HANDLES
        parts = parted_by(component, narrow_side(component)) if has_many else []
        if not 1 < len(parts) <= room:
            draft = _evened(component, options, fill, wanted)
            parts = _parts(draft, wanted) if room > 1 else []
        if 1 < len(parts) <= room:
            waiting += parts
        else:
            n_done += 1
            yield draft


def _parts(draft: Draft, wanted: float) -> list[Component]:
    """Part a disk that overlaps itself, or whose scale varies more than is wanted."""
    overlaps = len(draft.outline.meeting) > 0
    is_uneven = draft.scale_variation > wanted and not draft.is_small
    parts = halves(draft) if overlaps or is_uneven else []
    return _apart(draft) if overlaps and len(parts) == 1 else parts


def _evened(component: Component, options: Options, fill: bool | None, wanted: float) -> Draft:
    """Open a component to a disk, and cut slits to cones while that evens out the scale."""
    filled = component if fill is False else fill_holes(component)
    draft = Draft(open_to_disk(filled), options)
    if fill is None and filled.n_filled and draft.scale_variation > wanted:
        with suppress(MeshError):  # edges that are forbidden may lie across
            cut = Draft(open_to_disk(component), options)
            if cut.scale_variation < WORTH_CUTTING * draft.scale_variation:
                draft = cut
    while draft.scale_variation > wanted:
        slit = draft.slit(max(wanted, draft.scale_variation / 2))
        if slit.seams > LONGEST or not slit.scale_variation < (1 - GAIN) * draft.scale_variation:
            break
        if draft.is_small and len(slit.outline.meeting):  # more charts than it is worth
            break
        draft = slit
    return draft


def _likely_nets(component: Component, options: Options, most: float) -> list[Draft]:
    """Take the net of a component of planes, or of one that is closed, if it is short."""
    n_edges = len(component.edges)
    is_planes = n_edges > 0 and np.mean(in_a_plane(component)[component.edges]) >= FLAT
    if not (is_planes or component.topology.euler_characteristic == 2):
        return []
    longest, n_pieces = NETS_OF_PLANES if is_planes else OTHER_NETS
    return _nets(component, options, longest, min(most, n_pieces))


def exact_nets(parts: list[Component], options: Options) -> list[Draft]:
    """Take the net of a component in one part that cannot be mapped well otherwise."""
    return _nets(parts[0], options, NETS_OF_PLANES[0], 1) if len(parts) == 1 else []


def _nets(component: Component, options: Options, longest: float, most: float) -> list[Draft]:
    """Cut a component that is flat but for few vertices along a tree through these, if it is.

    Pieces of such a net that overlap are parted, into at most so many.
    """
    opened = component.uncut.cut(net(component))
    if seams(opened) > longest:
        return []
    waiting, drafts = pieces(opened), list[Draft]()
    while waiting:
        draft = Draft(open_to_disk(waiting.pop()), options)
        n_pieces = len(waiting) + len(drafts) + 1
        if not draft.scale_variation < EXACT or n_pieces > most:
            return []
        if len(draft.outline.meeting):
            mesh = draft.surface.mesh
            pairs = mesh.loop_index[draft.outline.meeting]
            parts = pieces(draft.opened.cut(crease_between(draft.opened, mesh.loop, pairs)))
            if len(parts) == 1:  # no crease is between them
                return []
            waiting += parts
        else:
            drafts.append(draft)
    return drafts


def halves(draft: Draft) -> list[Component]:
    """Part a disk where it is narrow: between two places that overlap, or between far ends."""
    parts = pieces(draft.opened)
    if len(parts) > 1:  # without what fills holes
        return parts
    row = np.full(draft.opened.n, -1)  # of vertices that only what fills holes has
    row[draft.opened.F[: len(parts[0].F)]] = parts[0].F
    meeting = row[draft.outline.meeting]
    meeting = meeting[(meeting >= 0).all(axis=1)]
    return parted_by(parts[0], narrow_side(parts[0], meeting[0] if len(meeting) else None))


def _apart(draft: Draft) -> list[Component]:
    """Part a disk along the cheapest seam between two edges of its outline that overlap."""
    mesh = draft.surface.mesh
    pairs = np.sort(mesh.loop_index[draft.outline.meeting[:MOST_PAIRS]], axis=1)
    return pieces(draft.opened.cut(shortest_between(draft.opened, mesh.loop, pairs)))
