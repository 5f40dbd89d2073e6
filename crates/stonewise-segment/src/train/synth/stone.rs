//! The shape of single stones: convex polygons with rounded corners, less what has broken off.

use super::cell::Ring;
use super::draw::{Rng, between, chance};

/// How stones depart from their cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoneShape {
    /// Radius over which corners are rounded, in parts of the stone's size, 0.02 to 0.42.
    pub rounding: f32,
    /// Probability that a corner or a piece of an edge has broken off, per stone, 0 to 0.5.
    pub chips: f32,
    /// Waviness of the outline, in parts of the stone's size, 0 to 0.05.
    pub ragged: f32,
    /// Waviness shared by neighbours, so that joints wander at constant width, in parts of the stone's size,
    /// 0 to 0.1.
    pub wander: f32,
    /// Probability that a place is left without stone, 0 to 0.04.
    pub missing: f32,
}

impl StoneShape {
    /// A shape drawn at random; rubble is rounder and rougher than squared blocks.
    pub(super) fn random(rng: &mut Rng, rubble: bool) -> Self {
        let rough = if rubble { 1.0 } else { between(rng, 0.0, 0.6) };
        Self {
            rounding: rough * between(rng, 0.02, 0.4) + 0.02,
            chips: between(rng, 0.0, 0.5) * between(rng, 0.0, 1.0),
            ragged: rough * between(rng, 0.0, 0.05) + between(rng, 0.0, 0.01),
            wander: rough * between(rng, 0.0, 0.1),
            missing: if chance(rng, 0.3) {
                between(rng, 0.0, 0.04)
            } else {
                0.0
            },
        }
    }
}

/// A stone in wall coordinates.
#[derive(Clone, Debug)]
pub(super) struct Stone {
    /// Unit normals to the inside and offsets: the distance to an edge is `n . p + c`.
    edges: Vec<[f32; 3]>,
    /// x from, y from, x to, y to.
    pub(super) bounds: [f32; 4],
    /// Mean of the corners.
    pub(super) centre: [f32; 2],
    /// Square root of the cell's area.
    pub(super) size: f32,
    rounding: f32,
    /// 1 / (4 rounding).
    sharpness: f32,
    /// Discs that have broken off: centre and radius.
    chips: Vec<[f32; 3]>,
}

impl Stone {
    /// The stone of a cell; `None` for cells without area.
    pub(super) fn new(ring: &Ring, shape: &StoneShape, rng: &mut Rng) -> Option<Self> {
        let pairs = || ring.iter().zip(ring.iter().cycle().skip(1));
        let doubled: f32 = pairs().map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
        let size = (0.5 * doubled.abs()).sqrt();
        if size < 1.0 {
            return None;
        }
        let edges: Vec<[f32; 3]> = pairs()
            .filter_map(|(a, b)| {
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                let length = dx.hypot(dy) * doubled.signum();
                let normal = [-dy / length, dx / length];
                (length.abs() > 1e-3).then(|| [normal[0], normal[1], -normal[0] * a[0] - normal[1] * a[1]])
            })
            .collect();

        let limit = |axis: usize, pick: fn(f32, f32) -> f32, start: f32| {
            ring.iter().map(|p| p[axis]).fold(start, pick)
        };
        let count = ring.len() as f32;
        let chips = if chance(rng, shape.chips) {
            (0..1 + usize::from(chance(rng, 0.3)))
                .map(|_| chip(ring, size, rng))
                .collect()
        } else {
            Vec::new()
        };
        let rounding = (shape.rounding * size * between(rng, 0.6, 1.2)).max(1e-3);

        Some(Self {
            edges,
            bounds: [
                limit(0, f32::min, f32::INFINITY),
                limit(1, f32::min, f32::INFINITY),
                limit(0, f32::max, f32::NEG_INFINITY),
                limit(1, f32::max, f32::NEG_INFINITY),
            ],
            centre: [0, 1].map(|axis| ring.iter().map(|p| p[axis]).sum::<f32>() / count),
            size,
            rounding,
            sharpness: 0.25 / rounding,
            chips,
        })
    }

    /// Distance of a point to the outline, positive inside; where it is at most `floor`, some number at most
    /// `floor`.
    #[inline]
    pub(super) fn distance(&self, x: f32, y: f32, floor: f32) -> f32 {
        let mut distance = f32::INFINITY;
        for edge in &self.edges {
            let next = edge[0] * x + edge[1] * y + edge[2];
            if next <= floor {
                return next;
            }
            // Polynomial smooth minimum: rounds the corner where two edges are about equally near.
            let overlap = (self.rounding - (distance - next).abs()).max(0.0);
            distance = distance.min(next) - overlap * overlap * self.sharpness;
        }
        for chip in &self.chips {
            distance = distance.min((x - chip[0]).hypot(y - chip[1]) - chip[2]);
        }
        distance
    }
}

/// A disc over a corner or the middle of an edge.
fn chip(ring: &Ring, size: f32, rng: &mut Rng) -> [f32; 3] {
    let i = (between(rng, 0.0, ring.len() as f32) as usize).min(ring.len() - 1);
    let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
    let t = if chance(rng, 0.7) {
        0.0
    } else {
        between(rng, 0.1, 0.9)
    };
    [
        a[0] + t * (b[0] - a[0]),
        a[1] + t * (b[1] - a[1]),
        size * between(rng, 0.06, 0.25),
    ]
}

/// Depth in parts of a stone's size beyond which no other stone reaches into it.
const SURE_DEPTH: f32 = 0.12;

