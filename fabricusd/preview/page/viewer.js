// WebGL2: the tables of a fabric, a mesh, and the mean of frames that each add a direction of sky.
const HEAD = '#version 300 es\nprecision highp float;\nprecision highp int;\n';
const WIDTH = 2048, SHADOW = 1024;
const R4 = [0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101];  // [Roberts2018]
const KINDS = { f4: Float32Array, i4: Int32Array, u1: Uint8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array };

export const decode = a => {
  const bytes = Uint8Array.from(atob(a.data), c => c.charCodeAt(0));
  return new KINDS[a.type](bytes.buffer);
};

export class Viewer {
  constructor(canvas, shaders) {
    this.canvas = canvas;
    this.shaders = shaders;
    const gl = this.gl = canvas.getContext('webgl2', { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw Error('this browser has no WebGL2');
    if (!gl.getExtension('EXT_color_buffer_float')) throw Error('this graphics card cannot sum float pictures');
    this.programs = new Map();
    this.blank = gl.createVertexArray();
    this.level = 0; this.frames = 0; this.view = 0; this.exposure = 0; this.ground = 0;
    this.lay = [1, 0];
    this.light = { azimuth: 0, elevation: 0 };
    this.shadowTargets = [this.depthTarget(), this.depthTarget()];
    this.resize(canvas.width, canvas.height);
  }

  resize(width, height) {
    const gl = this.gl;
    this.canvas.width = width; this.canvas.height = height;
    for (const t of this.targets ?? []) {
      gl.deleteFramebuffer(t.frame); gl.deleteTexture(t.texture);
      if (t.depth) gl.deleteRenderbuffer(t.depth);
    }
    this.targets = [this.target(true), this.target(false), this.target(false)];
    this.frames = 0;
  }

  target(deep) {
    const gl = this.gl, { width, height } = this.canvas;
    const t = { frame: gl.createFramebuffer(), texture: this.newTexture() };
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, t.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, t.texture, 0);
    if (deep) {
      t.depth = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, t.depth);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, t.depth);
    }
    return t;
  }

  depthTarget() {
    const gl = this.gl, t = { frame: gl.createFramebuffer(), texture: this.newTexture() };
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW);
    gl.bindFramebuffer(gl.FRAMEBUFFER, t.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, t.texture, 0);
    return t;
  }

  newTexture() {
    const gl = this.gl, texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE15);  // on a unit that nothing else uses
    gl.bindTexture(gl.TEXTURE_2D, texture);
    // Float, integer and depth textures are read by texel; with a filter they would read as black.
    for (const p of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, p, gl.NEAREST);
    for (const p of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, p, gl.CLAMP_TO_EDGE);
    return texture;
  }

  program(vertex, fragment, defines = '') {
    const key = vertex + fragment + defines;
    if (this.programs.has(key)) return this.programs.get(key);
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, HEAD + defines + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(program));
    const places = new Map();
    program.at = name => {
      if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
      return places.get(name);
    };
    this.programs.set(key, program);
    return program;
  }

  bind(program, name, unit, texture) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1i(program.at(name), unit);
  }

  upload(flat, internal, format, type, channels = 1) {
    const gl = this.gl, rows = Math.max(1, Math.ceil(flat.length / (WIDTH * channels)));
    const padded = new flat.constructor(rows * WIDTH * channels), texture = this.newTexture();
    padded.set(flat);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, WIDTH, rows, 0, format, type, padded);
    return texture;
  }

  setFabric(fabric) {
    const gl = this.gl;
    for (const t of Object.values(this.tables ?? {})) gl.deleteTexture(t);
    for (const b of this.blocks ?? []) gl.deleteBuffer(b);
    this.fabric = fabric;
    this.floats = decode(fabric.floats);
    this.tables = {
      floats: this.upload(this.floats, gl.R32F, gl.RED, gl.FLOAT),
      ints: this.upload(decode(fabric.ints), gl.R32I, gl.RED_INTEGER, gl.INT),
      bytes: this.upload(decode(fabric.bytes), gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE),
      quads: this.upload(decode(fabric.quads), gl.RGBA32F, gl.RGBA, gl.FLOAT, 4),
    };
    this.blocks = [decode(fabric.shapes), decode(fabric.numbers)].map(data => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.UNIFORM_BUFFER, buffer);
      gl.bufferData(gl.UNIFORM_BUFFER, data, gl.STATIC_DRAW);
      return buffer;
    });
    this.frames = 0;
  }

  writeFloats(start, values) {  // change some numbers of a table
    const gl = this.gl;
    this.floats.set(values, start);
    gl.activeTexture(gl.TEXTURE15);
    gl.bindTexture(gl.TEXTURE_2D, this.tables.floats);
    values.forEach((value, k) => {
      const at = start + k;
      gl.texSubImage2D(gl.TEXTURE_2D, 0, at % WIDTH, Math.floor(at / WIDTH), 1, 1, gl.RED, gl.FLOAT, new Float32Array([value]));
    });
    this.frames = 0;
  }

  get defines() {
    return Object.entries(this.fabric.defines).map(([k, v]) => `#define ${k} ${v}\n`).join('');
  }

  useFabric(program) {
    const gl = this.gl;
    ['floats', 'ints', 'bytes', 'quads'].forEach((name, k) => this.bind(program, name, 9 + k, this.tables[name]));
    ['Shapes', 'Numbers'].forEach((name, k) => {
      const index = gl.getUniformBlockIndex(program, name);
      if (index === gl.INVALID_INDEX) return;
      gl.uniformBlockBinding(program, index, k);
      gl.bindBufferBase(gl.UNIFORM_BUFFER, k, this.blocks[k]);
    });
    gl.uniform4iv(program.at('repeats'), this.fabric.repeats);
  }

  setMesh(mesh) {
    const gl = this.gl;
    for (const b of this.buffers ?? []) gl.deleteBuffer(b);
    if (this.mesh) gl.deleteVertexArray(this.mesh.vao);
    const vao = gl.createVertexArray(), indices = decode(mesh.indices);
    this.buffers = [];
    const buffer = (target, data) => {
      const made = gl.createBuffer();
      gl.bindBuffer(target, made);
      gl.bufferData(target, data, gl.STATIC_DRAW);
      this.buffers.push(made);
    };
    gl.bindVertexArray(vao);
    const parts = [['places', 3, gl.UNSIGNED_SHORT, true, 8], ['normals', 3, gl.SHORT, true, 8],
      ['tangents', 4, gl.SHORT, true, 8], ['metres', 2, gl.FLOAT, false, 8]];
    parts.forEach(([name, size, type, unit, stride], k) => {
      buffer(gl.ARRAY_BUFFER, decode(mesh[name]));
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, size, type, unit, stride, 0);
    });
    buffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    this.mesh = { ...mesh, vao, count: indices.length };
    this.keyIsDrawn = false;
    this.frames = 0;
  }

  // Column-major matrix of a map of the whole mesh as seen from `towards`.
  shadowMatrix(towards) {
    const [x, y, z] = axesAlong(towards), { centre, radius } = this.mesh, s = 1 / (1.01 * radius);
    const move = v => -s * dot(v, centre);
    return [s * x[0], s * y[0], -s * z[0], 0, s * x[1], s * y[1], -s * z[1], 0, s * x[2], s * y[2], -s * z[2], 0,
      move(x), move(y), -move(z), 1];
  }

  drawShadow(number, towards) {
    const gl = this.gl, program = this.program(this.shaders.vertex, 'void main() {}'), matrix = this.shadowMatrix(towards);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTargets[number].frame);
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

  // One frame more, of the camera's { eye, matrix }.
  draw(camera, lights) {
    const gl = this.gl, { width, height } = this.canvas, k = this.frames;
    const [tent, far] = [2 * k, 2 * k + 1].map(n => (n ? R4.slice(0, 2).map(a => tented((0.5 + n * a) % 1)) : [0, 0]));
    const [sky, other] = [2 * k, 2 * k + 1].map(skyDirection), key = this.keyDirection(), shadows = !this.mesh.convex;
    gl.bindVertexArray(this.mesh.vao);
    gl.enable(gl.DEPTH_TEST);
    let maps = [null, null];
    if (shadows) {
      if (!this.keyIsDrawn) this.keyMap = this.drawShadow(0, key);
      this.keyIsDrawn = true;
      maps = [this.keyMap, this.drawShadow(1, sky)];
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[0].frame);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const program = this.program(this.shaders.vertex, this.shaders.surface, `${this.defines}#define LEVEL ${this.level}\n`);
    gl.useProgram(program);
    this.useFabric(program);
    this.aim(program, camera.matrix, [-2 * tent[0] / width, 2 * tent[1] / height]);
    gl.uniform3fv(program.at('eye'), camera.eye);
    gl.uniform3fv(program.at('key'), key);
    gl.uniform3fv(program.at('sky'), sky);
    gl.uniform3fv(program.at('other_sky'), other);
    gl.uniform2f(program.at('other_place'), far[0] - tent[0], tent[1] - far[1]);
    gl.uniform3f(program.at('zenith'), 0, 1, 0);
    for (const [name, value] of Object.entries(lights)) gl.uniform1f(program.at(name), value);
    gl.uniform4f(program.at('lay'), ...this.fabric.density, ...this.lay);
    gl.uniform1i(program.at('shadows'), shadows ? 1 : 0);
    gl.uniform1f(program.at('lift'), 4 * this.mesh.radius / SHADOW);
    this.shadowTargets.forEach((t, n) => this.bind(program, ['key_depth', 'sky_depth'][n], 3 + n, t.texture));
    maps.forEach((m, n) => { if (m) gl.uniformMatrix4fv(program.at(['key_map', 'sky_map'][n]), false, m); });
    gl.drawElements(gl.TRIANGLES, this.mesh.count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.DEPTH_TEST);
    const [before, after] = k % 2 ? [1, 2] : [2, 1], add = this.program(this.shaders.screen, this.shaders.sum);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.targets[after].frame);
    gl.useProgram(add);
    gl.bindVertexArray(this.blank);
    this.bind(add, 'before', 5, this.targets[before].texture);
    this.bind(add, 'frame', 6, this.targets[0].texture);
    gl.uniform1f(add.at('keep'), k ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.sum = this.targets[after];
    ++this.frames;
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
    gl.uniform1f(program.at('scale'), 1 / this.frames);
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
    return turned.map(x => x / this.frames);
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

// Direction number k of the sky: evenly over the sphere, apart from the places in the pixels.
function skyDirection(k) {
  const [y, turn] = [1 - 2 * ((0.5 + k * R4[2]) % 1), 2 * Math.PI * ((0.5 + k * R4[3]) % 1)];
  const flat = Math.sqrt(1 - y * y);
  return [flat * Math.cos(turn), y, flat * Math.sin(turn)];
}
