// The page beside a picture of its middle square by the path tracer.
uniform highp sampler2D total, traced;
uniform float scale, split;
uniform vec4 square;  // left and bottom of the square, its side in pixels, that of the picture
uniform int mode;     // 0 a wipe, 1 the differences as colours, 2 the differences as numbers
out vec4 color;

// CIE L*a*b* under D65 of linear Rec. 709.
vec3 lab(vec3 c) {
  mat3 xyz = mat3(0.4123908, 0.2126390, 0.0193308, 0.3575843, 0.7151687, 0.1191948, 0.1804808, 0.0721923, 0.9505322);
  vec3 t = (xyz * c) / vec3(0.9504559, 1.0, 1.0890578);
  vec3 f = mix(pow(max(t, vec3(1e-6)), vec3(1.0 / 3.0)), (903.2963 * t + 16.0) / 116.0, lessThanEqual(t, vec3(0.00885645)));
  return vec3(116.0 * f.y - 16.0, 500.0 * (f.x - f.y), 200.0 * (f.y - f.z));
}

float turned(float b, float a) {  // an angle of hue, from 0 to 2 pi
  if (a == 0.0 && b == 0.0) return 0.0;
  float h = atan(b, a);
  return h < 0.0 ? h + 6.283185307 : h;
}

// CIE delta E 2000 [Sharma2005].
float difference(vec3 one, vec3 two) {
  const float PI = 3.14159265359, DEGREE = PI / 180.0, P25 = 6103515625.0;
  float mean = 0.5 * (length(one.yz) + length(two.yz)), m7 = pow(mean, 7.0);
  float grey = 1.0 + 0.5 * (1.0 - sqrt(m7 / (m7 + P25)));
  vec2 a = vec2(grey * one.y, one.z), b = vec2(grey * two.y, two.z);
  float c1 = length(a), c2 = length(b), h1 = turned(a.y, a.x), h2 = turned(b.y, b.x), dh = h2 - h1;
  bool none = c1 * c2 == 0.0;
  if (none) dh = 0.0;
  else if (dh > PI) dh -= 2.0 * PI;
  else if (dh < -PI) dh += 2.0 * PI;
  float h = h1 + h2;
  if (!none) h = 0.5 * (abs(h1 - h2) <= PI ? h : h < 2.0 * PI ? h + 2.0 * PI : h - 2.0 * PI);
  float l = 0.5 * (one.x + two.x) - 50.0, c = 0.5 * (c1 + c2), c7 = pow(c, 7.0);
  float t = 1.0 - 0.17 * cos(h - 30.0 * DEGREE) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0 * DEGREE)
    - 0.20 * cos(4.0 * h - 63.0 * DEGREE);
  float off = (h / DEGREE - 275.0) / 25.0, turn = 30.0 * DEGREE * exp(-off * off);
  float sl = 1.0 + 0.015 * l * l / sqrt(20.0 + l * l), sc = 1.0 + 0.045 * c, sh = 1.0 + 0.015 * c * t;
  float rt = -2.0 * sqrt(c7 / (c7 + P25)) * sin(2.0 * turn);
  float dl = (two.x - one.x) / sl, dc = (c2 - c1) / sc, df = 2.0 * sqrt(c1 * c2) * sin(0.5 * dh) / sh;
  return sqrt(max(dl * dl + dc * dc + df * df + rt * dc * df, 0.0));
}

// The page's mean over pixel p of the picture.
vec4 drawn(ivec2 p) {
  float step = square.z / square.w;
  vec2 low = square.xy + vec2(p) * step;
  ivec2 first = ivec2(floor(low + 0.5)), last = max(ivec2(floor(low + step + 0.5)), first + 1), size = textureSize(total, 0);
  vec4 sum = vec4(0.0);
  for (int y = first.y; y < last.y; ++y)
    for (int x = first.x; x < last.x; ++x) sum += texelFetch(total, clamp(ivec2(x, y), ivec2(0), size - 1), 0);
  ivec2 count = last - first;
  return sum * (scale / float(count.x * count.y));
}

vec4 reference(ivec2 p) {  // its rows begin at the top
  return texelFetch(traced, ivec2(p.x, int(square.w) - 1 - p.y), 0);
}

// Black for equal colours, then violet, red, and yellow for a difference of 5 and more.
vec3 heat(float d) {
  float t = clamp(d / 5.0, 0.0, 1.0) * 3.0;
  vec3 a = mix(vec3(0.0, 0.0, 0.02), vec3(0.34, 0.06, 0.43), min(t, 1.0));
  a = mix(a, vec3(0.88, 0.32, 0.15), clamp(t - 1.0, 0.0, 1.0));
  return mix(a, vec3(0.99, 0.95, 0.55), clamp(t - 2.0, 0.0, 1.0));
}

void main() {
  if (mode == 2) {
    ivec2 p = ivec2(gl_FragCoord.xy);
    vec4 mine = drawn(p), other = reference(p);
    color = vec4(difference(lab(shown(mine)), lab(shown(other))), min(mine.a, other.a), 0.0, 1.0);
    return;
  }
  vec2 q = (gl_FragCoord.xy - square.xy) / square.z * square.w;
  ivec2 p = ivec2(floor(q));
  bool inside = all(greaterThanEqual(p, ivec2(0))) && all(lessThan(p, ivec2(square.w)));
  vec3 here = shown(scale * texelFetch(total, ivec2(gl_FragCoord.xy), 0));
  if (inside && mode == 1) {
    color = vec4(heat(difference(lab(shown(drawn(p))), lab(shown(reference(p))))), 1.0);
    return;
  }
  // Both sides of the line have the same pixels: where the picture's are larger, the page takes them.
  bool other = gl_FragCoord.x > split;
  if (inside && (other || square.z > 1.02 * square.w)) {
    vec2 t = q - 0.5, f = fract(t);
    ivec2 low = ivec2(floor(t)), most = ivec2(square.w) - 1;
    vec4 sum = vec4(0.0);
    for (int k = 0; k < 4; ++k) {
      ivec2 s = ivec2(k & 1, k >> 1), at = clamp(low + s, ivec2(0), most);
      sum += (s.x == 1 ? f.x : 1.0 - f.x) * (s.y == 1 ? f.y : 1.0 - f.y) * (other ? reference(at) : drawn(at));
    }
    here = shown(sum);
  }
  color = vec4(abs(gl_FragCoord.x - split) < 1.0 ? vec3(1.0) : encoded(here), 1.0);
}
