/** The camera: where it stands, and how the user moves it. */

import { PerspectiveCamera, Sphere, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Extent } from "./model";

/** The farthest that a link may put the camera from a model's centre, in its radii. */
const FARTHEST = 100;

/** The air around a model: how much farther away the camera stands than it has to. */
const MARGIN = 1.08;

/** The front of a glTF is +Z: seen from 30 degrees beside it and a little above it shows its depth. */
const FRONT = new Vector3(0.5, 0.28, 0.866).normalize();

export class Rig {
  readonly camera = new PerspectiveCamera(35, 1, 0.01, 100);
  /** Pixels that tools cover at the foot of the canvas: the model stands above them. */
  covered = 0;
  /** Whether the user has moved the camera: a link then holds its place. */
  chosen = false;
  onChosen: () => void = () => {};
  private readonly controls: OrbitControls;
  private readonly sphere = new Sphere(new Vector3(), 1);

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly changed: () => void,
  ) {
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", changed);
    this.controls.addEventListener("end", () => this.choose());
  }

  /** Look at all of a model in a picture `width` wide; `turn` goes back to the first direction. */
  frame({ box, points }: Extent, width: number, turn: boolean): void {
    if (box.isEmpty()) return;
    const { center, radius } = box.getBoundingSphere(this.sphere);
    const size = radius || 1;
    const towards = turn ? FRONT.clone() : this.camera.position.clone().sub(this.controls.target).normalize();
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(towards, this.distance(points, center, towards, width) || 3 * size);
    this.camera.near = size / 200;
    this.camera.far = size * 200;
    this.controls.minDistance = size / 50;
    this.controls.maxDistance = size * 40;
    if (turn) this.chosen = false;
    this.update();
  }

  /** The least distance from `center`, in the direction `towards`, from which every point is in the picture. */
  private distance(points: Float32Array, center: Vector3, towards: Vector3, width: number): number {
    const height = this.canvas.clientHeight || 1;
    const tall = Math.tan((this.camera.fov * Math.PI) / 360);
    const [wide, free] = [(tall * width) / height, tall * (1 - this.foot(height))];
    const right = new Vector3().crossVectors(this.camera.up, towards).normalize();
    const up = new Vector3().crossVectors(towards, right);
    const at = new Vector3();
    let distance = 0;
    for (let place = 0; place < points.length; place += 3) {
      at.fromArray(points, place).sub(center);
      const aside = Math.max(Math.abs(at.dot(right)) / wide, Math.abs(at.dot(up)) / free);
      distance = Math.max(distance, MARGIN * aside + at.dot(towards));
    }
    return distance;
  }

  /** Set the camera for a picture whose middle is to lie in the middle of what tools leave free. */
  project(width: number, height: number): void {
    this.camera.setViewOffset(1, 1, 0, this.foot(height) / 2, 1, 1);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /** The part of the height that tools cover; on a low canvas they do not count in full. */
  private foot(height: number): number {
    return Math.min(this.covered / height, 0.3);
  }

  /** Write where the camera stands and looks, from a model's centre and in its radii: six numbers. */
  place({ box }: Extent): string {
    const { center, radius } = box.getBoundingSphere(this.sphere);
    const at = [this.camera.position, this.controls.target];
    const numbers = at.flatMap((point) => point.clone().sub(center).divideScalar(radius || 1).toArray());
    return numbers.map((x) => Number(x.toFixed(4))).join();
  }

  /** Go to such a place; any other text changes nothing. */
  goTo(place: string, { box }: Extent): void {
    const numbers = place.split(",").map(Number);
    if (numbers.length !== 6 || !numbers.every((x) => Math.abs(x) <= FARTHEST) || box.isEmpty()) return;
    const { center, radius } = box.getBoundingSphere(this.sphere);
    for (const [point, first] of [[this.camera.position, 0], [this.controls.target, 3]] as const) {
      point.fromArray(numbers, first).multiplyScalar(radius || 1).add(center);
    }
    this.chosen = true;
    this.update();
  }

  /** Turn around the centre, in radians. */
  orbit(right: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const side = new Vector3().crossVectors(this.camera.up, offset).normalize();
    const polar = offset.angleTo(this.camera.up);
    offset.applyAxisAngle(side, Math.min(Math.max(up, 0.01 - polar), Math.PI - 0.01 - polar));
    offset.applyAxisAngle(this.camera.up, right);
    this.camera.position.copy(this.controls.target).add(offset);
    this.choose();
    this.update();
  }

  zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.camera.position.copy(this.controls.target).addScaledVector(offset, factor);
    this.choose();
    this.update();
  }

  /** Make a point the centre, without turning. */
  centreOn(point: Vector3): void {
    const shift = point.clone().sub(this.controls.target);
    this.controls.target.add(shift);
    this.camera.position.add(shift);
    this.choose();
    this.update();
  }

  private choose(): void {
    this.chosen = true;
    this.onChosen();
  }

  private update(): void {
    this.controls.update();
    this.changed();
  }
}
