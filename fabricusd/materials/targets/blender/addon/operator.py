"""File > Import > fabricusd look: the garment, its surfaces and the dome light in one step."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from .build import BEST, LOBES, PRINCIPLED, build, materials_by_path
from .hook import HAS_USD, told
from .looks import Look, LookError, read
from .world import bring_dome

ENDS = (".usda", ".usdc", ".usd", ".usdz")


class ImportFabricusd(bpy.types.Operator, ImportHelper):  # type: ignore[misc]
    """Import a look of fabricusd with its garment and dome light"""

    bl_idname = "import_scene.fabricusd"
    bl_label = "Import fabricusd Look"
    bl_options = {"REGISTER", "UNDO", "PRESET"}  # noqa: RUF012

    filename_ext = ".usda"
    filter_glob: StringProperty(default="*.usda;*.usdc;*.usd;*.usdz", options={"HIDDEN"})  # type: ignore[valid-type]
    surface: EnumProperty(  # type: ignore[valid-type]
        name="Surface",
        items=(
            (BEST, "Best", "Lobes where the look has them, and else the Principled BSDF"),
            (LOBES, "Lobes", "The sum of lobes: the cloth from afar"),
            (PRINCIPLED, "Principled BSDF", "The fitted Principled BSDF, with all textures"),
        ),
        default=BEST,
    )
    lights: BoolProperty(  # type: ignore[valid-type]
        name="Lights",
        description="Bring the lights of the look, its dome light as the world",
        default=True,
    )
    cameras: BoolProperty(  # type: ignore[valid-type]
        name="Cameras",
        description="Bring the cameras; the first becomes the scene's where it has none",
        default=True,
    )
    subdivision: BoolProperty(  # type: ignore[valid-type]
        name="Subdivision",
        description="Subdivide meshes whose subdivision scheme is Catmull-Clark",
        default=True,
    )

    def execute(self, context: Any) -> set[str]:
        """Import the file."""
        stage, why = _stage(self.filepath)
        looks: list[Look] = []
        try:
            looks = read(stage) if stage else []
            if stage and not looks:
                why = "holds no look of fabricusd; write one with 'fabricusd material'"
        except LookError as error:
            why = str(error)
        if why:
            self.report({"ERROR"}, f"{self.filepath} {why}")
            return {"CANCELLED"}
        before = set(bpy.data.materials)
        others = set(bpy.data.objects)
        with told() as prim_map:
            done = bpy.ops.wm.usd_import(**self._settings())
        if "FINISHED" not in done:
            self.report({"ERROR"}, f"{self.filepath} cannot be imported by Blender")
            return {"CANCELLED"}
        if context.scene.camera is None:
            # Blender's import leaves the scene without one, and nothing could be rendered.
            cameras = [o for o in bpy.data.objects if o not in others and o.type == "CAMERA"]
            context.scene.camera = next(iter(cameras), None)
        new = [m for m in bpy.data.materials if m not in before]
        made = build(looks, materials_by_path(looks, prim_map, new), self.surface)
        domed, left_out = bring_dome(stage, context.scene) if self.lights else (False, [])
        self._tell(made.groups, domed, [*made.left_out, *left_out])
        return {"FINISHED"}

    def _settings(self) -> dict[str, Any]:
        """Return the arguments of Blender's own import, those that this Blender knows."""
        known = bpy.ops.wm.usd_import.get_rna_type().properties.keys()
        wanted = {
            "filepath": self.filepath, "import_lights": self.lights,
            "import_cameras": self.cameras, "import_subdivision": self.subdivision,
            "import_subdiv": self.subdivision, "create_world_material": False,
            "mtl_name_collision_mode": "MAKE_UNIQUE",
        }  # fmt: skip
        return {name: value for name, value in wanted.items() if name in known}

    def _tell(self, groups: dict[str, list[Any]], domed: bool, left_out: list[str]) -> None:
        made = ", ".join(f"{name} on {len(on)}" for name, on in groups.items()) or "no fabric"
        self.report({"INFO"}, f"Imported {made}{' and the dome light' if domed else ''}")
        if left_out:
            self.report({"WARNING"}, f"Left out {'; '.join(left_out)}")


def _stage(path: str) -> tuple[Any, str]:
    """Open a stage; return it, or why there is none."""
    if not HAS_USD:
        return None, "cannot be read: this Blender was built without USD; blender.org's has it"
    if not path.lower().endswith(ENDS):
        return None, f"is not the name of a USD file; it must end in {', '.join(ENDS)}"
    try:
        from pxr import Tf, Usd
    except ImportError:
        return None, "cannot be read: Blender's USD modules (pxr) are missing"
    try:
        return Usd.Stage.Open(path), ""
    except Tf.ErrorException as error:
        first = str(error).strip().splitlines()[-1].strip()
        return None, f"cannot be opened as USD: {first}"


def _menu(self: Any, context: Any) -> None:
    self.layout.operator(ImportFabricusd.bl_idname, text="fabricusd look (.usda, .usdz)")


def register() -> None:
    """Register the operator and its menu entry."""
    bpy.utils.register_class(ImportFabricusd)
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister() -> None:
    """Unregister the operator and its menu entry."""
    bpy.types.TOPBAR_MT_file_import.remove(_menu)
    bpy.utils.unregister_class(ImportFabricusd)
