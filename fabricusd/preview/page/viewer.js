// The mean of frames, each of which adds some samples of each pixel, and that mean beside another picture.
const PLACES = 2, MOST_SKIES = 8;
const PASS = 1, SKY = 2, POINTS = 3, COARSE = 5;  // seeds

export class Viewer extends Card {
  constructor(canvas, shaders) {
    super(canvas, shaders);
    this.level = 0; this.view = 0; this.exposure = 0; this.ground = 0;
    this.lay = [1, 0];
    this.passes = 1;  // how often a frame draws the mesh
    this.drawn = 0;   // passes of all frames
    this.light = { azimuth: 0, elevation: 0 };
  }

  get samples() { return PLACES * this.drawn; }  // of each pixel

  // Column-major matrix of a map of the whole mesh as seen from `towards`.
  shadowMatrix(towards) {
    const [x, y, z] = axesAlong(towards), { centre, radius } = this.mesh, s = 1 / (1.01 * radius);
    const move = v => -s * dot(v, centre);
    return [s * x[0], s * y[0], -s * z[0], 0, s * x[1], s * y[1], -s * z[1], 0, s * x[2], s * y[2], -s * z[2], 0,
      move(x), move(y), -move(z), 1];
  }

  drawShadow(number, towards) {
    const gl = this.gl, program = this.program(this.shaders.vertex, 'void main() {}'), matrix = this.shadowMatrix(towards);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.depths.frames[number]);
    gl.viewport(0, 0, SHADOW, SHADOW);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program);
    this.aim(program, matrix, [0, 0]);
    gl.drawElements(gl.TRIANGLES, this.mesh.count, gl.UNSIGNED_INT, 0);
    return matrix;
  }

  aim(program, matrix, jitter) {
    const gl = this.gl;
    gl.uniformMatrix4fv(program.at('matrix'), false, matrix);
    gl.uniform2fv(program.at('jitter'), jitter);
    gl.uniform3fv(program.at('low'), this.mesh.low);
    gl.uniform3fv(program.at('extent'), this.mesh.extent);
  }

  keyDirection() {
    const { azimuth: a, elevation: e } = this.light;
    return [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
  }

  // One frame more, of the camera's { eye, matrix }: passes with the same shadows, each at a place in the pixels.
  draw(camera, lights) {
    const gl = this.gl, shadows = !this.mesh.convex, key = this.keyDirection();
    if (!this.frames) this.drawn = 0;
    const sky = shadows ? this.drawShadows(key) : null;
    const program = this.program(this.shaders.vertex, this.shaders.surface, `${this.defines}#define LEVEL ${this.level}\n`);
    gl.useProgram(program);
    this.useFabric(program);
    gl.uniform3fv(program.at('eye'), camera.eye);
    gl.uniform3fv(program.at('key'), key);
    gl.uniform3f(program.at('zenith'), 0, 1, 0);
    for (const [name, value] of Object.entries(lights)) gl.uniform1f(program.at(name), value);
    gl.uniform4f(program.at('lay'), ...this.fabric.density, ...this.lay);
    gl.uniform2fv(program.at('repeat'), this.fabric.repeat);
    gl.uniform1i(program.at('skies'), shadows ? sky.length : 0);
    gl.uniform1f(program.at('lift'), 4 * this.mesh.radius / SHADOW);
    if (shadows) {
      gl.uniform3fv(program.at('sky'), sky.flatMap(one => one.direction));
      gl.uniformMatrix4fv(program.at('sky_maps'), false, sky.flatMap(one => one.maps).flat());
      gl.uniformMatrix4fv(program.at('key_map'), false, this.keyMap);
    }
    for (let k = 0; k < this.passes; ++k) this.drawPass(program, camera);
    ++this.frames;
  }

  drawPass(program, camera) {
    const gl = this.gl, { width, height } = this.canvas, at = sobol(this.drawn, PASS).slice(0, 2).map(tented);
    // Each place is even by itself, and with its directions: see surface.glsl.
    const numbers = seed => [...Array(PLACES)].map((_, p) => sobol(this.drawn, seed + p));
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[0].frame);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.bindVertexArray(this.mesh.vao);
    this.bind(program, 'depths', 3, this.depths?.texture ?? null, gl.TEXTURE_2D_ARRAY);
    this.aim(program, camera.matrix, [-2 * at[0] / width, 2 * at[1] / height]);
    gl.uniform2f(program.at('seen_at'), at[0], -at[1]);
    gl.uniform4fv(program.at('points'), numbers(POINTS).flat());
    gl.uniform2fv(program.at('coarse'), numbers(COARSE).flatMap(one => one.slice(0, 2)));
    gl.drawElements(gl.TRIANGLES, this.mesh.count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST);
    this.add();
  }

  // Pairs of opposite directions to the sky with maps of their shadows: those of the last frames, and new
  // ones in place of the oldest. Once for each light, a map in the direction of the key light.
  drawShadows(key) {
    const gl = this.gl;
    this.depths ??= this.depthTargets(1 + 2 * MOST_SKIES);
    gl.bindVertexArray(this.mesh.vao);
    gl.enable(gl.DEPTH_TEST);
    if (!this.keyIsDrawn) this.keyMap = this.drawShadow(0, key);
    this.keyIsDrawn = true;
    for (let k = Math.min(this.passes, Math.max(2, this.passes >> 1)); k > 0; --k) {
      const direction = skyDirection(this.skies), n = this.skies % MOST_SKIES;
      const maps = [this.drawShadow(2 * n + 1, direction), this.drawShadow(2 * n + 2, direction.map(x => -x))];
      this.sky[n] = { direction, maps };
      ++this.skies;
    }
    return this.sky;
  }

  add() {  // the pass that was drawn to the sum
    const gl = this.gl, k = this.drawn, [before, after] = k % 2 ? [1, 2] : [2, 1];
    const program = this.program(this.shaders.screen, this.shaders.sum);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[after].frame);
    gl.useProgram(program);
    gl.bindVertexArray(this.blank);
    this.bind(program, 'before', 5, this.targets[before].texture);
    this.bind(program, 'frame', 6, this.targets[0].texture);
    gl.uniform1f(program.at('keep'), k ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.sum = this.targets[after];
    ++this.drawn;
  }

  show() {
    const gl = this.gl, program = this.program(this.shaders.screen, this.shaders.display);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.useProgram(program);
    gl.bindVertexArray(this.blank);
    this.bind(program, 'total', 5, this.sum.texture);
    this.tone(program);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  tone(program) {
    const gl = this.gl;
    gl.uniform1f(program.at('scale'), 1 / this.drawn);
    gl.uniform1f(program.at('exposure'), this.exposure);
    gl.uniform1f(program.at('ground'), this.ground);
    gl.uniform1i(program.at('view'), this.view);
  }

  // A picture by the path tracer, (n n 4) floats with rows from the top, to compare with.
  setTraced(pixels, size) {
    const gl = this.gl;
    if (this.traced) gl.deleteTexture(this.traced.texture);
    this.traced = { size, texture: this.newTexture() };
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, size, size, 0, gl.RGBA, gl.FLOAT, pixels);
  }

  // Draw a wipe (mode 0) or the differences (1); split : share of the width that the page has.
  compare(mode, split, target = null) {
    const gl = this.gl, program = this.program(this.shaders.screen, this.shaders.compare), { width, height } = this.canvas;
    const side = Math.min(width, height), { size, texture } = this.traced;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, target ? size : width, target ? size : height);
    gl.useProgram(program);
    gl.bindVertexArray(this.blank);
    this.bind(program, 'total', 5, this.sum.texture);
    this.bind(program, 'traced', 6, texture);
    this.tone(program);
    gl.uniform1f(program.at('split'), split * width);
    gl.uniform4f(program.at('square'), (width - side) / 2, (height - side) / 2, side, size);
    gl.uniform1i(program.at('mode'), mode);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Delta E 2000 and the lesser cover of each pixel of the picture, by fours.
  differences() {
    const gl = this.gl, { size } = this.traced, frame = gl.createFramebuffer(), texture = this.newTexture();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, size, size, 0, gl.RGBA, gl.FLOAT, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    this.compare(2, 0, frame);
    const found = new Float32Array(4 * size * size);
    gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, found);
    gl.deleteTexture(texture);
    gl.deleteFramebuffer(frame);
    return found;
  }

  // Mean radiance and cover of all frames, rows from the top.
  read() {
    const gl = this.gl, { width, height } = this.canvas, out = new Float32Array(4 * width * height), row = 4 * width;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.sum.frame);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, out);
    const turned = new Float32Array(out.length);
    for (let y = 0; y < height; ++y) turned.set(out.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
    return turned.map(x => x / this.drawn);
  }

  // The kernels at n pairs of directions; to, from : (w h 4) floats, whose fourth is u and v in threads.
  evaluate(to, from, width, height) {
    const gl = this.gl, texture = data => {
      const made = this.newTexture();
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, data);
      return made;
    };
    const program = this.program(this.shaders.screen, this.shaders.pairs, `${this.defines}#define LEVEL ${this.level}\n`);
    const out = { frame: gl.createFramebuffer(), texture: texture(null) }, given = [texture(to), texture(from)];
    gl.bindFramebuffer(gl.FRAMEBUFFER, out.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, out.texture, 0);
    gl.viewport(0, 0, width, height);
    gl.useProgram(program);
    this.useFabric(program);
    given.forEach((t, k) => this.bind(program, ['to_light', 'to_viewer'][k], 7 + k, t));
    gl.bindVertexArray(this.blank);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const values = new Float32Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, values);
    for (const t of [out.texture, ...given]) gl.deleteTexture(t);
    gl.deleteFramebuffer(out.frame);
    return values;
  }
}

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = a => { const l = Math.hypot(...a); return a.map(x => x / l); };

// Right, up and back of a view from `towards`.
function axesAlong(towards) {
  const z = unit(towards), aside = Math.abs(z[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], x = unit(cross(aside, z));
  return [x, cross(z, x), z];
}

// A place in a tent filter one pixel in radius, for u in [0, 1).
const tented = u => (u < 0.5 ? Math.sqrt(2 * u) - 1 : 1 - Math.sqrt(2 - 2 * u));

// Direction number k of the sky: evenly over the sphere.
function skyDirection(k) {
  const [, , u, v] = sobol(k, SKY), y = 1 - 2 * u, turn = 2 * Math.PI * v, flat = Math.sqrt(1 - y * y);
  return [flat * Math.cos(turn), y, flat * Math.sin(turn)];
}
