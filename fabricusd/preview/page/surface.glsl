// One frame: the key light, and one direction of the sky; two where nothing is in their way. Where
// threads are looked up, each pixel has two places, since one holds many threads.
in vec3 place, normal, tangent;
in float hand;
in vec2 metres;
uniform vec3 eye, key, zenith, sky, other_sky;
uniform vec2 other_place;      // from the first place in a pixel to the second, in pixels
uniform float key_power, even, slope, lift;
uniform vec4 lay;              // threads per metre along u and v, cosine and sine of the grain's turn
uniform bool shadows;
uniform mat4 key_map, sky_map;
uniform highp sampler2D key_depth, sky_depth;
out vec4 color;

float reaches(mat4 map, highp sampler2D depth, vec3 at) {
  vec3 p = (map * vec4(at, 1.0)).xyz * 0.5 + 0.5;
  vec2 size = vec2(textureSize(depth, 0)), t = p.xy * size - 0.5, b = fract(t);
  ivec2 low = ivec2(floor(t)), last = ivec2(size) - 1;
  float total = 0.0;
  for (int k = 0; k < 4; ++k) {
    ivec2 s = ivec2(k & 1, k >> 1), q = clamp(low + s, ivec2(0), last);
    float w = (s.x == 1 ? b.x : 1.0 - b.x) * (s.y == 1 ? b.y : 1.0 - b.y);
    total += p.z <= texelFetch(depth, q, 0).r ? w : 0.0;
  }
  return total;
}

void main() {
  vec3 o = normalize(eye - place);
  vec3 face = normalize(cross(dFdx(place), dFdy(place)));
  if (dot(face, o) < 0.0) face = -face;
  vec3 n = normalize(normal);
  // Where the triangle turns its back to the viewer, so does its normal.
  n *= gl_FrontFacing ? 1.0 : -1.0;
  if (dot(n, o) <= 1e-4) n = face;
  vec3 t = normalize(tangent - dot(tangent, n) * n), v = sign(hand) * cross(n, t);
  mat3 local = transpose(mat3(t, v, n));
  vec3 wo = local * o;
  vec2 m = vec2(lay.z * metres.x + lay.w * metres.y, lay.z * metres.y - lay.w * metres.x);
  // To turn the grain is to turn the frame of the cloth as well.
  mat2 turn = mat2(lay.z, -lay.w, lay.w, lay.z);
  wo.xy = turn * wo.xy;
  vec2 beyond = dFdx(m) * other_place.x + dFdy(m) * other_place.y;
#if LEVEL == 0
  const int PLACES = 1, SKIES = 2;
#else
  const int PLACES = 2, SKIES = 1;
#endif
  int skies = shadows ? 1 : SKIES;
  // The sky's directions are even over the sphere, and stand for 4 pi. Without shadows, those below
  // the cloth are turned over, and stand for the half above it.
  float solid = (shadows ? 12.566370614 : 6.283185307) / float(PLACES * skies);
  vec3 total = vec3(0.0), at = place + n * lift;
  // In loops, since a compiler of shaders puts in the kernels once for each call.
  for (int p = 0; p < PLACES; ++p) {
    look_up((p == 0 ? m : m + beyond) * lay.xy);
    for (int k = 0; k <= skies; ++k) {
      vec3 to = k == 0 ? key : k + p == 1 || shadows ? sky : other_sky;
      if (!shadows && k > 0 && dot(n, to) < 0.0) to = -to;
      float lit = k == 0 ? key_power / float(PLACES) : solid * (even + slope * dot(zenith, to));
      if (shadows) lit *= k == 0 ? reaches(key_map, key_depth, at) : reaches(sky_map, sky_depth, at);
      vec3 wi = local * to;
      wi.xy = turn * wi.xy;
      if (lit > 0.0) total += cloth(wi, wo) * lit;
    }
  }
  color = vec4(total, 1.0);
}
