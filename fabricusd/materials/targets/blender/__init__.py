"""Files to install in Blender: the USD import hook, and the thread model as an OSL shader.

These files run inside Blender; fabricusd does not import them.
"""
