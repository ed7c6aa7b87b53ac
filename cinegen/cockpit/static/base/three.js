// three.js as meshcat's viewer has it, under the name that modules import it by: one copy of it in the page.

export const {
  AmbientLight, Box3, BoxGeometry, BufferAttribute, BufferGeometry, CanvasTexture, Color, ConeGeometry,
  CylinderGeometry, DirectionalLight, DoubleSide, Euler, Float32BufferAttribute, Group, HemisphereLight, InstancedMesh, Line,
  LineBasicMaterial, LineDashedMaterial, LineSegments, Matrix3, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  MeshStandardMaterial, Object3D, OctahedronGeometry, OrthographicCamera, PCFSoftShadowMap, PerspectiveCamera, Plane,
  PlaneGeometry, Points, PointsMaterial, Quaternion, Ray, Raycaster, Scene, ShaderMaterial, Sphere, SphereGeometry,
  TorusGeometry, Vector2, Vector3, WebGLRenderer, WebGLRenderTarget,
} = window.MeshCat.THREE;
