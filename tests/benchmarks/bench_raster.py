"""Face, depth and normal of the knob at 1280×720, against Mesa's llvmpipe in interleaved turns of the same run.

    python tests/benchmarks/bench_raster.py [--threads 2] [--turns 20] [--counts 1k 100k 1m]

A turn of ours: vertices to clip space, `wr.rasterize`, and unit normals by `wr.interpolate`. A turn of llvmpipe (when
moderngl and an EGL Mesa are installed): the same mesh with depth test, interpolated normals and one light, drawn and
finished.
Only ratios of one run mean anything on a shared machine; those of processor time, and of the best of many turns,
suffer least from its other work.
"""

import argparse
import os
import time

import numpy as np
import warp as wp
from bumpy_balls import bumpy

import warprender as wr
from warprender.launch import launch
from warprender.shapes.normals import vertex_normals

SIDES = {"1k": 9, "100k": 91, "1m": 289}
WIDTH, HEIGHT = 1280, 720


def knob(n):
    """A ball with seeded bumps: points (N, 3) float32 and triangles (12 n², 3) int32."""
    points, triangles = bumpy(n, 1.0, 0.25, 1)
    return points.astype(np.float32), triangles.astype(np.int32)


def view_projection():
    """(4, 4) for column vectors: 45° high, from (0, -3.2, 0), z up."""
    f, near, far = 1 / np.tan(np.radians(22.5)), 0.1, 100.0
    depth = [(far + near) / (near - far), 2 * far * near / (near - far)]
    projection = np.array([[f * HEIGHT / WIDTH, 0, 0, 0], [0, f, 0, 0], [0, 0, *depth], [0, 0, -1, 0]])
    return projection @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, -3.2], [0, 0, 0, 1]])


@wp.kernel(enable_backward=False)
def project(first: wp.int32, matrix: wp.mat44, points: wp.array(dtype=wp.vec3), clip: wp.array(dtype=wp.vec4)):
    i = first + wp.tid()
    p = points[i]
    clip[i] = matrix * wp.vec4(p[0], p[1], p[2], 1.0)


class Ours:
    def __init__(self, points, triangles, normals, threads):
        self.threads = threads
        self.matrix = wp.mat44(*view_projection().reshape(-1))
        self.points, self.normals = wp.array(points, dtype=wp.vec3), wp.array(normals, dtype=wp.vec3)
        self.indices = wp.array(triangles.reshape(-1), dtype=wp.int32)
        self.clip = wp.empty(len(points), wp.vec4)
        self.out = wp.empty((HEIGHT, WIDTH), wp.vec3)

    def draw(self):
        launch(project, len(self.points), [self.matrix, self.points, self.clip], "cpu", self.threads)
        seen = wr.rasterize(self.clip, self.indices, WIDTH, HEIGHT, threads=self.threads)
        wr.interpolate(seen, self.indices, self.normals, normalize=True, threads=self.threads, into=self.out)
        return seen


class Llvmpipe:
    VERTEX = """#version 330
    uniform mat4 mvp; in vec3 p; in vec3 n; out vec3 vn;
    void main() { vn = n; gl_Position = mvp * vec4(p, 1.0); }"""
    FRAGMENT = """#version 330
    in vec3 vn; out vec4 c;
    void main() { vec3 n = normalize(vn); float d = max(dot(n, normalize(vec3(0.4, -0.8, 0.5))), 0.0);
                  c = vec4(0.1 + 0.9 * d * (n * 0.5 + 0.5), 1.0); }"""

    def __init__(self, context, points, triangles, normals):
        self.context = context
        program = context.program(vertex_shader=self.VERTEX, fragment_shader=self.FRAGMENT)
        program["mvp"].write(view_projection().T.astype("f4").tobytes())
        self.target = context.framebuffer(
            [context.renderbuffer((WIDTH, HEIGHT), 4)], context.depth_renderbuffer((WIDTH, HEIGHT))
        )
        vertices = context.buffer(np.concatenate([points, normals], 1).astype("f4").tobytes())
        indices = context.buffer(triangles.astype("u4").tobytes())
        self.mesh = context.vertex_array(program, [(vertices, "3f 3f", "p", "n")], indices)

    def draw(self):
        self.target.use()
        self.context.enable(self.context.DEPTH_TEST)
        self.target.clear(0, 0, 0, 1, depth=1.0)
        self.mesh.render()
        self.context.finish()


def gl_context(threads):
    os.environ["LP_NUM_THREADS"] = str(threads)
    try:
        import moderngl

        return moderngl.create_context(standalone=True, backend="egl", require=330)
    except Exception as error:
        print(f"llvmpipe left out: {error}")
        return None


def milliseconds(function):
    """Of the wall clock, and of processor time over all threads."""
    start, busy = time.perf_counter(), time.process_time()
    function()
    return 1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - busy)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--turns", type=int, default=20)
    parser.add_argument("--counts", nargs="+", default=list(SIDES), choices=list(SIDES))
    options = parser.parse_args()
    context = gl_context(options.threads)
    for name in options.counts:
        points, triangles = knob(SIDES[name])
        normals = vertex_normals(points, triangles)
        runs = {"ours": Ours(points, triangles, normals, options.threads)}
        if context is not None:
            runs["llvmpipe"] = Llvmpipe(context, points, triangles, normals)
        for run in runs.values():
            run.draw()
        times = {key: [] for key in runs}
        for _ in range(options.turns):
            for key, run in runs.items():
                times[key].append(milliseconds(run.draw))
        covered = int((runs["ours"].draw().face.numpy() >= 0).sum())
        line = f"{name}: {len(triangles)} triangles, {covered} pixels"
        medians = {key: np.median(of_turn, 0) for key, of_turn in times.items()}
        for key, (wall, busy) in medians.items():
            line += f"; {key} {wall:.1f} ms (best {min(times[key])[0]:.1f}, processor {busy:.1f})"
        if context is not None:
            wall, busy = medians["ours"] / medians["llvmpipe"]
            best, least = np.min(times["ours"], 0) / np.min(times["llvmpipe"], 0)
            line += f"; ratio {wall:.2f} (processor {busy:.2f}), of the best {best:.2f} ({least:.2f})"
        print(line, flush=True)


if __name__ == "__main__":
    main()
