"""Scans as rasterized bounding volume hierarchies, ray cast on OpenCL devices.

    import rbvh
    scan = rbvh.read("scan.ply")
    pair = rbvh.build(scan, levels=["Q0", "Q2"])
    hits = pair.cast_rays(rays)         # (..., 6) float32: origin, direction
    picture = pair.render()             # (H, W, 4) uint8
    pair.save("scan.rbvh")

All coordinates are the file's own. docs/python.md is the guide.
"""
from rbvh._rbvh import (INVALID_ID, Asset, Error, Scan, __version__, build, devices, info, open, read,
                        use_device, write_image)
from rbvh._rays import (RaycastingScene, intersects_any, intersects_first, intersects_location,
                        rays_pinhole)

# As trimesh names them.
for _function in (intersects_any, intersects_first, intersects_location):
    setattr(Asset, _function.__name__, _function)
del _function

__all__ = ["INVALID_ID", "Asset", "Error", "RaycastingScene", "Scan", "__version__", "build", "devices", "info",
           "open", "rays_pinhole", "read", "use_device", "write_image"]
