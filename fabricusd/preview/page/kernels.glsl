// Made by `python -m fabricusd.preview.glsl` of the kernels in fabricusd.appearance
#define MASKED 0
#define UNMASKED 1
#define PROJECTED 2
#define VISIBLE 3
ivec4 split_cell; vec2 split_place; ivec2 split_entry;
uniform sampler2D floats;
uniform highp isampler2D ints;
uniform highp usampler2D bytes;
uniform sampler2D quads;
layout(std140) uniform Shapes { ivec4 shapes[72]; };
layout(std140) uniform Numbers { vec4 numbers[18]; };
float F(int k) { return texelFetch(floats, ivec2(k & 2047, k >> 11), 0).r; }
int I(int k) { return texelFetch(ints, ivec2(k & 2047, k >> 11), 0).r; }
int B(int k) { return int(texelFetch(bytes, ivec2(k & 2047, k >> 11), 0).r); }
// `shadow.mean.mean_over`, by four groups at a time.
float mean_of_groups(int at, int here, int beside, float c, float level) {
  float total = 0.0;
  for (int k = 0; k < 6; ++k) {
    int i = at + (here >> 2) + k, j = at + (beside >> 2) + k;
    vec4 a = texelFetch(quads, ivec2(i & 2047, i >> 11), 0);
    vec4 b = texelFetch(quads, ivec2(j & 2047, j >> 11), 0);
    vec4 t = clamp(level - (a + (b - a) * c), 0.0, 1.0);
    total += dot(t * t * (3.0 - 2.0 * t), vec4(1.0));
  }
  return total * 0.041666666666666664;
}
#define published_threads_at shapes[0].x
#define published_threads_n0 shapes[0].y
#define published_threads_n1 shapes[0].z
#define published_nodes_at shapes[2].x
#define published_nodes_n0 shapes[2].y
#define published_nodes_n1 shapes[2].z
#define published_node_thread_at shapes[4].x
#define published_node_thread_n0 shapes[4].y
#define published_published_at shapes[6].x
#define published_published_n0 shapes[6].y
#define published_wide_2_at shapes[8].x
#define published_wide_2_n0 shapes[8].y
#define published_tall_2_at shapes[10].x
#define published_tall_2_n0 shapes[10].y
#define published_means_at shapes[12].x
#define published_means_n0 shapes[12].y
#define published_excess_at shapes[14].x
#define published_excess_n0 shapes[14].y
#define published_shares_at shapes[16].x
#define published_shares_n0 shapes[16].y
#define conserving_threads_at shapes[18].x
#define conserving_threads_n0 shapes[18].y
#define conserving_threads_n1 shapes[18].z
#define conserving_nodes_at shapes[20].x
#define conserving_nodes_n0 shapes[20].y
#define conserving_nodes_n1 shapes[20].z
#define conserving_node_thread_at shapes[22].x
#define conserving_node_thread_n0 shapes[22].y
#define conserving_scatters_at shapes[24].x
#define conserving_scatters_n0 shapes[24].y
#define conserving_sides_at shapes[26].x
#define conserving_sides_n0 shapes[26].y
#define conserving_sides_n1 shapes[26].z
#define conserving_sides_n2 shapes[26].w
#define conserving_sides_n3 shapes[27].x
#define conserving_gap_at shapes[28].x
#define conserving_gap_n0 shapes[28].y
#define conserving_gap_n1 shapes[28].z
#define conserving_strength_at shapes[30].x
#define conserving_strength_n0 shapes[30].y
#define conserving_strength_n1 shapes[30].z
#define cloth_grid_at shapes[32].x
#define cloth_grid_n0 shapes[32].y
#define cloth_grid_n1 shapes[32].z
#define cloth_runs_at shapes[34].x
#define cloth_runs_n0 shapes[34].y
#define cloth_runs_n1 shapes[34].z
#define cloth_runs_n2 shapes[34].w
#define cloth_runs_n3 shapes[35].x
#define cloth_sequence_at shapes[36].x
#define cloth_sequence_n0 shapes[36].y
#define cloth_sequence_n1 shapes[36].z
#define cloth_width_at shapes[38].x
#define cloth_width_n0 shapes[38].y
#define cloth_rim_at shapes[40].x
#define cloth_rim_n0 shapes[40].y
#define cloth_pitch_at shapes[42].x
#define cloth_pitch_n0 shapes[42].y
#define cloth_curve_start_at shapes[44].x
#define cloth_curve_start_n0 shapes[44].y
#define cloth_curve_start_n1 shapes[44].z
#define cloth_curve_angle_at shapes[46].x
#define cloth_curve_angle_n0 shapes[46].y
#define cloth_curve_angle_n1 shapes[46].z
#define cloth_curve_slope_at shapes[48].x
#define cloth_curve_slope_n0 shapes[48].y
#define cloth_curve_slope_n1 shapes[48].z
#define cloth_pile_at shapes[50].x
#define cloth_pile_n0 shapes[50].y
#define shadow_table_at shapes[52].x
#define shadow_table_n0 shapes[52].y
#define shadow_table_n1 shapes[52].z
#define shadow_table_n2 shapes[52].w
#define shadow_table_n3 shapes[53].x
#define shadow_table_n4 shapes[53].y
#define shadow_kinds_at shapes[54].x
#define shadow_kinds_n0 shapes[54].y
#define shadow_kinds_n1 shapes[54].z
#define shadow_mean_at shapes[56].x
#define shadow_mean_n0 shapes[56].y
#define shadow_piece_first_at shapes[58].x
#define shadow_piece_first_n0 shapes[58].y
#define shadow_piece_first_n1 shapes[58].z
#define shadow_piece_scale_at shapes[60].x
#define shadow_piece_scale_n0 shapes[60].y
#define shadow_piece_scale_n1 shapes[60].z
#define shadow_absolute_at shapes[62].x
#define shadow_absolute_n0 shapes[62].y
#define fuzz_phase_at shapes[64].x
#define fuzz_phase_n0 shapes[64].y
#define fuzz_phase_n1 shapes[64].z
#define fuzz_phase_n2 shapes[64].w
#define fuzz_lost_at shapes[66].x
#define fuzz_lost_n0 shapes[66].y
#define fuzz_up_at shapes[68].x
#define fuzz_up_n0 shapes[68].y
#define fuzz_up_n1 shapes[68].z
#define fuzz_again_at shapes[70].x
#define fuzz_again_n0 shapes[70].y
#define fuzz_again_n1 shapes[70].z
#define published_warp_start int(numbers[0].x)
#define published_gap numbers[1].x
#define published_precision numbers[2].x
#define published_columns int(numbers[3].x)
#define published_lit_rows int(numbers[4].x)
#define published_lit_nodes int(numbers[5].x)
#define published_share_columns int(numbers[6].x)
#define conserving_warp_start int(numbers[7].x)
#define conserving_covered numbers[8].x
#define conserving_opaque int(numbers[9].x)
#define cloth_gap numbers[10].x
#define cloth_last numbers[11].x
#define cloth_tiny numbers[12].x
#define shadow_softness numbers[13].x
#define shadow_mean_columns int(numbers[14].x)
#define shadow_set_stretches int(numbers[15].x)
#define shadow_groups int(numbers[16].x)
#define fuzz_depth numbers[17].x

struct Place { int thread_set_; int thread_; float psi0_; float w_; float shade_; };

struct Hit { int thread_set_; int thread_; float s_; float w_; float length_; };

struct T_fff { float m0_; float m1_; float m2_; };

struct T_ii { int m0_; int m1_; };

T_ii k_node_range(int thread_set) {
  if ((thread_set == 1)) {
    return T_ii(published_warp_start, published_nodes_n0);
  }
  return T_ii(0, published_warp_start);
}

float k_cos_half_difference(float sin_i, float cos_i, float sin_o, float cos_o) {
  float s;
  float c;
  s = (sin_i + sin_o);
  c = (cos_i + cos_o);
  return (0.5 * sqrt(((s * s) + (c * c))));
}

float k_atan2_32(float y, float x) {
  float a;
  float b;
  float low;
  float high;
  float t;
  float z;
  float p;
  float angle;
  a = abs(x);
  b = abs(y);
  low = mix(b, a, (a < b));
  high = mix(a, b, (a < b));
  t = (low / max(high, 1e-37));
  z = (t * t);
  p = (-0.0162828691 + (z * 0.00290351746));
  p = (-0.0753365739 + (z * (0.0430391445 + (z * p))));
  p = (-0.142071315 + (z * (0.106546688 + (z * p))));
  p = (-0.333330939 + (z * (0.199930538 + (z * p))));
  angle = (t + ((t * z) * p));
  angle = mix(angle, (1.57079633 - angle), (a < b));
  angle = mix(angle, (3.14159265 - angle), (x < 0.0));
  return mix(abs(angle), -abs(angle), y < 0.0);
}

float k_acos32(float x) {
  float c;
  float square;
  c = min(max(x, -1.0), 1.0);
  square = ((1.0 - c) * (1.0 + c));
  return k_atan2_32(sqrt(square), c);
}

float k_exp32(float x) {
  float clamped;
  float k;
  float r;
  float p;
  float scale;
  clamped = min(max(x, -87.3), 88.7);
  k = floor(((clamped * 1.44269504) + 0.5));
  r = (clamped - (k * 0.693359375));
  r = (r - (k * -0.00021219444));
  p = (0.00836888243 + (r * 0.00139504768));
  p = (0.166665189 + (r * (0.041666206 + (r * p))));
  p = (1.0 + (r * (1.0 + (r * (0.5 + (r * p))))));
  scale = intBitsToFloat(int(((k + 127.0) * 8388608.0)));
  return mix((p * scale), 0.0, (x < -87.3));
}

float k_overlap(float cos_half) {
  float half_;
  half_ = k_acos32(cos_half);
  return k_exp32((((-published_precision) * half_) * half_));
}

float k_shared(int thread_set, float across_o, float cos_half) {
  return k_overlap(cos_half);
}

float k_nothing_shared(int thread_set, float across_o, float cos_half) {
  return 0.0;
}

float k_shared_1(int thread_set, float across_o, float cos_half) {
  float wide_2;
  wide_2 = max(F(published_wide_2_at + thread_set), 1e-12);
  return (((F(published_tall_2_at + thread_set) / wide_2) * across_o) * across_o);
}

float k_law_shared(int a2, float a3, float a4) {
#if LAW == MASKED
  return k_shared(a2, a3, a4);
#elif LAW == UNMASKED
  return k_nothing_shared(a2, a3, a4);
#elif LAW == PROJECTED
  return k_shared_1(a2, a3, a4);
#elif LAW == VISIBLE
  return k_shared_1(a2, a3, a4);
#endif
}

