#!/usr/bin/env python3
"""Runs docs/python.md as one script, on a simulated scan and a copy of it with a dent. Environment: RBVH_TOOL,
RBVH_DEMO_SCAN, PYTHONPATH."""
import os
import re
import subprocess
import tempfile

import numpy as np

import rbvh

HERE = os.path.dirname(os.path.abspath(__file__))


def main():
    with open(os.path.join(HERE, "..", "..", "docs", "python.md")) as guide:
        blocks = re.findall(r"^```python\n(.*?)^```", guide.read(), re.M | re.S)
    assert len(blocks) >= 6, "the guide has lost its code"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        subprocess.run([os.environ["RBVH_DEMO_SCAN"], "-o", "demo.ply", "--triangles", "5000"], check=True)
        subprocess.run([os.environ["RBVH_TOOL"], "ingest", "demo.ply", "-o", "scan.ply", "-q"], check=True)
        scan = rbvh.read("scan.ply")
        vertices = scan.vertices.copy()
        size = np.linalg.norm(np.ptp(scan.bounds, axis=0))
        dent = vertices[np.argmax(vertices[:, 2])]
        near = np.linalg.norm(vertices - dent, axis=1) < 0.15 * size
        vertices[near] -= [0, 0, 0.01 * size]
        rbvh.Scan(vertices, scan.triangles).save("later.ply")

        names = {}
        for block in blocks:
            exec(compile(block, "docs/python.md", "exec"), names)

        for name in ("scan.rbvh", "depth.png", "depth.exr", "occlusion.png", "thickness.rbvh", "change.png"):
            assert os.path.getsize(name) > 0, name
        assert 0.05 < names["seen"].mean() < 0.95
        assert 0.3 < names["sky"].mean() < 1 and names["sky"].min() < 0.9
        assert np.isfinite(names["thickness"]).mean() > 0.3
        changed = names["amount"][names["there"]] > 0.05
        assert 0.001 < changed.mean() < 0.5, changed.mean()
        assert names["change"][names["there"] & (names["amount"][..., 0] > 0.05)].mean() < 0  # the dent goes inwards
        if folder_to_keep := os.environ.get("RBVH_KEEP"):
            subprocess.run(["cp", "-r", folder, folder_to_keep], check=True)


main()
