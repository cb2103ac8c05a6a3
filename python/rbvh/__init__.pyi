from typing import Any, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
INVALID_ID: int

class Error(Exception):
    kind: str  # "usage", "input", "budget", "device" or "failure"
    file: str

class Asset:
    path: str
    kind: str
    bounds: NDArray[np.float64]
    shift: NDArray[np.float64]
    levels: list[str]
    layers: list[str]
    def cast_rays(self, rays: ArrayLike, *, level: str = "") -> dict[str, NDArray[Any]]: ...
    def test_occlusions(self, rays: ArrayLike, *, level: str = "") -> NDArray[np.bool_]: ...
    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int64]: ...
    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]: ...
    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> Tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]: ...
    def render(
        self,
        *,
        resolution: Tuple[int, int] = (1024, 1024),
        aov: str = "shaded",
        level: str = "",
        position: Optional[Sequence[float]] = None,
        focal_point: Optional[Sequence[float]] = None,
        view_up: Optional[Sequence[float]] = None,
        view_angle: Optional[float] = None,
        azimuth: Optional[float] = None,
        elevation: Optional[float] = None,
        up: Optional[Sequence[float]] = None,
        samples: int = 0,
        light: str = "",
        ground: bool = False,
        denoise: bool = False,
    ) -> NDArray[Any]: ...
    def sample(
        self, points: ArrayLike, layer: str, *, level: str = "", reach: Optional[float] = None
    ) -> NDArray[np.float32]: ...
    def paint(
        self,
        points: ArrayLike,
        values: ArrayLike,
        layer: str,
        *,
        levels: Sequence[str] = ...,
        radius: float = 0.0,
        scale: Optional[float] = None,
        reach: Optional[float] = None,
    ) -> int: ...
    def bake(
        self,
        what: str = "ao",
        *,
        layer: str = "",
        light: str = "white",
        samples: int = 64,
        levels: Sequence[str] = ...,
        scale: float = 1.0,
        distance: float = 0.0,
        ground: bool = False,
    ) -> dict[str, int]: ...
    def mesh(self, level: str = "") -> Scan: ...
    def info(self) -> dict[str, Any]: ...
    def save(self, path: str, *, overwrite: bool = False) -> None: ...

class Scan(Asset):
    vertices: NDArray[Any]
    triangles: Optional[NDArray[np.uint32]]
    normals: Optional[NDArray[np.float32]]
    colors: Optional[NDArray[np.uint8]]
    radii: Optional[NDArray[np.float32]]
    object_ids: Optional[NDArray[np.int32]]
    properties: dict[str, NDArray[np.float32]]
    units: str
    def __init__(
        self,
        vertices: ArrayLike,
        triangles: Optional[ArrayLike] = None,
        normals: Optional[ArrayLike] = None,
        colors: Optional[ArrayLike] = None,
        *,
        radii: Optional[ArrayLike] = None,
        object_ids: Optional[ArrayLike] = None,
        properties: Mapping[str, ArrayLike] = ...,
        units: str = "",
    ) -> None: ...

class RaycastingScene:
    INVALID_ID: int
    def add_triangles(self, vertex_positions: ArrayLike, triangle_indices: ArrayLike) -> int: ...
    def cast_rays(self, rays: ArrayLike) -> dict[str, NDArray[Any]]: ...
    def test_occlusions(self, rays: ArrayLike, tnear: float = 0.0, tfar: float = ...) -> NDArray[np.bool_]: ...
    @staticmethod
    def create_rays_pinhole(
        fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
    ) -> NDArray[Any]: ...

def read(path: str) -> Scan: ...
def open(path: str, *, levels: Optional[Sequence[str]] = None) -> Asset: ...
def build(
    scan: Scan,
    *,
    levels: Union[None, str, Sequence[str], Mapping[str, Optional[float]]] = None,
    error: Optional[float] = None,
) -> Asset: ...
def info(path: str) -> dict[str, Any]: ...
def devices() -> list[dict[str, Any]]: ...
def use_device(choice: str) -> None: ...
def write_image(path: str, pixels: ArrayLike, *, overwrite: bool = False) -> None: ...
def rays_pinhole(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
) -> NDArray[Any]: ...