struct T_iff { int m0_; float m1_; float m2_; };

T_iff k_no_place(float ox, float oy, float oz) {
  return T_iff(0, 0.0, 0.0);
}

float k_diamond(float x, float y) {
  float part;
  part = (x / max((abs(x) + abs(y)), 1e-30));
  return mix((3.0 + part), (1.0 - part), (y >= 0.0));
}

struct T_if { int m0_; float m1_; };

T_if k_column_of(int columns, float x, float y) {
  float turn;
  int column;
  turn = ((k_diamond(x, y) * 0.25) * float(columns));
  column = max(min(int(turn), (columns - 1)), 0);
  return T_if(column, (turn - float(column)));
}

T_if k_row_of(int rows, float z) {
  float across;
  int row;
  across = (sqrt(max(z, 0.0)) * float((rows - 1)));
  row = max(min(int(across), (rows - 2)), 0);
  return T_if(row, min((across - float(row)), 1.0));
}

T_iff k_view_place(float ox, float oy, float oz) {
  T_if t1;
  int column;
  float c;
  T_if t2;
  int row;
  float r;
  t1 = k_column_of(published_share_columns, ox, oy);
  column = t1.m0_;
  c = t1.m1_;
  t2 = k_row_of(33, oz);
  row = t2.m0_;
  r = t2.m1_;
  return T_iff((((column * 33) + row) * 8), c, r);
}

T_iff k_law_view_place(float a2, float a3, float a4) {
#if LAW == MASKED
  return k_no_place(a2, a3, a4);
#elif LAW == UNMASKED
  return k_no_place(a2, a3, a4);
#elif LAW == PROJECTED
  return k_no_place(a2, a3, a4);
#elif LAW == VISIBLE
  return k_view_place(a2, a3, a4);
#endif
}

struct T_ffff { float m0_; float m1_; float m2_; float m3_; };

T_ffff k_all_visible(int thread_set, int entry, float c, float r) {
  return T_ffff(1.0, 0.0, 0.0, 0.0);
}

float k_between(int here, int beside, float c, float r) {
  float low;
  float high;
  low = F(published_shares_at + (here + 0));
  low = (low + ((F(published_shares_at + (beside + 0)) - low) * c));
  high = F(published_shares_at + (here + 8));
  high = (high + ((F(published_shares_at + (beside + 8)) - high) * c));
  return (low + ((high - low) * r));
}

T_ffff k_visible_shares(int thread_set, int entry, float c, float r) {
  int here;
  int beside;
  here = (entry + (thread_set * 4));
  beside = (here + 264);
  return T_ffff(k_between(here, beside, c, r), k_between((here + 1), (beside + 1), c, r), k_between((here + 2), (beside + 2), c, r), k_between((here + 3), (beside + 3), c, r));
}

T_ffff k_law_visible_shares(int a2, int a3, float a4, float a5) {
#if LAW == MASKED
  return k_all_visible(a2, a3, a4, a5);
#elif LAW == UNMASKED
  return k_all_visible(a2, a3, a4, a5);
#elif LAW == PROJECTED
  return k_all_visible(a2, a3, a4, a5);
#elif LAW == VISIBLE
  return k_visible_shares(a2, a3, a4, a5);
#endif
}

struct SetPair { float along_i_; float across_i_; float up_i_; float scale_i_; float along_o_; float across_o_; float up_o_; float scale_o_; float shared_; float seen_0_; float seen_1_; float seen_2_; float seen_4_; };

SetPair k_along_set(int thread_set, float ix, float iy, float iz, float ox, float oy, float oz) {
  bool warp;
  float a_i;
  float b_i;
  float a_o;
  float b_o;
  float scale_i;
  float scale_o;
  float cos_half;
  float u;
  T_iff t1;
  int entry;
  float c;
  float r;
  T_ffff t2;
  float v0;
  float v1;
  float v2;
  float v4;
  warp = (thread_set == 1);
  a_i = mix(ix, iy, warp);
  b_i = mix(iy, (-ix), warp);
  a_o = mix(ox, oy, warp);
  b_o = mix(oy, (-ox), warp);
  scale_i = (1.0 / sqrt(((a_i * a_i) + (iz * iz))));
  scale_o = (1.0 / sqrt(((a_o * a_o) + (oz * oz))));
  cos_half = k_cos_half_difference((a_i * scale_i), (iz * scale_i), (a_o * scale_o), (oz * scale_o));
  u = k_law_shared(thread_set, b_o, cos_half);
  t1 = k_law_view_place(ox, oy, oz);
  entry = t1.m0_;
  c = t1.m1_;
  r = t1.m2_;
  t2 = k_law_visible_shares(thread_set, entry, c, r);
  v0 = t2.m0_;
  v1 = t2.m1_;
  v2 = t2.m2_;
  v4 = t2.m3_;
  return SetPair(a_i, b_i, iz, scale_i, a_o, b_o, oz, scale_o, u, v0, v1, v2, v4);
}

float k_masked(float x, float y, float u) {
  return ((x * y) + (u * (min(x, y) - (x * y))));
}

float k_weight(float c, float s, SetPair pair) {
  float x;
  float y;
  x = (max(((s * pair.along_i_) + (c * pair.up_i_)), 0.0) * pair.scale_i_);
  y = (max(((s * pair.along_o_) + (c * pair.up_o_)), 0.0) * pair.scale_o_);
  return k_masked(x, y, pair.shared_);
}

float k_weight_1(float c, float s, SetPair pair) {
  return 1.0;
}

float k_weight_2(float c, float s, SetPair pair) {
  float n;
  float seen;
  n = ((s * pair.along_o_) + (c * pair.up_o_));
  seen = max((n + sqrt(((n * n) + pair.shared_))), 0.0);
  return ((0.5 * seen) / max(c, 0.08715574274765814));
}

float k_weight_3(float c, float s, SetPair pair) {
  float square;
  float share;
  square = (s * s);
  share = ((pair.seen_0_ + (s * pair.seen_1_)) + (square * (pair.seen_2_ + (square * pair.seen_4_))));
  return (k_weight_2(c, s, pair) * max(share, 0.01));
}

float k_law_weight(float a2, float a3, SetPair a4) {
#if LAW == MASKED
  return k_weight(a2, a3, a4);
#elif LAW == UNMASKED
  return k_weight_1(a2, a3, a4);
#elif LAW == PROJECTED
  return k_weight_2(a2, a3, a4);
#elif LAW == VISIBLE
  return k_weight_3(a2, a3, a4);
#endif
}

float k_cos_inclination(float y, float z) {
  return sqrt(((y * y) + (z * z)));
}

struct T_ff { float m0_; float m1_; };

T_ff k_unit_azimuth(float y, float z, float cos_theta) {
  bool along;
  float scale;
  along = (cos_theta <= 1e-30);
  scale = (1.0 / max(cos_theta, 1e-30));
  return T_ff(mix((y * scale), 0.0, along), mix((z * scale), 1.0, along));
}

float k_mask(float cos_phi_i, float cos_phi_o, float cos_half) {
  return k_masked(max(cos_phi_i, 0.0), max(cos_phi_o, 0.0), k_overlap(cos_half));
}

float k_no_mask(float cos_phi_i, float cos_phi_o, float cos_half) {
  return 1.0;
}

float k_law_mask(float a2, float a3, float a4) {
#if LAW == MASKED
  return k_mask(a2, a3, a4);
#elif LAW == UNMASKED
  return k_no_mask(a2, a3, a4);
#elif LAW == PROJECTED
  return k_no_mask(a2, a3, a4);
#elif LAW == VISIBLE
  return k_no_mask(a2, a3, a4);
#endif
}

float k_cos2_difference_inclination(float sin_i, float cos_i, float sin_o, float cos_o) {
  float s;
  float c;
  s = (sin_i + sin_o);
  c = (cos_i + cos_o);
  return (0.25 * ((s * s) + (c * c)));
}

T_ff k_fresnel(float excess, float c) {
  float g;
  float inverse;
  float r_s;
  float p;
  float inverse_p;
  float reflected;
  float transmitted;
  c = max(c, 1e-12);
  g = sqrt((excess + (c * c)));
  inverse = (1.0 / ((c + g) * (c + g)));
  r_s = (excess * inverse);
  p = (c + (excess * c));
  inverse_p = (1.0 / ((p + g) * (p + g)));
  reflected = (0.5 * ((r_s * r_s) + (((p - g) * (p - g)) * inverse_p)));
  transmitted = ((2.0 * g) * ((c * inverse) + (p * inverse_p)));
  return T_ff(reflected, transmitted);
}

float k_compressed(float cos2_d) {
  return (1.0 / max(cos2_d, 1e-06));
}

float k_spread(float cos_i, float cos_o) {
  return (1.0 / max((cos_i + cos_o), 0.001));
}

T_ff k_factors(int row, float sin_i, float cos_i, float sin_o, float cos_o, float cos_half) {
  float cos2_d;
  T_ff t1;
  float reflected;
  float once;
  float scale;
  cos2_d = k_cos2_difference_inclination(sin_i, cos_i, sin_o, cos_o);
  t1 = k_fresnel(F(published_threads_at + (row) * published_threads_n1 + 4), (sqrt(cos2_d) * cos_half));
  reflected = t1.m0_;
  once = t1.m1_;
  scale = k_compressed(cos2_d);
  return T_ff(((reflected * cos_half) * scale), (((once * once) * scale) * k_spread(cos_i, cos_o)));
}

T_ff k_half_inclination_legs(float sin_i, float cos_i, float sin_o, float cos_o) {
  float d;
  float s;
  float c;
  bool opposite;
  float turned;
  d = (sin_i - sin_o);
  s = (sin_i + sin_o);
  c = (cos_i + cos_o);
  opposite = (abs(d) > c);
  turned = mix((cos_i - cos_o), (cos_o - cos_i), (d > 0.0));
  return T_ff(mix(s, turned, opposite), mix(c, abs(d), opposite));
}

float k_cos2_half_inclination(float sin_i, float cos_i, float sin_o, float cos_o) {
  T_ff t1;
  float y;
  float x;
  t1 = k_half_inclination_legs(sin_i, cos_i, sin_o, cos_o);
  y = t1.m0_;
  x = t1.m1_;
  return ((x * x) / ((x * x) + (y * y)));
}

