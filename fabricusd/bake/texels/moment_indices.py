"""Indices of the moments stored per texel."""

AZIMUTHS = 16
PARTS = 4

# A trailing comment starts with the number of entries if there are several. Moments of a thread set
# occur twice, weft first. All moments are means over the whole texel, so that they stay linear;
# gaps count as 0, but as lit in LIT. Maps that describe the threads alone divide by COVER.
COVER = 0
SHARE = 1  # 8: cover of each set in PARTS by its tangent angle: falling gently or steeply along its
#            axis, rising gently or steeply. A hump has all four; their mean angle is none of them.
ANGLE, ANGLE_2 = 9, 17  # 8 each, as SHARE: tangent angle [rad] and its square, times the share
TINT = 25  # 6: the thread's `A`, three channels for each set, times the set's share
SLOPE = 31  # 2: of the height along U and V
SLOPE_2 = 33  # 3: UU, VV, UV
HEIGHT = 36  # [m]
LOBE_2 = 37  # 2: squared slope width of the surface lobe along U, along V
SURFACE, VOLUME, FUZZ = 39, 40, 43  # reflectances, see `reflectance`; VOLUME has three channels
FRESNEL = 44
THROUGH = 45  # 3: transmittance
LIT = 48  # share of the chosen light that arrives
HORIZON = 49  # AZIMUTHS: squared sine of the horizon
BACK_COVER = (
    HORIZON + AZIMUTHS
)  # cover and VOLUME of the back, seen from the back at the same place
BACK_VOLUME = BACK_COVER + 1  # 3
MOMENTS = BACK_VOLUME + 3
