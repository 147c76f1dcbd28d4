// Scenery from the pilot's seat: ground, hills, trees and a landing place, drawn by three.js. Light is
// baked into the corners: a machine without a graphics card draws it too.
import { BackSide, BoxGeometry, BufferAttribute, type BufferGeometry, CircleGeometry, Color, ConeGeometry, Euler, Fog, Group, InstancedMesh, Matrix4, Mesh, MeshBasicMaterial, Object3D, PerspectiveCamera, PlaneGeometry, Quaternion, RingGeometry, Scene, SphereGeometry, Vector3, WebGLRenderer } from "three";
import type { FlyPose } from "./types";

/** Of the whole height of the picture, degrees; the pitch ladder is drawn for it too. */
export const VIEW_DEGREES = 50;
const SEEN_M = 3000;
const SUN = [0.5, 0.7, 0.5];
const TILE_M = 400;
const GRID_M = 20;
const EYE_M = 2;
const TREES = 30;
const CLEAR_M = 45;
const HAZE_M = 1300;
/** Below this many frames a second a picture is drawn with fewer points; `COARSEST` is the end. */
const WANTED_MS = 22;
const COARSEST = 0.4;
/** So long, in time and not in pictures: at one a second sixty of them were a minute of standing still. */
const PATIENCE_MS = 1000;

const COLOURS = {
  light: { sky: "#a9d3ef", high: "#4d93cf", ground: "#7d9b5f", line: "#93ae76", hill: "#8aa0a8", tree: "#4f7546", pad: "#6d7276", mark: "#f4f4f0" },
  dark: { sky: "#33516c", high: "#122a44", ground: "#333f2c", line: "#3f4d36", hill: "#2e3f4d", tree: "#22331f", pad: "#3d4245", mark: "#c9ccc8" },
};
export type Paint = keyof typeof COLOURS;

/** The same numbers for the same scenery, each time. */
function numbers(seed: number) {
  return () => {
    seed = (seed * 1664525 + 1013904223) % 4294967296;
    return seed / 4294967296;
  };
}

/** North is -z, east is x, up is y; a camera looks along -z as a vehicle along its x. */
export class FlyWorld {
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(VIEW_DEGREES, 1.6, 0.5, 2 * SEEN_M);
  readonly #ground = new Group();
  readonly #far = new Group();
  readonly #attitude = new Euler(0, 0, 0, "YXZ");
  readonly #painted: (paint: Paint) => void;
  #scale = 1;
  #slow = 0; // ms for which pictures came too slowly
  #before = performance.now();
  #size = [0, 0];