T_ff k_factors_1(int row, float sin_i, float cos_i, float sin_o, float cos_o, float cos_half) {
  float excess;
  float cos2_h;
  T_ff t1;
  float reflected;
  T_ff t2;
  float entering;
  T_ff t3;
  float leaving;
  float scale;
  excess = F(published_threads_at + (row) * published_threads_n1 + 4);
  cos2_h = k_cos2_half_inclination(sin_i, cos_i, sin_o, cos_o);
  t1 = k_fresnel(excess, (sqrt(cos2_h) * cos_half));
  reflected = t1.m0_;
  t2 = k_fresnel(excess, cos_i);
  entering = t2.m1_;
  t3 = k_fresnel(excess, cos_o);
  leaving = t3.m1_;
  scale = k_compressed(k_cos2_difference_inclination(sin_i, cos_i, sin_o, cos_o));
  return T_ff(((reflected * cos_half) * scale), (((entering * leaving) * scale) * k_spread(cos_i, cos_o)));
}

T_ff k_chosen(int number, int a1, float a2, float a3, float a4, float a5, float a6) {
  if (number == 0) return k_factors_1(a1, a2, a3, a4, a5, a6);
  return k_factors(a1, a2, a3, a4, a5, a6);
}

struct T_ffffffff { float m0_; float m1_; float m2_; float m3_; float m4_; float m5_; float m6_; float m7_; };

T_ffffffff k_factors_2(int model, int row, float c, float s, SetPair pair) {
  float a_i;
  float b_i;
  float iz;
  float a_o;
  float b_o;
  float oz;
  float t_i;
  float n_i;
  float t_o;
  float n_o;
  float cos_i;
  float cos_o;
  T_ff t1;
  float sin_phi_i;
  float cos_phi_i;
  T_ff t2;
  float sin_phi_o;
  float cos_phi_o;
  float cos_half;
  float m;
  T_ff t3;
  float surface;
  float volume;
  a_i = pair.along_i_;
  b_i = pair.across_i_;
  iz = pair.up_i_;
  a_o = pair.along_o_;
  b_o = pair.across_o_;
  oz = pair.up_o_;
  t_i = ((c * a_i) - (s * iz));
  n_i = ((s * a_i) + (c * iz));
  t_o = ((c * a_o) - (s * oz));
  n_o = ((s * a_o) + (c * oz));
  cos_i = k_cos_inclination(b_i, n_i);
  cos_o = k_cos_inclination(b_o, n_o);
  t1 = k_unit_azimuth(b_i, n_i, cos_i);
  sin_phi_i = t1.m0_;
  cos_phi_i = t1.m1_;
  t2 = k_unit_azimuth(b_o, n_o, cos_o);
  sin_phi_o = t2.m0_;
  cos_phi_o = t2.m1_;
  cos_half = k_cos_half_difference(sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o);
  m = (k_law_mask(cos_phi_i, cos_phi_o, cos_half) * cos_i);
  t3 = k_chosen(model, row, t_i, cos_i, t_o, cos_o, cos_half);
  surface = t3.m0_;
  volume = t3.m1_;
  return T_ffffffff(t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, (surface * m), (volume * m));
}

float k_half_inclination(float sin_i, float cos_i, float sin_o, float cos_o) {
  T_ff t1;
  float y;
  float x;
  t1 = k_half_inclination_legs(sin_i, cos_i, sin_o, cos_o);
  y = t1.m0_;
  x = t1.m1_;
  return k_atan2_32(y, x);
}

float k_gaussian(float half_precision, float norm, float x) {
  return (norm * k_exp32((((-half_precision) * x) * x)));
}

T_ff k_gaussian_lobes(int row, float sin_i, float cos_i, float sin_o, float cos_o) {
  float theta_h;
  float kd;
  float g_s;
  float g_v;
  theta_h = k_half_inclination(sin_i, cos_i, sin_o, cos_o);
  kd = F(published_threads_at + (row) * published_threads_n1 + 5);
  g_s = k_gaussian(F(published_threads_at + (row) * published_threads_n1 + 8), F(published_threads_at + (row) * published_threads_n1 + 9), theta_h);
  g_v = k_gaussian(F(published_threads_at + (row) * published_threads_n1 + 10), F(published_threads_at + (row) * published_threads_n1 + 11), theta_h);
  return T_ff(g_s, (((1.0 - kd) * g_v) + kd));
}

T_ff k_chosen_1(int number, int a1, float a2, float a3, float a4, float a5) {
  return k_gaussian_lobes(a1, a2, a3, a4, a5);
}

T_ff k_segment(int model, int row, float c, float s, SetPair pair) {
  T_ffffffff t1;
  float t_i;
  float cos_i;
  float t_o;
  float cos_o;
  float surface;
  float volume;
  T_ff t2;
  float on_surface;
  float on_volume;
  t1 = k_factors_2(model, row, c, s, pair);
  t_i = t1.m0_;
  cos_i = t1.m1_;
  t_o = t1.m3_;
  cos_o = t1.m4_;
  surface = t1.m6_;
  volume = t1.m7_;
  t2 = k_chosen_1(model, row, t_i, cos_i, t_o, cos_o);
  on_surface = t2.m0_;
  on_volume = t2.m1_;
  return T_ff((surface * on_surface), (volume * on_volume));
}

T_ff k_node_terms(int k, SetPair pair) {
  float c;
  float s;
  int row;
  int model;
  c = F(published_nodes_at + (k) * published_nodes_n1 + 0);
  s = F(published_nodes_at + (k) * published_nodes_n1 + 1);
  row = I(published_node_thread_at + k);
  model = int(F(published_threads_at + (row) * published_threads_n1 + 3));
  return k_segment(model, row, c, s, pair);
}

float k_lit_alone(int node, float x, float y, float z) {
  return 1.0;
}

float k_mean_at(int here, int beside, int step_, float c, float r) {
  float low;
  float high;
  low = F(published_means_at + here);
  low = (low + ((F(published_means_at + beside) - low) * c));
  high = F(published_means_at + (here + step_));
  high = (high + ((F(published_means_at + (beside + step_)) - high) * c));
  return (low + ((high - low) * r));
}

float k_lit_alone_1(int node, float x, float y, float z) {
  T_if t1;
  int column;
  float c;
  T_if t2;
  int row;
  float r;
  int nodes;
  int here;
  if ((published_columns == 0)) {
    return 1.0;
  }
  t1 = k_column_of(published_columns, x, y);
  column = t1.m0_;
  c = t1.m1_;
  t2 = k_row_of(published_lit_rows, z);
  row = t2.m0_;
  r = t2.m1_;
  nodes = published_lit_nodes;
  here = ((((column * published_lit_rows) + row) * nodes) + node);
  return k_mean_at(here, (here + (published_lit_rows * nodes)), nodes, c, r);
}

float k_law_lit_alone(int a2, float a3, float a4, float a5) {
#if LAW == MASKED
  return k_lit_alone(a2, a3, a4, a5);
#elif LAW == UNMASKED
  return k_lit_alone_1(a2, a3, a4, a5);
#elif LAW == PROJECTED
  return k_lit_alone_1(a2, a3, a4, a5);
#elif LAW == VISIBLE
  return k_lit_alone_1(a2, a3, a4, a5);
#endif
}

float k_total(float seen, float ox, float oy, float oz) {
  return (seen + (published_gap * oz));
}

float k_by_view(float x, float y, float z) {
  float across;
  float turn;
  int row;
  int column;
  float a;
  float b;
  int near_;
  int far_;
  float low;
  float high;
  across = ((1.0 - sqrt(max(0.0, min(1.0, z)))) * 23.0);
  turn = (k_diamond(x, y) * 8.0);
  row = max(min(int(across), 22), 0);
  column = max(min(int(turn), 31), 0);
  a = (across - float(row));
  b = (turn - float(column));
  near_ = ((row * 33) + column);
  far_ = (near_ + 33);
  low = F(published_excess_at + near_);
  low = (low + ((F(published_excess_at + (near_ + 1)) - low) * b));
  high = F(published_excess_at + far_);
  high = (high + ((F(published_excess_at + (far_ + 1)) - high) * b));
  return (low + ((high - low) * a));
}

float k_excess_at(float x, float y, float z) {
  if ((published_excess_n0 == 1)) {
    return 1.0;
  }
  return k_by_view(x, y, z);
}

float k_total_1(float seen, float ox, float oy, float oz) {
  return k_excess_at(ox, oy, oz);
}

float k_openness(float ox, float oy, float oz) {
  float up_2;
  float weft;
  float warp;
  up_2 = max((oz * oz), 1e-12);
  weft = (F(published_wide_2_at + 0) + (((F(published_tall_2_at + 0) * oy) * oy) / up_2));
  warp = (F(published_wide_2_at + 1) + (((F(published_tall_2_at + 1) * ox) * ox) / up_2));
  return (max(0.0, (1.0 - sqrt(weft))) * max(0.0, (1.0 - sqrt(warp))));
}

float k_total_2(float seen, float ox, float oy, float oz) {
  float most;
  most = k_excess_at(ox, oy, oz);
  return ((seen * most) / (1.0 - k_openness(ox, oy, oz)));
}

float k_total_3(float seen, float ox, float oy, float oz) {
  return (seen * k_by_view(ox, oy, oz));
}

float k_law_total(float a2, float a3, float a4, float a5) {
#if LAW == MASKED
  return k_total(a2, a3, a4, a5);
#elif LAW == UNMASKED
  return k_total_1(a2, a3, a4, a5);
#elif LAW == PROJECTED
  return k_total_2(a2, a3, a4, a5);
#elif LAW == VISIBLE
  return k_total_3(a2, a3, a4, a5);
#endif
}

T_fff k_far_value(float ix, float iy, float iz, float ox, float oy, float oz) {
  float seen;
  float red;
  float green;
  float blue;
  T_ii t1;
  int first;
  int last;
  SetPair pair;
  float p;
  T_ff t2;
  float surface;
  float volume;
  int row;
  float q;
  float inverse;
  if (((iz <= 0.0) || (oz <= 0.0))) {
    return T_fff(0.0, 0.0, 0.0);
  }
  seen = 0.0;
  red = 0.0;
  green = 0.0;
  blue = 0.0;
  for (int thread_set = 0; thread_set < 2; ++thread_set) {
    t1 = k_node_range(thread_set);
    first = t1.m0_;
    last = t1.m1_;
    pair = k_along_set(thread_set, ix, iy, iz, ox, oy, oz);
    for (int k = first; k < last; ++k) {
      p = k_law_weight(F(published_nodes_at + (k) * published_nodes_n1 + 0), F(published_nodes_at + (k) * published_nodes_n1 + 1), pair);
      p = (p * F(published_nodes_at + (k) * published_nodes_n1 + 2));
      seen = (seen + p);
      if (((p == 0.0) || (I(published_published_at + k) == 0))) {
        continue;
      }
      t2 = k_node_terms(k, pair);
      surface = t2.m0_;
      volume = t2.m1_;
      p = (p * k_law_lit_alone(k, ix, iy, iz));
      row = I(published_node_thread_at + k);
      red = (red + (p * (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 0)))));
      green = (green + (p * (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 1)))));
      blue = (blue + (p * (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 2)))));
    }
  }
  q = k_law_total(seen, ox, oy, oz);
  if ((q <= 1e-12)) {
    return T_fff(0.0, 0.0, 0.0);
  }
  inverse = (1.0 / q);
  red = mix((red * inverse), 0.0, (red < 0.0));
  green = mix((green * inverse), 0.0, (green < 0.0));
  blue = mix((blue * inverse), 0.0, (blue < 0.0));
  return T_fff(red, green, blue);
}

