// What the page's own modules use of the libraries.
export {
  BufferAttribute, BufferGeometry, Color, ConeGeometry, DataTexture, DoubleSide, Group, LineBasicMaterial,
  LineSegments, Mesh, MeshBasicMaterial, PerspectiveCamera, Raycaster, Scene, ShaderMaterial,
  SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/addons/controls/OrbitControls.js';
export { MeshBVH, acceleratedRaycast } from 'three-mesh-bvh';
export { default as uPlot } from 'uplot';
