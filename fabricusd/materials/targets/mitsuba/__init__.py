"""Files for Mitsuba 3: the thread law as a BSDF, and the fabrics that it reads.

`fabricusd_cloth` runs inside Mitsuba and needs nothing else of fabricusd; `export` writes it.
"""
