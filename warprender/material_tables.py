"""From the host's materials to the rows, nodes, primvar slots and pictures that kernels read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from .materials import MATERIALS, Material, MeasuredBRDF
from .materials.brdf_table import BrdfTable
from .materials.inputs import NORMAL, Varying
from .records import BrdfRecord, DeviceScene, InputRecord, LevelRecord, MaterialRecord, PictureRecord
from .shapes import Mesh
from .shapes.tangents import corner_tangents
from .texels import TEXTURE_BYTES, TexelPool, halvings_within, srgb_table
from .textures import CHANNELS, FIRST_TILE, TILES, PrimvarReader, Texture, as_picture, pyramid_bytes
from .watched import same


@dataclass(frozen=True)
class Tangents:
    """A slot that is made, not authored: tangents along a primvar of coordinates, seen through a 2×2 matrix."""

    varname: str
    linear: tuple[float, float, float, float]

    def of(self, mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """`corner_tangents` of a mesh with these points, None where it has no such coordinates on its corners."""
        coordinates = mesh.primvars.get(self.varname)
        if coordinates is None or coordinates.values.shape[1] < 2:
            return None
        if coordinates.interpolation not in ("vertex", "faceVarying"):
            return None
        elements = mesh.triangles if coordinates.interpolation == "vertex" else mesh.corners
        moved = coordinates.expanded()[elements][..., :2] @ np.reshape(self.linear, (2, 2)).T
        return corner_tangents(mesh, points, moved)


Slot = str | Tangents | PrimvarReader


class MaterialTables:
    """Rows of the materials of a scene, and what they refer to.

    Attributes:
        materials: (M,) rows of `MaterialRecord`.
        inputs: rows of `InputRecord`.
        slots: what the primvar slots hold, the display colour and opacity first.
        pool: the pictures.
        tiles: 100 picture numbers for each UDIM set.
        brdfs: the measured BRDFs, each once.
        warnings: one line for each picture that cannot be read or was made smaller, and about measured data.
    """

    def __init__(self, materials: dict[str, Material], used: Iterable[str], budget: int = TEXTURE_BYTES) -> None:
        """Pictures of materials that are not among the `used` keys are not read."""
        self.slots: list[Slot] = ["displayColor", "displayOpacity"]
        self.inputs: list[np.ndarray] = []
        self.pool = TexelPool()
        self.tiles: list[np.ndarray] = []
        self.brdfs: list[BrdfTable] = []
        self.warnings: list[str] = []
        self._pictures: dict[tuple, int] = {}
        used = set(used)
        self._used, self._links = used, _links(materials)
        self._read_pictures({key: m for key, m in materials.items() if key in used}, budget)
        self.materials = np.zeros(len(materials), MaterialRecord.numpy_dtype())
        for row, (key, material) in zip(self.materials, materials.items(), strict=True):
            values = material.pack()
            row["kind"] = MATERIALS.index(type(material))
            row["values"][: len(values)] = values
            row["normal"] = row["table"] = -1
            if key in used:
                self._link(row, material)
                if isinstance(material, MeasuredBRDF):
                    row["table"] = self._brdf(key, material.table)

    def repacked(self, materials: dict[str, Material], used: Iterable[str]) -> MaterialTables | None:
        """These tables with the constants of `materials`, or None where more than constants has changed."""
        if not (set(used) <= self._used and same(self._links, _links(materials))):
            return None
        for row, material in zip(self.materials, materials.values(), strict=True):
            values = material.pack()
            row["values"][: len(values)] = values
        return self

    def slot(self, content: Slot) -> int:
        """Number of the slot with this content."""
        if content not in self.slots:
            self.slots.append(content)
        return self.slots.index(content)

    def fill(self, record: DeviceScene, device: str) -> list[wp.array]:
        """Copy everything to a device and let `record` point to it; returns the arrays, for their owner to keep."""
        record.materials = wp.array(self.materials, dtype=MaterialRecord, device=device)
        record.inputs = _rows(self.inputs, InputRecord, device)
        record.pictures = _rows(self.pool.pictures, PictureRecord, device)
        record.levels = _rows(self.pool.levels, LevelRecord, device)
        # Without a copy on the CPU: nobody writes texels.
        record.texels = wp.array(self.pool.words, dtype=wp.uint32, device=device, copy=False)
        record.tiles = wp.array(np.array(self.tiles, np.int32).reshape(-1), dtype=wp.int32, device=device)
        record.decode = wp.array(srgb_table(), dtype=wp.float32, device=device)
        uploads = [table.upload(device) for table in self.brdfs]
        record.brdfs = wp.empty(0, BrdfRecord, device=device)
        if uploads:
            record.brdfs = wp.array([brdf for brdf, _ in uploads], dtype=BrdfRecord, device=device)
        names = ("materials", "inputs", "pictures", "levels", "texels", "tiles", "decode", "brdfs")
        return [getattr(record, name) for name in names] + [array for _, kept in uploads for array in kept]

    def _brdf(self, owner: str, table: BrdfTable) -> int:
        """Number of a measured BRDF; what is to be said of its data is said for each material."""
        self.warnings += [f"{owner}: {warning}" for warning in table.warnings]
        if table not in self.brdfs:
            self.brdfs.append(table)
        return self.brdfs.index(table)

    def _read_pictures(self, materials: dict[str, Material], budget: int) -> None:
        """Put every picture into the pool once, after working out how small they must be."""
        wanted: dict[tuple, tuple[str, Texture, object]] = {}
        sizes = []
        for key, material in materials.items():
            for name, source in material.varying().values():
                if not isinstance(source, Texture):
                    continue
                owner = source.prim or f"{key}: {name}"
                for _, file in self._sources(source, owner):
                    if _picture_key(file, source) not in wanted and (size := self._size(file, owner)):
                        wanted[_picture_key(file, source)] = owner, source, file
                        sizes.append(size)
        halvings = halvings_within(sizes, budget)
        for (key, (owner, texture, file)), count in zip(wanted.items(), halvings, strict=True):
            try:
                self._pictures[key] = self.pool.add(as_picture(file), texture.sourceColorSpace, count)
            except ValueError as error:
                self._miss(owner, error)
            if count:
                self.warnings.append(f"{owner}: {texture.name} is halved {count} times to keep textures below {budget}")
        self.pool.close()

    def _sources(self, texture: Texture, owner: str) -> list[tuple[int, object]]:
        sources = list(texture.sources())
        if not sources:
            self._miss(owner, f"{texture.name}: there is no such tile")
        return sources

    def _size(self, file: object, owner: str) -> int:
        try:
            return pyramid_bytes(file)
        except ValueError as error:
            self._miss(owner, error)
            return 0

    def _miss(self, owner: str, reason: object) -> None:
        message = f"{owner}: {reason}; its fallback is taken"
        if message not in self.warnings:
            self.warnings.append(message)

    def _link(self, row: np.void, material: Material) -> None:
        """Add the nodes of a material and let its row refer to them."""
        varying = material.varying()
        row["first"] = len(self.inputs)
        for number, (name, source) in varying.items():
            if number != NORMAL:
                # A mean of opacities says nothing of how much of them lies above a threshold: a cut-out has no
                # footprint, the samples of a pixel find the share.
                self._add_node(number, source, float(name != "opacity" or not material.is_cut_out()))
        row["varying"] = len(self.inputs) - row["first"]
        if NORMAL in varying:
            row["normal"] = len(self.inputs)
            self._add_node(NORMAL, varying[NORMAL][1], 1.0)

    def _add_node(self, number: int, source: Varying | tuple, footprint: float) -> None:
        row = np.zeros(1, InputRecord.numpy_dtype())[0]
        row["picture"] = row["tiles"] = row["primvar"] = row["tangents"] = -1
        row["number"], row["footprint"], row["channel"] = number, footprint, 4
        coordinates, linear = "st", (1.0, 0.0, 0.0, 1.0)
        if isinstance(source, Texture):
            self._fill_texture(row, source)
            linear = tuple(source.transform[:, :2].reshape(-1))
            if isinstance(source.st, PrimvarReader):
                coordinates = source.st.varname
        elif isinstance(source, PrimvarReader):
            row["primvar"], row["absent"] = self.slot(_content(source)), _four(source.fallback)
        else:
            row["absent"] = _four(source)
        if number == NORMAL:
            self.slot(coordinates)
            row["tangents"] = self.slot(Tangents(coordinates, linear))
        self.inputs.append(row)

    def _fill_texture(self, row: np.void, texture: Texture) -> None:
        row["channel"] = CHANNELS.index(texture.channel)
        row["absent"] = row["fallback"] = _four(texture.fallback)
        numbers = {tile: self._pictures.get(_picture_key(file, texture), -1) for tile, file in texture.sources()}
        if max(numbers.values(), default=-1) < 0:
            return
        if 0 in numbers:
            row["picture"] = numbers[0]
        else:
            row["tiles"] = TILES * len(self.tiles)
            self.tiles.append(np.array([numbers.get(FIRST_TILE + k, -1) for k in range(TILES)], np.int32))
        row["wrap_s"], row["wrap_t"] = texture.wraps()
        row["scale"], row["bias"] = _four(texture.scale), _four(texture.bias)
        row["linear"], row["offset"] = texture.transform[:, :2], texture.transform[:, 2]
        if isinstance(texture.st, PrimvarReader):
            row["primvar"], row["absent"] = self.slot(_content(texture.st)), _four(texture.st.fallback)
        else:
            row["absent"] = _four(texture.st)


def _links(materials: dict[str, Material]) -> list[object]:
    """All of materials but their constants, for `same`: kinds, what varies, and cut-outs, which have no footprint."""
    links: list[object] = []
    for key, material in materials.items():
        links += [key, type(material), material.is_cut_out(), getattr(material, "table", None)]
        for number, (name, source) in material.varying().items():
            links += [number, name, *(source if isinstance(source, tuple) else [source])]
    return links


def _rows(rows: list, dtype: type, device: str) -> wp.array:
    """Records of tuples in the order of their fields."""
    rows = np.array(rows, dtype.numpy_dtype())
    return wp.array(rows, dtype=dtype, device=device) if len(rows) else wp.empty(0, dtype, device=device)


def _content(reader: PrimvarReader) -> Slot:
    """What a reader needs of a shape: a primvar, or the one that its matrix makes of it."""
    return replace(reader, fallback=()) if reader.matrix else reader.varname


def _picture_key(file: object, texture: Texture) -> tuple:
    return file if isinstance(file, str) else id(file), texture.sourceColorSpace


def _four(numbers: Iterable[float]) -> list[float]:
    return ([float(n) for n in numbers] + [0.0] * 4)[:4]
