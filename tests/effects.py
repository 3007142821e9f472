"""A base scene, and one effect more at a time: for the tests of what a plan names and the table of what it costs."""

from collections.abc import Callable

import numpy as np
import scenes
import warp as wp
from brdf_tables import lobes

import warprender as wr
from warprender.lights import IesProfile, LightTexture, PortalLight
from warprender.lights.shadow import Shadow
from warprender.lights.shaping import Shaping

NOISE = np.random.default_rng(0).random((64, 64, 4)).astype(np.float32)
ABOVE = scenes.look_at((1, 2, 1))
BALL = (1.2, 0.0, 0.0, 0, 0, 0, 1)


@wp.func
def ball(p: wp.vec3) -> float:
    """Distance to a ball."""
    return wp.length(p) - 0.5


def base() -> wr.Scene:
    """A cube on a ground under a rectangular lamp."""
    scene = wr.Scene()
    scene.add_mesh("/box", *scenes.cube(1.0), color=(0.7, 0.5, 0.3))
    ground = np.array([(-3, -0.5, 3), (3, -0.5, 3), (3, -0.5, -3), (-3, -0.5, -3)])
    scene.add_mesh("/ground", ground, [[0, 1, 2, 3]], color=(0.6,) * 3)
    scene.add_light(wr.RectLight(intensity=5.0), "/lamp", pose=ABOVE)
    scene.add_camera("/camera", scenes.camera((2, 2, 4)))
    scene.settings.camera = "/camera"
    return scene


def sheet(**inputs: object) -> Callable[[wr.Scene], None]:
    """A sheet beside the cube of UsdPreviewSurface with these inputs."""

    def add(scene: wr.Scene) -> None:
        points, faces = scenes.quad(1.0)
        material = wr.PreviewSurface(**inputs)
        scene.add_mesh("/sheet", points + (1.2, 0, 0), faces, material=material, st=points[:, :2])

    return add


def sphere_of(material: object) -> Callable[[wr.Scene], None]:
    """A sphere beside the cube."""
    return lambda scene: scene.add_sphere("/ball", 0.5, material=material, pose=BALL)


def mesh_of(material: object) -> Callable[[wr.Scene], None]:
    """A ball of triangles beside the cube."""
    return lambda scene: scene.add_mesh(
        "/ball", *scenes.icosphere(3), material=material, pose=np.diag([0.5, 0.5, 0.5, 1])
    )


def light(make: Callable[[], object]) -> Callable[[wr.Scene], None]:
    """A second light."""
    return lambda scene: scene.add_light(make(), "/second", pose=scenes.look_at((-2, 2, 1)))


def lamp_with(**fields: object) -> Callable[[wr.Scene], None]:
    """The lamp changed."""

    def change(scene: wr.Scene) -> None:
        for name, value in fields.items():
            setattr(scene.lights["/lamp"], name, value)

    return change


def camera_with(**fields: object) -> Callable[[wr.Scene], None]:
    """The camera changed."""

    def change(scene: wr.Scene) -> None:
        for name, value in fields.items():
            setattr(scene.cameras["/camera"], name, value)

    return change


def shaken(scene: wr.Scene) -> None:
    """The cube moves while the shutter is open."""
    scene.motion = lambda time: scene.set_poses("/box", np.array([(0.2 * time, 0, 0, 0, 0, 0, 1)]))
    camera_with(shutterOpen=0.0, shutterClose=1.0)(scene)


PROFILE = IesProfile.parse("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 1 0 0 0 1 1 1\n0 45 90\n0\n9 4 0\n")
MAPPED = {"normal": wr.Texture(NOISE, scale=(1, 1, 1, 1), bias=(-0.5, -0.5, 0.5, 0))}
COLORS = {"diffuseColor": wr.PrimvarReader("st", fallback=(0.2, 0.4, 0.6))}

#: Effect to what adds it to the base scene, and arguments of `Renderer`.
EFFECTS: dict[str, tuple[Callable[[wr.Scene], None], dict]] = {
    "base": (lambda scene: None, {}),
    "UsdPreviewSurface": (sheet(), {}),
    "clearcoat": (sheet(clearcoat=1.0, clearcoatRoughness=0.2), {}),
    "mirror": (sheet(metallic=1.0, roughness=0.0), {}),
    "texture": (sheet(diffuseColor=wr.Texture(NOISE)), {}),
    "primvar": (sheet(**COLORS), {}),
    "normal map": (sheet(**MAPPED), {}),
    "cut-out": (sheet(opacity=wr.Texture(NOISE, "a"), opacityThreshold=0.5), {}),
    "opacity 0.5": (sheet(opacity=0.5), {}),
    "energy compensation": (sheet(roughness=0.8), {"energy_compensation": True}),
    "transmission": (mesh_of(wr.Dielectric()), {}),
    "rough transmission": (mesh_of(wr.Dielectric(roughness=0.5)), {}),
    "Phong": (mesh_of(wr.Phong(specularColor=(0.5,) * 3)), {}),
    "measured BRDF": (mesh_of(wr.MeasuredBRDF(lobes())), {}),
    "sphere": (sphere_of(None), {}),
    "signed distance function": (lambda scene: scene.add_sdf("/ball", ball, [(-0.6,) * 3, (0.6,) * 3], pose=BALL), {}),
    "sphere light": (light(lambda: wr.SphereLight(radius=0.3, intensity=5.0)), {}),
    "disk light": (light(lambda: wr.DiskLight(radius=0.3, intensity=5.0)), {}),
    "cylinder light": (light(lambda: wr.CylinderLight(radius=0.2, length=0.5, intensity=5.0)), {}),
    "distant light": (light(lambda: wr.DistantLight(intensity=1.0, angle=1.0)), {}),
    "dome": (light(lambda: wr.DomeLight(intensity=0.5)), {}),
    "dome with a picture": (light(lambda: wr.DomeLight(texture=LightTexture.of(NOISE[..., :3]))), {}),
    "dome with a portal": (light(lambda: wr.DomeLight(portals=(PortalLight(transform=ABOVE),))), {}),
    "lamp with a picture": (lamp_with(texture=LightTexture.of(NOISE[..., :3])), {}),
    "glowing mesh": (mesh_of(wr.PreviewSurface(emissiveColor=(2, 2, 2))), {}),
    "glowing sphere": (sphere_of(wr.PreviewSurface(emissiveColor=(2, 2, 2))), {}),
    "shaping": (lamp_with(shaping=Shaping(coneAngle=40.0, coneSoftness=0.5)), {}),
    "photometric profile": (lamp_with(shaping=Shaping(iesProfile=PROFILE)), {}),
    "changed shadows": (lamp_with(shadow=Shadow(color=(0.2, 0.1, 0.3))), {}),
    "light linking": (lamp_with(unlit=frozenset(["/box"])), {}),
    "depth of field": (camera_with(fStop=4.0, focusDistance=4.5), {}),
    "clipping planes": (camera_with(clippingPlanes=((0.0, 0.0, -1.0, -1.0),)), {}),
    "motion blur": (shaken, {}),
    "outputs normal and cameraDepth": (lambda scene: None, {"outputs": ("color", "normal", "cameraDepth")}),
    "outputs color:0 and color:1": (lambda scene: None, {"outputs": ("color", "color:0", "color:1")}),
}
