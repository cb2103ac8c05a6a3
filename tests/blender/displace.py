"""Displaces a proxy in Blender as docs/proxy.md says, and writes the surface as an OBJ.

    blender --background --factory-startup --python-exit-code 1 --python displace.py -- proxy.obj levels out.obj
"""
import sys

import bpy

proxy, levels, out = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()

# Axes as they are in the file: the map's vectors are not turned with the mesh.
if hasattr(bpy.ops.wm, "obj_import"):
    forward = "Y" if "Y" in bpy.ops.wm.obj_import.get_rna_type().properties["forward_axis"].enum_items else "Y_FORWARD"
    up = "Z" if forward == "Y" else "Z_UP"
    bpy.ops.wm.obj_import(filepath=proxy, forward_axis=forward, up_axis=up)
else:
    bpy.ops.import_scene.obj(filepath=proxy, axis_forward="Y", axis_up="Z", split_mode="OFF")
mesh = bpy.context.selected_objects[0]

# Straight subdivision, as many times as the finest tile wants: 2^levels + 1 texels a side.
subdivision = mesh.modifiers.new("Subdivision", "SUBSURF")
subdivision.subdivision_type = "SIMPLE"
subdivision.levels = subdivision.render_levels = int(levels)
subdivision.uv_smooth = "NONE"

image = bpy.data.images.load(proxy.replace(".obj", ".vdm.exr"))
image.colorspace_settings.name = "Non-Color"
texture = bpy.data.textures.new("VDM", "IMAGE")
texture.image = image
texture.use_clamp = False  # or negative displacements become zero
displace = mesh.modifiers.new("Displace", "DISPLACE")
displace.texture = texture
displace.texture_coords = "UV"
displace.direction = "RGB_TO_XYZ"
displace.space = "LOCAL"
displace.mid_level = 0
displace.strength = 1

surface = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
with open(out, "w") as file:
    for vertex in surface.vertices:
        file.write("v %.9g %.9g %.9g\n" % tuple(vertex.co))
    for polygon in surface.polygons:
        file.write("f " + " ".join(str(i + 1) for i in polygon.vertices) + "\n")
