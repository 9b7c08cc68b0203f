"""Names of the columns of the thread table, in which kernels see a thread as a row of numbers.

`table.pack_threads` computes the columns in float64, as the model of the thread defines them.
"""

from __future__ import annotations

(
    ALBEDO_R, ALBEDO_G, ALBEDO_B, MODEL, IOR_EXCESS, ISOTROPIC, GAMMA_SURFACE, GAMMA_VOLUME,
    SURFACE_LOBE, _, VOLUME_LOBE, _, POINT_COLUMNS,
) = range(13)  # fmt: skip
"""ALBEDO_ : `A` per channel, clamped to the model's `most_albedo`
MODEL : index into `fabric.MODELS`
IOR_EXCESS : eta^2 - 1
ISOTROPIC : kd
GAMMA_ : standard deviations gs and gv [rad], at least `lobes.NARROWEST`
SURFACE_LOBE, VOLUME_LOBE : first of two constants each of the model's lobes, from its
    `lobe_constants`
POINT_COLUMNS : the number of these columns; the vectorised loops over points copy them for each hit
"""

(
    SURFACE_GAIN, LAW, SURFACE_WIDTH, VOLUME_WIDTH, BRIGHTNESS, INVERSE_T_MAX, COMPLETION_SCALE,
    TRANSMISSION,
) = range(POINT_COLUMNS, POINT_COLUMNS + 8)  # fmt: skip
"""SURFACE_GAIN : ks
LAW : `model.PUBLISHED` or `model.CONSERVING`
SURFACE_WIDTH, VOLUME_WIDTH : standard deviations of theta_i in the samplers' two lobes [rad]
BRIGHTNESS : mean of the albedo's channels, for sampling
INVERSE_T_MAX : 1/T_max, for models with a table
COMPLETION_SCALE : sqrt(2 pi X), by which an entry of the table at COMPLETION becomes x(theta)
TRANSMISSION : first of TRANSMISSION_ENTRIES + 1 columns: T at sqrt(cos theta) from 0 to 1, with the
    last entry repeated; 0 for models without this table
"""

CONSTANTS = TRANSMISSION
"""Number of columns before the table."""

TRANSMISSION_ENTRIES = 721

COMPLETION = TRANSMISSION + TRANSMISSION_ENTRIES + 1
"""First column of a table like that at TRANSMISSION: x/sqrt(2 pi X), what the other two terms lose
of the energy at A = 1; 0 for models without it."""

COLUMNS = COMPLETION + TRANSMISSION_ENTRIES + 1
