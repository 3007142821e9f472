"""The plan: which effects a request on a scene calls for, which prim called for each, and what follows from it.

A kernel is compiled for its key, a frozen value of names; what is not named is not in the generated code. Counts,
sizes and colours are runtime values and never in a key.
"""

from .analysis import analyse
from .bounds import BOUNCE_TOLERANCE, MOST_BOUNCES, WHITTED_BOUNCES
from .choices import PIXEL_COST, RAY_COST, TRIANGLE_COST
from .keys import LIGHT_EFFECTS, OutputsKey, PathKey, covers, everything
from .occurring import distance_functions
from .render_plan import RenderPlan
from .request import (
    LIGHT_BY_LIGHT,
    LIGHT_SAMPLINGS,
    ONE_SURFACE,
    RAY_ACCURACIES,
    SAMPLERS,
    TRANSPORTS,
    VISIBILITIES,
    Request,
    check_outputs,
    check_seed,
)

__all__ = [
    "BOUNCE_TOLERANCE",
    "LIGHT_BY_LIGHT",
    "LIGHT_EFFECTS",
    "LIGHT_SAMPLINGS",
    "MOST_BOUNCES",
    "ONE_SURFACE",
    "PIXEL_COST",
    "RAY_ACCURACIES",
    "RAY_COST",
    "SAMPLERS",
    "TRANSPORTS",
    "TRIANGLE_COST",
    "VISIBILITIES",
    "WHITTED_BOUNCES",
    "OutputsKey",
    "PathKey",
    "RenderPlan",
    "Request",
    "analyse",
    "check_outputs",
    "check_seed",
    "covers",
    "distance_functions",
    "everything",
]
