/** Names that the build fills in: files with a hash in their names, beside the bundle. */

declare const DRACO_WRAPPER: string;
declare const DRACO_WASM: string;
declare const BASIS_WRAPPER: string;
declare const BASIS_WASM: string;
declare const EXAMPLE: string;
declare const VALIDATOR: string;

declare module "three/addons/libs/fflate.module.js" {
  export type Unzipped = Record<string, Uint8Array>;
  export function unzip(
    data: Uint8Array,
    done: (error: Error | null, files: Unzipped) => void,
  ): void;
  export function unzipSync(data: Uint8Array): Unzipped;
}

declare module "gltf-validator" {
  export interface Message {
    code: string;
    message: string;
    severity: number;
    pointer?: string;
  }
  export interface Outcome {
    issues: {
      numErrors: number;
      numWarnings: number;
      numInfos: number;
      numHints: number;
      messages: Message[];
      truncated: boolean;
    };
  }
  export function validateBytes(
    data: Uint8Array,
    options: {
      maxIssues?: number;
      writeTimestamp?: boolean;
      externalResourceFunction?: (uri: string) => Promise<Uint8Array>;
    },
  ): Promise<Outcome>;
}
