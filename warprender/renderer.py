"""`Renderer`: a scene, a camera and a request, kept ready on a device and rendered as often as needed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import warp as wp

from .adaptive import PILOT, Allocation
from .camera import Camera
from .denoise import GUIDES, MISSING, available, denoised
from .emitters import use_camera_light
from .errors import SceneError
from .films import Films
from .filters import filter_table, pixel_offset
from .frame import Frame, Stats
from .framing import checked_resolution, choose_data_window, choose_resolution
from .given import shown
from .hit_finders import HitFinders
from .integrators import RADIANCE
from .integrators.none import launch_outputs
from .integrators.samples import PathRequest, follow_bounds, launch_samples, path_request, samples_kernel
from .launch import thread_count
from .live import LiveScene
from .outputs import FILM_OUTPUTS, OutputBuffers, cleared_outputs, output_names, term_of, terms_of
from .plan import LIGHT_BY_LIGHT, LIGHT_SAMPLINGS, RenderPlan, Request, analyse, check_seed
from .receipt import make_receipt
from .scene import Scene
from .shutter import shutter_share
from .stopping import Limits, Passes
from .texels import TEXTURE_BYTES
from .viewpoint import Viewpoint
from .visibility.raster import LARGEST_SIDE

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
            and refraction as well. "path": all light, by path tracing. "auto": the cheapest that leaves out nothing
            that the scene calls for (docs/transports.md).
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
        ray_accuracy: how rays of colour meet triangles: "watertight", or "fast", `wp.mesh_query_ray`, which loses rays
            at edges and vertices. A figure for studies: on the CPU it is the slower one.

    Attributes:
        plan: the `RenderPlan`: which effects occur, and which prim called for each.
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
        ray_accuracy: str = "watertight",
    ) -> None:
        """Plan, compile and upload."""
        start = time.perf_counter()
        if not isinstance(scene, Scene):
            raise SceneError(f"scene is {shown(scene)}, not a Scene")
        self.scene, self.device, self.threads = scene, device, thread_count(threads)
        self._viewpoint = Viewpoint(scene, camera)
        full = choose_resolution(scene, self.camera) if resolution is None else checked_resolution(resolution)
        self.data_window = choose_data_window(scene, full)
        self.resolution = (self.data_window.width, self.data_window.height)
        outputs = output_names(outputs)
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
            ray_accuracy,
        )
        if denoise and not available():
            raise SceneError(MISSING)
        self._with_camera_light = use_camera_light(scene, camera_light)
        self.plan: RenderPlan = self._analyse()
        self._live = LiveScene(
            scene,
            device,
            self.camera.transform,
            self._with_camera_light,
            self.plan.sdfs,
            texture_bytes,
            keep_meshes=ray_accuracy == "fast",
        )
        if not (scene.placements or dome_light_visible or lights_visible):
            scene.warn(f"{scene.source or 'the scene'}: there is nothing to draw")
        self._sobol = sampler == "sobol"
        self._finders = HitFinders(device)
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
            SceneError: a limit is not above 0, or the seed is no whole number.
        """
        limits = Limits(samples, error, seconds)
        check_seed(seed)
        seed = int(seed)
        start = time.perf_counter()
        values = self._render_outputs()
        self._seconds["outputs"] = time.perf_counter() - start
        taken, interrupted = 0, False
        if self.plan.path is not None:
            start = time.perf_counter()
            taken, interrupted = self._sample(limits, seed, progress, values)
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
        self._viewpoint.choose(camera)
        self.update()

    def standard_error(self) -> np.ndarray:
        """(H, W, 3) float64 standard error of the last frame's colour; inf where a pixel has under two samples."""
        return self._films.last.standard_error() * self.camera.exposureScale

    @property
    def camera(self) -> Camera:
        """The `Camera` that was chosen, where `update` has last seen it."""
        return self._viewpoint.camera

    def _analyse(self) -> RenderPlan:
        pixels, request = self.resolution[0] * self.resolution[1], self.request
        if request.visibility == "auto" and max(self.resolution) > LARGEST_SIDE:
            request = replace(request, visibility="rays")
        return analyse(self.scene, self.camera, request, self._with_camera_light, pixels)

    def _follow(self) -> None:
        """See what has changed: camera, scene, and the plan where effects may have come or gone."""
        lens_changed = self._viewpoint.look()
        if self._live.look_again() or lens_changed:
            self.plan = self._analyse().kept_from(self.plan, self.camera)
        self._live.update(self.camera.transform, self.plan.sdfs)
        self._look()

    def _go_to(self, time: float) -> None:
        """Bring the scene to a time in frames from its own."""
        self.scene.motion(time)
        self._follow()

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
            self._first_hits = self._finders.get("outputs", plan.visibility, plan.outputs, upload, self._camera_record)
        if plan.path is not None and plan.color_visibility != "rays":
            self._color_hits = self._finders.get("color", plan.color_visibility, plan.path, upload, self._camera_record)

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
        self, limits: Limits, seed: int, progress: Progress | None, values: dict[str, wp.array]
    ) -> tuple[float, bool]:
        """Add passes of samples until a limit is reached; returns samples taken and whether it was cut short."""
        self._films.turn()
        request, shutter = self._path_request(seed), self.plan.shutter
        pixels = self.resolution[0] * self.resolution[1]
        if limits.seconds is not None:
            # Compiling and loading come before the clock starts.
            self._pass(request, 0, 0)
        take = self._pass if shutter is None else partial(self._blurred_pass, shutter)
        # All pixels see one time together: none gets samples of its own number then.
        adaptive = self.request.adaptive and shutter is None
        if adaptive != self.request.adaptive:
            self.scene.warn(
                "adaptive: every pixel gets the same samples, because things move while the shutter is open"
            )

        def report(share: float) -> None:
            progress(share, partial(self._frame, values, passes.taken, seed, True, settled=True))

        film, allocation = self._films.last, None
        reports = None if progress is None else report
        passes = Passes(limits, pixels, lambda: film.relative_error().error, reports, PILOT if adaptive else 0)
        try:
            for size in passes:
                taken = passes.taken
                if adaptive and taken == PILOT:
                    allocation = Allocation(film)
                if allocation is not None:
                    self._adaptive_pass(request, allocation, taken, size)
                else:
                    take(request, int(taken), max(int(size), 1), round(pixels * min(size, 1)))
        except KeyboardInterrupt:
            return passes.taken, True
        finally:
            if shutter is not None:
                self._go_to(0.0)
        return passes.taken, False

    def _path_request(self, seed: int) -> PathRequest:
        request = path_request(self.request, self.plan, seed, self._sobol)
        request.terms = self._films.last.terms
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
            follow_bounds(request, self.plan)
            self._pass(request, sample, 1, pixels)

    def _launch(self, request: PathRequest, first_sample: int, samples: int, pixels: int | None) -> None:
        request.first_sample, request.samples = first_sample, samples
        scene, camera, film, key = self._live.record, self._camera_record, self._films.last.record, self.plan.path
        radiance, rasterized = RADIANCE[self.plan.transport](key), self._color_hits is not None
        kernel = samples_kernel(key.camera, key.sdfs, radiance, rasterized, key.terms, key.ray_accuracy)
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
        shot = samples, seed, self.device, self._viewpoint.path
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
