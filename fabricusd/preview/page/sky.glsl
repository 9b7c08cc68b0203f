// Directions to the sky, in the frame of the cloth: every other one along the highlight of the
// thread, and weighed by the density of both kinds together [Veach1997].
const float HALF_TURN = 3.141592654;

// Above the cloth: half evenly, half by the cosine.
vec3 drawn_above(vec2 u) {
  float z = 0.5 * (sqrt(1.0 + 8.0 * u.x) - 1.0), level = sqrt(max(1.0 - z * z, 0.0)), turn = 2.0 * HALF_TURN * u.y;
  return vec3(level * cos(turn), level * sin(turn), z);
}
float density_above(vec3 w) { return (0.25 + 0.5 * w.z) / HALF_TURN; }

#if LEVEL == 0
float density_of_sky(vec3 w) { return density_above(w); }
vec4 drawn_sky(vec2 u, bool along) {
  vec3 w = drawn_above(u);
  return vec4(w, density_of_sky(w));
}
void find_highlight(vec3 wo) {}
#else
# if PUBLISHED
#  define ROW(k) F(published_threads_at + hit_here.thread_ * published_threads_n1 + k)
# else
#  define ROW(k) F(conserving_threads_at + hit_here.thread_ * conserving_threads_n1 + k)
# endif
// Of the cosine along the thread: a Cauchy distribution about the mirror's, cut off where nothing
// is above the cloth. Its tails hold the wider lobes too. The sine of the azimuth is even.
struct Highlight { float c, s, mean, width, low, high; };
Highlight highlight;
bool on_thread;

void find_highlight(vec3 wo) {
  on_thread = hit_here.thread_set_ < 2;
  if (!on_thread) return;
  float angle = clamp(place_here.psi0_, -1.55, 1.55), c = cos(angle), s = sin(angle);
  float t = c * (hit_here.thread_set_ == 1 ? wo.y : wo.x) - s * wo.z;
  float low = s < 0.0 ? -c : -1.0, high = s < 0.0 ? 1.0 : c, mean = clamp(-t, low, high);
  float width = max(2.0 * ROW(6) * sqrt(1.0 - min(t * t, 1.0)), 0.03);
  highlight = Highlight(c, s, mean, width, atan((low - mean) / width), atan((high - mean) / width));
}

// The sine of the largest azimuth that is above the cloth.
float widest(float t, float level) {
  float edge = clamp(t * highlight.s / max(highlight.c * level, 1e-6), 0.0, 1.0);
  return sqrt(max(1.0 - edge * edge, 1e-6));
}

vec3 drawn_along(vec2 u) {
  Highlight h = highlight;
  float t = clamp(h.mean + h.width * tan(mix(h.low, h.high, u.x)), -1.0, 1.0), level = sqrt(1.0 - t * t);
  float across = (2.0 * u.y - 1.0) * widest(t, level), b = level * across, n = level * sqrt(1.0 - across * across);
  float x = h.c * t + h.s * n, z = h.c * n - h.s * t;
  return hit_here.thread_set_ == 1 ? vec3(-b, x, z) : vec3(x, b, z);
}

float density_along(vec3 w) {
  Highlight h = highlight;
  float x = hit_here.thread_set_ == 1 ? w.y : w.x;
  float t = h.c * x - h.s * w.z, n = h.s * x + h.c * w.z, level = sqrt(max(1.0 - t * t, 1e-12)), d = t - h.mean;
  return max(n, 0.0) * 0.5 * h.width / (level * widest(t, level) * (h.width * h.width + d * d) * (h.high - h.low));
}

float density_of_sky(vec3 w) {
  return on_thread ? 0.5 * (density_above(w) + density_along(w)) : density_above(w);
}

// A direction, and the density of both kinds there.
vec4 drawn_sky(vec2 u, bool along) {
  vec3 w = drawn_above(u);
  if (along && on_thread) w = drawn_along(u);
  return vec4(w, density_of_sky(w));
}
#endif