float k_normalization(float ix, float iy, float iz, float ox, float oy, float oz) {
  float seen;
  T_ii t1;
  int first;
  int last;
  SetPair pair;
  float p;
  seen = 0.0;
  for (int thread_set = 0; thread_set < 2; ++thread_set) {
    t1 = k_node_range(thread_set);
    first = t1.m0_;
    last = t1.m1_;
    pair = k_along_set(thread_set, ix, iy, iz, ox, oy, oz);
    for (int k = first; k < last; ++k) {
      p = k_law_weight(F(published_nodes_at + (k) * published_nodes_n1 + 0), F(published_nodes_at + (k) * published_nodes_n1 + 1), pair);
      seen = (seen + (F(published_nodes_at + (k) * published_nodes_n1 + 2) * p));
    }
  }
  return k_law_total(seen, ox, oy, oz);
}

T_ff k_quarter_turns(float x) {
  float k;
  float r;
  k = floor(((x * 0.636619772) + 0.5));
  r = (x - (k * 1.5703125));
  r = (r - (k * 0.000483751297));
  return T_ff(k, (r - (k * 7.54978942e-08)));
}

float k_sine_of_turn(float k, float r) {
  float z;
  float s;
  float c;
  float odd;
  float half_;
  float turned;
  z = (r * r);
  s = (0.00833217814 + (z * -0.000195172979));
  s = (r + ((r * z) * (-0.166666549 + (z * s))));
  c = (-0.00138873675 + (z * 2.44384498e-05));
  c = (1.0 + (z * (-0.5 + (z * (0.0416666469 + (z * c))))));
  odd = (k - (2.0 * floor((0.5 * k))));
  half_ = floor((0.5 * k));
  turned = (half_ - (2.0 * floor((0.5 * half_))));
  return ((1.0 - (2.0 * turned)) * mix(s, c, (odd > 0.5)));
}

float k_cos32(float x) {
  T_ff t1;
  float k;
  float r;
  t1 = k_quarter_turns(x);
  k = t1.m0_;
  r = t1.m1_;
  return k_sine_of_turn((k + 1.0), r);
}

float k_sin32(float x) {
  T_ff t1;
  float k;
  float r;
  t1 = k_quarter_turns(x);
  k = t1.m0_;
  r = t1.m1_;
  return k_sine_of_turn(k, r);
}

T_ff k_segment_at(int model, int row, float c, float s, float w, SetPair pair) {
  T_ff t1;
  float surface;
  float volume;
  t1 = k_segment(model, row, c, s, pair);
  surface = t1.m0_;
  volume = t1.m1_;
  return T_ff(surface, volume);
}

T_fff k_point_value(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  int row;
  float q;
  SetPair pair;
  float c;
  float s;
  float p;
  T_ff t1;
  float surface;
  float volume;
  row = place.thread_;
  if (((iz <= 0.0) || (oz <= 0.0) || (F(published_threads_at + (row) * published_threads_n1 + 13) != 0.0))) {
    return T_fff(0.0, 0.0, 0.0);
  }
  q = k_normalization(ix, iy, iz, ox, oy, oz);
  if ((q <= 1e-12)) {
    return T_fff(0.0, 0.0, 0.0);
  }
  pair = k_along_set(place.thread_set_, ix, iy, iz, ox, oy, oz);
  c = k_cos32(place.psi0_);
  s = k_sin32(place.psi0_);
  p = k_law_weight(c, s, pair);
  t1 = k_segment_at(int(F(published_threads_at + (row) * published_threads_n1 + 3)), row, c, s, place.w_, pair);
  surface = t1.m0_;
  volume = t1.m1_;
  p = (p / q);
  surface = (surface * p);
  volume = (volume * (p * place.shade_));
  return T_fff((surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 0))), (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 1))), (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 2))));
}

T_ii k_shape_of() {
  return T_ii((conserving_sides_n1 - 2), (conserving_sides_n2 - 4));
}

float k_asin32(float x) {
  float c;
  float square;
  c = min(max(x, -1.0), 1.0);
  square = ((1.0 - c) * (1.0 + c));
  return k_atan2_32(c, sqrt(square));
}

struct T_iiff { int m0_; int m1_; float m2_; float m3_; };

T_iiff k_cell(int rows, int columns, float x, float y, float z) {
  float t;
  float i;
  float j;
  int row;
  int column;
  t = (k_asin32((k_acos32(z) * 0.6366197723675814)) * 0.6366197723675814);
  i = (t * float((rows - 1)));
  j = (k_atan2_32(y, x) * (float(columns) / 6.283185307179586));
  j = mix(j, (j + float(columns)), (j < 0.0));
  row = int(min(i, float((rows - 2))));
  column = int(j);
  return T_iiff(row, column, (i - float(row)), (j - float(column)));
}

float k_cubic_weight(int k, float t) {
  if ((k == 0)) {
    return ((0.5 * t) * ((t * (2.0 - t)) - 1.0));
  }
  if ((k == 1)) {
    return (1.0 + (((0.5 * t) * t) * ((3.0 * t) - 5.0)));
  }
  if ((k == 2)) {
    return ((0.5 * t) * (1.0 + (t * (4.0 - (3.0 * t)))));
  }
  return (((0.5 * t) * t) * (t - 1.0));
}

T_fff k_side_in(int side, int row, int column, float t, float u) {
  float first;
  float second;
  float third;
  float weight;
  first = 0.0;
  second = 0.0;
  third = 0.0;
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < 4; ++b) {
      weight = (k_cubic_weight(a, t) * k_cubic_weight(b, u));
      first = (first + (weight * F(conserving_sides_at + (((side) * conserving_sides_n1 + (row + a)) * conserving_sides_n2 + (column + b)) * conserving_sides_n3 + 0)));
      second = (second + (weight * F(conserving_sides_at + (((side) * conserving_sides_n1 + (row + a)) * conserving_sides_n2 + (column + b)) * conserving_sides_n3 + 1)));
      third = (third + (weight * F(conserving_sides_at + (((side) * conserving_sides_n1 + (row + a)) * conserving_sides_n2 + (column + b)) * conserving_sides_n3 + 2)));
    }
  }
  return T_fff(max(0.0, first), max(0.0, second), max(0.0, third));
}

T_fff k_side_at(int side, float x, float y, float z) {
  float t1;
  float t2;
  float t3;
  T_ii t4;
  int rows;
  int columns;
  T_iiff t5;
  int row;
  int column;
  float t;
  float u;
  if ((z < 0.0)) {
    t1 = (-x);
    t2 = (-y);
    t3 = (-z);
    x = t1;
    y = t2;
    z = t3;
  }
  t4 = k_shape_of();
  rows = t4.m0_;
  columns = t4.m1_;
  t5 = k_cell(rows, columns, x, y, z);
  row = t5.m0_;
  column = t5.m1_;
  t = t5.m2_;
  u = t5.m3_;
  return k_side_in(side, row, column, t, u);
}

T_fff k_between_sides(float ix, float iy, float iz, float ox, float oy, float oz) {
  int side;
  T_fff t1;
  float surface_i;
  float volume_i;
  float lost_i;
  T_fff t2;
  float surface_o;
  float volume_o;
  float lost_o;
  if (((conserving_sides_n1 == 0) || (iz == 0.0) || (oz == 0.0))) {
    return T_fff(1.0, 1.0, 0.0);
  }
  side = (((iz > 0.0) == (oz > 0.0)) ? 0 : 1);
  t1 = k_side_at(side, ix, iy, iz);
  surface_i = t1.m0_;
  volume_i = t1.m1_;
  lost_i = t1.m2_;
  t2 = k_side_at(side, ox, oy, oz);
  surface_o = t2.m0_;
  volume_o = t2.m1_;
  lost_o = t2.m2_;
  return T_fff((surface_i * surface_o), (volume_i * volume_o), ((lost_i * lost_o) * abs(iz)));
}

float k_facing(float side, float c, float s, float along, float z) {
  return max(0.0, (side * ((s * along) + (c * z))));
}

float k_projected(float x, float y, float z) {
  float side;
  float total;
  float along;
  float c;
  float s;
  side = mix(-1.0, 1.0, (z > 0.0));
  total = 0.0;
  for (int k = 0; k < conserving_nodes_n0; ++k) {
    along = mix(x, y, (k >= conserving_warp_start));
    c = F(conserving_nodes_at + (k) * conserving_nodes_n1 + 0);
    s = F(conserving_nodes_at + (k) * conserving_nodes_n1 + 1);
    total = (total + (F(conserving_nodes_at + (k) * conserving_nodes_n1 + 2) * k_facing(side, c, s, along, z)));
  }
  return total;
}

float k_visible(float x, float y, float z) {
  float up;
  up = abs(z);
  if (((up == 0.0) || (conserving_covered == 0.0))) {
    return 0.0;
  }
  return (1.0 / max(up, (k_projected(x, y, z) / conserving_covered)));
}

T_fff k_to_thread(int thread_set, float cos_psi0, float sin_psi0, float x, float y, float z) {
  bool warp;
  float along;
  float across;
  warp = (thread_set == 1);
  along = mix(x, y, warp);
  across = mix(y, (-x), warp);
  return T_fff(((cos_psi0 * along) - (sin_psi0 * z)), across, ((sin_psi0 * along) + (cos_psi0 * z)));
}

float k_position(float cos_theta) {
  return min((sqrt(cos_theta) * 720.0), 720.0);
}

float k_chosen_2(int number, float a1) {
  return k_position(a1);
}

T_ff k_read(int row, float place) {
  int entry;
  float part;
  float through;
  float lost;
  entry = int(place);
  part = (place - float(entry));
  through = F(conserving_threads_at + (row) * conserving_threads_n1 + (19 + entry));
  lost = F(conserving_threads_at + (row) * conserving_threads_n1 + (741 + entry));
  through = (through + (part * (F(conserving_threads_at + (row) * conserving_threads_n1 + (20 + entry)) - through)));
  lost = (lost + (part * (F(conserving_threads_at + (row) * conserving_threads_n1 + (742 + entry)) - lost)));
  return T_ff(through, lost);
}

T_ff k_chosen_3(int number, int a1, float a2) {
  return k_read(a1, a2);
}

