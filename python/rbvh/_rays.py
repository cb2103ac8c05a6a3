"""Rays in the words of Open3D and of trimesh, on top of Asset.cast_rays()."""
import numpy as np

from rbvh._rbvh import INVALID_ID, Scan


def rays_pinhole(fov_deg, center, eye, up, width_px, height_px):
    """The rays of a pinhole camera, as Open3D's create_rays_pinhole() makes them.

    fov_deg: horizontal, full angle, degrees. center: what is looked at. eye: where from. up: what is up. All in
    scan units and the file's own coordinates.

    Returns (height_px, width_px, 6): float32, or float64 where eye or center are too large for that. Row 0 is on
    top. Directions have length 1 along the view, so that t_hit is the depth.
    """
    eye, center, up = (np.asarray(v, np.float64) for v in (eye, center, up))
    forward = _unit(center - eye)
    right = _unit(np.cross(forward, up))
    down = np.cross(forward, right)
    focal = 0.5 * width_px / np.tan(np.radians(fov_deg) / 2)
    x = (np.arange(width_px) + 0.5 - 0.5 * width_px) / focal
    y = (np.arange(height_px) + 0.5 - 0.5 * height_px) / focal
    directions = forward + x[None, :, None] * right + y[:, None, None] * down
    rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], -1)
    large = max(np.abs(eye).max(), np.abs(center).max()) > 1e4 * np.linalg.norm(center - eye)
    return rays if large else rays.astype(np.float32)


def _unit(v):
    length = np.linalg.norm(v)
    if not length > 0:
        raise ValueError("eye and center are equal, or up runs along the view")
    return v / length


def _joined(ray_origins, ray_directions):
    origins, directions = np.asarray(ray_origins), np.asarray(ray_directions)
    return np.concatenate(np.broadcast_arrays(origins, directions), -1)


def intersects_first(self, ray_origins, ray_directions):
    """The triangle that each ray hits first: (n,) int64, -1 for a miss. Origins and directions: (n, 3)."""
    ids = self.cast_rays(_joined(ray_origins, ray_directions))["primitive_ids"].astype(np.int64)
    ids[ids == INVALID_ID] = -1
    return ids


def intersects_any(self, ray_origins, ray_directions):
    """Whether each ray hits anything: (n,) bool. Origins and directions: (n, 3)."""
    return self.test_occlusions(_joined(ray_origins, ray_directions))


def intersects_location(self, ray_origins, ray_directions, multiple_hits=True):
    """Where rays hit: all places, or with multiple_hits=False the first of each ray.

    Origins and directions: (n, 3). Returns locations (m, 3) float64 in the file's own coordinates, the ray of
    each (m,) int64 and its triangle (m,) int64; the nearer hits of a ray come before the farther ones. Of
    triangles that a ray hits at the same distance one is found.
    """
    rays = _joined(ray_origins, ray_directions).reshape(-1, 6)
    rays = np.concatenate([rays, np.zeros((len(rays), 1), rays.dtype), np.full((len(rays), 1), np.inf, rays.dtype)], -1)
    left = np.arange(len(rays))
    places, ray_ids, triangles = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    while len(left):
        hits = self.cast_rays(rays[left])
        t = hits["t_hit"]
        found = np.isfinite(t)
        left, t = left[found], t[found]
        places.append(rays[left, :3] + t[:, None].astype(np.float64) * rays[left, 3:6])
        ray_ids.append(left)
        triangles.append(hits["primitive_ids"][found].astype(np.int64))
        if not multiple_hits:
            break
        rays[left, 6] = np.nextafter(t, np.float32(np.inf))
    places, ray_ids, triangles = (np.concatenate(parts) for parts in (places, ray_ids, triangles))
    order = np.argsort(ray_ids, kind="stable")
    return places[order], ray_ids[order], triangles[order]


class RaycastingScene:
    """Meshes to cast rays at, with the names of Open3D's class: arrays go in and come out.

    scene = rbvh.RaycastingScene()
    scene.add_triangles(vertices, triangles)   # returns its geometry id
    hits = scene.cast_rays(rays)
    """
    INVALID_ID = INVALID_ID
    create_rays_pinhole = staticmethod(rays_pinhole)

    def __init__(self):
        self._vertices, self._triangles = [], []
        self._asset, self._firsts = None, None

    def add_triangles(self, vertex_positions, triangle_indices):
        """vertex_positions: (n, 3). triangle_indices: (m, 3) integers. Returns the geometry id, from 0 on."""
        self._vertices.append(np.asarray(vertex_positions))
        self._triangles.append(np.asarray(triangle_indices, np.int64).reshape(-1, 3))
        self._asset = None
        return len(self._triangles) - 1

    def _built(self):
        if self._asset is None:
            if not self._triangles:
                raise ValueError("the scene has no triangles; call add_triangles() first")
            counts = [len(t) for t in self._triangles]
            starts = np.cumsum([0] + [len(v) for v in self._vertices])
            self._firsts = np.cumsum([0] + counts).astype(np.uint32)
            self._asset = Scan(np.concatenate(self._vertices),
                               np.concatenate([t + s for t, s in zip(self._triangles, starts)]),
                               object_ids=np.repeat(np.arange(len(counts), dtype=np.int32), counts))
        return self._asset

    def cast_rays(self, rays):
        """As Asset.cast_rays(); primitive ids count from each geometry's first triangle on."""
        hits = self._built().cast_rays(rays)
        ids = hits["geometry_ids"]
        found = ids != INVALID_ID
        hits["primitive_ids"][found] -= self._firsts[ids[found]]
        return hits

    def test_occlusions(self, rays, tnear=0.0, tfar=np.inf):
        """Whether rays (..., 6) hit anything from tnear to tfar: (...) bool."""
        rays = np.asarray(rays)
        interval = np.broadcast_to(np.array([tnear, tfar], rays.dtype), rays.shape[:-1] + (2,))
        return self._built().test_occlusions(np.concatenate([rays, interval], -1))
