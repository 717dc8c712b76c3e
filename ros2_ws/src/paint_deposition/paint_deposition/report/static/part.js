// The part in 3D: its film in colours, the guns with their passes, the probe.

import {
  acceleratedRaycast, BufferAttribute, BufferGeometry, Color, ConeGeometry, DataTexture, DoubleSide,
  Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshBVH, OrbitControls,
  PerspectiveCamera, Raycaster, Scene, ShaderMaterial, SphereGeometry, Vector2, Vector3,
  WebGLRenderer,
} from './libraries.js';

const TABLE = 256; // colours of a palette, before those for under, over and bare
const CONE_M = 0.25; // from the TCP to the model plane
const JUMP_M = 0.2; // a gun that is so much further on was not seen on its way
const SPRAYED = new Color('#17212b');
const MOVED = new Color('#a9b4be');

// Film to colour as `ColourScale.rows` has it; a slanted surface is a little darker.
const FILM = {
  vertexShader: `
    attribute float um; varying float film; varying vec3 outward; varying vec3 toEye;
    void main() {
      film = um; outward = normalMatrix * normal;
      vec4 place = modelViewMatrix * vec4(position, 1.0);
      toEye = -place.xyz; gl_Position = projectionMatrix * place;
    }`,
  fragmentShader: `
    uniform sampler2D palettes; uniform float low, high, bare, target; uniform bool against;
    varying float film; varying vec3 outward; varying vec3 toEye;
    void main() {
      float value = against ? film - target : film;
      float row = film <= bare ? ${TABLE + 2}.0 : value < low ? ${TABLE}.0 : value > high ? ${TABLE + 1}.0
        : clamp(floor((value - low) * ${TABLE}.0 / (high - low)), 0.0, ${TABLE - 1}.0);
      vec3 colour = texture2D(palettes, vec2((row + 0.5) / ${TABLE + 3}.0, against ? 0.75 : 0.25)).rgb;
      float facing = abs(dot(normalize(outward), normalize(toEye)));
      gl_FragColor = vec4(colour * mix(0.7, 1.0, facing), 1.0);
    }`,
};