float k_chosen_4(int number, float a1) {
  return k_position(a1);
}

T_ff k_chosen_5(int number, int a1, float a2) {
  return k_read(a1, a2);
}

T_fff k_pair_angles(float iy, float iz, float oy, float oz) {
  float cos_i;
  float cos_o;
  T_ff t1;
  float sin_phi_i;
  float cos_phi_i;
  T_ff t2;
  float sin_phi_o;
  float cos_phi_o;
  cos_i = k_cos_inclination(iy, iz);
  cos_o = k_cos_inclination(oy, oz);
  t1 = k_unit_azimuth(iy, iz, cos_i);
  sin_phi_i = t1.m0_;
  cos_phi_i = t1.m1_;
  t2 = k_unit_azimuth(oy, oz, cos_o);
  sin_phi_o = t2.m0_;
  cos_phi_o = t2.m1_;
  return T_fff(cos_i, cos_o, k_cos_half_difference(sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o));
}

T_ff k_factors_3(int row, float sin_i, float cos_i, float sin_o, float cos_o, float cos_half) {
  float cos2_d;
  T_ff t1;
  float reflected;
  cos2_d = k_cos2_difference_inclination(sin_i, cos_i, sin_o, cos_o);
  t1 = k_fresnel(F(conserving_threads_at + (row) * conserving_threads_n1 + 4), (sqrt(cos2_d) * cos_half));
  reflected = t1.m0_;
  reflected = min(1.0, (F(conserving_threads_at + (row) * conserving_threads_n1 + 12) * reflected));
  return T_ff((((0.25 * reflected) * cos_half) / max(max(cos_i, cos_o), 1e-06)), 1.0);
}

T_ff k_chosen_6(int number, int a1, float a2, float a3, float a4, float a5, float a6) {
  return k_factors_3(a1, a2, a3, a4, a5, a6);
}

float k_i0e32(float x) {
  float near_x;
  float z;
  float p;
  float near_;
  float t;
  float far_;
  near_x = min(x, 6.0);
  z = (near_x * near_x);
  p = (2.07498059e-12 + (z * 1.45854529e-14));
  p = (6.76279675e-08 + (z * (4.81476738e-10 + (z * p))));
  p = (0.000434017505 + (z * (6.78359057e-06 + (z * p))));
  p = (0.249999977 + (z * (0.015625026 + (z * p))));
  near_ = ((1.0 + (z * p)) * k_exp32((-near_x)));
  t = (1.0 / max(x, 6.0));
  p = (-0.0722954579 + (t * 0.572700066));
  p = (0.0276126165 + (t * (0.0402138482 + (t * p))));
  p = (0.398942266 + (t * (0.0498739974 + (t * p))));
  far_ = (p * sqrt(t));
  return mix(far_, near_, (x < 6.0));
}

float k_longitudinal(float inverse_v, float norm, float sin_i, float cos_i, float sin_o, float cos_o) {
  T_ff t1;
  float y;
  float x;
  float sin2_h;
  float decay;
  t1 = k_half_inclination_legs(sin_i, cos_i, sin_o, cos_o);
  y = t1.m0_;
  x = t1.m1_;
  sin2_h = ((y * y) / ((y * y) + (x * x)));
  decay = k_exp32(((-2.0 * inverse_v) * sin2_h));
  return ((norm * decay) * k_i0e32(((cos_i * cos_o) * inverse_v)));
}

T_ff k_lobes(int row, float sin_i, float cos_i, float sin_o, float cos_o) {
  float k_s;
  float k_v;
  float kd;
  float widest;
  k_s = k_longitudinal(F(conserving_threads_at + (row) * conserving_threads_n1 + 8), F(conserving_threads_at + (row) * conserving_threads_n1 + 9), sin_i, cos_i, sin_o, cos_o);
  k_v = k_longitudinal(F(conserving_threads_at + (row) * conserving_threads_n1 + 10), F(conserving_threads_at + (row) * conserving_threads_n1 + 11), sin_i, cos_i, sin_o, cos_o);
  kd = F(conserving_threads_at + (row) * conserving_threads_n1 + 5);
  widest = max(max(cos_i, cos_o), 1e-06);
  return T_ff(k_s, (((((1.0 - kd) * 0.15915494309189535) * k_v) / widest) + (kd * 0.10132118364233778)));
}

T_ff k_chosen_7(int number, int a1, float a2, float a3, float a4, float a5) {
  return k_lobes(a1, a2, a3, a4, a5);
}

T_ff k_looked_up(int row, float through_i, float lost_i, float through_o, float lost_o) {
  return T_ff(((through_i * through_o) * F(conserving_threads_at + (row) * conserving_threads_n1 + 17)), (lost_i * lost_o));
}

T_ff k_chosen_8(int number, int a1, float a2, float a3, float a4, float a5) {
  return k_looked_up(a1, a2, a3, a4, a5);
}

T_ff k_conserving_terms_read(int row, float first_i, float second_i, float first_o, float second_o, float ix, float iy, float iz, float ox, float oy, float oz) {
  int model;
  T_fff t1;
  float cos_i;
  float cos_o;
  float cos_half;
  T_ff t2;
  float surface;
  float volume;
  T_ff t3;
  float on_surface;
  float on_volume;
  T_ff t4;
  float scale;
  float added;
  model = int(F(conserving_threads_at + (row) * conserving_threads_n1 + 3));
  t1 = k_pair_angles(iy, iz, oy, oz);
  cos_i = t1.m0_;
  cos_o = t1.m1_;
  cos_half = t1.m2_;
  t2 = k_chosen_6(model, row, ix, cos_i, ox, cos_o, cos_half);
  surface = t2.m0_;
  volume = t2.m1_;
  t3 = k_chosen_7(model, row, ix, cos_i, ox, cos_o);
  on_surface = t3.m0_;
  on_volume = t3.m1_;
  t4 = k_chosen_8(model, row, first_i, second_i, first_o, second_o);
  scale = t4.m0_;
  added = t4.m1_;
  return T_ff((surface * on_surface), (((volume * on_volume) * scale) + added));
}

T_ff k_conserving_terms(int row, float ix, float iy, float iz, float ox, float oy, float oz) {
  int model;
  float cos_i;
  float cos_o;
  T_ff t1;
  float first_i;
  float second_i;
  T_ff t2;
  float first_o;
  float second_o;
  model = int(F(conserving_threads_at + (row) * conserving_threads_n1 + 3));
  cos_i = k_cos_inclination(iy, iz);
  cos_o = k_cos_inclination(oy, oz);
  t1 = k_chosen_3(model, row, k_chosen_2(model, cos_i));
  first_i = t1.m0_;
  second_i = t1.m1_;
  t2 = k_chosen_5(model, row, k_chosen_4(model, cos_o));
  first_o = t2.m0_;
  second_o = t2.m1_;
  return k_conserving_terms_read(row, first_i, second_i, first_o, second_o, ix, iy, iz, ox, oy, oz);
}

T_ff k_facet_terms(int row, int thread_set, float c, float s, float ix, float iy, float iz, float ox, float oy, float oz) {
  T_fff t1;
  float ta;
  float tb;
  float tn;
  T_fff t2;
  float va;
  float vb;
  float vn;
  float seen;
  T_ff t3;
  float surface;
  float volume;
  t1 = k_to_thread(thread_set, c, s, ix, iy, iz);
  ta = t1.m0_;
  tb = t1.m1_;
  tn = t1.m2_;
  t2 = k_to_thread(thread_set, c, s, ox, oy, oz);
  va = t2.m0_;
  vb = t2.m1_;
  vn = t2.m2_;
  seen = (max(0.0, mix((-tn), tn, (iz > 0.0))) * max(0.0, mix((-vn), vn, (oz > 0.0))));
  if ((seen == 0.0)) {
    return T_ff(0.0, 0.0);
  }
  t3 = k_conserving_terms(row, ta, tb, tn, va, vb, vn);
  surface = t3.m0_;
  volume = t3.m1_;
  return T_ff((surface * seen), (volume * seen));
}

T_fff k_conserving_single(float on_surface, float on_volume, float ix, float iy, float iz, float ox, float oy, float oz) {
  float red;
  float green;
  float blue;
  float scale;
  int row;
  T_ff t1;
  float surface;
  float volume;
  float weight;
  float t2;
  float t3;
  red = 0.0;
  green = 0.0;
  blue = 0.0;
  scale = ((k_visible(ix, iy, iz) * k_visible(ox, oy, oz)) * abs(iz));
  if (((conserving_opaque != 0) && ((iz > 0.0) != (oz > 0.0)))) {
    scale = 0.0;
  }
  if ((scale == 0.0)) {
    return T_fff(red, green, blue);
  }
  for (int k = 0; k < conserving_nodes_n0; ++k) {
    if ((I(conserving_scatters_at + k) == 0)) {
      continue;
    }
    row = I(conserving_node_thread_at + k);
    t1 = k_facet_terms(row, ((k >= conserving_warp_start) ? 1 : 0), F(conserving_nodes_at + (k) * conserving_nodes_n1 + 0), F(conserving_nodes_at + (k) * conserving_nodes_n1 + 1), ix, iy, iz, ox, oy, oz);
    surface = t1.m0_;
    volume = t1.m1_;
    weight = (F(conserving_nodes_at + (k) * conserving_nodes_n1 + 2) * scale);
    t2 = (on_surface * surface);
    t3 = (on_volume * volume);
    surface = t2;
    volume = t3;
    red = (red + (weight * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 0)))));
    green = (green + (weight * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 1)))));
    blue = (blue + (weight * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 2)))));
  }
  return T_fff(red, green, blue);
}

T_fff k_conserving_value(float ix, float iy, float iz, float ox, float oy, float oz) {
  T_fff t1;
  float on_surface;
  float on_volume;
  float share;
  T_fff t2;
  float red;
  float green;
  float blue;
  int side;
  t1 = k_between_sides(ix, iy, iz, ox, oy, oz);
  on_surface = t1.m0_;
  on_volume = t1.m1_;
  share = t1.m2_;
  t2 = k_conserving_single(on_surface, on_volume, ix, iy, iz, ox, oy, oz);
  red = t2.m0_;
  green = t2.m1_;
  blue = t2.m2_;
  side = (((iz > 0.0) == (oz > 0.0)) ? 0 : 1);
  return T_fff((red + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 0))), (green + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 1))), (blue + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 2))));
}

T_ii k_beyond(int rows, int columns, int row, int column) {
  int t1;
  int t2;
  if ((row < 0)) {
    t1 = (-row);
    t2 = (column + (columns / 2));
    row = t1;
    column = t2;
  } else {
    if ((row > (rows - 1))) {
      row = ((2 * (rows - 1)) - row);
    }
  }
  return T_ii(row, ((column + columns) % columns));
}

