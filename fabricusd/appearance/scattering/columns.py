"""A thread as a row of numbers of precision R: the names of its columns.

`table.pack_threads` fills them, in float64, from what the thread's model says of it.
"""

from __future__ import annotations

(
    ALBEDO_R, ALBEDO_G, ALBEDO_B, MODEL, IOR_EXCESS, ISOTROPIC, GAMMA_SURFACE, GAMMA_VOLUME,
    SURFACE_LOBE, _, VOLUME_LOBE, _, POINT_COLUMNS,
) = range(13)  # fmt: skip
"""ALBEDO_ : `A` per channel, clamped where the model says so
MODEL : index into `fabric.MODELS`
IOR_EXCESS : eta^2 - 1
ISOTROPIC : kd
GAMMA_ : standard deviations gs and gv [rad], at least `lobes.NARROWEST`
SURFACE_LOBE, VOLUME_LOBE : first of two numbers each that the model's lobes need, by its
    `lobe_constants`
POINT_COLUMNS : how many columns these are; the vectorised loops over points copy them hit by hit
"""

(
    SURFACE_GAIN, LAW, SURFACE_WIDTH, VOLUME_WIDTH, BRIGHTNESS, INVERSE_T_MAX, COMPLETION_SCALE,
    TRANSMISSION,
) = range(POINT_COLUMNS, POINT_COLUMNS + 8)  # fmt: skip
"""SURFACE_GAIN : ks
LAW : `model.PUBLISHED` or `model.CONSERVING`
SURFACE_WIDTH, VOLUME_WIDTH : deviations of theta_i that the samplers give the two lobes [rad]
BRIGHTNESS : mean of the albedo's channels, for sampling
INVERSE_T_MAX : 1/T_max, for models with a table
COMPLETION_SCALE : sqrt(2 pi X), by which an entry of the table from COMPLETION on is x(theta)
TRANSMISSION : first of TRANSMISSION_ENTRIES + 1 columns: T over sqrt(cos theta) from 0 to 1, the
    last one repeated; 0 for models without that table
"""

CONSTANTS = TRANSMISSION
"""Columns before the table."""

TRANSMISSION_ENTRIES = 721

COMPLETION = TRANSMISSION + TRANSMISSION_ENTRIES + 1
"""First column of a table like that at TRANSMISSION: x/sqrt(2 pi X), what the other two terms lose
of the energy at A = 1; 0 for models without it."""

COLUMNS = COMPLETION + TRANSMISSION_ENTRIES + 1
