// A picture, graded in the page by WebGL2. No framework, no network.
// The parameters of the model are those of the class LookView (look_view.py).

// --- A LUT as a fragment shader: one line of GLSL an operation ---------------------------------------------------------

const VERTEX = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1); }`;

// Tables are fetched and interpolated here, in float32: the texture units' own interpolation has 8 bits of fraction.
const HEAD = `#version 300 es
precision highp float;
precision highp int;
uniform highp sampler2D picture;
uniform vec2 centre, middle, size, grid;  // of the picture, in its pixels; of the view, in pixels; picture; texels
uniform float zoom, top, lod;             // pixels of the view to one of the picture; height of the target; mip level
uniform vec3 surround;
uniform bool clipping, nearest;
out vec4 shown;

vec3 curve(highp sampler2D table, int count, float low, float high, vec3 x) {
  vec3 place = clamp((x - low) / (high - low), 0.0, 1.0) * float(count - 1);
  ivec3 i = min(ivec3(place), count - 2), j = i + 1;
  #define ENTRY(n, c) texelFetch(table, ivec2(n.c & 1023, n.c >> 10), 0).c
  vec3 a = vec3(ENTRY(i, r), ENTRY(i, g), ENTRY(i, b)), b = vec3(ENTRY(j, r), ENTRY(j, g), ENTRY(j, b));
  return a + (place - vec3(i)) * (b - a);
}
// The texture's axes are blue, green, red.
vec3 tetrahedral(highp sampler3D cube, vec3 last, vec3 x) {
  vec3 place = clamp(x, 0.0, 1.0) * last;
  ivec3 i = ivec3(min(floor(place), last - 1.0));
  vec3 f = place - vec3(i);
  bool rg = f.r >= f.g, gb = f.g >= f.b, rb = f.r >= f.b;
  ivec3 largest = rg && rb ? ivec3(1, 0, 0) : !rg && gb ? ivec3(0, 1, 0) : ivec3(0, 0, 1);
  ivec3 smallest = gb && rb ? ivec3(0, 0, 1) : !rg && !rb ? ivec3(1, 0, 0) : ivec3(0, 1, 0);
  float high = max(f.r, max(f.g, f.b)), low = min(f.r, min(f.g, f.b));
  float between = max(min(f.r, f.g), min(max(f.r, f.g), f.b));
  return (1.0 - high) * texelFetch(cube, i.bgr, 0).rgb + (high - between) * texelFetch(cube, (i + largest).bgr, 0).rgb
    + (between - low) * texelFetch(cube, (i + 1 - smallest).bgr, 0).rgb + low * texelFetch(cube, (i + 1).bgr, 0).rgb;
}
vec3 trilinear(highp sampler3D cube, vec3 last, vec3 x) {
  vec3 place = clamp(x, 0.0, 1.0) * last;
  ivec3 i = ivec3(min(floor(place), last - 1.0)), k = i.bgr;
  vec3 f = place - vec3(i);
  #define NODE(b, g, r) texelFetch(cube, k + ivec3(b, g, r), 0).rgb
  vec3 low = mix(mix(NODE(0, 0, 0), NODE(1, 0, 0), f.b), mix(NODE(0, 1, 0), NODE(1, 1, 0), f.b), f.g);
  vec3 high = mix(mix(NODE(0, 0, 1), NODE(1, 0, 1), f.b), mix(NODE(0, 1, 1), NODE(1, 1, 1), f.b), f.g);
  return mix(low, high, f.r);
}
`;
const MAIN = `
void main() {
  vec2 at = centre + (vec2(gl_FragCoord.x, top - gl_FragCoord.y) - middle) / zoom;
  if (any(lessThan(at, vec2(0))) || any(greaterThanEqual(at, size))) { shown = vec4(surround, 1); return; }
  vec3 source = nearest ? texelFetch(picture, ivec2(at / size * grid), 0).rgb : textureLod(picture, at / size, lod).rgb;
  vec3 c = grade(source);
  float stripe = mod(floor((gl_FragCoord.x + gl_FragCoord.y) / 4.0), 2.0);
  #ifdef COVERAGE
  if (coverage(source).b < 0.5 && stripe > 0.5) c = vec3(0.0, 0.62, 0.45);
  #endif
  // Orange over white, violet over black: told apart by colour-blind eyes.
  if (clipping && stripe < 0.5) {
    vec3 code = floor(clamp(c, 0.0, 1.0) * 255.0 + 0.5);
    if (any(equal(code, vec3(255)))) c = vec3(0.902, 0.380, 0.004);
    else if (any(equal(code, vec3(0)))) c = vec3(0.369, 0.235, 0.600);
  }
  shown = vec4(c, 1);
}`;

const literal = value => { const text = String(value); return /[.e]/.test(text) ? text : text + ".0"; };

function glslFunction(name, ops) {
  const uniforms = [], lines = [];
  ops.forEach((op, n) => {
    const id = `${name}_${n}`;
    if (op.kind === "matrix") {
      uniforms.push(`uniform mat3 ${id};`, `uniform vec3 ${id}_offset;`);
      lines.push(`c = ${id} * c + ${id}_offset;`);
    } else if (op.kind === "range") {
      if (op.low !== null) lines.push(`c = max(c, ${literal(op.low)});`);
      if (op.high !== null) lines.push(`c = min(c, ${literal(op.high)});`);
    } else if (op.kind === "curve") {
      uniforms.push(`uniform highp sampler2D ${id};`);
      lines.push(`c = curve(${id}, ${op.size[0]}, ${literal(op.low)}, ${literal(op.high)}, c);`);
    } else {
      uniforms.push(`uniform highp sampler3D ${id};`);
      lines.push(`c = ${op.kind}(${id}, vec3(${op.size.map(nodes => literal(nodes - 1))}), c);`);
    }
  });
  return `${uniforms.join("\n")}\nvec3 ${name}(vec3 c) {\n  ${lines.join("\n  ")}\n  return c;\n}\n`;
}

class WebGLGrader {
  constructor(canvas) {
    const options = { alpha: false, antialias: false, depth: false, stencil: false, powerPreference: "high-performance" };
    this.gl = canvas.getContext("webgl2", options);
    if (!this.gl) throw new Error("no WebGL2");
    this.canvas = canvas;
    this.most = this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE);
    this.programs = new Map();
    this.tables = new Map();
    this.size = [0, 0];
  }

  async load(bitmap) {
    const gl = this.gl, { width, height } = bitmap;
    const shrink = Math.min(1, this.most / Math.max(width, height));
    const fitting = shrink === 1 ? bitmap : await createImageBitmap(bitmap, {
      resizeWidth: Math.floor(width * shrink), resizeHeight: Math.floor(height * shrink), resizeQuality: "high" });
    gl.deleteTexture(this.picture);
    this.picture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texStorage2D(gl.TEXTURE_2D, 1 + Math.floor(Math.log2(Math.max(fitting.width, fitting.height))), gl.RGBA8,
      fitting.width, fitting.height);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, gl.RGBA, gl.UNSIGNED_BYTE, fitting);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.size = [width, height];
    this.grid = [fitting.width, fitting.height];
  }

  // Drop the tables that no operation of `luts` has.
  keep(...luts) {
    const keys = new Set(luts.flat().map(op => op.key));
    for (const [key, texture] of this.tables) {
      if (!keys.has(key)) { this.gl.deleteTexture(texture); this.tables.delete(key); }
    }
  }

  // The keys of the tables that operations need and that have not come.
  missing(ops) { return ops.map(op => op.key).filter(key => key && !this.tables.has(key)); }

  // Upload a table, float32: a curve or a cube, by its size.
  put({ key, size, table }) {
    const gl = this.gl, target = size.length === 3 ? gl.TEXTURE_3D : gl.TEXTURE_2D, values = new Float32Array(table);
    if (this.tables.has(key)) return;
    const texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(target, texture);
    gl.texParameteri(target, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(target, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    if (size.length === 3) {
      const [red, green, blue] = size;
      gl.texImage3D(target, 0, gl.RGB32F, blue, green, red, 0, gl.RGB, gl.FLOAT, values);
    } else {
      const rows = Math.ceil(size[0] / 1024), whole = new Float32Array(3 * 1024 * rows);
      whole.set(values);
      gl.texImage2D(target, 0, gl.RGB32F, 1024, rows, 0, gl.RGB, gl.FLOAT, whole);
    }
    this.tables.set(key, texture);
  }

  program(grade, coverage) {
    const gl = this.gl;
    const marked = coverage ? "#define COVERAGE\n" + glslFunction("coverage", coverage) : "";
    const body = glslFunction("grade", grade) + marked;
    let program = this.programs.get(body);
    if (!program) {
      program = gl.createProgram();
      for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, HEAD + body + MAIN]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
      }
      gl.linkProgram(program);
      if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
        throw new Error(gl.getAttachedShaders(program).map(gl.getShaderInfoLog.bind(gl)).join(""));
      }
      const places = new Map();
      program.at = name => {
        if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
        return places.get(name);
      };
      this.programs.set(body, program);
    }
    gl.useProgram(program);
    let unit = 1;
    for (const [name, ops] of [["grade", grade], ["coverage", coverage || []]]) {
      ops.forEach((op, n) => {
        const id = `${name}_${n}`;
        if (op.kind === "matrix") {
          gl.uniformMatrix3fv(program.at(id), true, op.matrix);
          gl.uniform3fv(program.at(`${id}_offset`), op.offset);
        } else if (op.kind !== "range") {
          gl.activeTexture(gl.TEXTURE0 + unit);
          gl.bindTexture(op.size.length === 3 ? gl.TEXTURE_3D : gl.TEXTURE_2D, this.tables.get(op.key));
          gl.uniform1i(program.at(id), unit++);
        }
      });
    }
    return program;
  }

  // Draw one region, {left, right, middle, ops}, of a target of `width` × `height` pixels.
  region({ left, right, middle, ops, marks }, view, width, height) {
    const gl = this.gl, program = this.program(ops, marks ? view.coverage : null);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.uniform1i(program.at("picture"), 0);
    gl.uniform2fv(program.at("centre"), view.centre);
    gl.uniform2f(program.at("middle"), middle, height / 2);
    gl.uniform2fv(program.at("size"), this.size);
    gl.uniform2fv(program.at("grid"), this.grid);
    gl.uniform1f(program.at("zoom"), view.zoom);
    gl.uniform1f(program.at("top"), height);
    gl.uniform1f(program.at("lod"), Math.max(0, Math.log2(this.grid[0] / this.size[0] / view.zoom) - 0.25));
    gl.uniform3fv(program.at("surround"), view.surround);
    gl.uniform1i(program.at("clipping"), view.clipping ? 1 : 0);
    gl.uniform1i(program.at("nearest"), view.nearest || view.zoom >= 1 ? 1 : 0);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, 0, Math.max(0, right - left), height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draw with `width` × `height` pixels, stretched over the canvas: to resize that itself waits for what is drawn.
  draw(regions, view, width, height) {
    const gl = this.gl, { width: w, height: h } = this.canvas, fewer = width < w || height < h;
    if (fewer) {
      if (!this.fewer) [this.fewer, this.few] = [gl.createFramebuffer(), gl.createRenderbuffer()];
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.fewer);
      if (this.few.size !== `${w} × ${h}`) {
        gl.bindRenderbuffer(gl.RENDERBUFFER, this.few);
        gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, w, h);
        gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.few);
        this.few.size = `${w} × ${h}`;
      }
    }
    for (const region of regions) this.region(region, view, width, height);
    if (fewer) {
      gl.disable(gl.SCISSOR_TEST);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, w, h, gl.COLOR_BUFFER_BIT, gl.LINEAR);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    return gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  }

  // Whether what a fence stands behind has been drawn.
  done(fence) { return this.gl.clientWaitSync(fence, this.gl.SYNC_FLUSH_COMMANDS_BIT, 0) !== this.gl.TIMEOUT_EXPIRED; }

  // Pixels (height, width, RGBA) of the picture through operations, taken at even steps of it, or at one place of it.
  read(ops, width, height, centre = [this.size[0] / 2, this.size[1] / 2], zoom = width / this.size[0]) {
    const gl = this.gl;
    if (!this.aside) { this.aside = gl.createFramebuffer(); this.target = gl.createRenderbuffer(); }
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.aside);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.target);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.target);
    const view = { centre, zoom, surround: [0, 0, 0], clipping: false, nearest: true };
    this.region({ left: 0, right: width, middle: width / 2, ops, marks: false }, view, width, height);
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return pixels;  // bottom row first
  }
}
