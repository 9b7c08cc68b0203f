layout(location = 0) in vec3 a_place;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec4 a_tangent;
layout(location = 3) in vec2 a_metres;
uniform mat4 matrix;
uniform vec2 jitter;
uniform vec3 low, extent;
out vec3 place, normal, tangent;
out float hand;
out vec2 metres;
void main() {
  place = low + extent * a_place;
  normal = a_normal; tangent = a_tangent.xyz; hand = a_tangent.w; metres = a_metres;
  gl_Position = matrix * vec4(place, 1.0);
  gl_Position.xy += jitter * gl_Position.w;
}