  /** Throws where there is no WebGL. */
  constructor(readonly canvas: HTMLCanvasElement) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: false, alpha: false, stencil: false, precision: "mediump", powerPreference: "low-power" });
    const [gl, told] = [this.#renderer.getContext(), this.#renderer.getContext().getExtension("WEBGL_debug_renderer_info")];
    const driver = told ? String(gl.getParameter(told.UNMASKED_RENDERER_WEBGL)) : "";
    if (/swiftshader|llvmpipe|software/i.test(driver)) this.#scale = 0.5;
    const shades: [MeshBasicMaterial, keyof (typeof COLOURS)["light"]][] = [];
    const flat = (name: keyof (typeof COLOURS)["light"], lit = false) => {
      const made = new MeshBasicMaterial({ vertexColors: lit });
      shades.push([made, name]);
      return made;
    };
    this.#scene.add(this.#ground, this.#far);
    this.#ground.add(floor(flat("ground")), ...lines(flat("line")), trees(flat("tree", true)));
    const sky = dome();
    this.#far.add(sky, ...hills(flat("hill", true)));
    this.#scene.add(...place(flat("pad"), flat("mark")));
    this.#scene.fog = new Fog("#ffffff", 0.2 * HAZE_M, HAZE_M);
    this.#painted = (paint) => {
      const told = COLOURS[paint];
      for (const [material, name] of shades) material.color.set(told[name]);
      (this.#scene.fog as Fog).color.set(told.sky);
      shade(sky, new Color(told.high), new Color(told.sky));
    };
  }

  paint(paint: Paint) {
    this.#painted(paint);
  }

  /** Whether the machine draws it at less than the coarsest points too slowly to fly by. */
  get tooSlow() {
    return this.#slow > 2 * PATIENCE_MS && this.#scale <= COARSEST;
  }

  /** `took` is what the last pictures took, ms. */
  draw(pose: FlyPose, width: number, height: number, ratio: number, took: number) {
    const [now, before] = [performance.now(), this.#before];
    this.#before = now;
    this.#slow = took > WANTED_MS ? this.#slow + now - before : Math.max(0, this.#slow - 2 * (now - before));
    if (this.#slow > PATIENCE_MS && this.#scale > COARSEST) [this.#scale, this.#slow] = [Math.max(COARSEST, 0.75 * this.#scale), 0];
    const size = [Math.round(width * ratio * this.#scale), Math.round(height * ratio * this.#scale)];
    if (size[0] !== this.#size[0] || size[1] !== this.#size[1]) {
      this.#size = size;
      this.#renderer.setSize(size[0], size[1], false);
      this.#camera.aspect = width / height;
      this.#camera.updateProjectionMatrix();
    }
    const camera = this.#camera;
    camera.position.set(pose.east_m, pose.height_m + EYE_M, -pose.north_m);
    this.#attitude.set(pose.theta, -pose.psi, -pose.phi);
    camera.quaternion.setFromEuler(this.#attitude);
    // What repeats goes along by whole tiles, what is far off wholly.
    this.#ground.position.set(TILE_M * Math.round(pose.east_m / TILE_M), 0, -TILE_M * Math.round(pose.north_m / TILE_M));
    this.#far.position.set(pose.east_m, 0, -pose.north_m);
    this.#renderer.render(this.#scene, camera);
  }

  dispose() {
    this.#scene.traverse((each) => {
      if (!(each instanceof Mesh)) return;
      each.geometry.dispose();
      each.material.dispose();
    });
    this.#renderer.dispose();
  }
}

/** Sides that look to the sun are lighter; each corner belongs to one side alone. */
function lit(geometry: BufferGeometry) {
  const made = geometry.toNonIndexed();
  made.computeVertexNormals();
  const normals = made.attributes.normal;
  const shade = new Float32Array(3 * normals.count);
  for (let k = 0; k < normals.count; k += 1) {
    const facing = SUN[0] * normals.getX(k) + SUN[1] * normals.getY(k) + SUN[2] * normals.getZ(k);
    shade.fill(0.72 + 0.38 * facing, 3 * k, 3 * k + 3);
  }
  made.setAttribute("color", new BufferAttribute(shade, 3));
  return made;
}

function floor(material: MeshBasicMaterial) {
  const made = new Mesh(new PlaneGeometry(4 * SEEN_M, 4 * SEEN_M), material);
  made.rotation.x = -Math.PI / 2;
  return made;
}

/** Fields: strips on the ground each way, so that drift and height are seen. */
function lines(material: MeshBasicMaterial) {
  const half = 60;
  return [0, 1].map((way) => {
    const made = new InstancedMesh(new PlaneGeometry(0.5, 2 * half * GRID_M), material, 2 * half + 1);
    const turn = new Quaternion().setFromEuler(new Euler(-Math.PI / 2, 0, way ? Math.PI / 2 : 0));
    for (let k = -half; k <= half; k += 1) {
      const at = new Vector3(way ? 0 : k * GRID_M, 0.05, way ? k * GRID_M : 0);
      made.setMatrixAt(k + half, new Matrix4().compose(at, turn, new Vector3(k % 5 ? 1 : 3, 1, 1)));
    }
    return made;
  });
}

function trees(material: MeshBasicMaterial) {
  const made = new InstancedMesh(lit(new ConeGeometry(2.6, 9, 5, 1, true)), material, TREES * 25);
  const [chance, spot] = [numbers(7), new Object3D()];
  let k = 0;
  // One tile of trees, beside itself: the ground goes along by tiles.
  for (let tree = 0; tree < TREES; tree += 1) {
    const [angle, away, size] = [2 * Math.PI * chance(), CLEAR_M + (0.5 * TILE_M - CLEAR_M) * Math.sqrt(chance()), 0.6 + 0.9 * chance()];
    const [x, z] = [away * Math.sin(angle), away * Math.cos(angle)];
    for (let across = -2; across <= 2; across += 1)
      for (let along = -2; along <= 2; along += 1) {
        spot.position.set(x + across * TILE_M, 4.5 * size, z + along * TILE_M);
        spot.scale.setScalar(size);
        spot.updateMatrix();
        made.setMatrixAt(k, spot.matrix);
        k += 1;
      }
  }
  return made;
}

function hills(material: MeshBasicMaterial) {
  const chance = numbers(3);
  material.fog = false;
  return Array.from({ length: 26 }, (_, k) => {
    const [angle, size] = [(2 * Math.PI * (k + 0.6 * chance())) / 26, 180 + 260 * chance()];
    const made = new Mesh(lit(new ConeGeometry(size * 2.6, size, 5, 1, true)), material);
    made.position.set(0.95 * SEEN_M * Math.sin(angle), 0.22 * size, -0.95 * SEEN_M * Math.cos(angle));
    made.rotation.y = 6 * chance();
    return made;
  });
}

/** A landing place under the take-off, and four masts around it to hover by. */
function place(pad: MeshBasicMaterial, mark: MeshBasicMaterial) {
  const ground = new Mesh(new CircleGeometry(14, 40), pad);
  ground.rotation.x = -Math.PI / 2;
  ground.position.y = 0.15;
  const ring = new Mesh(new RingGeometry(10.5, 12, 40), mark);
  ring.rotation.x = -Math.PI / 2;
  ring.position.y = 0.25;
  const bars = ([[-2.6, 0, 1, 8], [2.6, 0, 1, 8], [0, 0, 5, 1]] as const).map(([x, z, wide, deep]) => {
    const bar = new Mesh(new BoxGeometry(wide, 0.1, deep), mark);
    bar.position.set(x, 0.25, z);
    return bar;
  });
  const masts = ([[-30, -60], [30, -60], [-30, 60], [30, 60]] as const).map(([x, z]) => {
    const mast = new Mesh(new BoxGeometry(1.2, 40, 1.2), mark);
    mast.position.set(x, 20, z);
    return mast;
  });
  return [ground, ring, ...bars, ...masts];
}

function dome() {
  return new Mesh(new SphereGeometry(1.9 * SEEN_M, 24, 12), new MeshBasicMaterial({ vertexColors: true, side: BackSide, fog: false }));
}

function shade(sky: Mesh<SphereGeometry, MeshBasicMaterial>, high: Color, low: Color) {
  const places = sky.geometry.attributes.position;
  const made = new Float32Array(3 * places.count);
  const mixed = new Color();
  for (let k = 0; k < places.count; k += 1) {
    const up = Math.max(0, places.getY(k) / (1.9 * SEEN_M));
    mixed.lerpColors(low, high, Math.min(1, 2.2 * up)).toArray(made, 3 * k);
  }
  sky.geometry.setAttribute("color", new BufferAttribute(made, 3));
}
