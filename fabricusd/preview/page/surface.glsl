// One pass: some places in each pixel, each with the key light and with directions to the sky.
const int PLACES = 2, MOST_SKIES = 8;
in vec3 place, normal, tangent;
in float hand;
in vec2 metres;
uniform vec3 eye, key, zenith;
uniform float key_power, even, slope, lift;
uniform vec4 lay;                   // threads per metre along u and v, cosine and sine of the grain's turn
uniform vec2 seen_at;               // where in the pixel this pass sees it, from its middle [pixels]
uniform vec4 points[PLACES];        // two numbers for a place, two for a direction to the sky
uniform vec2 coarse[PLACES];        // two more for a place
uniform vec2 repeat;                // threads until the weave repeats
uniform int skies;                  // pairs of directions to the sky with maps of their shadows, or 0
uniform vec3 sky[MOST_SKIES];       // the first of each pair; the second is opposite
uniform mat4 key_map, sky_maps[2 * MOST_SKIES];
uniform highp sampler2DArray depths;  // of the key light, then of the directions to the sky
out vec4 color;

float reaches(mat4 map, int layer, vec3 at) {
  vec3 p = (map * vec4(at, 1.0)).xyz * 0.5 + 0.5;
  vec2 size = vec2(textureSize(depths, 0).xy), t = p.xy * size - 0.5, b = fract(t);
  ivec2 low = ivec2(floor(t)), last = ivec2(size) - 1;
  float total = 0.0;
  for (int k = 0; k < 4; ++k) {
    ivec2 s = ivec2(k & 1, k >> 1), q = clamp(low + s, ivec2(0), last);
    float w = (s.x == 1 ? b.x : 1.0 - b.x) * (s.y == 1 ? b.y : 1.0 - b.y);
    total += p.z <= texelFetch(depths, ivec3(q, layer), 0).r ? w : 0.0;
  }
  return total;
}

// Two numbers in [0, 1) of each pixel, without which all pixels would show moire together [Jarzynski2020].
vec2 of_pixel() {
  uvec2 v = uvec2(gl_FragCoord.xy) * 1664525u + 1013904223u;
  for (int k = 0; k < 2; ++k) {
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16u;
  }
  return vec2(v >> 8u) / 16777216.0;
}

// A place in a tent filter one pixel in radius.
vec2 tented(vec2 u) {
  return mix(1.0 - sqrt(2.0 - 2.0 * u), sqrt(2.0 * u) - 1.0, vec2(lessThan(u, vec2(0.5))));
}

// From a place to the nearest at a share `phase` of the repeat.
vec2 to_phase(vec2 threads, vec2 phase) {
  vec2 off = phase - threads / repeat;
  return repeat * (off - floor(off + 0.5));
}

vec4 seen[MOST_SKIES];  // the direction of each pair that is above the cloth, and the radiance from there

// One of them by chance, where the cloth is likely to send it on, and its weight [Talbot2005].
vec4 one_seen(float u) {
  float total = 0.0, chosen = 1.0;
  vec3 w = vec3(0.0, 0.0, 1.0);
  for (int k = 0; k < skies; ++k) {
    float density = density_of_sky(seen[k].xyz), part = density * seen[k].w;
    if (part <= 0.0) continue;
    total += part;
    float edge = part / total;
    if (u < edge) { w = seen[k].xyz; chosen = density; u /= edge; } else u = (u - edge) / (1.0 - edge);
  }
  return vec4(w, 2.0 * HALF_TURN * total / (chosen * float(skies)));
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
  // To turn the grain is to turn the frame of the cloth as well.
  mat3 turn = mat3(lay.z, -lay.w, 0.0, lay.w, lay.z, 0.0, 0.0, 0.0, 1.0);
  mat3 local = turn * transpose(mat3(t, v, n));
  vec3 wo = local * o, up = local * zenith, total = vec3(0.0), at = place + n * lift;
  vec2 m = mat2(turn) * metres, m_x = dFdx(m), m_y = dFdy(m);
  // Of many repeats in a pixel, samples are even over one: where in which is of no account.
  bool many = LEVEL > 0 && all(greaterThan((abs(m_x) + abs(m_y)) * lay.xy, 2.0 * repeat));
  vec2 own = of_pixel();
  float share = 1.0 / float(PLACES), lit = key_power;
  if (skies > 0) {
    lit *= reaches(key_map, 0, at);
    for (int k = 0; k < skies; ++k) {
      bool below = dot(n, sky[k]) < 0.0;
      int map = 2 * k + (below ? 1 : 0);
      vec3 w = local * (below ? -sky[k] : sky[k]);
      seen[k] = vec4(w, (even + slope * dot(up, w)) * reaches(sky_maps[map], map + 1, at));
    }
  }
  for (int p = 0; p < PLACES; ++p) {
    vec4 u = points[p];
    vec2 exact = fract(u.xy + own), from = tented(many ? fract(coarse[p] + own.yx) : exact) - seen_at;
    vec2 threads = (m + m_x * from.x + m_y * from.y) * lay.xy;
    if (many) threads += to_phase(threads, exact);
    look_up(threads);
    find_highlight(wo);
    // In a loop, since a compiler of shaders puts in the kernels once for each call.
    for (int k = LEVEL == 0 && p > 0 ? 1 : 0; k < 2; ++k) {
      vec3 wi = local * key;
      float weight = LEVEL == 0 ? lit : lit * share;
      if (k == 1) {
        vec4 drawn = skies > 0 ? one_seen(u.z) : drawn_sky(u.zw, p == 1);
        wi = drawn.xyz;
        weight = share * (skies > 0 ? drawn.w : (even + slope * dot(up, wi)) / drawn.w);
      }
      if (weight > 0.0) total += cloth(wi, wo) * weight;
    }
  }
  color = vec4(total, 1.0);
}
