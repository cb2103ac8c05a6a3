#!/usr/bin/env python3
"""The Python module against the tool and against arithmetic. Environment: RBVH_TOOL, RBVH_DEMO_SCAN, PYTHONPATH."""
import os
import re
import subprocess
import sys
import tempfile
import threading
import unittest
import warnings

import numpy as np

import rbvh

TOOL, DEMO = os.environ["RBVH_TOOL"], os.environ["RBVH_DEMO_SCAN"]
SEED = int(os.environ.get("RBVH_SEED", np.random.SeedSequence().entropy % 2**32))


def random_rays(box, count, rng):
    """Towards points in a box, from around it."""
    center, size = box.mean(0), np.linalg.norm(box[1] - box[0])
    origins = center + size * rng.normal(size=(count, 3))
    targets = rng.uniform(box[0], box[1], (count, 3))
    return np.concatenate([origins, targets - origins], -1)


def cube(low=(0, 0, 0), side=1.0):
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return np.asarray(low) + side * corners, np.array(triangles)


class Demo(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        print(f"RBVH_SEED={SEED}", file=sys.stderr)
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        os.chdir(cls.folder.name)
        subprocess.run([DEMO, "-o", "demo.ply", "--triangles", "5000"], check=True, capture_output=True)
        cls.tool("ingest", "demo.ply", "-o", "scan.ply")
        cls.tool("build", "scan.ply", "-o", "scan.rbvh", "--levels", "Q1,Q3")
        cls.scan, cls.pair = rbvh.open("scan.ply"), rbvh.open("scan.rbvh")

    @staticmethod
    def tool(*words):
        return subprocess.run([TOOL, *words], check=True, capture_output=True, text=True).stdout

    def setUp(self):
        self.rng = np.random.default_rng(SEED)

    def test_rays_as_the_tool_casts_them(self):
        for name, asset, words, level in (("scan.ply", self.scan, (), ""), ("scan.rbvh", self.pair, (), ""),
                                          ("scan.rbvh", self.pair, ("--level", "Q3"), "Q3")):
            for kind in (np.float32, np.float64):
                rays = random_rays(asset.bounds, 3000, self.rng)
                rays = np.concatenate([rays, np.zeros((3000, 1)), self.rng.uniform(0.5, 2, (3000, 1))], -1).astype(kind)
                rays[7, 3:6] = 0
                np.save("rays.npy", rays)
                self.tool("trace", name, "--rays", "rays.npy", "-o", "hits.npy", "-f", *words)
                wanted = np.load("hits.npy")
                with self.assertWarnsRegex(UserWarning, "1 rays are not finite"):
                    hits = asset.cast_rays(rays, level=level)
                np.testing.assert_array_equal(hits["t_hit"], wanted[:, 0])
                np.testing.assert_array_equal(hits["primitive_normals"], wanted[:, 1:4])
                np.testing.assert_array_equal(hits["primitive_uvs"], wanted[:, 4:6])
                ids = np.where(wanted[:, 6] < 0, rbvh.INVALID_ID, wanted[:, 6].astype(np.int64))
                np.testing.assert_array_equal(hits["primitive_ids"], ids)
                self.assertGreater(np.isfinite(hits["t_hit"]).mean(), 0.1)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    occluded = asset.test_occlusions(rays, level=level)
                np.testing.assert_array_equal(occluded, np.isfinite(wanted[:, 0]))

    def test_shapes_and_types(self):
        rays = random_rays(self.scan.bounds, 24, self.rng).reshape(2, 3, 4, 6)
        hits = self.scan.cast_rays(rays)
        shapes = {"t_hit": (2, 3, 4), "geometry_ids": (2, 3, 4), "primitive_ids": (2, 3, 4),
                  "primitive_uvs": (2, 3, 4, 2), "primitive_normals": (2, 3, 4, 3)}
        self.assertEqual({key: value.shape for key, value in hits.items()}, shapes)
        self.assertEqual(hits["t_hit"].dtype, np.float32)
        self.assertEqual(hits["geometry_ids"].dtype, np.uint32)
        self.assertEqual(self.scan.cast_rays(rays[0, 0, 0])["t_hit"].shape, ())
        self.assertEqual(self.scan.cast_rays(np.zeros((0, 6), np.float32))["primitive_uvs"].shape, (0, 2))
        self.assertEqual(self.scan.test_occlusions(rays).dtype, np.bool_)
        strided = np.zeros((100, 12), np.float32)
        strided[:, ::2] = random_rays(self.scan.bounds, 100, self.rng)
        np.testing.assert_array_equal(self.scan.cast_rays(strided[:, ::2])["t_hit"],
                                      self.scan.cast_rays(strided[:, ::2].copy())["t_hit"])

    def test_many_rays_and_threads(self):
        rays = random_rays(self.scan.bounds, 600_000, self.rng).astype(np.float32)
        whole = self.scan.cast_rays(rays)["t_hit"]
        parts = [None] * 4

        def work(i):
            parts[i] = self.scan.cast_rays(rays[i * 150_000:(i + 1) * 150_000])["t_hit"]

        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        np.testing.assert_array_equal(np.concatenate(parts), whole)

    def test_hits_lie_on_their_triangles(self):
        rays = random_rays(self.scan.bounds, 2000, self.rng)
        hits = self.scan.cast_rays(rays)
        found = np.isfinite(hits["t_hit"])
        corners = self.scan.vertices[self.scan.triangles[hits["primitive_ids"][found]]]
        u, v = hits["primitive_uvs"][found].T[..., None]
        on_triangle = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        on_ray = rays[found, :3] + hits["t_hit"][found, None] * rays[found, 3:]
        size = np.linalg.norm(self.scan.bounds[1] - self.scan.bounds[0])
        self.assertLess(np.abs(on_triangle - on_ray).max(), 1e-5 * size)

    def test_trimesh_words(self):
        vertices, triangles = cube()
        scan = rbvh.Scan(vertices, triangles)
        origins, directions = np.array([[0.3, 0.4, 5], [9, 9, 9.]]), np.array([[0, 0, -1.], [0, 0, 1]])
        places, rays, ids = scan.intersects_location(origins, directions)
        np.testing.assert_allclose(places, [[0.3, 0.4, 1], [0.3, 0.4, 0]], atol=1e-6)
        np.testing.assert_array_equal(rays, [0, 0])
        np.testing.assert_array_equal(ids // 2, [1, 0])  # the top quad, then the bottom one
        places, rays, ids = scan.intersects_location(origins, directions, multiple_hits=False)
        self.assertEqual((len(places), list(rays)), (1, [0]))
        first = scan.intersects_first(origins, directions)
        self.assertEqual(list(first), [ids[0], -1])
        self.assertEqual(list(scan.intersects_any(origins, directions)), [True, False])

    def test_open3d_words(self):
        scene = rbvh.RaycastingScene()
        a, b = cube(), cube((3, 0, 0))
        self.assertEqual(scene.add_triangles(*a), 0)
        self.assertEqual(scene.add_triangles(*b), 1)
        rays = np.array([[[3.3, 0.4, 5, 0, 0, -2], [0.3, 0.4, 5, 0, 0, -1]], [[2, 2, 2, 0, 0, 1], [2, 0.5, 0.4, -1, 0, 0]]],
                        np.float32)
        hits = scene.cast_rays(rays)
        np.testing.assert_allclose(hits["t_hit"], [[2, 4], [np.inf, 1]])
        invalid = rbvh.RaycastingScene.INVALID_ID
        np.testing.assert_array_equal(hits["geometry_ids"], [[1, 0], [invalid, 0]])
        np.testing.assert_array_equal(hits["primitive_ids"] // 2, [[1, 1], [invalid // 2, 5]])
        np.testing.assert_array_equal(hits["primitive_normals"], [[[0, 0, 1]] * 2, [[0, 0, 0], [1, 0, 0]]])
        np.testing.assert_array_equal(scene.test_occlusions(rays), [[True, True], [False, True]])
        np.testing.assert_array_equal(scene.test_occlusions(rays, tfar=1.5), [[False, False], [False, True]])
        np.testing.assert_array_equal(scene.test_occlusions(rays, tnear=1.5), [[True, True], [False, True]])

    def test_pinhole(self):
        rays = rbvh.rays_pinhole(90, center=[0, 0, 0], eye=[0, 0, 4], up=[0, 1, 0], width_px=4, height_px=2)
        self.assertEqual((rays.shape, rays.dtype), ((2, 4, 6), np.float32))
        np.testing.assert_allclose(rays[0, 0], [0, 0, 4, -0.75, 0.25, -1])  # the top left
        np.testing.assert_allclose(rays[1, 3], [0, 0, 4, 0.75, -0.25, -1])
        far = rbvh.rays_pinhole(90, [5e5, 5e6, 0], [5e5, 5e6, 4], [0, 1, 0], 4, 2)
        self.assertEqual(far.dtype, np.float64)

    def test_large_coordinates(self):
        low = (500000.25, 5400000.5, 100)
        scan = rbvh.Scan(*cube(low))
        self.assertTrue(np.any(scan.shift))
        np.testing.assert_allclose(scan.bounds[0], low, atol=1e-6)
        np.testing.assert_allclose(scan.vertices, cube(low)[0], atol=1e-6)
        ray = np.array([[low[0] + 0.5, low[1] + 0.25, 110, 0, 0, -1]])
        self.assertAlmostEqual(float(scan.cast_rays(ray)["t_hit"][0]), 9, places=5)
        with self.assertWarnsRegex(UserWarning, "float32"):
            scan.cast_rays(ray.astype(np.float32))
        np.testing.assert_allclose(scan.intersects_location(ray[:, :3], ray[:, 3:])[0][0], ray[0, :3] - [0, 0, 9])

    def test_arrays(self):
        vertices, triangles = cube()
        colors = self.rng.integers(0, 256, (8, 3)).astype(np.uint8)
        scan = rbvh.Scan(vertices, triangles, colors=colors, object_ids=np.arange(12), properties={"wear": np.arange(8)},
                         units="mm")
        np.testing.assert_array_equal(scan.vertices, vertices)
        np.testing.assert_array_equal(scan.triangles, triangles)
        np.testing.assert_array_equal(scan.colors, colors)
        np.testing.assert_array_equal(scan.properties["wear"], np.arange(8))
        self.assertEqual((scan.kind, scan.units, scan.normals), ("mesh", "mm", None))
        self.assertFalse(scan.vertices.flags.writeable)
        self.assertIs(scan.vertices.base, scan)  # a view
        view = scan.vertices
        del scan
        np.testing.assert_array_equal(view, vertices)  # which keeps its scan
        np.testing.assert_array_equal(rbvh.Scan(vertices, triangles, colors=colors / 255.0).colors, colors)
        cloud = rbvh.Scan(np.stack(np.meshgrid(np.arange(9.), np.arange(9.), [0.]), -1).reshape(-1, 3))
        self.assertEqual(cloud.kind, "cloud")
        np.testing.assert_allclose(np.abs(cloud.normals[:, 2]), 1)
        self.assertTrue((cloud.radii > 0).all())
        cloud.save("cloud.ply")
        np.testing.assert_array_equal(rbvh.read("cloud.ply").vertices, cloud.vertices)

    def test_build_save_mesh(self):
        pair = rbvh.build(self.scan, levels=["Q1", "Q3"])
        self.assertEqual(pair.levels, ["Q1", "Q3"])
        rays = random_rays(pair.bounds, 500, self.rng)
        np.testing.assert_array_equal(pair.cast_rays(rays)["t_hit"], self.pair.cast_rays(rays)["t_hit"])
        pair.save("again.rbvh")
        self.assertEqual(rbvh.info("again.rbvh")["levels"][0]["name"], "Q1")
        with self.assertRaisesRegex(rbvh.Error, "overwrite=True"):
            pair.save("again.rbvh")
        pair.save("again.rbvh", overwrite=True)
        mesh = pair.mesh("Q3")
        self.tool("mesh", "scan.rbvh", "--level", "Q3", "-o", "q3.ply")
        np.testing.assert_array_equal(mesh.triangles, rbvh.read("q3.ply").triangles)
        one = rbvh.build(self.scan, error=1e-3)
        self.assertEqual(len(one.levels), 1)
        own = rbvh.build(self.scan, levels={"Q1": 1e-4, "Q4": None})
        self.assertEqual(own.levels, ["Q1", "Q4"])
        self.assertEqual(pair.info()["kind"], "rbvh")
        self.assertEqual(self.pair.info()["kind"], "rbvh")

    def test_pictures(self):
        picture = self.pair.render(resolution=(64, 48), level="Q3")
        self.assertEqual((picture.shape, picture.dtype), ((48, 64, 4), np.uint8))
        self.assertGreater((picture[..., 3] == 255).mean(), 0.05)
        self.tool("render", "scan.rbvh", "--level", "Q3", "--resolution", "64,48", "--quick",
                  "--camera-azimuth-angle", "30", "--camera-elevation-angle", "20", "-o", "tool.png", "-f")
        np.testing.assert_array_equal(picture, read_png("tool.png"))
        rbvh.write_image("again.png", picture)
        np.testing.assert_array_equal(read_png("again.png"), picture)
        depth = self.scan.render(resolution=(64, 48), aov="depth", azimuth=40)
        self.assertEqual((depth.shape, depth.dtype), ((48, 64), np.float32))
        self.assertTrue(np.isinf(depth).any() and np.isfinite(depth).any())
        self.assertEqual(self.scan.render(resolution=(8, 8), aov="normal").shape, (8, 8, 3))
        lit = self.scan.render(resolution=(16, 16), light="sky", samples=2, ground=True)
        self.assertEqual((lit.shape, lit.dtype), ((16, 16, 4), np.uint8))
        self.assertEqual(self.scan.render(resolution=(16, 16), aov="ao", samples=2).shape, (16, 16))

    def test_layers(self):
        pair = rbvh.build(self.scan, levels=["Q3"])
        hits = pair.cast_rays(random_rays(pair.bounds, 400, self.rng) + np.zeros(6))
        rays = random_rays(pair.bounds, 400, np.random.default_rng(SEED))
        t = pair.cast_rays(rays)["t_hit"]
        points = (rays[:, :3] + t[:, None] * rays[:, 3:])[np.isfinite(t)]
        self.assertEqual(len(hits["t_hit"]), 400)
        self.assertEqual(pair.paint(points, np.full(len(points), 3.0), "wear"), 0)
        self.assertEqual(pair.layers, ["wear"])
        values = pair.sample(points, "wear")
        self.assertEqual(values.shape, (len(points), 1))
        np.testing.assert_allclose(values[np.isfinite(values)], 3, rtol=1e-3)
        self.assertGreater(np.isfinite(values).mean(), 0.9)
        self.assertEqual(pair.sample(points, "normal").shape, (len(points), 3))
        baked = pair.bake("ao", samples=4)
        self.assertGreater(baked["Q3"], 0)
        ao = pair.sample(points, "ao")
        self.assertTrue(((ao >= 0) & (ao <= 1.001) | np.isnan(ao)).all())

    def test_errors(self):
        vertices, triangles = cube()
        for wrong, words, kind in (
                (lambda: rbvh.open("missing.ply"), "missing.ply", "input"),
                (lambda: rbvh.Scan(vertices, triangles + 5), "there are 8 vertices", "input"),
                (lambda: rbvh.Scan(vertices, -triangles), "no vertex", "usage"),
                (lambda: rbvh.Scan(vertices[:, :2]), "shape", "usage"),
                (lambda: rbvh.Scan(vertices, triangles, colors=np.zeros((7, 3), np.uint8)), "colors", "usage"),
                (lambda: rbvh.Scan(np.ones((5, 3))), "equal", "input"),
                (lambda: self.scan.cast_rays(np.zeros((5, 7))), "6 or 8", "usage"),
                (lambda: self.scan.cast_rays("rays"), "rays", "usage"),
                (lambda: self.pair.cast_rays(np.zeros((1, 6)), level="Q7"), "no level 'Q7'", "usage"),
                (lambda: self.scan.sample(vertices, "wear"), "no .rbvh pair", "usage"),
                (lambda: self.pair.sample(vertices, "wear"), "wear", "usage"),
                (lambda: self.pair.paint(vertices, np.ones(8), "a b"), "no layer's name", "usage"),
                (lambda: rbvh.write_image("a.png", np.zeros(5)), "pixels", "usage"),
                (lambda: rbvh.write_image("a.png", np.zeros((5, 5))), "exr", "usage"),
                (lambda: self.scan.render(aov="beauty"), "beauty", "usage"),
                (lambda: self.scan.render(ground=True), "ground", "usage"),
                (lambda: self.scan.render(denoise=True), "denoise", "usage"),
                (lambda: self.scan.render(aov="depth", samples=4), "samples", "usage"),
                (lambda: self.scan.render(aov="normal", light="sky"), "light", "usage"),
                (lambda: self.pair.bake("sky", distance=1), "distance", "usage"),
                (lambda: rbvh.build(self.scan, levels=["Q9"]), "Q9", "usage"),
                (lambda: self.scan.mesh(), "no .rbvh pair", "usage")):
            with self.assertRaisesRegex(rbvh.Error, re.escape(words)) as raised:
                wrong()
            self.assertEqual(raised.exception.kind, kind, raised.exception)
            self.assertNotIn("\n", str(raised.exception))

    def test_all_is_documented_and_stubbed(self):
        with open(os.path.join(os.path.dirname(rbvh.__file__), "__init__.pyi")) as stubs:
            stubbed = stubs.read()
        for name in rbvh.__all__:
            self.assertIn(name, stubbed)
            if name not in ("INVALID_ID", "__version__"):
                self.assertTrue(getattr(rbvh, name).__doc__, name)
        for of in (rbvh.Asset, rbvh.Scan):
            for name in vars(of):
                if not name.startswith("_"):
                    self.assertRegex(stubbed, rf"\b{name}\b")
                    self.assertTrue(getattr(of, name).__doc__, name)


def read_png(path):
    """(H, W, 4) of a PNG of 8 bits, RGBA."""
    import struct
    import zlib
    with open(path, "rb") as file:
        data = file.read()
    width, height = struct.unpack(">II", data[16:24])
    packed, at = b"", 8
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 4 * width)
    out = np.zeros((height, width, 4), np.uint8)
    for y in range(height):
        line, above = rows[y, 1:].astype(int), (out[y - 1] if y else np.zeros((width, 4))).reshape(-1).astype(int)
        result = np.zeros(4 * width, int)
        for i in range(4 * width):
            a, b = result[i - 4] if i >= 4 else 0, above[i]
            c = above[i - 4] if i >= 4 else 0
            p = a + b - c
            paeth = a if abs(p - a) <= abs(p - b) and abs(p - a) <= abs(p - c) else b if abs(p - b) <= abs(p - c) else c
            result[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[rows[y, 0]]) & 255
        out[y] = result.reshape(width, 4)
    return out


if __name__ == "__main__":
    unittest.main()
