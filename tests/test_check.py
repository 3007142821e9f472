"""`warprender check` names what is hard about a scene, and nothing about a sound one."""

import json
from pathlib import Path

import numpy as np
import pytest
import scenes

import warprender as wr
from warprender.checks import COMPARED, check, visibility_findings
from warprender.cli import main

BOX = Path(__file__).parent.parent / "scenes_usd" / "cornell_box.usda"


def with_mesh(change):
    points, faces = scenes.cube(1.0)
    points = np.array(points, np.float32)
    scene = wr.Scene()
    mesh = scene.add_mesh("/m", points, faces)
    change(mesh, scene.placements["/m"])
    return [str(finding) for finding in check(scene)]


def test_a_sound_scene_has_no_findings():
    assert with_mesh(lambda mesh, placement: None) == []


def broken_point(mesh, placement):
    mesh.points[0, 1] = np.nan


def repeated_index(mesh, placement):
    mesh.triangles[0, 1] = mesh.triangles[0, 0]


def twice(mesh, placement):
    mesh.triangles[1] = np.roll(mesh.triangles[0], 1)


def tiny(mesh, placement):
    mesh.points *= np.float32(1e-12)


def far_away(mesh, placement):
    mesh.points += np.float32(1e5)


def collapsed(mesh, placement):
    placement.transforms[0, :3, :3] = 0.0


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (broken_point, "points that are not finite"),
        (repeated_index, "1 triangles have no area"),
        (twice, "1 triangles lie on others"),
        (tiny, "scaled by a power of two"),
        (far_away, "float32 holds them to"),
        (collapsed, "1 of 1 transforms are singular"),
    ],
)
def test_what_is_hard_is_named_with_its_prim(change, named):
    findings = with_mesh(change)
    assert any(finding.startswith("/m: ") and named in finding for finding in findings), findings


def test_lights_without_power_and_cameras_without_a_window():
    scene = wr.Scene()
    scene.add_light(wr.SphereLight(radius=0.0), "/lamp")
    scene.add_camera("/cam", wr.Camera(focalLength=0.0))
    assert [finding.path for finding in check(scene)] == ["/lamp", "/cam"]


def test_command(tmp_path, capsys):
    assert main(["check", str(BOX)]) == 0
    assert capsys.readouterr().out == f"{BOX}: nothing found\n"
    stage = tmp_path / "bad.usda"
    stage.write_text('#usda 1.0\ndef SphereLight "dark" {\n float inputs:intensity = 0\n}\ndef Volume "v" { }\n')
    assert main(["check", str(stage), "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert any(finding["path"] == "/dark" for finding in findings)
    assert any("/v" in finding["what"] for finding in findings)


def test_visibility_names_the_prims_behind_pixels_that_differ(capsys):
    assert main(["check", "--visibility", str(BOX), "-w", "64"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith(f"{BOX}: ")
    scene = wr.load(BOX)
    paths = list(scene.placements)
    pictures = []
    for prim in (0, 1):
        picture = {name: np.full((2, 3), -1) for name in COMPARED}
        picture["primId"][1, 2], picture["elementId"][1, 2], picture["cameraDepth"] = prim, 7, np.ones((2, 3))
        pictures.append(picture)
    (finding,) = visibility_findings(scene, *pictures)
    assert str(finding) == (
        f"{paths[0]}: pixel 2,1: rays see {paths[0]} face 7 at depth 1, the rasterizer {paths[1]} face 7 at depth 1"
    )


def glass(points, faces, **inputs):
    scene = wr.Scene()
    scene.add_mesh("/glass", points, faces, material=wr.Dielectric(**inputs))
    return [str(finding) for finding in check(scene)]


def test_glass_that_does_not_enclose_anything_is_named():
    points, faces = scenes.cube(1.0)
    assert glass(points, faces) == []
    assert glass(points, faces[:-1])[0].startswith("/glass: 4 edges do not close the mesh")
    assert glass(points, faces[:-1], thinWalled=1) == []
    # One face turned round opens its four edges as well; all of them make a bubble.
    assert "4 edges" in glass(points, [*faces[:-1], faces[-1][::-1]])[0]
    assert "look inwards" in glass(points, [face[::-1] for face in faces])[0]
    # Corners that are stored once for each face are closed where their places are the same.
    assert glass(points[np.reshape(faces, -1)], np.arange(24).reshape(6, 4)) == []
