/**
 * The colour map cividis: even in lightness, the same to most of the colour-blind.
 * Nuñez, Anderton, Renslow, PLoS ONE 13(7), 2018; its table at 33 places, linear between.
 */

const TABLE =
  "00224e 00285b 002e6a 053371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 535a6d " +
  "5a5f6e 61656f 686a71 6f7073 767676 7d7c78 848279 8c8878 938e78 9b9476 a39a74 " +
  "aba072 b4a76f bcae6c c4b468 cdbb63 d5c25e dec958 e7d150 f0d846 f9e03a fee838";

const COLOURS = TABLE.split(" ");

export function cividis(share: number): [number, number, number] {
  const at = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1);
  const low = Math.min(Math.floor(at), COLOURS.length - 2);
  return [0, 2, 4].map((channel) => {
    const [a, b] = [low, low + 1].map((i) => parseInt(COLOURS[i]!.slice(channel, channel + 2), 16));
    return Math.round(a! + (at - low) * (b! - a!));
  }) as [number, number, number];
}
