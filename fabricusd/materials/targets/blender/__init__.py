"""Files for Blender: the add-on that imports looks, and the thread model as an OSL shader.

They run inside Blender; `pack` writes the add-on as a file to install.
"""