float k_share_in(int row, int column, float t, float u) {
  int rows;
  int columns;
  float total;
  T_ii t1;
  int i;
  int j;
  rows = conserving_gap_n0;
  columns = conserving_gap_n1;
  total = 0.0;
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < 4; ++b) {
      t1 = k_beyond(rows, columns, ((row + a) - 1), ((column + b) - 1));
      i = t1.m0_;
      j = t1.m1_;
      total = (total + ((k_cubic_weight(a, t) * k_cubic_weight(b, u)) * F(conserving_gap_at + (i) * conserving_gap_n1 + j)));
    }
  }
  return max(0.0, total);
}

float k_share_at(float x, float y, float z) {
  float t1;
  float t2;
  float t3;
  T_iiff t4;
  int row;
  int column;
  float t;
  float u;
  if ((z < 0.0)) {
    t1 = (-x);
    t2 = (-y);
    t3 = (-z);
    x = t1;
    y = t2;
    z = t3;
  }
  t4 = k_cell(conserving_gap_n0, conserving_gap_n1, x, y, z);
  row = t4.m0_;
  column = t4.m1_;
  t = t4.m2_;
  u = t4.m3_;
  return k_share_in(row, column, t, u);
}

float k_gap_towards(float x, float y, float z) {
  if ((conserving_gap_n0 == 0)) {
    return (1.0 - conserving_covered);
  }
  return min(1.0, k_share_at(x, y, z));
}

float k_share_of_closed(float open_to_it) {
  float closed;
  closed = max(0.0, ((1.0 - conserving_covered) - open_to_it));
  return mix(0.0, (closed / (1.0 - open_to_it)), (closed > 0.0));
}

float k_share_of_gaps(float x, float y, float z) {
  return k_share_of_closed(k_gap_towards(x, y, z));
}

T_fff k_conserving_point_single(Place place, float on_surface, float on_volume, float ix, float iy, float iz, float ox, float oy, float oz) {
  int row;
  float scale;
  float angle;
  float c;
  float s;
  T_ff t1;
  float surface;
  float volume;
  float t2;
  float t3;
  row = place.thread_;
  scale = ((k_visible(ix, iy, iz) * k_visible(ox, oy, oz)) * abs(iz));
  if (((conserving_opaque != 0) && ((iz > 0.0) != (oz > 0.0)))) {
    scale = 0.0;
  }
  if (((scale == 0.0) || (F(conserving_threads_at + (row) * conserving_threads_n1 + 13) != 1.0))) {
    return T_fff(0.0, 0.0, 0.0);
  }
  angle = min(max(place.psi0_, -1.4835298641951802), 1.4835298641951802);
  c = k_cos32(angle);
  s = k_sin32(angle);
  t1 = k_facet_terms(row, place.thread_set_, c, s, ix, iy, iz, ox, oy, oz);
  surface = t1.m0_;
  volume = t1.m1_;
  volume = (volume * place.shade_);
  scale = (scale / max(c, 0.08715574274765814));
  t2 = (on_surface * surface);
  t3 = (on_volume * volume);
  surface = t2;
  volume = t3;
  return T_fff((scale * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 0)))), (scale * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 1)))), (scale * (surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 2)))));
}

T_fff k_conserving_point_value(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  T_fff t1;
  float on_surface;
  float on_volume;
  float share;
  T_fff t2;
  float red;
  float green;
  float blue;
  int side;
  t1 = k_between_sides(ix, iy, iz, ox, oy, oz);
  on_surface = t1.m0_;
  on_volume = t1.m1_;
  share = t1.m2_;
  t2 = k_conserving_point_single(place, on_surface, on_volume, ix, iy, iz, ox, oy, oz);
  red = t2.m0_;
  green = t2.m1_;
  blue = t2.m2_;
  side = (((iz > 0.0) == (oz > 0.0)) ? 0 : 1);
  share = (share / conserving_covered);
  return T_fff((red + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 0))), (green + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 1))), (blue + (share * F(conserving_strength_at + (side) * conserving_strength_n1 + 2))));
}

T_fff k_conserving_level_value(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  float in_gaps;
  float share;
  T_fff t1;
  float red;
  float green;
  float blue;
  int row;
  T_fff t2;
  in_gaps = 0.0;
  if ((conserving_covered < 1.0)) {
    in_gaps = min(k_share_of_gaps(ix, iy, iz), k_share_of_gaps(ox, oy, oz));
  }
  if ((place.thread_set_ > 1)) {
    if ((in_gaps == 0.0)) {
      return T_fff(0.0, 0.0, 0.0);
    }
    share = (in_gaps / (1.0 - conserving_covered));
    t1 = k_conserving_value(ix, iy, iz, ox, oy, oz);
    red = t1.m0_;
    green = t1.m1_;
    blue = t1.m2_;
    return T_fff((share * red), (share * green), (share * blue));
  }
  share = (1.0 - in_gaps);
  row = place.thread_;
  t2 = k_conserving_point_value(place, ix, iy, iz, ox, oy, oz);
  red = t2.m0_;
  green = t2.m1_;
  blue = t2.m2_;
  return T_fff((share * red), (share * green), (share * blue));
}

struct T_iiffff { int m0_; int m1_; float m2_; float m3_; float m4_; float m5_; };

T_ff k_seen_run(float rim, int around, float place, float count) {
  bool ended;
  ended = (count > 0.0);
  return T_ff((place + mix(0.0, rim, ended)), mix(float(around), (count + (2.0 * rim)), ended));
}

T_ff k_upper_run(int i, int j, int top) {
  return k_seen_run(F(cloth_rim_at + top), ((top == 1) ? cloth_grid_n1 : cloth_grid_n0), float(I(cloth_runs_at + (((i) * cloth_runs_n1 + j) * cloth_runs_n2 + 0) * cloth_runs_n3 + 0)), float(I(cloth_runs_at + (((i) * cloth_runs_n1 + j) * cloth_runs_n2 + 0) * cloth_runs_n3 + 1)));
}

int k_wrapped(int k, int count) {
  k = ((k < 0) ? (count - 1) : k);
  return ((k >= count) ? 0 : k);
}

T_fff k_hidden_run(float rim, float tiny, int around, bool ahead, float place, float count, float beyond) {
  bool ended;
  bool on_run;
  float endless_start;
  float first;
  float strips;
  float start;
  ended = (count > 0.0);
  on_run = (ended && (place == mix(0.0, (count - 1.0), ahead)));
  endless_start = mix(0.0, ((2.0 * rim) - 1.0), ahead);
  first = mix(endless_start, mix((-rim), (rim - 1.0), ahead), ended);
  strips = max(((2.0 * rim) * mix(float(around), (count - 1.0), ended)), tiny);
  start = mix((((2.0 * rim) * place) + first), mix((beyond + rim), (rim - 1.0), ahead), on_run);
  return T_fff(start, mix(strips, (beyond + (2.0 * rim)), on_run), mix(0.0, 1.0, on_run));
}

T_fff k_lower_run(int i, int j, int top, float over) {
  int which;
  int slot;
  bool ahead;
  int ends;
  int picks;
  int step_;
  int i_next;
  int j_next;
  which = (1 - top);
  slot = (cloth_runs_n2 - 1);
  ahead = (over > 0.5);
  ends = cloth_grid_n0;
  picks = cloth_grid_n1;
  step_ = (ahead ? 1 : -1);
  i_next = k_wrapped((i + ((which == 0) ? step_ : 0)), ends);
  j_next = k_wrapped((j + ((which == 1) ? step_ : 0)), picks);
  return k_hidden_run(F(cloth_rim_at + which), cloth_tiny, ((which == 1) ? picks : ends), ahead, float(I(cloth_runs_at + (((i) * cloth_runs_n1 + j) * cloth_runs_n2 + slot) * cloth_runs_n3 + 0)), float(I(cloth_runs_at + (((i) * cloth_runs_n1 + j) * cloth_runs_n2 + slot) * cloth_runs_n3 + 1)), float(I(cloth_runs_at + (((i_next) * cloth_runs_n1 + j_next) * cloth_runs_n2 + 0) * cloth_runs_n3 + 1)));
}

struct T_ifff { int m0_; float m1_; float m2_; float m3_; };

T_ifff k_place_on(int top, float width, float other, float upper_start, float upper_cells, float lower_start, float lower_cells, float x, float y) {
  bool warp;
  float over;
  float along;
  float offset;
  float aside;
  bool on_top;
  bool beside;
  int hit;
  float seen;
  float cells;
  float w;
  float s;
  warp = (top == 1);
  over = mix(y, x, warp);
  along = mix(x, y, warp);
  offset = (over - 0.5);
  aside = (along - 0.5);
  on_top = ((abs(offset) <= (0.5 * width)) && (width > 0.0));
  beside = ((abs(aside) <= (0.5 * other)) && (other > 0.0));
  hit = (on_top ? top : (1 - top));
  seen = mix((lower_start + over), (upper_start + along), on_top);
  cells = mix(lower_cells, upper_cells, on_top);
  w = ((2.0 * mix(aside, offset, on_top)) / max(mix(other, width, on_top), cloth_tiny));
  s = max(0.0, min((seen / cells), cloth_last));
  w = max(-1.0, min(mix(w, (-w), (hit == 1)), 1.0));
  return T_ifff(((on_top || beside) ? hit : 2), s, w, cells);
}

int k_piece_of(int thread, float s) {
  int k;
  int pieces;
  int step_;
  k = 0;
  pieces = cloth_curve_start_n1;
  if ((pieces <= 32)) {
    for (int p = 1; p < pieces; ++p) {
      k = (k + int((s >= F(cloth_curve_start_at + (thread) * cloth_curve_start_n1 + p))));
    }
    return k;
  }
  step_ = (pieces >> 1);
  while ((step_ > 0)) {
    k = (k + ((s >= F(cloth_curve_start_at + (thread) * cloth_curve_start_n1 + (k + step_))) ? step_ : 0));
    step_ = (step_ >> 1);
  }
  return k;
}

float k_angle_of(int thread, int k, float s) {
  return (F(cloth_curve_angle_at + (thread) * cloth_curve_angle_n1 + k) + ((s - F(cloth_curve_start_at + (thread) * cloth_curve_start_n1 + k)) * F(cloth_curve_slope_at + (thread) * cloth_curve_slope_n1 + k)));
}

float k_angle_on(int thread, float s) {
  return k_angle_of(thread, k_piece_of(thread, s), s);
}

