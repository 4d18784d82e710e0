/** Where a camera stands to see all of a model. */

import { Vector3 } from "three";
import type { Extent } from "./model";

/** How much farther away than need be: the air around a model. */
const MARGIN = 1.15;

/**
 * Return the least distance from `center`, in the direction `towards`, from which every point is in the
 * picture; `wide` and `free` are the tangents of half its angles across and along.
 */
export function distanceTo(
  { points }: Extent,
  center: Vector3,
  towards: Vector3,
  top: Vector3,
  wide: number,
  free: number,
): number {
  const right = new Vector3().crossVectors(top, towards).normalize();
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