/// Finds the stone at a place by a grid over their bounds.
pub(super) struct StoneIndex {
    origin: [f32; 2],
    side: f32,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl StoneIndex {
    /// An index with squares of about `side`.
    pub(super) fn new(stones: &[Stone], side: f32) -> Self {
        let mut bounds = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        for stone in stones {
            for axis in 0..2 {
                bounds[axis] = bounds[axis].min(stone.bounds[axis]);
                bounds[axis + 2] = bounds[axis + 2].max(stone.bounds[axis + 2]);
            }
        }

        let count = |axis: usize| {
            let length = (bounds[axis + 2] - bounds[axis]).max(0.0);
            (length / side) as usize + 1
        };
        let (columns, rows) = (count(0), count(1));
        let origin = [bounds[0], bounds[1]];
        let square =
            |value: f32, axis: usize, most: usize| (((value - origin[axis]) / side) as usize).min(most - 1);
        let mut squares: Vec<Vec<u32>> = vec![Vec::new(); columns * rows];

        for (i, stone) in stones.iter().enumerate() {
            for r in square(stone.bounds[1], 1, rows)..=square(stone.bounds[3], 1, rows) {
                for c in square(stone.bounds[0], 0, columns)..=square(stone.bounds[2], 0, columns) {
                    squares[r * columns + c].push(i as u32);
                }
            }
        }

        let mut starts = vec![0];
        let mut items = Vec::new();
        for square in squares {
            items.extend(square);
            starts.push(items.len() as u32);
        }

        Self {
            origin,
            side,
            columns,
            rows,
            starts,
            items,
        }
    }

    /// The stone in which the point lies deepest, and its distance to the outline.
    ///
    /// `guess` is the stone of a point nearby. Cells overlap by little, so a point deep in the guess lies in
    /// no other.
    #[inline]
    pub(super) fn find(
        &self,
        stones: &[Stone],
        x: f32,
        y: f32,
        guess: Option<usize>,
    ) -> Option<(usize, f32)> {
        if let Some(guess) = guess {
            let sure = SURE_DEPTH * stones[guess].size;
            let distance = stones[guess].distance(x, y, sure);
            if distance > sure {
                return Some((guess, distance));
            }
        }

        let (c, r) = ((x - self.origin[0]) / self.side, (y - self.origin[1]) / self.side);
        if c < 0.0 || r < 0.0 || c as usize >= self.columns || r as usize >= self.rows {
            return None;
        }
        let square = r as usize * self.columns + c as usize;
        let near = &self.items[self.starts[square] as usize..self.starts[square + 1] as usize];
        let mut best = None;

        // Points in the corners of joints lie a little outside of every stone.
        let mut deepest = -self.side;
        for &i in near {
            let distance = stones[i as usize].distance(x, y, deepest);
            if distance > deepest {
                deepest = distance;
                best = Some((i as usize, distance));
            }
        }

        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const PLAIN: StoneShape = StoneShape {
        rounding: 0.0,
        chips: 0.0,
        ragged: 0.0,
        wander: 0.0,
        missing: 0.0,
    };

    #[test]
    fn distance_in_a_rectangle_is_that_to_its_nearest_side() {
        let mut rng = Rng::seed_from_u64(0);
        let ring = vec![[0.0, 0.0], [30.0, 0.0], [30.0, 12.0], [0.0, 12.0]];
        let reversed: Ring = ring.iter().rev().copied().collect();
        for ring in [ring, reversed] {
            let stone = Stone::new(&ring, &PLAIN, &mut rng).unwrap();
            assert!((stone.size - 360f32.sqrt()).abs() < 1e-4);
            for (p, expected) in [([4.0, 6.0], 4.0), ([15.0, 5.0], 5.0), ([29.0, 6.0], 1.0)] {
                assert!(
                    (stone.distance(p[0], p[1], -1e9) - expected).abs() < 1e-4,
                    "{p:?}"
                );
            }
            assert!(stone.distance(-2.0, 6.0, -1e9) < 0.0);
        }
    }

    #[test]
    fn rounding_takes_from_the_corners_only() {
        let mut rng = Rng::seed_from_u64(0);
        let ring = vec![[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]];
        let shape = StoneShape {
            rounding: 0.3,
            ..PLAIN
        };
        let stone = Stone::new(&ring, &shape, &mut rng).unwrap();
        assert!(stone.distance(0.3, 0.3, -1e9) < 0.0);
        assert!((stone.distance(0.3, 10.0, -1e9) - 0.3).abs() < 1e-4);
    }

    #[test]
    fn index_finds_what_a_search_over_all_stones_finds() {
        let mut rng = Rng::seed_from_u64(9);
        let bond = super::super::layout::Bond::Rubble {
            aspect: 1.3,
            mixture: 0.5,
            disorder: 0.6,
        };
        let stones: Vec<Stone> = bond
            .lay(15.0, [0.0, 0.0, 120.0, 90.0], &mut rng)
            .iter()
            .filter_map(|ring| Stone::new(ring, &PLAIN, &mut rng))
            .collect();
        let index = StoneIndex::new(&stones, 9.0);
        let (mut guess, mut last) = (None, None);
        for _ in 0..500 {
            let (x, y) = (between(&mut rng, 0.0, 120.0), between(&mut rng, 0.0, 90.0));
            let deepest = stones
                .iter()
                .map(|s| s.distance(x, y, -1e9))
                .fold(f32::NEG_INFINITY, f32::max);
            for guess in [None, guess] {
                let (stone, found) = index.find(&stones, x, y, guess).unwrap();
                assert!((found - deepest).abs() < 1e-3, "{found} {deepest}");
                last = Some(stone);
            }
            guess = last;
        }
    }
}
