"""UsdRenderPass: which settings a pass renders with, and which prims it leaves out."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Sdf, Usd, UsdRender

from ..scene import SceneError
from .light_apis import restricts
from .reading import Reading


@dataclass
class RenderPass:
    """A pass, as far as it decides what is drawn.

    Attributes:
        settings: path of the RenderSettings prim that it renders.
        pruned: members are not there at all, nor is what is below them; None prunes nothing.
        visible: only members are drawn or shine; None for all.
    """

    settings: str
    pruned: Usd.UsdCollectionMembershipQuery | None = None
    visible: Usd.UsdCollectionMembershipQuery | None = None

    def prunes(self, prim: Usd.Prim) -> bool:
        """Whether the prim and all below it are left out."""
        return self.pruned is not None and self.pruned.IsPathIncluded(prim.GetPath())

    def hides(self, prim: Usd.Prim) -> bool:
        """Whether the prim itself is not drawn."""
        return self.visible is not None and not self.visible.IsPathIncluded(prim.GetPath())


def read_pass(reading: Reading, path: str) -> RenderPass:
    """The pass at `path`.

    Raises:
        SceneError: there is no such pass, or it has no renderSource.
    """
    prim = reading.stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if not prim or not prim.IsA(UsdRender.Pass):
        raise SceneError(f"render pass {path}: there is no such RenderPass prim")
    schema = UsdRender.Pass(prim)
    sources = schema.GetRenderSourceRel().GetForwardedTargets()
    if not sources:
        raise SceneError(f"render pass {path}: its renderSource names no RenderSettings prim")
    if len(sources) > 1:
        reading.remark(prim, f"renderSource has {len(sources)} targets; {sources[0]} is taken")
    if schema.GetInputPassesRel().GetForwardedTargets() or reading.get(schema.GetCommandAttr()):
        reading.remark(prim, "its inputPasses and command are not run; its own source is drawn")
    found = RenderPass(str(sources[0]))
    prune, visible = (Usd.CollectionAPI(prim, name) for name in ("prune", "renderVisibility"))
    if not prune.HasNoIncludedPaths():
        found.pruned = prune.ComputeMembershipQuery()
    if restricts(visible):
        found.visible = visible.ComputeMembershipQuery()
    if restricts(Usd.CollectionAPI(prim, "cameraVisibility")):
        reading.remark(prim, "cameraVisibility is ignored: what is drawn, the camera sees")
    if not Usd.CollectionAPI(prim, "matte").HasNoIncludedPaths():
        reading.remark(prim, "matte is ignored: its members are drawn as they are")
    return found
