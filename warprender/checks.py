"""What is bad or numerically hard about a scene, prim by prim, and what it does to a picture.

Sources: the loader's own warnings, and float32's limits for the geometry, transforms, lights and cameras as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .emitters import lit
from .materials import Dielectric
from .placement import Placement, materials_of
from .scene import Scene
from .shapes import Mesh
from .visibility.trees import CLEAN_RANGE

_UNIT_ROUNDOFF = 2.0**-24
#: Digits are worth a remark where points are known to no better than this share of the shape's size.
_COARSE = 1e-4


@dataclass(frozen=True)
class Finding:
    """One line of `warprender check`.

    Attributes:
        path: the prim, "" for the stage.
        what: what was found.
        effect: what it does to a picture.
    """

    path: str
    what: str
    effect: str

    def __str__(self) -> str:
        prim = f"{self.path}: " if self.path else ""
        return f"{prim}{self.what}" + (f"; {self.effect}" if self.effect else "")


def check(scene: Scene) -> list[Finding]:
    """Everything worth knowing before a render, in the order of the scene; an empty list for a sound stage."""
    findings = [Finding("", warning, "") for warning in scene.warnings]
    seen: set[int] = set()
    for path, placement in scene.placements.items():
        if isinstance(placement.shape, Mesh) and id(placement.shape) not in seen:
            seen.add(id(placement.shape))
            findings += _mesh_findings(path, placement.shape)
        findings += _transform_findings(path, placement)
        findings += _glass_findings(scene, path, placement)
    emitting = lit(scene, False)
    for path in scene.lights:
        if path not in emitting:
            findings.append(Finding(path, "the light has no power or no size", "it gives no light"))
    for path, camera in scene.cameras.items():
        if fault := camera.fault():
            findings.append(Finding(path, fault, "no picture can be taken with it"))
    return findings


#: Outputs that `visibility_findings` compares.
COMPARED = ("primId", "instanceId", "elementId", "cameraDepth")


def visibility_findings(
    scene: Scene, by_rays: dict[str, np.ndarray], by_raster: dict[str, np.ndarray]
) -> list[Finding]:
    """The pixels in which rays and the rasterizer see another prim, instance or face first, by prim.

    Args:
        scene: what was drawn.
        by_rays: `COMPARED` outputs (H, W) of one picture.
        by_raster: those of the other.
    """
    differs = np.any([by_rays[name] != by_raster[name] for name in COMPARED[:3]], 0)
    findings = []
    for y, x in np.argwhere(differs):
        rays, raster = ({name: picture[name][y, x] for name in COMPARED} for picture in (by_rays, by_raster))
        nearest = rays if rays["primId"] >= 0 else raster
        path = list(scene.placements)[nearest["primId"]]
        what = f"pixel {x},{y}: rays see {_seen(scene, rays)}, the rasterizer {_seen(scene, raster)}"
        findings.append(Finding(path, what, ""))
    return sorted(findings, key=lambda finding: finding.path)


def _seen(scene: Scene, pixel: dict[str, float]) -> str:
    if pixel["primId"] < 0:
        return "nothing"
    instance = f" instance {pixel['instanceId']}" if pixel["instanceId"] >= 0 else ""
    path = list(scene.placements)[pixel["primId"]]
    return f"{path}{instance} face {pixel['elementId']} at depth {pixel['cameraDepth']:.9g}"


def _mesh_findings(path: str, mesh: Mesh) -> Iterator[Finding]:
    points = mesh.host_points()
    triangles = mesh.triangles
    finite = np.isfinite(points).all(1)
    broken = ~finite[triangles].all(1)
    if broken.any():
        yield Finding(path, f"{broken.sum()} triangles have points that are not finite", "they are not drawn")
    a, b, c = triangles.T
    repeated = (a == b) | (b == c) | (c == a)
    corners = points[triangles[~broken & ~repeated]].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = int(repeated.sum() + (areas == 0).sum())
    if flat:
        yield Finding(path, f"{flat} triangles have no area", "nothing hits them; their neighbours stay closed")
    ordered = np.sort(triangles[~repeated], 1)
    copies = len(ordered) - len(np.unique(ordered, axis=0))
    if copies:
        yield Finding(path, f"{copies} triangles lie on others", "the one with the smaller number is seen")
    used = points[np.unique(triangles)] if len(triangles) else points[:0]
    yield from _range_findings(path, used[np.isfinite(used).all(1)].astype(np.float64))


def _glass_findings(scene: Scene, path: str, placement: Placement) -> Iterator[Finding]:
    """What keeps a mesh from enclosing the glass that its material says it does."""
    looks = [scene.materials[key] for key in materials_of(placement)]
    if not isinstance(placement.shape, Mesh) or not any(isinstance(m, Dielectric) and m.thinWalled == 0 for m in looks):
        return
    points, triangles = placement.shape.host_points(), placement.shape.triangles
    _, same = np.unique(points, axis=0, return_inverse=True)
    corners = same.reshape(-1)[triangles]
    corners = corners[(corners != np.roll(corners, 1, 1)).all(1)]
    edges = np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    # Each edge of a closed, oriented mesh is walked as often one way as the other.
    there, back = (edges[:, [k, 1 - k]] @ (len(points), 1) for k in (0, 1))
    either, counts = np.unique(np.minimum(there, back), return_inverse=True)
    balance = np.bincount(counts, np.where(there < back, 1, -1), len(either))
    if (balance != 0).any():
        what = f"{np.count_nonzero(balance)} edges do not close the mesh of a Dielectric"
        yield Finding(path, what, "light may enter it and not leave: close it, or set thinWalled")
    elif _signed_volume(points[triangles].astype(np.float64)) < 0:
        yield Finding(path, "the faces of a Dielectric look inwards", "it is a bubble in glass without an end")


def _signed_volume(corners: np.ndarray) -> float:
    """Volume within closed triangles (T, 3, 3), negative where they look inwards."""
    a, b, c = (corners - corners.mean((0, 1))).transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def _range_findings(path: str, points: np.ndarray) -> Iterator[Finding]:
    """What float32 does to points (N, 3): their scale, and how far they lie from their object's origin."""
    if not len(points):
        return
    largest, size = np.abs(points).max(), np.ptp(points, 0).max()
    if largest > 0 and not CLEAN_RANGE[0] <= largest <= CLEAN_RANGE[1]:
        yield Finding(path, f"coordinates reach {largest:.0e}", "rays meet a copy that is scaled by a power of two")
    spacing = largest * 2 * _UNIT_ROUNDOFF
    if size > 0 and spacing > _COARSE * size:
        yield Finding(
            path,
            f"points lie {largest:.3g} from the object's origin and {size:.3g} apart at most",
            f"float32 holds them to {spacing:.1e}; a transform on the prim would keep the digits",
        )


def _transform_findings(path: str, placement: Placement) -> Iterator[Finding]:
    transforms = placement.transforms
    finite = np.isfinite(transforms).all((1, 2))
    with np.errstate(all="ignore"):
        scales = np.linalg.norm(transforms[finite, :3, :3], axis=2)
        volume = np.abs(np.linalg.det(transforms[finite, :3, :3]))
    bad = int((~finite).sum() + (volume == 0).sum())
    if bad:
        yield Finding(path, f"{bad} of {len(transforms)} transforms are singular or not finite", "not drawn")
    outside = (scales.max(1, initial=0) > CLEAN_RANGE[1]) | ((scales.max(1, initial=0) < CLEAN_RANGE[0]) & (volume > 0))
    if outside.any():
        yield Finding(path, f"{outside.sum()} transforms scale by less than 1e-9 or more than 1e9", "digits are lost")
