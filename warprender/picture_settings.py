"""What a stage says of the pictures to make: UsdRenderSettings and their products."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class PictureSettings:
    """What UsdRenderSettings and UsdRenderProduct both say of a picture; names and defaults as in the schema.

    Attributes:
        path: path of the prim, "" where the stage has none.
        resolution: (width, height) in pixels, None where the camera's aspect decides.
        camera: path of the camera, "" for usdrecord's choice.
        pixelAspectRatio: width over height of a pixel.
        aspectRatioConformPolicy: one of `warprender.camera.CONFORM_POLICIES`.
        dataWindowNDC: left, bottom, right, top of what is drawn, as parts of the picture from its lower left
            corner; beyond 0 and 1 more than the picture is drawn (overscan).
        disableMotionBlur: the shutter is taken as open for no time (`instantaneousShutter` too).
        disableDepthOfField: cameras of the stage are taken as pinholes.
    """

    path: str = ""
    resolution: tuple[int, int] | None = None
    camera: str = ""
    pixelAspectRatio: float = 1.0
    aspectRatioConformPolicy: str = "expandAperture"
    dataWindowNDC: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    disableMotionBlur: bool = False
    disableDepthOfField: bool = False


@dataclass
class RenderProduct(PictureSettings):
    """UsdRenderProduct: one file that the render settings ask for; what it leaves open it has from them.

    Attributes:
        productName: the file.
        outputs: outputs that its orderedVars name, as `Renderer` takes them.
    """

    productName: str = ""
    outputs: tuple[str, ...] = ("color",)


@dataclass
class RenderSettings(PictureSettings):
    """UsdRenderSettings.

    Attributes:
        products: in the order of the relationship.
        includedPurposes: purposes to draw, None where none are authored.
        materialBindingPurposes: material purposes in the order of preference, None where none are authored; "" is
            all purposes.
    """

    products: tuple[RenderProduct, ...] = ()
    includedPurposes: tuple[str, ...] | None = None
    materialBindingPurposes: tuple[str, ...] | None = None
