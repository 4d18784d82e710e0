/** A soft shadow where a model meets the ground: its depth seen from below, blurred. */

import {
  Color,
  Mesh,
  MeshBasicMaterial,
  MeshDepthMaterial,
  NoBlending,
  OrthographicCamera,
  PlaneGeometry,
  ShaderMaterial,
  Vector3,
  WebGLRenderTarget,
  type Box3,
  type Scene,
  type WebGLRenderer,
} from "three";
import { FullScreenQuad } from "three/addons/postprocessing/Pass.js";
import { HorizontalBlurShader } from "three/addons/shaders/HorizontalBlurShader.js";
import { VerticalBlurShader } from "three/addons/shaders/VerticalBlurShader.js";

const PIXELS = 256;
/** The side of the ground, and the height up to which a model darkens it, in sides of its box. */
const [REACH, HEIGHT] = [1.7, 0.4];
const DARKNESS = 0.55;
/** Blurs one after the other, in pixels: a wide one, and a narrow one that hides its steps. */
const BLURS = [3.5, 1.4];

const DEPTH = "gl_FragColor = vec4( vec3( 1.0 - fragCoordZ ), opacity );";

export class ContactShadow {
  readonly ground: Mesh;
  private readonly camera = new OrthographicCamera();
  private readonly targets = [0, 1].map(() => new WebGLRenderTarget(PIXELS, PIXELS)) as [WebGLRenderTarget, WebGLRenderTarget];
  private readonly depth = depthMaterial();
  private readonly quad = new FullScreenQuad();
  private readonly across = new ShaderMaterial({ ...HorizontalBlurShader, depthTest: false, blending: NoBlending });
  private readonly along = new ShaderMaterial({ ...VerticalBlurShader, depthTest: false, blending: NoBlending });

  constructor() {
    const material = new MeshBasicMaterial({
      map: this.targets[0].texture,
      transparent: true,
      depthWrite: false,
      toneMapped: false,
    });
    this.ground = new Mesh(new PlaneGeometry().rotateX(Math.PI / 2), material);
    this.ground.visible = false;
    this.camera.rotation.x = Math.PI / 2;
  }

  /** Lay the ground under a box. */
  place(box: Box3): void {
    const size = box.getSize(new Vector3());
    const side = REACH * (Math.max(size.x, size.z) || 1);
    const foot = box.getCenter(new Vector3()).setY(box.min.y - 1e-3 * side);
    this.ground.position.copy(foot);
    // The picture from below is mirrored.
    this.ground.scale.set(side, -1, side);
    this.camera.position.copy(foot);
    Object.assign(this.camera, { left: -side / 2, right: side / 2, top: side / 2, bottom: -side / 2, near: 0 });
    this.camera.far = HEIGHT * Math.max(size.y, 0.1 * side);
    this.camera.updateProjectionMatrix();
  }

  /** Draw the shadow of what is visible in the scene. */
  render(renderer: WebGLRenderer, scene: Scene): void {
    const [first, second] = this.targets;
    const paper = renderer.getClearColor(new Color());
    const { background } = scene;
    this.ground.visible = false;
    scene.overrideMaterial = this.depth;
    scene.background = null;
    renderer.setClearColor(0x000000, 0);
    renderer.setRenderTarget(first);
    renderer.clear();
    renderer.render(scene, this.camera);
    scene.overrideMaterial = null;
    scene.background = background;
    for (const blur of BLURS) {
      this.blur(renderer, this.across, "h", first, second, blur);
      this.blur(renderer, this.along, "v", second, first, blur);
    }
    renderer.setRenderTarget(null);
    renderer.setClearColor(paper);
    this.ground.visible = true;
  }

  private blur(
    renderer: WebGLRenderer,
    material: ShaderMaterial,
    step: "h" | "v",
    from: WebGLRenderTarget,
    to: WebGLRenderTarget,
    pixels: number,
  ): void {
    material.uniforms.tDiffuse!.value = from.texture;
    material.uniforms[step]!.value = pixels / PIXELS;
    this.quad.material = material;
    renderer.setRenderTarget(to);
    renderer.clear();
    this.quad.render(renderer);
  }
}

/** Write how near the ground is as the alpha of black. */
function depthMaterial(): MeshDepthMaterial {
  const material = new MeshDepthMaterial({ blending: NoBlending });
  material.onBeforeCompile = (shader) => {
    if (!shader.fragmentShader.includes(DEPTH)) throw new Error("three's depth shader changed");
    const alpha = `gl_FragColor = vec4( vec3( 0.0 ), ( 1.0 - fragCoordZ ) * ${DARKNESS} );`;
    shader.fragmentShader = shader.fragmentShader.replace(DEPTH, alpha);
  };
  return material;
}
