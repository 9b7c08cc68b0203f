// The views of `images.view`: 0 neutral, 1 srgb, 2 aces.
uniform float exposure, ground;
uniform int view;
vec3 neutral(vec3 c) {
  float peak = max(c.r, max(c.g, c.b)), start = 0.8;
  if (peak <= start) return c;
  float room = 1.0 - start, packed = 1.0 - room * room / (peak + room - start);
  float white = 1.0 - 1.0 / (0.15 * (peak - packed) + 1.0);
  return mix(c * packed / peak, vec3(packed), white);
}
vec3 aces(vec3 c) {
  vec3 x = ACES_SCALE * c;
  return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}
// Display light, from 0 to 1, of mean radiance and cover.
vec3 shown(vec4 mean) {
  vec3 c = exp2(exposure) * mean.rgb + (1.0 - mean.a) * ground;
  return clamp(view == 2 ? aces(c) : view == 1 ? c : neutral(c), 0.0, 1.0);
}
vec3 encoded(vec3 c) {
  vec3 high = 1.055 * pow(max(c, vec3(0.0031308)), vec3(1.0 / 2.4)) - 0.055;
  return mix(high, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}
