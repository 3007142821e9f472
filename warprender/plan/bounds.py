"""How many bounces are worth following, and what they leave out."""

from __future__ import annotations

import math

from ..lights import Light
from .occurring import Occurring
from .request import ONE_SURFACE, Request

#: Share of the emitted light that may be lost to the end of paths when no number of bounces is given.
BOUNCE_TOLERANCE = 1e-4
#: Perfect reflections and refractions that "whitted" follows when it is asked for without a number of bounces.
WHITTED_BOUNCES = 8
#: Paths never reflect more often than this.
MOST_BOUNCES = 256


def unfollowed(albedo: float, bounces: int) -> float:
    """Share of what is emitted that d bounces leave out, at most: ρ^(d+2) / (1 - ρ) with the largest albedo ρ.

    Light that was scattered n times is at most ρ^n of what was emitted. d bounces after the reflection at the
    camera's hit bring what was scattered up to d + 1 times: what is missing is Σ ρ^n over n > d + 1. In a closed box
    of one grey that glows alike everywhere, it is that much.
    """
    return albedo ** (bounces + 2) / (1.0 - albedo) if albedo < 1.0 else math.inf


def bounces_called_for(albedo: float, request: Request) -> int:
    """Bounces of paths: those that are asked for, or the fewest that leave out no more than the tolerance.

    Single terms of color follow no bounce behind the last; -1 bounces are emission alone.
    """
    bounces = request.bounces
    if bounces is None:
        bounces = _fewest(albedo)
    # Term n is what n - 1 bounces bring; for term 0 nothing is scattered.
    last = request.last_term
    return bounces if last is None else min(bounces, last - 1)


def _fewest(albedo: float) -> int:
    if albedo <= 0.0:
        return 0
    if albedo >= 1.0:
        return MOST_BOUNCES
    needed = math.log(BOUNCE_TOLERANCE * (1.0 - albedo)) / math.log(albedo) - 2.0
    return int(min(MOST_BOUNCES, max(0, math.ceil(needed))))


def bounds_of(transport: str, found: Occurring, request: Request, lights: dict[str, Light]) -> dict[str, float | bool]:
    """`RenderPlan.bounds` of a transport; those that reflect only some of the light state no share of it."""
    if transport == "none":
        return {}
    if request.transport in ONE_SURFACE or transport == "local":
        return {"bounces": 0}
    if request.transport == "whitted":
        return {"bounces": WHITTED_BOUNCES if request.bounces is None else request.bounces}
    hit = bool(found.emitting) or not all(light.is_delta() for light in lights.values())
    followed = {"lights can be hit": hit, "shadow rays can pass": bool(found.passing)}
    bounces = bounces_called_for(found.albedo, request)
    return {"albedo": found.albedo, "bounces": bounces, "unfollowed": unfollowed(found.albedo, bounces), **followed}
