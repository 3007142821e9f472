"""The receipt that every picture carries: what rendering it again needs."""

from __future__ import annotations

import hashlib
import platform
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from .camera import Camera
from .plan import RenderPlan, Request
from .scene import RenderProduct, Scene

_PACKAGES = ("warprender", "warp-lang", "numpy", "usd-core", "OpenImageIO")


def make_receipt(
    scene: Scene,
    plan: RenderPlan,
    request: Request,
    camera: Camera,
    resolution: tuple[int, int],
    samples: int,
    seed: int,
    device: str,
    camera_path: str = "",
) -> dict:
    """Plain values, ready for JSON. Bits are promised per machine, so the machine is named."""
    values = {
        "stage": scene.source,
        "stageHash": file_hash(scene.source),
        "layerHashes": {path: file_hash(path) for path in scene.layers},
        "loading": scene.loading,
        "product": scene.settings.productName if isinstance(scene.settings, RenderProduct) else None,
        "resolution": list(resolution),
        "samples": samples,
        "seed": seed,
        "request": asdict(request),
        "camera": {**asdict(camera), "transform": camera.transform.tolist()},
        "cameraPath": camera_path,
        "plan": plan.as_dict(),
        "device": device,
        "machine": platform.machine(),
        "versions": versions(),
    }
    return _plain(values)


def _plain(value: object) -> object:
    """Numbers and arrays of NumPy, which users may give for any other, as Python's."""
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def file_hash(source: str) -> str:
    """SHA-256 of a file, "" where there is none, as for a scene that was built in Python."""
    path = Path(source)
    if not source or not path.is_file():
        return ""
    status = path.stat()
    return _file_hash(path, status.st_mtime_ns, status.st_size)


@cache
def _file_hash(path: Path, modified: int, size: int) -> str:
    """Read once for all frames: the time and size stand for the contents."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def versions(*more: str) -> dict[str, str]:
    """Of the packages that pictures depend on, and of `more`; "" for what is not installed."""
    return {name: _version(name) for name in (*_PACKAGES, *more)}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
