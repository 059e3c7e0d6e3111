"use strict";
// The objects of a scene, see-through: triangles that move as rigid bodies.

const SOLID_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 corner;
layout(location = 1) in vec3 outward;
uniform mat4 toScreen;
uniform mat3 toView, frame;
uniform vec3 place;
out vec3 normal;

void main() {
  gl_Position = toScreen * vec4(place + frame * corner, 1);
  normal = toView * (frame * outward);
}`;

const SOLID_FRAGMENT = `#version 300 es
precision highp float;
in vec3 normal;
out vec4 colour;

void main() {
  vec3 n = normalize(normal);
  float facing = abs(n.z), rim = pow(1.0 - facing, 2.0), shade = 0.55 + 0.45 * max(dot(n, normalize(vec3(0.3, 0.65, 0.7))), 0.0);
  float alpha = 0.26 + 0.5 * rim;
  colour = vec4(vec3(0.36, 0.42, 0.5) * shade * alpha, alpha);
}`;

class Solids {
  constructor(gl, link, meshes, arrays) {
    Object.assign(this, { gl, arrays, visible: true });
    if (!meshes.length) { this.items = []; return; }
    this.program = link(SOLID_VERTEX, SOLID_FRAGMENT);
    this.items = meshes.map(mesh => {
      const object = gl.createVertexArray();
      gl.bindVertexArray(object);
      for (const [slot, values] of [mesh.vertices, mesh.normals].entries()) {
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
        gl.enableVertexAttribArray(slot);
        gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 0, 0);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(mesh.triangles), gl.STATIC_DRAW);
      gl.bindVertexArray(null);
      return { object, count: mesh.triangles.length, place: mesh.place, frame: mesh.frame };
    });
  }

  draw(screen, view, instant, share) {
    if (!this.visible || !this.items.length) return;
    const gl = this.gl, at = name => gl.getUniformLocation(this.program, name);
    const between = (name, size) => {
      const { data } = this.arrays[name], found = new Float32Array(size);
      for (let i = 0; i < size; i++) found[i] = data[instant * size + i] * (1 - share) + data[(instant + 1) * size + i] * share;
      return found;
    };
    gl.useProgram(this.program);
    gl.uniformMatrix4fv(at("toScreen"), false, screen);
    gl.uniformMatrix3fv(at("toView"), false, view);
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    for (const item of this.items) {
      gl.uniform3fv(at("place"), between(item.place, 3));
      gl.uniformMatrix3fv(at("frame"), false, between(item.frame, 9));   // its rows are directors: as columns they lead outwards
      gl.bindVertexArray(item.object);
      gl.drawElements(gl.TRIANGLES, item.count, gl.UNSIGNED_SHORT, 0);
    }
    gl.bindVertexArray(null);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.disable(gl.CULL_FACE);
  }
}
