"use strict";
// The arm in space: tubes whose surface is made in the vertex shader from textures of node by rod by instant.

const VERTEX = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform sampler2DArray places, sideways, colours;   // xyz and radius; towards LM3; value of the field
uniform mat4 toScreen;
uniform mat3 toView;
uniform int nodes, sides, cuts, instant;
uniform float share;
uniform vec2 range;
uniform bool framed;
out vec3 normal;
out float angle, value, along;

vec4 read(sampler2DArray source, int node) {
  int k = clamp(node, 0, nodes - 1);
  return mix(texelFetch(source, ivec3(k, gl_InstanceID, instant), 0), texelFetch(source, ivec3(k, gl_InstanceID, instant + 1), 0), share);
}

void main() {
  int ring = gl_VertexID / (sides + 1), side = gl_VertexID % (sides + 1);
  int k = min(ring / cuts, nodes - 2);
  float u = float(ring - k * cuts) / float(cuts);
  vec4 p0 = read(places, k - 1), p1 = read(places, k), p2 = read(places, k + 1), p3 = read(places, k + 2);
  // Catmull-Rom between nodes, one-sided at the ends.
  vec3 m1 = k == 0 ? p2.xyz - p1.xyz : 0.5 * (p2.xyz - p0.xyz);
  vec3 m2 = k == nodes - 2 ? p2.xyz - p1.xyz : 0.5 * (p3.xyz - p1.xyz);
  vec3 c2 = 3.0 * (p2.xyz - p1.xyz) - 2.0 * m1 - m2, c3 = 2.0 * (p1.xyz - p2.xyz) + m1 + m2;
  vec3 centre = p1.xyz + u * (m1 + u * (c2 + u * c3));
  vec3 tangent = normalize(m1 + u * (2.0 * c2 + 3.0 * u * c3));
  vec3 first = framed ? mix(read(sideways, k).xyz, read(sideways, k + 1).xyz, u) : (abs(tangent.z) < 0.9 ? vec3(0, 0, 1) : vec3(1, 0, 0));
  first = normalize(first - dot(first, tangent) * tangent);
  angle = 6.28318531 * float(side) / float(sides);
  normal = cos(angle) * first + sin(angle) * cross(tangent, first);
  float radius = mix(p1.w, p2.w, u);
  if (ring == (nodes - 1) * cuts) { radius = 0.0; normal = tangent; }
  value = (mix(read(colours, k).x, read(colours, k + 1).x, u) - range.x) / (range.y - range.x);
  along = (float(k) + u) / float(nodes - 1);
  gl_Position = toScreen * vec4(centre + radius * normal, 1);
  normal = toView * normal;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 normal;
in float angle, value, along;
uniform sampler2D map;
uniform vec3 plain;
uniform bool framed;
uniform float mark;
out vec4 colour;

void main() {
  vec3 base = plain;
  if (framed) {
    base = texture(map, vec2(clamp(value, 0.002, 0.998), 0.5)).rgb;
    float orange = min(angle, 6.28318531 - angle), white = abs(angle - 3.14159265);
    if (orange < 0.16) base = vec3(0.84, 0.37, 0.0);
    if (white < 0.16) base = vec3(0.98, 0.96, 0.88);
    if (abs(along - mark) < 0.005) base = vec3(0.76, 0.09, 0.36);
  }
  vec3 n = normalize(normal), light = normalize(vec3(0.3, 0.65, 0.7));
  float shade = 0.42 + 0.5 * max(dot(n, light), 0.0) + 0.1 * n.z;
  float gloss = 0.16 * pow(max(dot(reflect(-light, n), vec3(0, 0, 1)), 0.0), 26.0);
  float rim = mix(0.6, 1.0, smoothstep(0.0, 0.4, n.z));
  colour = vec4((base * shade + gloss) * rim, 1);
}`;

class TubeView {
  constructor(canvas, run, arrays) {
    Object.assign(this, { canvas, run, arrays, yaw: 0.5, pitch: 0.3, zoom: 1, mark: -1, stale: true, layers: [] });
    this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!this.gl) return;
    const gl = this.gl;
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    this.program = this.link(VERTEX, FRAGMENT);
    this.solids = new Solids(gl, (...sources) => this.link(...sources), run.solids, arrays);
    this.maps = Object.fromEntries(Object.keys(COLOUR_MAPS).map(name => [name, this.mapTexture(name)]));
    for (const layer of run.layers) this.addLayer(layer);
    this.listen();
  }

  link(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    return program;
  }

  place(name) {
    return this.gl.getUniformLocation(this.program, name);
  }

  mapTexture(name) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colourTable(name));
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE]]) {
      gl.texParameteri(gl.TEXTURE_2D, key, value);
    }
    return texture;
  }

  // Instants by rods by nodes of up to four numbers each.
  dataTexture(instants, rods, nodes, fill) {
    const gl = this.gl, texture = gl.createTexture(), data = new Float32Array(4 * instants * rods * nodes);
    for (let i = 0; i < instants * rods * nodes; i++) fill(data, i);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA32F, nodes, rods, instants, 0, gl.RGBA, gl.FLOAT, data);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return texture;
  }

  addLayer(layer) {
    const gl = this.gl, points = this.arrays[layer.points], [instants, rods, nodes] = points.shape;
    const radius = layer.radius ? this.arrays[layer.radius].data : null, normals = layer.normals ? this.arrays[layer.normals].data : null;
    const places = this.dataTexture(instants, rods, nodes, (data, i) => {
      data.set(points.data.subarray(3 * i, 3 * i + 3), 4 * i);
      data[4 * i + 3] = radius ? radius[i % radius.length] : layer.thickness;   // one instant of radii stands for all
    });
    const sideways = normals && this.dataTexture(instants, rods, nodes, (data, i) => data.set(normals.subarray(3 * i, 3 * i + 3), 4 * i));
    const rings = (nodes - 1) * layer.cuts + 1, corners = [];
    for (let ring = 0; ring < rings - 1; ring++) {
      for (let side = 0; side < layer.sides; side++) {
        const a = ring * (layer.sides + 1) + side, b = a + layer.sides + 1;
        corners.push(a, a + 1, b, a + 1, b + 1, b);
      }
    }
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners), gl.STATIC_DRAW);
    this.layers.push({ ...layer, instants, rods, nodes, places, sideways: sideways || places, buffer, count: corners.length });
  }

  paint(field) {
    if (!this.gl) return;
    const { data, shape } = this.arrays[field.array];
    if (this.colours) this.gl.deleteTexture(this.colours);
    this.colours = this.dataTexture(shape[0], 1, shape[1], (target, i) => { target[4 * i] = data[i]; });
    this.field = field;
    this.stale = true;
  }

  show(name, visible) {
    this.layers.filter(layer => layer.name === name).forEach(layer => { layer.visible = visible; });
    if (name === "objects") this.solids.visible = visible;
    this.stale = true;
  }

  listen() {
    let held = null;
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", event => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", event => {
      if (!held) return;
      this.yaw += (event.clientX - held[0]) / 140;
      this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch + (event.clientY - held[1]) / 140));
      held = [event.clientX, event.clientY];
      this.stale = true;
    });
    canvas.addEventListener("wheel", event => { event.preventDefault(); this.zoom *= Math.exp(-event.deltaY / 800); this.stale = true; }, { passive: false });
    canvas.addEventListener("dblclick", () => { Object.assign(this, { yaw: 0.5, pitch: 0.3, zoom: 1, stale: true }); });
    new ResizeObserver(() => { this.stale = true; }).observe(canvas);
  }

  draw(time) {
    this.stale = false;
    const gl = this.gl, canvas = this.canvas, times = this.run.time;
    if (!gl || !this.colours) return;
    const scale = Math.min(devicePixelRatio, 2), width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    let instant = 0;
    while (instant < times.length - 2 && times[instant + 1] <= time) instant++;
    const share = Math.max(0, Math.min(1, (time - times[instant]) / (times[instant + 1] - times[instant])));
    const between = list => list.map(values => values[instant] + share * (values[instant + 1] - values[instant]));
    const [cx, cy, cz, size] = between([...this.run.camera.centre, this.run.camera.size]);
    const [a, b, c, d] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    // Rows of the rotation: right, up, towards the viewer.
    const rows = [[a, 0, b], [d * b, c, -d * a], [-c * b, d, c * a]];
    const reach = (2 * this.zoom) / size, stretch = [reach * Math.min(1, height / width), reach * Math.min(1, width / height), -reach / 8];
    const screen = new Float32Array(16), view = new Float32Array(9);
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 3; j++) { screen[4 * j + i] = stretch[i] * rows[i][j]; view[3 * j + i] = rows[i][j]; }
      screen[12 + i] = -stretch[i] * (rows[i][0] * cx + rows[i][1] * cy + rows[i][2] * cz);
    }
    screen[15] = 1;
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(this.place("toScreen"), false, screen);
    gl.uniformMatrix3fv(this.place("toView"), false, view);
    gl.uniform1i(this.place("instant"), instant);
    gl.uniform1f(this.place("share"), share);
    gl.uniform1f(this.place("mark"), this.mark);
    gl.uniform2f(this.place("range"), this.field.low, this.field.high);
    ["places", "sideways", "colours", "map"].forEach((name, unit) => gl.uniform1i(this.place(name), unit));
    for (const layer of this.layers) {
      if (!layer.visible) continue;
      const textures = [[gl.TEXTURE_2D_ARRAY, layer.places], [gl.TEXTURE_2D_ARRAY, layer.sideways], [gl.TEXTURE_2D_ARRAY, this.colours], [gl.TEXTURE_2D, this.maps[this.field.map]]];
      textures.forEach(([kind, texture], unit) => { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(kind, texture); });
      for (const name of ["nodes", "sides", "cuts"]) gl.uniform1i(this.place(name), layer[name]);
      gl.uniform1i(this.place("framed"), layer.normals ? 1 : 0);
      gl.uniform3fv(this.place("plain"), layer.colour || [0, 0, 0]);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, layer.buffer);
      gl.drawElementsInstanced(gl.TRIANGLES, layer.count, gl.UNSIGNED_INT, 0, layer.rods);
    }
    this.solids.draw(screen, view, instant, share);
  }
}
