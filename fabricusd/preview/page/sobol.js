// Numbers that are even together: four dimensions of Sobol's sequence, as `reference.rays.sobol` has them.
// Each use of them has its own seed, and with it permutations of its own [Burley2020].
const BITS = 16;

function directionNumbers(degree, coefficients, first) {
  const m = degree ? [...first] : Array(BITS).fill(1);
  while (m.length < BITS) {
    let value = m.at(-degree) ^ (m.at(-degree) << degree);
    for (let k = 1; k < degree; ++k) if ((coefficients >> (degree - 1 - k)) & 1) value ^= m.at(-k) << k;
    m.push(value);
  }
  return m.map((value, k) => reversed(value << (31 - k)));
}

function reversed(x) {
  x = ((x >>> 1) & 0x55555555) | ((x & 0x55555555) << 1);
  x = ((x >>> 2) & 0x33333333) | ((x & 0x33333333) << 2);
  x = ((x >>> 4) & 0x0f0f0f0f) | ((x & 0x0f0f0f0f) << 4);
  x = ((x >>> 8) & 0x00ff00ff) | ((x & 0x00ff00ff) << 8);
  return ((x >>> 16) | (x << 16)) >>> 0;
}

const NUMBERS = [[0, 0, []], [1, 0, [1]], [2, 1, [1, 3]], [3, 1, [1, 3, 1]]].map(given => directionNumbers(...given));

function scrambled(x, seed) {
  x ^= Math.imul(x, 0x3d20adea);
  x = Math.imul((x + seed) | 0, (seed >>> 16) | 1);
  x ^= Math.imul(x, 0x05526c56);
  return x ^ Math.imul(x, 0x53a22864);
}

// Four numbers in [0, 1): point k of the sequence with that seed. Each seed has its own order of points
// too, without which the numbers of two seeds would go together.
export function sobol(k, seed) {
  const of = n => Math.imul(5 * seed + n + 1, 0x9e3779b9), index = reversed(scrambled(reversed(k), of(4))) & ((1 << BITS) - 1);
  return NUMBERS.map((numbers, dimension) => {
    let x = 0;
    for (let bit = 0; bit < BITS; ++bit) if ((index >> bit) & 1) x ^= numbers[bit];
    return (reversed(scrambled(x, of(dimension))) >>> 8) / 0x1000000;
  });
}
