/** The service's report, as far as the page reads it. */

export interface Summary {
  max: number;
  mean: number;
}

export interface Level {
  vertices: number;
  faces: number;
  edges: { interior: number; boundary: number; irregular: number; crease?: number; soft?: number };
  flipped_faces: number;
  proximity_ratio: Summary;
  gate: Summary & { active: number };
  guarded?: number;
  displacement_max?: number;
  vertex_rule?: { proximity_ratio: Summary; gate: Summary };
}

export interface Advice {
  text: string;
  /** Those that the text names, as HTTP spells them: `crease=off`. */
  options: string[];
}

export interface Report {
  scheme: string;
  base: string;
  budget: number | null;
  model: string | null;
  model_hash: string | null;
  totals: { vertices: number; faces: number };
  dropped: Record<string, number>;
  changes: { pointer: string; code: string; what: string; count: number }[];
  /** By the code of what was changed: whether that is harmless, or what to do. */
  hints?: Record<string, Advice>;
  levels: Level[];
  meshes: MeshReport[];
  /** Why little changed, and which setting changes that. */
  advice?: Advice[];
}

export interface MeshReport {
  /** Its place in the file's `meshes`. */
  index: number;
  /** What the file calls it. */
  name?: string;
  learned_levels: number;
  /** No point of the limit surface is farther from the classic rule's, in the mesh's own units. */
  limit_distance: number;
  /** Of faces made where they are needed: none is farther from the surface over it, in the mesh's own units. */
  adaptive?: { distance_max: number };
}

/** Whether a model took part. */
export function isLearned({ model }: Report): boolean {
  return model !== null;
}

/** Edges of a level that stay sharp, or more sharp than smooth. */
export function sharpEdges({ edges }: Level): number {
  return (edges.crease ?? 0) + (edges.soft ?? 0);
}

/** How many levels the learned rule acted at; those below are the classic rule's. */
export function learnedLevels(report: Report): number {
  if (!isLearned(report)) return 0;
  return Math.max(0, ...report.meshes.map((mesh) => mesh.learned_levels ?? report.levels.length));
}

export function largestRatio(level: Level): number {
  return Math.max(level.proximity_ratio.max, level.vertex_rule?.proximity_ratio.max ?? 0);
}
