/** Light: a room to mirror on a graphics card; plain lights where software draws. */

import {
  Color,
  DirectionalLight,
  HemisphereLight,
  PMREMGenerator,
  type Camera,
  type Mesh,
  type Scene,
  type WebGLRenderer,
} from "three";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";

/** A lamp's place before the camera, and its strength. */
type Lamp = readonly [x: number, y: number, z: number, strength: number];

// One over the viewer's left shoulder; where nothing else mirrors, a weak one from the right too.
const BESIDE_A_ROOM: readonly Lamp[] = [[-0.7, 1, 0.8, 1.5]];
const ALONE: readonly Lamp[] = [
  [-0.7, 1, 0.8, 2.3],
  [1, 0.1, 0.5, 0.7],
];
// A room alone leaves no side of a model dark: its form would not show.
const ROOM = 0.55;

/** Light a scene. `software` says that no card draws it: an environment map would take it seconds. */
export function light(
  renderer: WebGLRenderer,
  scene: Scene,
  camera: Camera,
  software: boolean,
): void {
  for (const [x, y, z, strength] of software ? ALONE : BESIDE_A_ROOM) {
    const lamp = new DirectionalLight(0xffffff, strength);
    lamp.position.set(x, y, z);
    camera.add(lamp, lamp.target);
  }
  scene.add(camera);
  if (software) {
    scene.add(new HemisphereLight(new Color(0xf4f7ff), new Color(0x8d8479), 1.7));
    return;
  }
  surround(renderer, scene);
}

/** Let surfaces mirror a room. A card that was lost forgets it, and has to be given it again. */
export function surround(renderer: WebGLRenderer, scene: Scene): void {
  const generator = new PMREMGenerator(renderer);
  const room = new RoomEnvironment();
  scene.environment = generator.fromScene(room, 0.03).texture;
  scene.environmentIntensity = ROOM;
  room.dispose();
  generator.dispose();
}

/** Show metal as if painted: in plain light it would mirror nothing, and be black. */
export function paint(meshes: Mesh[]): void {
  for (const { material } of meshes) {
    for (const painted of [material].flat()) {
      if ("metalness" in painted) painted.metalness = 0;
    }
  }
}
