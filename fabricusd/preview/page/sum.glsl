// The sum of all passes so far and of one more.
uniform highp sampler2D before, frame;
uniform float keep;
out vec4 color;
void main() {
  ivec2 p = ivec2(gl_FragCoord.xy);
  color = keep * texelFetch(before, p, 0) + texelFetch(frame, p, 0);
}
