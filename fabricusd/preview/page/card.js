// WebGL2: programs, textures, the tables of a fabric, and a mesh.
const HEAD = '#version 300 es\nprecision highp float;\nprecision highp int;\n';
const WIDTH = 2048, SHADOW = 1024;
const KINDS = { f4: Float32Array, i4: Int32Array, u1: Uint8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array };

export const decode = a => {
  const bytes = Uint8Array.from(atob(a.data), c => c.charCodeAt(0));
  return new KINDS[a.type](bytes.buffer);
};

export class Card {
  constructor(canvas, shaders) {
    this.canvas = canvas;
    this.shaders = shaders;
    const gl = this.gl = canvas.getContext('webgl2', { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw Error('this browser has no WebGL2');
    if (!gl.getExtension('EXT_color_buffer_float')) throw Error('this graphics card cannot sum float pictures');
    this.programs = new Map();
    this.blank = gl.createVertexArray();
    this.frames = 0;
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

  // Layers of one texture, each with its frame buffer.
  depthTargets(count) {
    const gl = this.gl, texture = this.newTexture(gl.TEXTURE_2D_ARRAY);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW, count);
    const frames = [...Array(count)].map((_, k) => {
      const frame = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, texture, 0, k);
      return frame;
    });
    return { texture, frames };
  }

  newTexture(kind = this.gl.TEXTURE_2D) {
    const gl = this.gl, texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE15);  // on a unit that nothing else uses
    gl.bindTexture(kind, texture);
    // Float, integer and depth textures are read by texel; with a filter they would read as black.
    for (const p of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, p, gl.NEAREST);
    for (const p of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, p, gl.CLAMP_TO_EDGE);
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

  bind(program, name, unit, texture, kind = this.gl.TEXTURE_2D) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, texture);
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
    this.sky = [];    // pairs of directions to the sky with maps of their shadows
    this.skies = 0;   // how many were drawn
    this.frames = 0;
  }
}
