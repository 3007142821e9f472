"""`Renderer`: a scene, a camera and a request, kept ready on a device and rendered as often as needed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import warp as wp

from .adaptive import PILOT, Allocation
from .attaching import posed_transforms
from .camera import Camera
from .denoise import GUIDES, MISSING, available, denoised
from .films import Films
from .filters import filter_table, pixel_offset
from .frame import Frame, Stats
from .framing import camera_at, choose_camera, choose_camera_path, choose_data_window, choose_resolution
from .integrators import RADIANCE
from .integrators.none import launch_outputs
from .integrators.samples import PathRequest, launch_samples, samples_kernel
from .launch import thread_count
from .live import LiveScene
from .outputs import FILM_OUTPUTS, OutputBuffers, cleared_outputs, term_of, terms_of
from .plan import LIGHT_BY_LIGHT, OutputsKey, PathKey, RenderPlan, Request, analyse
from .receipt import make_receipt
from .scene import Scene, SceneError, pose_matrix
from .shutter import shutter_share
from .texels import TEXTURE_BYTES
from .visibility.first_hits import RasterHits, RayHits

#: Samples a pixel when neither samples, error nor seconds is asked for.
DEFAULT_SAMPLES = 64
#: The frame's error is trusted from this many samples a pixel on.
FEWEST_FOR_ERROR = 16
SAMPLERS = ("sobol", "independent")
#: In the order of `DeviceScene.light_sampling`.
LIGHT_SAMPLINGS = ("tree", "power", "none")
#: A pass is short enough to report progress and to stop in time.
_PASS_SECONDS = 0.25
#: Samples between two looks at the error: it falls by 5 % at most meanwhile, and looking takes time too.
_CHECK_FACTOR = 1.1
#: Share of the time limit that is not worth another launch.
_SPARE_SHARE = 0.005

Progress = Callable[[float, Callable[[], Frame]], None]


class Renderer:
    """Renders one scene from one camera.

    The scene is uploaded here. What changes in it later is seen from the next `update` on.

    Args:
        scene: what to draw.
        camera: a `Camera`, a camera's prim path or name, or None for usdrecord's choice: the render settings'
            camera, else one named main_cam, else one that frames everything.
        resolution: (width, height) in pixels; None takes the render settings', or 960 by the camera's aspect.
        outputs: a name, or several: "color", its single terms "color:0", "color:1", …, the AOVs of
            `warprender.outputs.OUTPUTS`, and for study "sampleCount", "standardError" and "rayCount".
        visibility: how first surfaces are found: "rays", "raster" (exact edges and a depth buffer), "painter"
            (triangles back to front, as it was done before depth buffers), or "auto": what should take less time.
            Colour that the rasterizer cannot see (depth of field, paths through what is clear) is made of rays.
        transport: how light gets to the camera. "none": no color, AOVs alone. "local": the first surface's reflection
            of each light, with nothing in the way. "direct": the same with shadows. "whitted": perfect reflection
            and refraction as well. "path": all light, by path tracing. "auto": "none", "local" or "path", the first
            that leaves out nothing.
        device: Warp device, as "cpu" or "cuda:0".
        threads: CPU threads, None for all cores. The picture does not depend on it.
        bounces: reflections followed after the one at the camera's hit, None for as many as matter; 0 is
            emission and direct light.
        camera_light: "auto" adds a light at the camera when the scene has no light; "on", "off".
        dome_light_visible: whether the camera sees the domes; where it sees nothing, alpha is 0.
        lights_visible: whether the camera sees all lights, domes among them.
        filter: reconstruction filter: "box" (one pixel wide), "triangle" (2) or "gaussian" (3).
        sampler: "sobol" (scrambled points, well spread over a pixel's samples) or "independent" numbers.
        energy_compensation: give back what reflecting lobes lose between their facets; UsdPreviewSurface does not.
            Rough glass (`Dielectric`) loses it still.
        texture_bytes: most memory for pictures, 2 GiB unless asked otherwise; beyond it the largest are halved, with
            a warning. `frame.stats["texture bytes"]` is what they take.
        denoise: let Open Image Denoise go over color, guided by albedo and normal. Needs the package pyoidn. The
            picture is biased then, and the stated error is that of the picture before.
        light_sampling: how paths aim at one of many lights: "tree" (by what may arrive), "power" (wherever they are),
            or "none": paths meet lights by chance, and only those that nothing can meet are aimed at. The same
            picture but for its noise: a figure for studies.
        filter_textures: average texture look-ups over a quarter of the pixel's width; without it they take the
            finest level at one point, and aliasing is left to the samples.
        adaptive: give more samples to pixels among noisy ones, fewer to those among quiet ones; see `adaptive`.

    Attributes:
        plan: the `RenderPlan`: which effects occur, and which prim called for each.
        camera: the `Camera` that was chosen, where `update` has last seen it.
        data_window: which pixels of the picture are drawn: all, or those of the render settings' dataWindowNDC.
        resolution: (width, height) of the data window in pixels.

    Raises:
        SceneError: the request cannot be met; the message names the prim or the argument.
        ValueError: there is no such device, filter or number of threads.
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera | str | None = None,
        resolution: tuple[int, int] | None = None,
        outputs: str | Sequence[str] = ("color",),
        visibility: str = "auto",
        transport: str = "auto",
        device: str = "cpu",
        threads: int | None = None,
        bounces: int | None = None,
        camera_light: str = "auto",
        dome_light_visible: bool = False,
        lights_visible: bool = False,
        filter: str = "box",
        sampler: str = "sobol",
        energy_compensation: bool = False,
        texture_bytes: int = TEXTURE_BYTES,
        denoise: bool = False,
        light_sampling: str = "tree",
        filter_textures: bool = True,
        adaptive: bool = False,
    ) -> None:
        """Plan, compile and upload."""
        start = time.perf_counter()
        self.scene, self.device, self.threads = scene, device, thread_count(threads)
        self._choose(camera)
        self._see_camera()
        full = resolution or choose_resolution(scene, self.camera)
        if min(full) < 1:
            raise SceneError(f"resolution {full[0]}x{full[1]} has no pixels")
        self.data_window = choose_data_window(scene, full)
        self.resolution = (self.data_window.width, self.data_window.height)
        outputs = (outputs,) if isinstance(outputs, str) else tuple(outputs)
        self.request = Request(
            outputs,
            visibility,
            transport,
            bounces,
            dome_light_visible,
            lights_visible,
            energy_compensation,
            camera_light,
            filter,
            sampler,
            texture_bytes,
            denoise,
            light_sampling,
            filter_textures,
            adaptive,
        )
        if denoise and not available():
            raise SceneError(MISSING)
        if sampler not in SAMPLERS:
            raise SceneError(f"sampler {sampler!r} is not one of {', '.join(SAMPLERS)}")
        if light_sampling not in LIGHT_SAMPLINGS:
            raise SceneError(f"light sampling {light_sampling!r} is not one of {', '.join(LIGHT_SAMPLINGS)}")
        self._with_camera_light = use_camera_light(scene, camera_light)
        self.plan: RenderPlan = self._analyse()
        self._live = LiveScene(
            scene, device, self.camera.transform, self._with_camera_light, self.plan.sdfs, texture_bytes
        )
        if not (scene.placements or dome_light_visible or lights_visible):
            scene.warn(f"{scene.source or 'the scene'}: there is nothing to draw")
        self._sobol = sampler == "sobol"
        self._finders: dict[str, tuple[tuple, RayHits | RasterHits]] = {}
        self._look()
        self._films = Films(*self.resolution, device, filter, terms_of(outputs))
        self._filter_table = filter_table(filter)
        self._seconds = {"prepare": time.perf_counter() - start}

    def render(
        self,
        samples: float | None = None,
        error: float | None = None,
        seconds: float | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Frame:
        """Render a frame; it stops at whichever of the three limits comes first.

        The first call compiles the kernels that the plan names, unless Warp's kernel cache has them.

        Args:
            samples: a pixel; 64 when no limit is given. What is beyond a whole number is the share of the pixels, from
                the top, that get one more.
            error: relative RMS standard error of the frame over lit pixels (mean above 1e-3), as 0.01: what
                `stats["error"]` states.
            seconds: wall-clock time for colour samples after compiling; at least one sample is taken. The last one may
                reach a part of the pixels alone, from the top: then `stats["samples"]` is no whole number.
            seed: another seed gives an independent picture; the same one gives the same bits on one machine.
            progress: called between passes with the share done, 0 to 1, and a function that returns the frame
                so far.

        Returns:
            The frame, with arrays of its own: a later call does not overwrite them. After Ctrl-C, what was
            finished, and `stats["interrupted"]` is True.

        Raises:
            SceneError: a limit is not above 0.
        """
        _check_limits(samples, error, seconds)
        start = time.perf_counter()
        values = self._render_outputs()
        self._seconds["outputs"] = time.perf_counter() - start
        taken, interrupted = 0, False
        if self.plan.path is not None:
            start = time.perf_counter()
            taken, interrupted = self._sample(samples, error, seconds, seed, progress, values)
            self._seconds["sample"] = time.perf_counter() - start
        return self._frame(values, taken, seed, interrupted)

    def update(self) -> None:
        """Follow what has changed in the scene since it was last looked at.

        Call it after writing into the points of meshes, `Scene.set_poses`, or other changes, and before `render`. Until
        then pictures show points as they were written with trees as they were built: what was moved may be cut off
        or missing, but nothing is read that is not there.

        Trees are refitted, and rebuilt once rays are expected to take twice the steps through them. Meshes whose
        points nobody was given are left alone. Nothing is compiled for what the plan names already.

        Raises:
            SceneError: the points of a mesh were replaced by another array, or the camera can take no picture.
        """
        start = time.perf_counter()
        self._follow()
        self._seconds["update"] = time.perf_counter() - start

    def set_camera(self, camera: Camera | str | np.ndarray | Sequence) -> None:
        """Look through another camera, or from another place; seen from the next picture on.

        Args:
            camera: a `Camera`, the path or name of one in the scene, or a camera-to-world transform: a (4, 4) matrix
                for row vectors, or position and quaternion xyzw.

        Raises:
            SceneError: there is no such camera, or it can take no picture.
        """
        if isinstance(camera, (str, Camera)):
            self._choose(camera)
        else:
            self._choose(replace(self.camera, transform=pose_matrix(camera, "camera")))
        self.update()

    def standard_error(self) -> np.ndarray:
        """(H, W, 3) float64 standard error of the last frame's colour; inf where a pixel has under two samples."""
        return self._films.last.standard_error() * self.camera.exposureScale

    def _analyse(self) -> RenderPlan:
        pixels = self.resolution[0] * self.resolution[1]
        return analyse(self.scene, self.camera, self.request, self._with_camera_light, pixels)

    def _follow(self) -> None:
        """See what has changed: camera, scene, and the plan where effects may have come or gone."""
        seen = self.camera.effects(), self.camera.shutterOpen, self.camera.shutterClose
        self._see_camera()
        now = self.camera.effects(), self.camera.shutterOpen, self.camera.shutterClose
        if self._live.look_again() or seen != now:
            self.plan = self._analyse().kept_from(self.plan, self.camera)
        self._live.update(self.camera.transform, self.plan.sdfs)
        self._look()

    def _go_to(self, time: float) -> None:
        """Bring the scene to a time in frames from its own."""
        self.scene.motion(time)
        self._follow()

    def _choose(self, camera: Camera | str | None) -> None:
        """Take a camera, or remember the path of one in the scene, which poses may move."""
        if isinstance(camera, Camera):
            self._camera_chosen = camera
            path = next((path for path, other in self.scene.cameras.items() if other is camera), "")
        else:
            path = choose_camera_path(self.scene, camera)
            self._camera_chosen = None if path else choose_camera(self.scene, camera)
        self._camera_path = path

    def _see_camera(self) -> None:
        """The camera, where poses have put it.

        Raises:
            SceneError: it can take no picture, or is gone.
        """
        path, camera = self._camera_path, self._camera_chosen
        if camera is None:
            if path not in self.scene.cameras:
                raise SceneError(f"{path}: the camera is no longer in the scene")
            camera = camera_at(self.scene, path)
        elif path:
            camera = self.scene.cameras.get(path, camera)
        moved = posed_transforms(self.scene, {path: camera.transform}) if path else {}
        if moved:
            camera = replace(camera, transform=moved[path])
        if fault := camera.fault():
            raise SceneError(f"{path or 'camera'}: {fault}")
        self.camera = camera

    def _look(self) -> None:
        """Prepare for the camera, the instances and the plan as they are."""
        upload, settings = self._live.upload, self.scene.settings
        self._camera_record = self.camera.record(
            *self.data_window.full,
            upload.origin,
            settings.pixelAspectRatio,
            settings.aspectRatioConformPolicy,
            self.device,
            self.data_window,
        )
        upload.record.eye = self._camera_record.position
        upload.record.energy_compensation = int(self.request.energy_compensation)
        upload.record.local_reflection = int(self.plan.transport in LIGHT_BY_LIGHT)
        upload.record.light_sampling = LIGHT_SAMPLINGS.index(self.request.light_sampling)
        plan = self.plan
        self._first_hits = self._color_hits = None
        if plan.outputs is not None:
            self._first_hits = self._finder("outputs", plan.visibility, plan.outputs)
        if plan.path is not None and plan.color_visibility != "rays":
            self._color_hits = self._finder("color", plan.color_visibility, plan.path)

    def _finder(self, use: str, visibility: str, key: PathKey | OutputsKey) -> RayHits | RasterHits:
        """What finds first hits for one use of them, as they are now; the one before, where it can follow."""
        kind = self._live.upload, visibility, key.camera, key.sdfs
        known = self._finders.get(use)
        if known is not None and known[0] == kind:
            known[1].follow(self._live.record, self._camera_record)
            return known[1]
        self._finders[use] = kind, self._see(visibility, key)
        return self._finders[use][1]

    def _see(self, visibility: str, key: PathKey | OutputsKey) -> RayHits | RasterHits:
        """What finds first hits for a kernel by "rays", "raster" or "painter"."""
        upload, camera = self._live.upload, self._camera_record
        if visibility == "rays":
            return RayHits(upload.record, camera, key.camera, self.device, key.sdfs)
        painter, boxes = visibility == "painter", upload.world.boxes
        instances, rayed = upload.rows["geometry"], upload.boxes_for_rays()
        triangles = [part.record for part in upload.parts]
        return RasterHits(
            upload.record, triangles, instances, rayed, boxes, camera, key.camera, self.device, painter, key.sdfs
        )

    def _render_outputs(self) -> dict[str, wp.array]:
        if self.plan.outputs is None:
            return {}
        buffers, values = OutputBuffers(), cleared_outputs(self.plan.outputs.outputs, *self.resolution, self.device)
        for name, array in values.items():
            setattr(buffers, name, array)
        hits = self._first_hits.find(self.threads)
        scene, camera = self._live.record, self._camera_record
        launch_outputs(self.plan.outputs, scene, camera, hits, buffers, self.device, self.threads)
        return values

    def _sample(
        self,
        samples: int | None,
        error: float | None,
        seconds: float | None,
        seed: int,
        progress: Progress | None,
        values: dict[str, wp.array],
    ) -> tuple[float, bool]:
        """Add passes of samples until a limit is reached; returns samples taken and whether it was cut short."""
        self._films.turn()
        request, shutter = self._path_request(seed), self.plan.shutter
        limit = samples if samples is not None else (DEFAULT_SAMPLES if error is None and seconds is None else 2**30)
        pixels = self.resolution[0] * self.resolution[1]
        if seconds is not None:
            # Compiling and loading come before the clock starts.
            self._pass(request, 0, 0)
        take = self._pass if shutter is None else partial(self._blurred_pass, shutter)
        # All pixels see one time together: none gets samples of its own number then.
        adaptive = self.request.adaptive and shutter is None
        if adaptive != self.request.adaptive:
            self.scene.warn(
                "adaptive: every pixel gets the same samples, because things move while the shutter is open"
            )
        taken, batch, start, next_check = 0, 1, time.perf_counter(), FEWEST_FOR_ERROR
        allocation = None
        try:
            while taken < limit:
                begin = time.perf_counter()
                # Below 1: one more sample for a part of the pixels.
                batch = min(batch, limit - taken)
                if adaptive and taken == PILOT:
                    allocation = Allocation(self._films.last)
                if allocation is not None:
                    self._adaptive_pass(request, allocation, taken, batch)
                else:
                    batch = min(batch, PILOT - taken) if adaptive else batch
                    batch = int(batch) if batch >= 1 else batch
                    take(request, int(taken), max(int(batch), 1), round(pixels * min(batch, 1)))
                taken += batch
                now = time.perf_counter()
                elapsed, per_sample = now - start, (now - begin) / batch
                left = math.inf if seconds is None else seconds - elapsed
                if batch < 1 or left <= _SPARE_SHARE * elapsed:
                    break
                if error is not None and taken >= next_check:
                    if self._films.last.relative_error().error <= error:
                        break
                    next_check = math.ceil(_CHECK_FACTOR * taken)
                batch = max(1, min(2 * batch, int(min(_PASS_SECONDS, left) / per_sample)))
                if left < per_sample:
                    batch = max(1, round(pixels * left / per_sample)) / pixels
                if progress is not None:
                    share = max(taken / limit, elapsed / seconds if seconds else 0.0)
                    progress(share, lambda n=taken: self._frame(values, n, seed, True, settled=True))
        except KeyboardInterrupt:
            return taken, True
        finally:
            if shutter is not None:
                self._go_to(0.0)
        return taken, False

    def _path_request(self, seed: int) -> PathRequest:
        request = PathRequest()
        request.seed = seed & 0xFFFFFFFF
        request.sobol = int(self._sobol)
        request.bounces = int(self.plan.bounds["bounces"])
        request.unfiltered = int(not self.request.filter_textures)
        request.terms = self._films.last.terms
        request.visible.lights = int(self.request.lights_visible)
        request.visible.domes = int(self.request.dome_light_visible or self.request.lights_visible)
        return request

    def _pass(self, request: PathRequest, first_sample: int, samples: int, pixels: int | None = None) -> None:
        """Add samples to the first `pixels`, None for all."""
        if self._color_hits is None:
            self._launch(request, first_sample, samples, pixels)
            return
        # Even without samples once: that compiles.
        for sample in range(first_sample, first_sample + max(samples, 1)):
            offset = pixel_offset(self._filter_table, request.seed, sample)
            request.hits, request.offset = self._color_hits.find(self.threads, offset), wp.vec2(*offset)
            self._launch(request, sample, min(samples, 1), pixels)

    def _adaptive_pass(self, request: PathRequest, allocation: Allocation, taken: float, more: float) -> None:
        """Add `more` samples a pixel on average, where the allocation wants them."""
        counts = allocation.samples(taken + more) - allocation.samples(taken)
        request.counts, request.adaptive = wp.array(counts, dtype=wp.int32, device=self.device), 1
        self._launch(request, 0, 0, None)

    def _blurred_pass(
        self, shutter: tuple[float, float], request: PathRequest, first_sample: int, samples: int, pixels: int
    ) -> None:
        """As `_pass`, each sample of all pixels at a time of its own while the shutter is open."""
        opens, closes = shutter
        for sample in range(first_sample, first_sample + samples):
            self._go_to(opens + (closes - opens) * shutter_share(request.seed, sample))
            request.bounces = int(self.plan.bounds["bounces"])
            self._pass(request, sample, 1, pixels)

    def _launch(self, request: PathRequest, first_sample: int, samples: int, pixels: int | None) -> None:
        request.first_sample, request.samples = first_sample, samples
        scene, camera, film, key = self._live.record, self._camera_record, self._films.last.record, self.plan.path
        radiance, rasterized = RADIANCE[self.plan.transport](key), self._color_hits is not None
        kernel = samples_kernel(key.camera, key.sdfs, radiance, rasterized, key.terms)
        launch_samples(kernel, scene, camera, request, film, self.device, self.threads, pixels)
        wp.synchronize_device(self.device)

    def _denoised(self, outputs: dict[str, wp.array]) -> wp.array:
        start = time.perf_counter()
        color = denoised(*(outputs[name].numpy() for name in ("color", *GUIDES)))
        self._seconds["denoise"] = time.perf_counter() - start
        return wp.array(color, dtype=wp.vec4, device=self.device)

    def _frame(
        self, values: dict[str, wp.array], samples: int, seed: int, interrupted: bool, settled: bool = False
    ) -> Frame:
        """The frame as it is now. Its statistics are left to who asks, unless they are to be `settled` at once."""
        outputs, plan, camera = dict(values), self.plan, replace(self.camera)
        stats = Stats(seconds=dict(self._seconds), samples=samples, interrupted=interrupted)
        if plan.path is not None:
            film, exposure = self._films.last, camera.exposureScale
            outputs["color"] = film.color(exposure, self.threads)
            if self.request.denoise:
                outputs["color"] = self._denoised(outputs)
                stats["denoised"], stats["seconds"] = True, dict(self._seconds)
            outputs |= {n: film.output(n, exposure) for n in self.request.outputs if n in FILM_OUTPUTS}
            terms = {n: number for n in self.request.outputs if (number := term_of(n)) is not None}
            outputs |= {n: film.term(number, exposure) for n, number in terms.items()}
            stats.update(film.facts())
            self._films.describe(stats)
        stats["texture bytes"] = self._live.upload.texture_bytes
        stats["plan"] = plan.as_dict
        stats["warnings"] = list(self.scene.warnings)
        ordered = {name: outputs[name] for name in self.request.outputs if name in outputs}
        shot = samples, seed, self.device, self._camera_path
        facts = self.scene, plan, self.request, camera, self.data_window.full, *shot
        settled_stats = stats.settle() if settled else stats
        return Frame(ordered, settled_stats, partial(make_receipt, *facts), self.data_window)


def render(scene: Scene, resolution: tuple[int, int] | None = None, samples: int | None = None, **options) -> Frame:
    """Render one frame: `Renderer(scene, resolution=resolution, …).render(samples=samples, …)`.

    Args:
        scene: what to draw.
        resolution: (width, height) in pixels; None takes the render settings', or 960 by the camera's aspect.
        samples: a pixel; 64 when neither `samples`, `error` nor `seconds` is given.
        **options: any other argument of `Renderer` or of `Renderer.render`.

    Returns:
        The `Frame`: `frame.color` and so on are `wp.array`s, `frame.save(path)` writes a file.

    Raises:
        SceneError: the request cannot be met; the message names the prim or the argument.
        ValueError: there is no such device, filter or number of threads.
    """
    of_render = {k: options.pop(k) for k in ("error", "seconds", "seed", "progress") if k in options}
    return Renderer(scene, resolution=resolution, **options).render(samples=samples, **of_render)


def use_camera_light(scene: Scene, mode: str) -> bool:
    """Whether a light is added at the camera; "auto" adds one to a scene without lights."""
    if mode not in ("auto", "on", "off"):
        raise SceneError(f"camera light {mode!r} is not one of auto, on, off")
    return mode == "on" or (mode == "auto" and not scene.lights)


def _check_limits(samples: int | None, error: float | None, seconds: float | None) -> None:
    for name, value in (("samples", samples), ("error", error), ("seconds", seconds)):
        if value is not None and not value > 0:
            raise SceneError(f"{name} must be above 0, not {value}")
