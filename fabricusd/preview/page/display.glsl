// The mean of all frames, as a screen shows it.
uniform highp sampler2D total;
uniform float scale;
out vec4 color;
void main() {
  color = vec4(encoded(shown(scale * texelFetch(total, ivec2(gl_FragCoord.xy), 0))), 1.0);
}