T_iiffff k_thread_at(int i, int j, int end, int pick, float x, float y) {
  float nan;
  int top;
  T_ff t1;
  float upper_start;
  float upper_cells;
  T_fff t2;
  float lower_start;
  float lower_cells;
  float rises;
  T_ifff t3;
  int which;
  float s;
  float w;
  float cells;
  int thread;
  if (!((x >= 0.0))) {
    nan = intBitsToFloat(0x7fc00000);
    return T_iiffff(0, 0, nan, nan, nan, nan);
  }
  top = I(cloth_grid_at + (i) * cloth_grid_n1 + j);
  t1 = k_upper_run(i, j, top);
  upper_start = t1.m0_;
  upper_cells = t1.m1_;
  t2 = k_lower_run(i, j, top, mix(y, x, (top == 1)));
  lower_start = t2.m0_;
  lower_cells = t2.m1_;
  rises = t2.m2_;
  t3 = k_place_on(top, F(cloth_width_at + top), F(cloth_width_at + (1 - top)), upper_start, upper_cells, lower_start, lower_cells, x, y);
  which = t3.m0_;
  s = t3.m1_;
  w = t3.m2_;
  cells = t3.m3_;
  if ((which == 2)) {
    return T_iiffff(2, 0, 0.0, 0.0, 0.0, 0.0);
  }
  thread = I(cloth_sequence_at + (which) * cloth_sequence_n1 + ((which == 1) ? end : pick));
  return T_iiffff(which, thread, s, w, k_angle_on(thread, s), ((cells * F(cloth_pitch_at + (1 - which))) * mix(rises, 1.0, (which == top))));
}

struct T_iiiiff { int m0_; int m1_; int m2_; int m3_; float m4_; float m5_; };

T_if k_rows_of_texels(bool on_top, float along, float over, float width, int count, float tiny) {
  bool behind;
  float strip;
  float place;
  int half_;
  int rows;
  float x;
  int k;
  behind = (over > 0.5);
  strip = max((0.5 * (1.0 - width)), tiny);
  place = mix((mix(over, (over - (1.0 - strip)), behind) / strip), along, on_top);
  half_ = (count / 2);
  rows = (on_top ? count : half_);
  x = max(0.0, min(((place * float(rows)) - 0.5), float((rows - 1))));
  k = min(int(x), max((rows - 2), 0));
  return T_if((k + ((behind && !(on_top)) ? half_ : 0)), (x - float(k)));
}

float k_between_1(int i, int j, int slot, int row, int first, int second, float c) {
  float low;
  low = float(B(shadow_table_at + ((((i) * shadow_table_n1 + j) * shadow_table_n2 + slot) * shadow_table_n3 + row) * shadow_table_n4 + first));
  return (low + ((float(B(shadow_table_at + ((((i) * shadow_table_n1 + j) * shadow_table_n2 + slot) * shadow_table_n3 + row) * shadow_table_n4 + second)) - low) * c));
}

float k_horizon_at(float u, float v, int which, float x, float y) {
  T_iiiiff t1;
  int i;
  int j;
  float p;
  float q;
  T_ii t2;
  int in_u;
  int in_v;
  int top;
  float along;
  float over;
  float width;
  bool on_top;
  int slot;
  T_if t3;
  int row;
  float a;
  int azimuths;
  float turn;
  int first;
  float c;
  int second;
  float near_;
  float far_;
  t1 = T_iiiiff(split_cell.x, split_cell.y, split_cell.z, split_cell.w, split_place.x, split_place.y);
  i = t1.m0_;
  j = t1.m1_;
  p = t1.m4_;
  q = t1.m5_;
  t2 = T_ii(split_entry.x, split_entry.y);
  in_u = t2.m0_;
  in_v = t2.m1_;
  top = I(cloth_grid_at + (i) * cloth_grid_n1 + j);
  along = mix(p, q, (top == 1));
  over = mix(q, p, (top == 1));
  width = F(cloth_width_at + top);
  on_top = (which == top);
  slot = (on_top ? 0 : (shadow_table_n2 - 1));
  t3 = k_rows_of_texels(on_top, along, over, width, shadow_table_n3, cloth_tiny);
  row = t3.m0_;
  a = t3.m1_;
  azimuths = shadow_table_n4;
  turn = (k_diamond(x, y) * (0.25 * float(azimuths)));
  first = min(int(turn), (azimuths - 1));
  c = (turn - float(first));
  second = (((first + 1) < azimuths) ? (first + 1) : 0);
  near_ = k_between_1(in_u, in_v, slot, row, first, second, c);
  far_ = k_between_1(in_u, in_v, slot, (row + 1), first, second, c);
  return ((near_ + ((far_ - near_) * a)) * 0.00392156862745098);
}

float k_above_horizon(float sine, float flat_, float z) {
  return ((z * sqrt(max(0.0, (1.0 - (sine * sine))))) - (flat_ * sine));
}

float k_soft_edge(float above, float softness) {
  float t;
  t = max(0.0, min(1.0, ((above / softness) + 0.5)));
  return ((t * t) * (3.0 - (2.0 * t)));
}

float k_lit(float u, float v, Hit hit, float x, float y, float z) {
  float flat_;
  int which;
  int thread;
  float sine;
  flat_ = sqrt(((x * x) + (y * y)));
  which = hit.thread_set_;
  thread = hit.thread_;
  if (!(((hit.s_ >= 0.0) && (flat_ < 2.0) && (z < 2.0)))) {
    return intBitsToFloat(0x7fc00000);
  }
  if ((z <= 0.0)) {
    return 0.0;
  }
  if (((which == 2) || (I(cloth_pile_at + thread) != 0))) {
    return 1.0;
  }
  if ((flat_ <= (1e-06 * z))) {
    return 1.0;
  }
  sine = k_horizon_at(u, v, which, x, y);
  return k_soft_edge(k_above_horizon(sine, flat_, z), shadow_softness);
}

int k_stretch_of(int which, int thread, float s) {
  int p;
  int part;
  p = k_piece_of(thread, s);
  part = int(((s - F(cloth_curve_start_at + (thread) * cloth_curve_start_n1 + p)) * F(shadow_piece_scale_at + (thread) * shadow_piece_scale_n1 + p)));
  return (((which * shadow_set_stretches) + I(shadow_piece_first_at + (thread) * shadow_piece_first_n1 + p)) + part);
}

float k_level_of(float z, float softness) {
  return ((k_asin32(z) / softness) + 0.5);
}

float k_mean_of(int stretch, float x, float y, float z) {
  int columns;
  T_if t1;
  int column;
  float c;
  int begin;
  float level;
  columns = shadow_mean_columns;
  t1 = k_column_of(columns, x, y);
  column = t1.m0_;
  c = t1.m1_;
  begin = (((stretch * (columns + 1)) + column) * 24);
  level = k_level_of(z, shadow_softness);
  return mean_of_groups(shadow_mean_at, begin, (begin + 24), c, level);
}

float k_mean_lit(Hit hit, float x, float y, float z) {
  int stretch;
  stretch = k_stretch_of(hit.thread_set_, hit.thread_, hit.s_);
  return k_mean_of(stretch, x, y, z);
}

float k_relative(float g, float mean) {
  float scale;
  scale = (1.0 / max(mean, 0.1));
  return ((g * scale) + (1.0 - (mean * scale)));
}

float k_shade(float u, float v, Hit hit, float x, float y, float z) {
  float g;
  bool free;
  g = k_lit(u, v, hit, x, y, z);
  free = ((hit.thread_set_ == 2) || (I(cloth_pile_at + hit.thread_) != 0));
  if ((free || (I(shadow_absolute_at + hit.thread_) != 0) || !((g >= 0.0)))) {
    return g;
  }
  if ((z <= 0.0)) {
    return g;
  }
  return k_relative(g, k_mean_lit(hit, x, y, z));
}

float k_channel(int c, int way, int row, int m, float x, int n, float y, float met_i, float met_o, bool above, int k, float a, float e, float value) {
  float up_i;
  float up_o;
  float kept;
  float p;
  up_i = (F(fuzz_up_at + (m) * fuzz_up_n1 + c) + (x * (F(fuzz_up_at + ((m + 1)) * fuzz_up_n1 + c) - F(fuzz_up_at + (m) * fuzz_up_n1 + c))));
  up_o = (F(fuzz_up_at + (n) * fuzz_up_n1 + c) + (y * (F(fuzz_up_at + ((n + 1)) * fuzz_up_n1 + c) - F(fuzz_up_at + (n) * fuzz_up_n1 + c))));
  kept = ((1.0 - (met_i * (F(fuzz_lost_at + c) + up_i))) * (1.0 - (met_o * (F(fuzz_lost_at + c) + up_o))));
  value = (value * (kept * F(fuzz_again_at + (way) * fuzz_again_n1 + c)));
  if (above) {
    p = F(fuzz_phase_at + ((row) * fuzz_phase_n1 + k) * fuzz_phase_n2 + c);
    value = (value + (e * (p + (a * (F(fuzz_phase_at + ((row) * fuzz_phase_n1 + (k + 1)) * fuzz_phase_n2 + c) - p)))));
  }
  return value;
}

T_fff k_fuzz_over(int row, float ix, float iy, float iz, float ox, float oy, float oz, float r, float g, float b) {
  float mu_i;
  float mu_o;
  float met_i;
  float met_o;
  int last;
  float at_i;
  float at_o;
  int m;
  int n;
  float x;
  float y;
  bool above;
  float a;
  int k;
  float e;
  float dx;
  float dy;
  float dz;
  float sx;
  float sy;
  float sz;
  float half_;
  int way;
  mu_i = abs(iz);
  mu_o = abs(oz);
  met_i = (1.0 - exp(((-fuzz_depth) / max(mu_i, 1e-06))));
  met_o = (1.0 - exp(((-fuzz_depth) / max(mu_o, 1e-06))));
  last = (fuzz_up_n0 - 1);
  at_i = (min(mu_i, 1.0) * float(last));
  at_o = (min(mu_o, 1.0) * float(last));
  m = min(int(at_i), (last - 1));
  n = min(int(at_o), (last - 1));
  x = (at_i - float(m));
  y = (at_o - float(n));
  above = ((row >= 0) && ((iz * oz) > 0.0));
  a = 0.0;
  k = 0;
  e = 0.0;
  if (above) {
    dx = (ix - ox);
    dy = (iy - oy);
    dz = (iz - oz);
    sx = (ix + ox);
    sy = (iy + oy);
    sz = (iz + oz);
    half_ = k_atan2_32(sqrt((((dx * dx) + (dy * dy)) + (dz * dz))), sqrt((((sx * sx) + (sy * sy)) + (sz * sz))));
    a = (half_ * 20.371832715762604);
    k = min(int(a), 31);
    a = (a - float(k));
    e = ((mu_i / (mu_i + mu_o)) * (1.0 - ((1.0 - met_i) * (1.0 - met_o))));
  }
  way = (((iz * oz) > 0.0) ? 0 : 1);
  r = k_channel(0, way, row, m, x, n, y, met_i, met_o, above, k, a, e, r);
  g = k_channel(1, way, row, m, x, n, y, met_i, met_o, above, k, a, e, g);
  b = k_channel(2, way, row, m, x, n, y, met_i, met_o, above, k, a, e, b);
  return T_fff(r, g, b);
}

