// The surface of the cloth: what it sends of one light, by the kernels above this text.
// Macros: LAW; LEVEL 0 far, 1 weave, 2 thread; PUBLISHED, FACETS, FUZZ: which kernels the fabric needs.
#if LEVEL == 2
# define POINT k_point_value_1
# define FACET k_conserving_level_value_1
#else
# define POINT k_point_value
# define FACET k_conserving_level_value
#endif
uniform ivec4 repeats;  // ends and picks after which the sequences of threads repeat, threads
Place place_here; Hit hit_here; int fuzz_row;

int wrapped_in(float x, int period) {
  int k = int(x) % period;
  return k < 0 ? k + period : k;
}

void look_up(vec2 threads) {
  fuzz_row = repeats.z;
#if LEVEL >= 1
  vec2 whole = floor(threads);
  split_place = threads - whole;
  split_cell = ivec4(
    wrapped_in(whole.x, cloth_grid_n0), wrapped_in(whole.y, cloth_grid_n1),
    wrapped_in(whole.x, repeats.x), wrapped_in(whole.y, repeats.y));
  if (shadow_kinds_n0 == 0) {
    split_entry = ivec2(wrapped_in(whole.x, shadow_table_n0), wrapped_in(whole.y, shadow_table_n1));
  } else {
    int i = wrapped_in(whole.x, shadow_kinds_n0), j = wrapped_in(whole.y, shadow_kinds_n1);
    split_entry = ivec2(0, I(shadow_kinds_at + i * shadow_kinds_n1 + j));
  }
  T_iiffff t = k_thread_at(
    split_cell.x, split_cell.y, split_cell.z, split_cell.w, split_place.x, split_place.y);
  place_here = Place(t.m0_, t.m1_, t.m4_, t.m3_, 1.0);
  hit_here = Hit(t.m0_, t.m1_, t.m2_, t.m3_, t.m5_);
  fuzz_row = t.m0_ > 1 ? -1 : t.m1_;
#endif
}

// Radiance towards wo per unit of L_i dwi, cosine included; both directions in the surface frame.
vec3 cloth(vec3 wi, vec3 wo) {
  vec3 f = vec3(0.0);
  if (wi.z <= 0.0 || wo.z <= 0.0) return f;
#if PUBLISHED
# if LEVEL == 0
  T_fff a = k_far_value(wi.x, wi.y, wi.z, wo.x, wo.y, wo.z);
  f += vec3(a.m0_, a.m1_, a.m2_);
# else
  if (place_here.thread_set_ < 2) {
    T_fff a = POINT(place_here, wi.x, wi.y, wi.z, wo.x, wo.y, wo.z);
    f += vec3(a.m0_, a.m1_, a.m2_);
  }
# endif
#endif
#if FACETS
# if LEVEL == 0
  T_fff b = k_conserving_value(wi.x, wi.y, wi.z, wo.x, wo.y, wo.z);
# else
  T_fff b = FACET(place_here, wi.x, wi.y, wi.z, wo.x, wo.y, wo.z);
# endif
  f += vec3(b.m0_, b.m1_, b.m2_);
#endif
#if LEVEL >= 1
  f *= k_shade(split_place.x, split_place.y, hit_here, wi.x, wi.y, wi.z);
#endif
#if FUZZ
  T_fff c = k_fuzz_over(fuzz_row, wi.x, wi.y, wi.z, wo.x, wo.y, wo.z, f.r, f.g, f.b);
  f = vec3(c.m0_, c.m1_, c.m2_);
#endif
  return f;
}