export class PartView {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.scene = new Scene();
    this.scene.background = new Color('#eef1f4');
    this.camera = new PerspectiveCamera(35, 1, 0.01, 100);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.uniforms = Object.fromEntries(
      ['low', 'high', 'bare', 'target', 'against', 'palettes'].map((name) => [name, { value: 0 }]),
    );
    this.guns = new Group();
    this.pin = new Mesh(new SphereGeometry(1, 16, 12), new MeshBasicMaterial({ color: '#d6007c' }));
    this.pin.visible = false;
    this.scene.add(this.guns, this.pin);
    this.clearTrack();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  showPart({ vertices, faces, outward, down }) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(vertices, 3));
    geometry.setIndex(new BufferAttribute(faces, 1));
    geometry.computeVertexNormals();
    this.film = new Float32Array(vertices.length / 3);
    geometry.setAttribute('um', new BufferAttribute(this.film, 1));
    // It may not sort the triangles, which the probe counts by.
    geometry.boundsTree = new MeshBVH(geometry, { indirect: true });
    geometry.computeBoundingSphere();
    if (this.mesh) {
      this.scene.remove(this.mesh);
      this.mesh.geometry.dispose();
    }
    this.mesh = new Mesh(geometry, new ShaderMaterial({ ...FILM, uniforms: this.uniforms, side: DoubleSide }));
    this.mesh.raycast = acceleratedRaycast;
    this.scene.add(this.mesh);
    this.pin.scale.setScalar(geometry.boundingSphere.radius / 130);
    this.outward = new Vector3(...outward);
    this.up = new Vector3(...down).negate();
    this.lookAtFront();
    this.pinAt(null);
  }

  lookAtFront() {
    if (!this.mesh) return;
    const { center, radius } = this.mesh.geometry.boundingSphere;
    const along = Math.abs(this.up.dot(this.outward)) > 0.95;
    this.camera.up.copy(along ? new Vector3(0, 1, 0) : this.up);
    if (along && Math.abs(this.outward.y) > 0.7) this.camera.up.set(0, 0, 1);
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (1.02 * radius) / Math.sin((this.camera.fov * Math.PI) / 360) / narrow;
    const aside = new Vector3().crossVectors(this.camera.up, this.outward).multiplyScalar(0.25);
    const from = this.outward.clone().add(aside).addScaledVector(this.camera.up, 0.12).normalize();
    this.camera.position.copy(center).addScaledVector(from, distance);
    this.camera.near = distance / 200;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(center);
    this.controls.update();
    this.draw();
  }

  filmChanged() {
    this.mesh.geometry.attributes.um.needsUpdate = true;
    this.draw();
  }

  // Colours from `low` to `high`, of the film or of its difference from the target.
  setColours({ low, high, bare, target, against, palettes }) {
    if (this.uniforms.palettes.value) this.uniforms.palettes.value.dispose();
    const texture = new DataTexture(palettes, TABLE + 3, 2);
    texture.needsUpdate = true;
    for (const [name, value] of Object.entries({ low, high, bare, target, against, palettes: texture })) {
      this.uniforms[name].value = value;
    }
    this.draw();
  }

  showGuns(guns) {
    this.guns.clear();
    for (const { at, z, flow } of guns) {
      const axis = new Vector3(...z);
      const colour = flow > 0 ? '#1673c6' : '#8d99a5';
      const cone = new Mesh(
        new ConeGeometry(0.09, CONE_M, 32, 1, true),
        new MeshBasicMaterial({ color: colour, transparent: true, opacity: flow > 0 ? 0.45 : 0.2, side: DoubleSide, depthWrite: false }),
      );
      cone.position.set(...at).addScaledVector(axis, CONE_M / 2);
      cone.quaternion.setFromUnitVectors(new Vector3(0, -1, 0), axis);
      const bell = new Mesh(new SphereGeometry(0.02, 20, 14), new MeshBasicMaterial({ color: colour }));
      bell.position.set(...at);
      this.guns.add(cone, bell);
    }
    this.draw();
  }

  clearTrack() {
    this.lastOf = new Map();
    this.segments = 0;
    this.growTrack(new Float32Array(6 * 1024), new Float32Array(6 * 1024));
  }

  growTrack(places, colours) {
    if (this.track) {
      this.scene.remove(this.track);
      this.track.geometry.dispose();
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(places, 3));
    geometry.setAttribute('color', new BufferAttribute(colours, 3));
    const shown = this.track?.visible ?? true;
    this.track = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
    this.track.frustumCulled = false;
    this.track.visible = shown;
    this.scene.add(this.track);
  }

  // Rows of gun, x, y, z, spraying: a line from the last place of each gun.
  addTrack(rows) {
    let { position, color } = this.track.geometry.attributes;
    for (let row = 0; row < rows.length; row += 5) {
      const [gun, x, y, z, spraying] = rows.subarray(row, row + 5);
      const before = this.lastOf.get(gun);
      this.lastOf.set(gun, [x, y, z, spraying]);
      if (!before || Math.hypot(x - before[0], y - before[1], z - before[2]) > JUMP_M) continue;
      const at = 6 * this.segments++;
      if (at + 6 > position.array.length) {
        const doubled = [position, color].map(({ array }) => {
          const longer = new Float32Array(2 * array.length);
          longer.set(array);
          return longer;
        });
        this.growTrack(...doubled);
        ({ position, color } = this.track.geometry.attributes);
      }
      const shade = before[3] ? SPRAYED : MOVED;
      position.array.set([...before.slice(0, 3), x, y, z], at);
      color.array.set([...shade.toArray(), ...shade.toArray()], at);
    }
    position.needsUpdate = color.needsUpdate = true;
    this.track.geometry.setDrawRange(0, 2 * this.segments);
    this.draw();
  }

  // What lies under a point of the window: the triangle and the weights of its corners.
  pick(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    const at = new Vector2(
      (2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height,
    );
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    ray.firstHitOnly = true;
    const [hit] = this.mesh ? ray.intersectObject(this.mesh) : [];
    if (!hit) return null;
    const { a, b, c } = hit.face;
    return { point: hit.point, corners: [a, b, c], weights: hit.barycoord.toArray() };
  }

  // Film [µm] at a picked place.
  filmAt({ corners, weights }) {
    return corners.reduce((sum, corner, k) => sum + weights[k] * this.film[corner], 0);
  }

  pinAt(place) {
    this.pinned = place;
    this.pin.visible = Boolean(place);
    if (place) this.pin.position.copy(place.point);
    this.draw();
  }

  // Where a place of the part is in the window.
  project(point) {
    const box = this.canvas.getBoundingClientRect();
    const at = point.clone().project(this.camera);
    return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.renderer.render(this.scene, this.camera);
    });
  }
}
