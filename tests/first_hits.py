"""First hits by rays and by the rasterizer, and why they differ where they do."""

import numpy as np

import warprender as wr

#: Raster and rays may differ where a centre is this near to an edge, in pixels.
TOLERANCE = 1 / 256
#: Hits whose distances differ by no more than this share of them are equally deep as float32.
EQUALLY_DEEP = 2.0**-22


def first_hits(scene, camera, visibility, size):
    """The renderer, and the (H, W) hits that it finds."""
    renderer = wr.Renderer(scene, camera, size, ("primId",), visibility=visibility)
    return renderer, renderer._first_hits.find().numpy().copy()


def differing(by_rays, by_raster):
    """(H, W) bool: where another face is seen."""
    return (by_rays["instance"] != by_raster["instance"]) | (by_rays["face"] != by_raster["face"])


def edge_distance(renderer, hit, x, y):
    """Pixels from a centre to the nearest edge of the triangle that was hit there; inf where that is no triangle."""
    upload = renderer._live.upload
    geometry = upload.parts[upload.rows["geometry"][hit["instance"]]].record
    if geometry.indices is None or hit["face"] < 0:
        return np.inf
    points = geometry.points.numpy()[geometry.indices.numpy().reshape(-1, 3)[hit["face"]]].astype(float)
    matrix = renderer._first_hits._draws.matrices.numpy()[hit["instance"]]
    clip = np.concatenate([points, np.ones((3, 1))], 1) @ matrix.T
    size = renderer._first_hits._camera.width, renderer._first_hits._camera.height
    # Clip-space lines are straight on the screen, whatever the signs of w.
    distances = []
    for k in range(3):
        line = np.cross(clip[k][[0, 1, 3]], clip[k - 1][[0, 1, 3]]) * (2 / size[0], -2 / size[1], 1)
        line[2] -= line[0] * size[0] / 2 + line[1] * size[1] / 2
        distances.append(abs(line @ (x + 0.5, y + 0.5, 1)) / np.hypot(line[0], line[1]))
    return min(distances)


def reasons(renderer, by_rays, by_raster):
    """Of each pixel that differs "edge", "depth", or None where neither explains it: {(x, y): reason}.

    `renderer` is the one that drew `by_raster`.
    """
    found = {}
    for y, x in np.argwhere(differing(by_rays, by_raster)):
        hits = [h for h in (by_rays[y, x], by_raster[y, x]) if h["instance"] >= 0]
        distances = [float(h["t"]) for h in hits]
        if min(edge_distance(renderer, h, x, y) for h in hits) < TOLERANCE:
            found[int(x), int(y)] = "edge"
        elif len(hits) == 2 and abs(distances[0] - distances[1]) <= EQUALLY_DEEP * max(distances):
            found[int(x), int(y)] = "depth"
        else:
            found[int(x), int(y)] = None
    return found