float k_across_deviation(float gamma_surface) {
  return max(gamma_surface, 0.1);
}

float k_erf32(float x) {
  float a;
  float z;
  float p;
  float near_;
  float b;
  float far_;
  a = abs(x);
  z = (a * a);
  p = (-0.000802084128 + (z * 7.88911952e-05));
  p = (-0.0268544446 + (z * (0.00518953534 + (z * p))));
  p = (-0.376126271 + (z * (0.112836002 + (z * p))));
  near_ = (a * (1.12837917 + (z * p)));
  b = min(a, 4.0);
  p = (-0.000441336377 + (b * 2.16868499e-05));
  p = (-0.0252082567 + (b * (0.00420456187 + (b * p))));
  p = (0.633219893 + (b * (0.108418577 + (b * p))));
  p = (-0.000188040226 + (b * (1.12957842 + (b * p))));
  far_ = (1.0 - k_exp32((-p)));
  return mix(abs(mix(far_, near_, (a < 1.0))), -abs(mix(far_, near_, (a < 1.0))), x < 0.0);
}

T_ff k_across(int row, float w, float sin_phi_i, float cos_phi_i, float sin_phi_o, float cos_phi_o) {
  float y;
  float x;
  float edge;
  float h;
  float beta;
  float scale;
  float ends;
  float z;
  float d;
  y = (sin_phi_i + sin_phi_o);
  x = (cos_phi_i + cos_phi_o);
  edge = mix(mix(0.0, -1.0, (y < 0.0)), 1.0, (y > 0.0));
  h = mix((y / max(sqrt(((x * x) + (y * y))), 1e-06)), edge, (x < 0.0));
  beta = k_across_deviation(F(published_threads_at + (row) * published_threads_n1 + 6));
  scale = (sqrt(0.5) / beta);
  ends = (k_erf32(((1.0 - h) * scale)) + k_erf32(((1.0 + h) * scale)));
  z = ((beta * (sqrt(6.283185307179586) / 4.0)) * ends);
  d = ((w - h) * scale);
  return T_ff((k_exp32(((-d) * d)) / z), (1.0 + ((0.5 * w) * (sin_phi_i + sin_phi_o))));
}

T_ff k_across_at(int row, float w, float b_i, float n_i, float b_o, float n_o) {
  T_ff t1;
  float sin_i;
  float cos_i;
  T_ff t2;
  float sin_o;
  float cos_o;
  t1 = k_unit_azimuth(b_i, n_i, k_cos_inclination(b_i, n_i));
  sin_i = t1.m0_;
  cos_i = t1.m1_;
  t2 = k_unit_azimuth(b_o, n_o, k_cos_inclination(b_o, n_o));
  sin_o = t2.m0_;
  cos_o = t2.m1_;
  return k_across(row, w, sin_i, cos_i, sin_o, cos_o);
}

T_ff k_segment_at_1(int model, int row, float c, float s, float w, SetPair pair) {
  T_ff t1;
  float surface;
  float volume;
  float n_i;
  float n_o;
  T_ff t2;
  float on_surface;
  float on_volume;
  t1 = k_segment(model, row, c, s, pair);
  surface = t1.m0_;
  volume = t1.m1_;
  n_i = ((s * pair.along_i_) + (c * pair.up_i_));
  n_o = ((s * pair.along_o_) + (c * pair.up_o_));
  t2 = k_across_at(row, w, pair.across_i_, n_i, pair.across_o_, n_o);
  on_surface = t2.m0_;
  on_volume = t2.m1_;
  return T_ff((surface * on_surface), (volume * on_volume));
}

T_fff k_point_value_1(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  int row;
  float q;
  SetPair pair;
  float c;
  float s;
  float p;
  T_ff t1;
  float surface;
  float volume;
  row = place.thread_;
  if (((iz <= 0.0) || (oz <= 0.0) || (F(published_threads_at + (row) * published_threads_n1 + 13) != 0.0))) {
    return T_fff(0.0, 0.0, 0.0);
  }
  q = k_normalization(ix, iy, iz, ox, oy, oz);
  if ((q <= 1e-12)) {
    return T_fff(0.0, 0.0, 0.0);
  }
  pair = k_along_set(place.thread_set_, ix, iy, iz, ox, oy, oz);
  c = k_cos32(place.psi0_);
  s = k_sin32(place.psi0_);
  p = k_law_weight(c, s, pair);
  t1 = k_segment_at_1(int(F(published_threads_at + (row) * published_threads_n1 + 3)), row, c, s, place.w_, pair);
  surface = t1.m0_;
  volume = t1.m1_;
  p = (p / q);
  surface = (surface * p);
  volume = (volume * (p * place.shade_));
  return T_fff((surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 0))), (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 1))), (surface + (volume * F(published_threads_at + (row) * published_threads_n1 + 2))));
}

T_ff k_across_1(int row, float w, float sin_phi_i, float cos_phi_i, float sin_phi_o, float cos_phi_o) {
  float y;
  float x;
  float edge;
  float h;
  float beta;
  float scale;
  float ends;
  float z;
  float d;
  y = (sin_phi_i + sin_phi_o);
  x = (cos_phi_i + cos_phi_o);
  edge = mix(mix(0.0, -1.0, (y < 0.0)), 1.0, (y > 0.0));
  h = mix((y / max(sqrt(((x * x) + (y * y))), 1e-06)), edge, (x < 0.0));
  beta = k_across_deviation(F(conserving_threads_at + (row) * conserving_threads_n1 + 6));
  scale = (sqrt(0.5) / beta);
  ends = (k_erf32(((1.0 - h) * scale)) + k_erf32(((1.0 + h) * scale)));
  z = ((beta * (sqrt(6.283185307179586) / 4.0)) * ends);
  d = ((w - h) * scale);
  return T_ff((k_exp32(((-d) * d)) / z), (1.0 + ((0.5 * w) * (sin_phi_i + sin_phi_o))));
}

T_ff k_across_at_1(int row, float w, float b_i, float n_i, float b_o, float n_o) {
  T_ff t1;
  float sin_i;
  float cos_i;
  T_ff t2;
  float sin_o;
  float cos_o;
  t1 = k_unit_azimuth(b_i, n_i, k_cos_inclination(b_i, n_i));
  sin_i = t1.m0_;
  cos_i = t1.m1_;
  t2 = k_unit_azimuth(b_o, n_o, k_cos_inclination(b_o, n_o));
  sin_o = t2.m0_;
  cos_o = t2.m1_;
  return k_across_1(row, w, sin_i, cos_i, sin_o, cos_o);
}

T_fff k_across_value(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  int row;
  float scale;
  float angle;
  float c;
  float s;
  T_ff t1;
  float surface;
  float volume;
  T_fff t2;
  float b_i;
  float n_i;
  T_fff t3;
  float b_o;
  float n_o;
  T_ff t4;
  float across_surface;
  float across_volume;
  T_fff t5;
  float on_surface;
  float on_volume;
  float lost;
  int side;
  row = place.thread_;
  scale = ((k_visible(ix, iy, iz) * k_visible(ox, oy, oz)) * abs(iz));
  if (((conserving_opaque != 0) && ((iz > 0.0) != (oz > 0.0)))) {
    scale = 0.0;
  }
  angle = min(max(place.psi0_, -1.4835298641951802), 1.4835298641951802);
  c = k_cos32(angle);
  s = k_sin32(angle);
  t1 = k_facet_terms(row, place.thread_set_, c, s, ix, iy, iz, ox, oy, oz);
  surface = t1.m0_;
  volume = t1.m1_;
  t2 = k_to_thread(place.thread_set_, c, s, ix, iy, iz);
  b_i = t2.m1_;
  n_i = t2.m2_;
  t3 = k_to_thread(place.thread_set_, c, s, ox, oy, oz);
  b_o = t3.m1_;
  n_o = t3.m2_;
  t4 = k_across_at_1(row, place.w_, b_i, n_i, b_o, n_o);
  across_surface = t4.m0_;
  across_volume = t4.m1_;
  t5 = k_between_sides(ix, iy, iz, ox, oy, oz);
  on_surface = t5.m0_;
  on_volume = t5.m1_;
  lost = t5.m2_;
  scale = (scale / c);
  surface = (surface * ((across_surface * on_surface) * scale));
  volume = (volume * (((across_volume * on_volume) * scale) * place.shade_));
  lost = (lost / conserving_covered);
  side = (((iz > 0.0) == (oz > 0.0)) ? 0 : 1);
  return T_fff(((surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 0))) + (lost * F(conserving_strength_at + (side) * conserving_strength_n1 + 0))), ((surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 1))) + (lost * F(conserving_strength_at + (side) * conserving_strength_n1 + 1))), ((surface + (volume * F(conserving_threads_at + (row) * conserving_threads_n1 + 2))) + (lost * F(conserving_strength_at + (side) * conserving_strength_n1 + 2))));
}

T_fff k_conserving_level_value_1(Place place, float ix, float iy, float iz, float ox, float oy, float oz) {
  float in_gaps;
  float share;
  T_fff t1;
  float red;
  float green;
  float blue;
  int row;
  T_fff t2;
  T_fff t3;
  in_gaps = 0.0;
  if ((conserving_covered < 1.0)) {
    in_gaps = min(k_share_of_gaps(ix, iy, iz), k_share_of_gaps(ox, oy, oz));
  }
  if ((place.thread_set_ > 1)) {
    if ((in_gaps == 0.0)) {
      return T_fff(0.0, 0.0, 0.0);
    }
    share = (in_gaps / (1.0 - conserving_covered));
    t1 = k_conserving_value(ix, iy, iz, ox, oy, oz);
    red = t1.m0_;
    green = t1.m1_;
    blue = t1.m2_;
    return T_fff((share * red), (share * green), (share * blue));
  }
  share = (1.0 - in_gaps);
  row = place.thread_;
  if (((F(conserving_threads_at + (row) * conserving_threads_n1 + 13) == 1.0))) {
    t2 = k_across_value(place, ix, iy, iz, ox, oy, oz);
    red = t2.m0_;
    green = t2.m1_;
    blue = t2.m2_;
  } else {
    t3 = k_conserving_point_value(place, ix, iy, iz, ox, oy, oz);
    red = t3.m0_;
    green = t3.m1_;
    blue = t3.m2_;
  }
  return T_fff((share * red), (share * green), (share * blue));
}
