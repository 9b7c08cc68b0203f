"""What a Blender user installs: the USD hook, and the thread model as an OSL shader.

Nothing here is imported by fabricusd: these files run inside Blender.
"""
